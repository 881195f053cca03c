"""All swims of the report, in several processes."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Sequence
from typing import Any

from evidence.control_report.conditions import CONDITIONS
from evidence.control_report.steps import Step, step
from evidence.control_report.swims import Row, Swim, swim
from manta_sim_ros.dynamics import ModelWarning
from manta_sim_ros.figures.jobs import Done, Job, run_jobs

STEP = 'step'
"""Name of the step in place of a course."""


def measured(rows: Sequence[Row], processes: int) -> tuple[dict[Row, list[Swim]], dict[Row, list[Step]]]:
    """Return the swims of each draw of each row, and the steps of those that are steps."""
    jobs, owners = [], []
    for row in rows:
        for seed in range(CONDITIONS[row.condition].draws):
            jobs.append(Job('', 1, functools.partial(quietly, step if row.course == STEP else swim, row, seed)))
            owners.append(row)
    found: dict[Row, list[Any]] = {}
    for row, one in zip(owners, run_jobs(jobs, processes), strict=True):
        found.setdefault(row, []).append(one)
    return ({row: draws for row, draws in found.items() if row.course != STEP},
            {row: draws for row, draws in found.items() if row.course == STEP})


def quietly(run: Callable[[Row, int, Done], Any], row: Row, seed: int, done: Done) -> Any:
    """Run a swim or a step without the warning of the chordwise instability, which the page mentions."""
    with warnings.catch_warnings():
        warnings.simplefilter('ignore', ModelWarning)
        return run(row, seed, done)

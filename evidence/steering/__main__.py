"""Measure what each input of the fins does, and write docs/controller.md: `make steering`."""

from __future__ import annotations

import functools
import itertools
from pathlib import Path

from evidence.steering import page
from evidence.steering.responses import (
    CHAINS,
    CHANGES,
    CONFIGURATIONS,
    GRID,
    TURNS,
    cruise_speed,
    response,
    yaw_rate,
)
from manta_sim_ros.dynamics import compile_kernels
from manta_sim_ros.figures.jobs import Job, run_jobs

PAGE = Path(__file__).parents[2] / 'docs' / 'controller.md'


def main() -> None:
    """Measure all and write the page."""
    jobs = []
    for parameters in CONFIGURATIONS.values():
        compile_kernels(parameters, print)
        jobs += [Job('', 1, functools.partial(response, parameters, change)) for change in CHANGES]
        jobs += [Job('', 1, functools.partial(cruise_speed, parameters, *case)) for case in GRID]
        jobs += [Job('', 1, functools.partial(yaw_rate, parameters, chains, change))
                 for change in TURNS for chains in CHAINS]
    results = iter(run_jobs(jobs))
    measured = {name: page.Measured(*(list(itertools.islice(results, count)) for count in (
        len(CHANGES), len(GRID), len(TURNS) * len(CHAINS)))) for name in CONFIGURATIONS}
    PAGE.write_text(page.text(measured), encoding='utf-8')
    for each in measured.values():
        print(page.motion_table(each.responses))
    print('written: docs/controller.md')


if __name__ == '__main__':
    main()

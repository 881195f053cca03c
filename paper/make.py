#!/usr/bin/env python3
"""Draw the paper's figures and write docs/paper.md anew: `make paper`."""

from __future__ import annotations

import os
import sys
from pathlib import Path

os.environ.update({f'{library}_NUM_THREADS': '1' for library in ('OMP', 'OPENBLAS', 'MKL', 'NUMBA')})
ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / 'test')]  # the literal version lives with the tests

import functools  # noqa: E402 - numerical libraries count threads when they are imported
import time  # noqa: E402

from paper import cost, page, sensitivity  # noqa: E402
from paper.statements import Results  # noqa: E402

from manta_sim_ros.dynamics.simulator import prepare  # noqa: E402
from manta_sim_ros.paper.command import figure_jobs, made_directory  # noqa: E402
from manta_sim_ros.paper.files import whole, write_csv  # noqa: E402
from manta_sim_ros.paper.gaits import robot  # noqa: E402
from manta_sim_ros.paper.jobs import Done, Job, run_jobs  # noqa: E402
from manta_sim_ros.paper.style import save_png  # noqa: E402


def run_case(case: sensitivity.Case, done: Done) -> tuple[float, ...]:
    """Run one case of the sensitivities."""
    results = sensitivity.run(case)
    done()
    return results


def main() -> None:
    """Draw, measure and write all."""
    start = time.monotonic()
    docs = ROOT / 'docs'
    plots = made_directory(docs / 'paper')
    prepare(robot(), print)
    figures = figure_jobs(plots)
    cases = [Job('', 1, functools.partial(run_case, case)) for case in sensitivity.cases()]
    outcomes = run_jobs(figures + cases)

    drawn = {name: figure for result in outcomes[:len(figures)] for name, figure in result.items()}
    sensitivities = sensitivity.Sensitivity.of(outcomes[len(figures):])
    with whole(plots / 'sensitivity.png') as path:
        save_png(sensitivities.draw, path, sensitivities.height)
    with whole(plots / 'sensitivity.csv') as path:
        write_csv(sensitivities.columns(), path)
    print('measuring what a step costs', flush=True)
    results = Results(
        drawn['figure_7'], drawn['figure_8'], drawn['figure_9'], drawn['figure_10'].turning, cost.measure())
    with whole(docs / 'paper.md') as path:
        path.write_text(page.text(results, sensitivities), encoding='utf-8')
    print(page.verdicts(results))
    print(f'written: docs/paper.md and docs/paper, {time.monotonic() - start:.0f} s')


if __name__ == '__main__':
    main()

"""Measure what each input of the fins does, and write docs/controller.md: `make steering`."""

from __future__ import annotations

import functools
from pathlib import Path

from evidence.steering import page
from evidence.steering.responses import CHANGES, GRID, cruise_speed, response
from manta_sim_ros.dynamics import Parameters, compile_kernels
from manta_sim_ros.figures.jobs import Job, run_jobs

PAGE = Path(__file__).parents[2] / 'docs' / 'controller.md'


def main() -> None:
    """Measure all and write the page."""
    compile_kernels(Parameters(), print)
    jobs = [Job('', 1, functools.partial(response, change)) for change in CHANGES]
    jobs += [Job('', 1, functools.partial(cruise_speed, *case)) for case in GRID]
    results = run_jobs(jobs)
    PAGE.write_text(page.text(results[:len(CHANGES)], results[len(CHANGES):]), encoding='utf-8')
    print(page.motion_table(results[:len(CHANGES)]))
    print('written: docs/controller.md')


if __name__ == '__main__':
    main()

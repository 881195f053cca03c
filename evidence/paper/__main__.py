"""Draw the paper's figures and write docs/paper.md: `make paper`."""

from __future__ import annotations

import functools
import time
from pathlib import Path

from evidence.paper import cost, page, sensitivity
from evidence.paper.statements import Results
from manta_sim_ros.dynamics import compile_kernels
from manta_sim_ros.figures.command import figure_jobs, made_directory
from manta_sim_ros.figures.files import whole, write_csv
from manta_sim_ros.figures.gaits import robot
from manta_sim_ros.figures.jobs import Job, run_jobs
from manta_sim_ros.figures.style import save_png

DOCS = Path(__file__).parents[2] / 'docs'


def main() -> None:
    """Draw all figures, measure all results, and write the page."""
    start = time.monotonic()
    plots = made_directory(DOCS / 'paper')
    compile_kernels(robot(), print)
    figures = figure_jobs(plots)
    cases = [Job('', 1, functools.partial(sensitivity.run_job, case)) for case in sensitivity.cases()]
    outcomes = run_jobs(figures + cases)

    drawn = {name: figure for result in outcomes[:len(figures)] for name, figure in result.items()}
    sensitivities = sensitivity.Sensitivity.of(outcomes[len(figures):])
    with whole(plots / 'sensitivity.png') as path:
        save_png(sensitivities.draw, path, sensitivities.height)
    with whole(plots / 'sensitivity.csv') as path:
        write_csv(sensitivities.columns(), path)
    print('measuring the cost of a step', flush=True)
    results = Results(
        drawn['figure_7'], drawn['figure_8'], drawn['figure_9'], drawn['figure_10'].turning, cost.measure())
    with whole(DOCS / 'paper.md') as path:
        path.write_text(page.text(results, sensitivities), encoding='utf-8')
    print(page.verdicts(results))
    print(f'docs/paper.md and docs/paper were written in {time.monotonic() - start:.0f} s.')


if __name__ == '__main__':
    main()

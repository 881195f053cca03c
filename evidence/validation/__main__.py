"""Measure both configurations beside published facts, and write docs/validation.md: `make validate`."""

from __future__ import annotations

import functools
import time
from pathlib import Path

from evidence.validation import page
from evidence.validation.figures import Exponents, Facts
from evidence.validation.measurements import CONFIGURATIONS, configuration, measured
from evidence.validation.sensitivity import Sensitivity, run, variants
from manta_sim_ros.dynamics import compile_kernels
from manta_sim_ros.figures.command import made_directory
from manta_sim_ros.figures.files import whole
from manta_sim_ros.figures.jobs import Job, run_jobs
from manta_sim_ros.figures.style import save_png

DOCS = Path(__file__).parents[2] / 'docs'


def main() -> None:
    """Measure all, draw the plots and write the page."""
    start = time.monotonic()
    plots = made_directory(DOCS / 'validation')
    for name in CONFIGURATIONS:
        compile_kernels(configuration(name), print)
    jobs = [Job('', 1, functools.partial(measured, name)) for name in CONFIGURATIONS]
    jobs += [Job('', 1, functools.partial(run, variant)) for variant in variants()]
    outcomes = run_jobs(jobs)
    found = dict(zip(CONFIGURATIONS, outcomes, strict=False))
    sensitivity = Sensitivity(dict(zip(variants(), outcomes[len(CONFIGURATIONS):], strict=True)))
    figures: tuple[Facts | Exponents, ...] = Facts(found, sensitivity), Exponents(sensitivity)
    for name, figure in zip(page.PLOTS, figures, strict=True):
        with whole(plots / f'{name}.png') as path:
            save_png(figure.draw, path, figure.height)
    with whole(DOCS / 'validation.md') as path:
        path.write_text(page.text(found, sensitivity), encoding='utf-8')
    print(page.fact_table(found, sensitivity))
    print(f'docs/validation.md and docs/validation were written in {time.monotonic() - start:.0f} s.')


if __name__ == '__main__':
    main()

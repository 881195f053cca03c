"""Measure how well controllers follow paths, and write docs/control_report.md with its plots: `make control-report`.

With options that leave out a part, the tables are only printed. The exit status is 1 if a bound that is met according
to the page before is no longer met.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from evidence.control_report import page
from evidence.control_report.conditions import CONDITIONS
from evidence.control_report.courses import COURSES
from evidence.control_report.figures import Steps, Tracks
from evidence.control_report.measure import STEP, measured
from evidence.control_report.robots import CONTROLLERS, ROBOTS
from evidence.control_report.steps import Step, largest
from evidence.control_report.swims import Row, Swim, of_draws
from manta_sim_ros.dynamics import compile_kernels
from manta_sim_ros.figures.command import made_directory
from manta_sim_ros.figures.files import whole
from manta_sim_ros.figures.style import save_png

DOCS = Path(__file__).parents[2] / 'docs'
PROCESSES = 2
"""Number of processes in which the robots swim."""


def main(args: Sequence[str] | None = None) -> int:
    """Measure, print the tables, write the page if all was measured, and return the exit status."""
    start = time.monotonic()
    parser = argparse.ArgumentParser(prog='python -m evidence.control_report', description=__doc__.partition('\n')[0])
    choices: dict[str, Mapping[str, Any]] = {
        'robots': ROBOTS, 'paths': {**COURSES, STEP: None}, 'conditions': CONDITIONS, 'controllers': CONTROLLERS}
    for name, known in choices.items():
        parser.add_argument(f'--{name}', nargs='+', choices=list(known), default=list(known))
    options = parser.parse_args(args)
    rows = [Row(*names) for names in itertools.product(*(getattr(options, name) for name in choices))]
    for name in options.robots:
        compile_kernels(ROBOTS[name].parameters, print)
    swims, steps = measured(rows, PROCESSES)
    results = {row: of_draws([one.result for one in draws]) for row, draws in swims.items()}
    settlings = {row: largest([one.result for one in draws]) for row, draws in steps.items()}
    for name in options.robots:
        of_robot = {row: result for row, result in results.items() if row.robot == name}
        print(f'\n{name}\n')
        print(page.error_table(of_robot), page.cost_table(of_robot), sep='\n\n')
        print('', page.step_table({row: one for row, one in settlings.items() if row.robot == name}), sep='\n')
    before = DOCS / 'control_report.md'
    text = page.text(results, settlings)
    broken = page.broken(before.read_text(encoding='utf-8') if before.exists() else '', text)
    print('', page.summary(results), *(f'was met before: {line}' for line in broken), '', sep='\n')
    if all(getattr(options, name) == list(known) for name, known in choices.items()):
        draw(swims, steps)
        with whole(before) as path:
            path.write_text(text, encoding='utf-8')
        print(f'docs/control_report.md was written in {time.monotonic() - start:.0f} s.')
    return 1 if broken else 0


def draw(swims: Mapping[Row, Sequence[Swim]], steps: Mapping[Row, Sequence[Step]]) -> None:
    """Draw the plots of the page."""
    folder = made_directory(DOCS / 'control_report')
    for name in ROBOTS:
        figures: dict[str, Tracks | Steps] = {
            'tracks': Tracks({row: draws[0] for row, draws in swims.items() if row.robot == name}),
            'step': Steps({row: draws[0] for row, draws in steps.items() if row.robot == name})}
        for kind, figure in figures.items():
            with whole(folder / f'{kind}_{name}.png') as path:
                save_png(figure.draw, path, figure.height)


if __name__ == '__main__':
    sys.exit(main())

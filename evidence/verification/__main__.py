"""Verify the physics and write docs/verification.md and its plots: `make verify`.

The exit status is 0 if every claim holds, and 1 otherwise.
"""

from __future__ import annotations

import functools
import sys
import time
from pathlib import Path

from evidence.verification import page
from evidence.verification.themes import THEMES
from manta_sim_ros.figures.jobs import Job, run_jobs

DOCS = Path(__file__).parents[2] / 'docs'


def main() -> int:
    """Run all sections, print the table of claims, write the page, and return the exit status."""
    folder = DOCS / 'verification'
    folder.mkdir(exist_ok=True)
    start = time.monotonic()
    parts = run_jobs([
        Job(f'{theme}: {check.__name__.replace("_", " ")}', 1,
            functools.partial(page.measured_part, theme, number, folder))
        for theme, checks in THEMES.items() for number, check in enumerate(checks)])
    for old in set(folder.glob('*.png')) - {folder / part.plot for part in parts}:
        old.unlink()
    (DOCS / 'verification.md').write_text(page.text(parts), encoding='utf-8')
    failed = [claim for part in parts for claim in part.claims if not claim.holds]
    print('', page.terminal_table(parts), '', sep='\n')
    print(f'{len(failed)} of {sum(len(part.claims) for part in parts)} claims failed. '
          f'docs/verification.md was written in {time.monotonic() - start:.0f} s.')
    return 1 if failed else 0


if __name__ == '__main__':
    sys.exit(main())

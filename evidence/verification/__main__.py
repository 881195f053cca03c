"""Verify the physics and write docs/verification.md and its plots again: `make verify`.

The exit status says whether every claim holds.
"""

from __future__ import annotations

import functools
import sys
import time
from pathlib import Path

from evidence.verification import figures, page
from evidence.verification.themes import THEMES
from manta_sim_ros.figures.jobs import Done, Job, run_jobs

DOCS = Path(__file__).parents[2] / 'docs'


def written(theme: str, number: int, folder: Path, done: Done) -> page.Part:
    """Run a section of a theme and draw its plot; return what the page takes of it."""
    check = THEMES[theme][number]
    section = check()
    plot = f'{check.__module__.rpartition(".")[2]}_{check.__name__}.png' if section.draw else ''
    if plot:
        figures.save(section, folder / plot)
    done()
    return page.Part(theme, section.title, section.text, section.claims, plot, section.caption)


def main() -> int:
    """Run all, print the table, write the page; return the exit status."""
    folder = DOCS / 'verification'
    folder.mkdir(exist_ok=True)
    start = time.monotonic()
    parts = run_jobs([
        Job(f'{theme}: {check.__name__.replace("_", " ")}', 1, functools.partial(written, theme, number, folder))
        for theme, checks in THEMES.items() for number, check in enumerate(checks)])
    for old in set(folder.glob('*.png')) - {folder / part.plot for part in parts}:
        old.unlink()
    (DOCS / 'verification.md').write_text(page.text(parts), encoding='utf-8')
    failed = [claim for part in parts for claim in part.claims if not claim.holds]
    print('', page.terminal_table(parts), '', sep='\n')
    print(f'{sum(len(part.claims) for part in parts)} claims, {len(failed)} do not hold; '
          f'{time.monotonic() - start:.0f} s. Written: docs/verification.md')
    return 1 if failed else 0


if __name__ == '__main__':
    sys.exit(main())

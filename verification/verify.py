#!/usr/bin/env python3
"""Verify the physics and write docs/verification.md and its plots anew: `make verify`.

Two processes with single-threaded libraries work through the sections. The exit status says whether every claim holds.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

os.environ.update({f'{library}_NUM_THREADS': '1' for library in ('OMP', 'OPENBLAS', 'MKL', 'NUMBA')})
ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / 'test')]  # the peers live with the tests

import concurrent.futures  # noqa: E402 - numerical libraries count threads when they are imported
import multiprocessing  # noqa: E402
import time  # noqa: E402

from verification import figures, page  # noqa: E402
from verification.themes import THEMES  # noqa: E402

PROCESSES = 2


def written(theme: str, number: int, folder: Path) -> tuple[page.Part, float]:
    """Run a section of a theme and draw its plot; return what the page takes of it, and the time it took [s]."""
    start = time.monotonic()
    check = THEMES[theme][number]
    section = check()
    plot = f'{check.__module__.rpartition(".")[2]}_{check.__name__}.png' if section.draw else ''
    if plot:
        figures.save(section, folder / plot)
    part = page.Part(theme, section.title, section.text, section.claims, plot, section.caption)
    return part, time.monotonic() - start


def main() -> int:
    """Run all, print the table, write the page; return the exit status."""
    folder = ROOT / 'docs' / 'verification'
    folder.mkdir(exist_ok=True)
    start = time.monotonic()
    context = multiprocessing.get_context('spawn')
    with concurrent.futures.ProcessPoolExecutor(PROCESSES, mp_context=context) as pool:
        runs = [pool.submit(written, theme, number, folder)
                for theme, checks in THEMES.items() for number in range(len(checks))]
        for run in concurrent.futures.as_completed(runs):
            part, seconds = run.result()
            print(f'{part.title}: {len(part.claims)} claims, {seconds:.0f} s', flush=True)
    parts = [run.result()[0] for run in runs]
    for old in set(folder.glob('*.png')) - {folder / part.plot for part in parts}:
        old.unlink()
    (ROOT / 'docs' / 'verification.md').write_text(page.text(parts), encoding='utf-8')
    failed = [claim for part in parts for claim in part.claims if not claim.holds]
    print('', page.terminal_table(parts), '', sep='\n')
    print(f'{sum(len(part.claims) for part in parts)} claims, {len(failed)} do not hold; '
          f'{time.monotonic() - start:.0f} s. Written: docs/verification.md')
    return 1 if failed else 0


if __name__ == '__main__':
    sys.exit(main())

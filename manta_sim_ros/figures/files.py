"""Files that are written completely or not at all."""

from __future__ import annotations

import contextlib
import csv
import fcntl
import glob
import math
import os
from collections.abc import Iterator, Mapping
from pathlib import Path

from manta_sim_ros.dynamics import FloatArray

DIGITS = 7
"""Significant digits of numbers in a CSV file."""


@contextlib.contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Give a path to write to, which is renamed to `path` after success and is removed after an error.

    What killed processes left of the same file is removed. The new one is on the disk before it has its name, so that
    it is whole also after a loss of power.
    """
    clear_abandoned(path.parent, path.name)
    part = path.with_name(f'.part-{os.getpid()}-{path.name}')
    with part.open('ab') as held:
        fcntl.flock(held, fcntl.LOCK_EX)  # for `clear_abandoned`: the lock lasts as long as this process
        try:
            yield part
            os.fsync(held.fileno())
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)


def clear_abandoned(directory: Path, name: str = '*') -> None:
    """Remove the incomplete files that killed processes left in a directory, of all names or one."""
    for part in directory.glob(f'.part-*-{name if name == "*" else glob.escape(name)}'):
        with contextlib.suppress(BlockingIOError, FileNotFoundError), part.open('r+b') as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            part.unlink()


def write_csv(columns: Mapping[str, FloatArray], path: Path) -> None:
    """Write columns of numbers or texts, of equal length, below their names; NaN becomes an empty cell."""
    with path.open('w', newline='', encoding='utf-8') as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        for row in zip(*(values.tolist() for values in columns.values()), strict=True):
            writer.writerow(_cell(value) for value in row)


def _cell(value: float | str) -> str:
    if isinstance(value, str):
        return value
    return '' if math.isnan(value) else f'{value:.{DIGITS}g}'

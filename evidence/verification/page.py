"""The page docs/verification.md, and the table of claims that is printed."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from evidence import report
from evidence.verification import figures
from evidence.verification.claims import Claim
from evidence.verification.themes import THEMES
from manta_sim_ros.figures.jobs import Done

HEAD = """# Verification: how correct the simulator is

`make verify` wrote this page: it measured every number and drew every plot. The same measurements are also tests
(`test/evidence/test_verification.py`), on smaller grids where the full grid takes long. The tests also compare the
table below with the code.

Each claim has a reference that does not share the code under test, a measured error, and a tolerance, whose reason is
given in the claim's section. Errors are relative unless they have a unit. Where the tolerance is a pair of numbers, for
example the bounds of an order of convergence, the error is the measured value. Equation numbers are those of Qu et al.,
J. Mar. Sci. Eng. 2024, 12, 292; [paper.md](paper.md) lists where the print is not followed.

This page verifies that the code solves the model, how accurately it does so, and how much accuracy the grid of the
model costs. It cannot verify that the model describes the robot. Only measurements on a robot can show that, above all
for the coefficients.
"""

HEADINGS = ('claim', 'reference', 'error', 'tolerance', 'holds')


class Part(NamedTuple):
    """A section in the form that the page needs; `plot` is a file name in docs/verification, or empty."""

    theme: str
    title: str
    text: str
    claims: tuple[Claim, ...]
    plot: str
    caption: str


def measured_part(theme: str, number: int, folder: Path, done: Done) -> Part:
    """Run a section of a theme, draw its plot into a folder, call `done`, and return the section for the page."""
    check = THEMES[theme][number]
    section = check()
    plot = f'{check.__module__.rpartition(".")[2]}_{check.__name__}.png' if section.draw else ''
    if plot:
        figures.save(section, folder / plot)
    done()
    return Part(theme, section.title, section.text, section.claims, plot, section.caption)


def text(parts: Iterable[Part]) -> str:
    """Return the page: the head, the table of all claims, and then the sections by theme."""
    parts = list(parts)
    blocks = [HEAD.strip(), '## The claims', table(parts)]
    for theme, of_theme in itertools.groupby(parts, key=lambda part: part.theme):
        blocks.append(f'## {theme}')
        for part in of_theme:
            reasons = ((claim.name, claim.error_text, claim.tolerance_text, claim.reason) for claim in part.claims)
            blocks += [
                f'### {part.title}', report.prose(part.text),
                report.table(('claim', 'error', 'tolerance', 'reason for the tolerance'), reasons)]
            if part.plot:
                blocks += [report.picture(f'verification/{part.plot}', part.title), f'*{part.caption}*']
    return '\n\n'.join(blocks) + '\n'


def table(parts: Iterable[Part]) -> str:
    """Return the table of all claims in Markdown."""
    return report.table(HEADINGS, (cells(claim) for part in parts for claim in part.claims))


def cells(claim: Claim) -> tuple[str, ...]:
    """Return a claim as a row of the table."""
    return (
        claim.name, claim.reference, claim.error_text, claim.tolerance_text, 'yes' if claim.holds else '**no**')


def terminal_table(parts: Iterable[Part]) -> str:
    """Return the table of all claims as plain text, one claim per line."""
    rows = [HEADINGS, *(cells(claim) for part in parts for claim in part.claims)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return '\n'.join(
        '  '.join(f'{cell:<{width}}' for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows)

"""The page docs/verification.md, and the table that is printed."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from typing import NamedTuple

from evidence import report
from evidence.verification.claims import Claim

HEAD = """# Verification: why the simulator is right, and how far

`make verify` wrote this page: it measured every number and drew every plot. The same measurements, on smaller grids
where a full one takes long, are tests (`test/evidence/test_verification.py`). They also hold this table against the
code.

A claim has a reference that does not share the code under test, a measured error, and a tolerance whose reason its
section gives. Errors are relative unless they have a unit. Where a tolerance is a pair of numbers, such as bounds of an
order of convergence, the error is the measured value. Equation numbers are those of Qu et al., J. Mar. Sci. Eng. 2024,
12, 292; [paper.md](paper.md) says where the print is not followed.

What is verified is that the code solves the model, how exactly, and what the model's grid costs in accuracy. Whether
the model is the robot, its coefficients above all, only measurements on a robot can say.
"""


HEADINGS = ('claim', 'reference', 'error', 'tolerance', 'holds')


class Part(NamedTuple):
    """A section as the page takes it; `plot` is a file name in docs/verification, or empty."""

    theme: str
    title: str
    text: str
    claims: tuple[Claim, ...]
    plot: str
    caption: str


def text(parts: Iterable[Part]) -> str:
    """Return the page: head, table of all claims, then the sections by theme."""
    parts = list(parts)
    blocks = [HEAD.strip(), '## The claims', table(parts)]
    for theme, of_theme in itertools.groupby(parts, key=lambda part: part.theme):
        blocks.append(f'## {theme}')
        for part in of_theme:
            reasons = ((claim.name, claim.error_text, claim.tolerance_text, claim.reason) for claim in part.claims)
            blocks += [
                f'### {part.title}', report.prose(part.text),
                report.table(('claim', 'error', 'tolerance', 'why this much'), reasons)]
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
    """Return the table of all claims as text, a claim a line."""
    rows = [HEADINGS, *(cells(claim) for part in parts for claim in part.claims)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return '\n'.join(
        '  '.join(f'{cell:<{width}}' for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows)

"""The page docs/verification.md, and the table that is printed."""

from __future__ import annotations

import itertools
import textwrap
from collections.abc import Iterable
from typing import NamedTuple

from verification.claims import Claim

HEAD = """# Verification: why the simulator is right, and how far

`make verify` wrote this page: it measured every number and drew every plot. The same measurements, on smaller grids
where a full one takes long, are tests (`test/test_verification.py`), which also hold this table against the code.

A claim has a reference that does not share the code under test, a measured error, and a tolerance whose reason its
section gives. Errors are relative unless they have a unit. Where a tolerance is a pair of numbers, such as bounds of an
order of convergence, the error is the measured value. Equation numbers are those of Qu et al., J. Mar. Sci. Eng. 2024,
12, 292; [paper.md](paper.md) says where the print is not followed.

What is verified is that the code solves the model, how exactly, and what the model's grid costs in accuracy. Whether
the model is the robot, its coefficients above all, only measurements on a robot can say.
"""


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
            blocks += [f'### {part.title}', _filled(part.text), _reasons(part.claims)]
            if part.plot:
                blocks.append(f'![{part.title}](verification/{part.plot})\n\n*{part.caption}*')
    return '\n\n'.join(blocks) + '\n'


def table(parts: Iterable[Part]) -> str:
    """Return the table of all claims in Markdown."""
    rows = [table_row(claim) for part in parts for claim in part.claims]
    return '\n'.join(['| claim | reference | error | tolerance | holds |', '|---|---|---|---|---|', *rows])


def table_row(claim: Claim) -> str:
    """Return a claim as a row of the table."""
    return _row(claim.name, claim.reference, claim.error_text, claim.tolerance_text, 'yes' if claim.holds else '**no**')


def terminal_table(parts: Iterable[Part]) -> str:
    """Return the table of all claims as text, a claim a line."""
    claims = [claim for part in parts for claim in part.claims]
    cells = [('claim', 'reference', 'error', 'tolerance', 'holds')]
    cells += [(claim.name, claim.reference, claim.error_text, claim.tolerance_text, 'yes' if claim.holds else 'NO')
              for claim in claims]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return '\n'.join(
        '  '.join(f'{cell:<{width}}' for cell, width in zip(row, widths, strict=True)).rstrip() for row in cells)


def _filled(prose: str) -> str:
    """Return paragraphs in lines of even length, whatever the length of the numbers in them; tables as they are."""
    paragraphs = (
        paragraph if paragraph.startswith('|')
        else textwrap.fill(' '.join(paragraph.split()), 120, break_long_words=False, break_on_hyphens=False)
        for paragraph in prose.strip().split('\n\n'))
    return '\n\n'.join(paragraphs)


def _reasons(claims: tuple[Claim, ...]) -> str:
    rows = [_row(claim.name, claim.error_text, claim.tolerance_text, claim.reason) for claim in claims]
    return '\n'.join(['| claim | error | tolerance | why this much |', '|---|---|---|---|', *rows])


def _row(*cells: str) -> str:
    return '| ' + ' | '.join(cell.replace('|', r'\|') for cell in cells) + ' |'

"""Pages in Markdown: the paragraphs, tables and pictures of every page that a measurement writes."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Sequence

WIDTH = 120
"""Greatest length of a line of prose [characters]."""


def prose(text: str) -> str:
    """Return paragraphs with their lines filled up to WIDTH; a paragraph that is a table stays as it is."""
    return '\n\n'.join(
        paragraph if paragraph.startswith('|')
        else textwrap.fill(' '.join(paragraph.split()), WIDTH, break_long_words=False, break_on_hyphens=False)
        for paragraph in text.strip().split('\n\n'))


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table with a head and rows of cells."""
    return '\n'.join(table_row(cells) for cells in (head, ['---'] * len(head), *rows))


def table_row(cells: Iterable[str]) -> str:
    """Return one row of a table."""
    return '| ' + ' | '.join(cell.replace('|', r'\|') for cell in cells) + ' |'


def picture(path: str, caption: str) -> str:
    """Return a picture; its caption is its alternative text."""
    return f'![{caption}]({path})'


def read_table(text: str) -> list[list[str]]:
    """Return the first table of a text: its head, then its rows, each as a list of cells."""
    found = re.search(r'^\|.*?(?=^[^|]|\Z)', text, flags=re.MULTILINE | re.DOTALL)
    lines = filter(None, found[0].splitlines()) if found else ()
    rows = [[cell.strip().replace(r'\|', '|') for cell in re.split(r'(?<!\\)\|', line)[1:-1]] for line in lines]
    return rows[:1] + rows[2:]

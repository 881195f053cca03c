"""Pages in Markdown: paragraphs, tables and pictures, for every page that a measurement writes."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Sequence

WIDTH = 120
"""Of lines of prose [characters], whatever the length of the numbers in it."""


def prose(text: str) -> str:
    """Return paragraphs in lines of even length; a paragraph that is a table stays as it is."""
    return '\n\n'.join(
        paragraph if paragraph.startswith('|')
        else textwrap.fill(' '.join(paragraph.split()), WIDTH, break_long_words=False, break_on_hyphens=False)
        for paragraph in text.strip().split('\n\n'))


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table."""
    return '\n'.join(table_row(cells) for cells in (head, ['---'] * len(head), *rows))


def table_row(cells: Iterable[str]) -> str:
    """Return one row of a table."""
    return '| ' + ' | '.join(cell.replace('|', r'\|') for cell in cells) + ' |'


def picture(path: str, caption: str) -> str:
    """Return a picture with its caption as the text for those who do not see it."""
    return f'![{caption}]({path})'


def read_table(text: str) -> list[list[str]]:
    """Return the first table of a text: its head, then its rows, each as the list of its cells."""
    found = re.search(r'^\|.*?(?=^[^|]|\Z)', text, flags=re.MULTILINE | re.DOTALL)
    lines = filter(None, found[0].splitlines()) if found else ()
    rows = [[cell.strip().replace(r'\|', '|') for cell in re.split(r'(?<!\\)\|', line)[1:-1]] for line in lines]
    return rows[:1] + rows[2:]

"""The parts, and the page docs/reliability.md."""

from __future__ import annotations

import traceback
from collections.abc import Mapping
from types import ModuleType

from evidence.report import prose, table
from evidence.soak import determinism, endurance, faults, fuzz, load, starts
from evidence.soak.facts import Fact, Lengths

PARTS: dict[str, ModuleType] = {
    'fuzz': fuzz, 'load': load, 'faults': faults, 'endurance': endurance, 'starts': starts, 'determinism': determinism}
HEAD = """
`make soak` wrote this page: it measured every number. It is started by hand, as it takes from half an hour on an idle
machine to more than an hour on a busy one. `SHORT=1 make soak` runs a small version of each part, which is also a
test (`test/evidence/test_soak.py`). A fact with an expectation must hold, else the command ends with status 1. A fact
without one depends on the machine, and is only printed. The load average tells how many programs wanted to compute at
the same time."""
HEADINGS = ('fact', 'measured', 'expected', 'holds')


def measured(part: ModuleType, lengths: Lengths) -> list[Fact]:
    """Return the facts of a part; one that falls over has the error as a fact that does not hold."""
    try:
        return part.measure(lengths)
    except Exception as error:  # whatever it was, the other parts go on
        traceback.print_exc()
        reason = ' '.join(f'{type(error).__name__}: {error}'.split())
        return [Fact('the part ran to its end', reason[:300], 'yes', False)]


def text(found: Mapping[str, list[Fact]], machine: str, before: str = '') -> str:
    """Return the page; the sections of parts that were not run are taken from the page `before`."""
    sections = {title: body for title, _, body in (
        section.partition('\n') for section in before.split('\n## ')[1:])}
    sections |= {PARTS[name].TITLE: section(name, facts, machine) for name, facts in found.items()}
    blocks = ['# Reliability: what the simulator survives', prose(HEAD)]
    blocks += [f'## {part.TITLE}\n\n{sections[part.TITLE].strip()}'
               for part in PARTS.values() if part.TITLE in sections]
    return '\n\n'.join(blocks) + '\n'


def section(name: str, facts: list[Fact], machine: str) -> str:
    """Return what stands below the title of a part."""
    part = PARTS[name]
    return '\n\n'.join([
        prose(part.ABOUT), facts_table(facts), prose(f'Not survived: {_begun(part)}'),
        prose(f'To repeat it: `make soak PARTS={name}`. Measured on {machine}.')])


def _begun(part: ModuleType) -> str:
    words = part.NOT_SURVIVED.strip()
    return words[0].lower() + words[1:]


def facts_table(facts: list[Fact]) -> str:
    """Return facts as a table in Markdown."""
    return table(HEADINGS, (
        (fact.name, fact.measured, fact.expected, '' if not fact.expected else 'yes' if fact.holds else '**no**')
        for fact in facts))

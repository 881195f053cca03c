"""Measure what the simulator survives, and write docs/reliability.md: `make soak`.

The exit status is 0 if every fact holds, and 1 otherwise.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from evidence.benchmark.__main__ import processor
from evidence.soak import page
from evidence.soak.facts import SHORT, Lengths

PAGE = Path(__file__).parents[2] / 'docs' / 'reliability.md'


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the parts, print their tables, write them into the page after a long run, and return the exit status."""
    parser = argparse.ArgumentParser(prog='python -m evidence.soak', description=__doc__.splitlines()[0])
    parser.add_argument('parts', nargs='*', metavar='PART', help=f'of {", ".join(page.PARTS)} (default: all)')
    parser.add_argument('--short', action='store_true', help='a small version of each part')
    for field in dataclasses.fields(Lengths):
        if field.name != 'cold':
            parser.add_argument(f'--{field.name}', type=type(field.default), metavar='N',
                                help=f'{field.default:g} in the long run')
    options = parser.parse_args(arguments)
    wanted = options.parts or list(page.PARTS)
    if unknown := set(wanted) - set(page.PARTS):
        parser.error(f'{min(unknown)!r} is no part; the parts are {", ".join(page.PARTS)}')
    given = {name: value for name, value in vars(options).items() if name in vars(SHORT) and value is not None}
    lengths = dataclasses.replace(SHORT if options.short else Lengths(), **given)
    found, busy = {}, os.getloadavg()[0]
    for name in wanted:
        began = time.monotonic()
        found[name] = page.measured(page.PARTS[name], lengths)
        print(f'\n{page.PARTS[name].TITLE} ({time.monotonic() - began:.0f} s)\n\n{page.facts_table(found[name])}',
              flush=True)
    failed = sum(not fact.holds for facts in found.values() for fact in facts)
    print(f'\n{failed} of {sum(map(len, found.values()))} facts do not hold.')
    if not (options.short or given):
        before = PAGE.read_text(encoding='utf-8') if PAGE.exists() else ''
        PAGE.write_text(page.text(found, f'{processor()}, load average {busy:.1f}', before), encoding='utf-8')
        print('written: docs/reliability.md')
    return 1 if failed else 0


if __name__ == '__main__':
    sys.exit(main())

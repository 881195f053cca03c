"""Every claim of docs/verification.md holds, measured on smaller grids where a full one takes long."""

import functools
import math
import re
from pathlib import Path

import pytest

from evidence.report import read_table
from evidence.verification import body_in_water, page, references
from evidence.verification.claims import Claim
from evidence.verification.themes import THEMES

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / 'docs' / 'verification.md').read_text(encoding='utf-8')
NEEDS = {
    references.one_fin: ['pinocchio'], body_in_water.added_mass_of_the_body: ['pinocchio'],
    body_in_water.plate_from_rest: ['mujoco']}
CHECKS = [check for checks in THEMES.values() for check in checks]


@functools.cache
def measured(check):
    for module in NEEDS.get(check, ()):
        pytest.importorskip(module)
    return check(quick=True)


@pytest.mark.parametrize('check', CHECKS, ids=lambda check: f'{check.__module__.rpartition(".")[2]}-{check.__name__}')
def test_the_claims_hold(check):
    failed = [f'{claim.name}: {claim.error_text}, tolerance {claim.tolerance_text} ({claim.reason})'
              for claim in measured(check).claims if not claim.holds]
    assert not failed, '\n'.join(failed)


def test_the_page_lists_exactly_the_claims_with_their_references_and_tolerances():
    head, *rows = read_table(PAGE.split('## The claims')[1])
    assert head == ['claim', 'reference', 'error', 'tolerance', 'holds']
    listed = [(name, reference, tolerance) for name, reference, _, tolerance, _ in rows]
    expected = [page.cells(claim) for check in CHECKS for claim in measured(check).claims]
    assert listed == [(name, reference, tolerance) for name, reference, _, tolerance, _ in expected]
    assert len(set(listed)) == len(listed)
    assert all(row[-1] == 'yes' for row in rows)


def test_the_page_has_the_sections_and_plots_of_the_code():
    assert re.findall(r'^### (.*)$', PAGE, flags=re.MULTILINE) == [measured(check).title for check in CHECKS]
    plots = re.findall(r'!\[.*?\]\((.*?)\)', PAGE)
    assert len(plots) == sum(measured(check).draw is not None for check in CHECKS)
    for plot in plots:
        assert (ROOT / 'docs' / plot).stat().st_size < 150_000


@pytest.mark.parametrize(('error', 'tolerance', 'holds'), [
    (1.0, 1.0, True), (1.1, 1.0, False), (math.nan, 1.0, False), (-math.inf, 1.0, False),
    (3.9, (3.5, 4.5), True), (3.4, (3.5, 4.5), False), (4.6, (3.5, 4.5), False), (math.nan, (3.5, 4.5), False),
])
def test_a_claim_holds_within_its_tolerance_and_never_without_a_number(error, tolerance, holds):
    assert Claim('', '', error, tolerance, '').holds == holds

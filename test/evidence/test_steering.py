"""docs/controller.md has what is measured now, in every row; the rules that it states follow from the numbers."""

import math
from pathlib import Path

import numpy as np
import pytest

from evidence.report import read_table
from evidence.steering import page
from evidence.steering.responses import CHANGES, GRID, RIGHT_PHASE, cruise_speed, response

PAGE = (Path(__file__).parents[2] / 'docs' / 'controller.md').read_text(encoding='utf-8')
# Below these, rounding on another machine may change a number: in turns, the chordwise instability amplifies it.
FORCE_TOLERANCE, MOMENT_TOLERANCE = 0.1, 0.05  # [N], [N m]
MOTION_TOLERANCES = [0.3, 0.01, 0.2, 0.5, 0.003]  # yaw rate [°/s], speed [m/s], pitch, roll [°], climb [m/s]


def done():
    """Take the report of a finished job."""


@pytest.fixture(scope='module')
def responses():
    return {change.name: response(change, done) for change in CHANGES}


def numbers(first_column):
    """Return the rows of the table of the page that begins with a heading: names and numbers."""
    _, *rows = read_table(PAGE[PAGE.index(f'| {first_column} |'):])
    return {row[0]: [float(cell) for cell in row[1:]] for row in rows}


def test_the_forces_are_those_that_are_measured_now(responses):
    written = numbers('change | F_x [N]')
    assert list(written) == [change.name for change in CHANGES]
    for name, row in written.items():
        np.testing.assert_allclose(row[:3], responses[name].wrench[:3], rtol=0.0, atol=FORCE_TOLERANCE)
        np.testing.assert_allclose(row[3:], responses[name].wrench[3:], rtol=0.0, atol=MOMENT_TOLERANCE)


def test_the_motions_are_those_that_are_measured_now(responses):
    written = numbers('change | yaw rate [°/s]')
    assert list(written) == [change.name for change in CHANGES]
    for name, row in written.items():
        one = responses[name]
        measured = [one.yaw_rate, one.speed, one.pitch, one.roll, one.climb]
        assert np.all(np.abs(np.subtract(row, measured)) <= MOTION_TOLERANCES), (name, row, measured)


def test_the_speeds_are_those_that_are_measured_now():
    _, *rows = read_table(PAGE[PAGE.index('| amplitude [°] |'):])
    assert [(float(row[0]), float(row[1])) for row in rows] == list(GRID)
    for row in rows:
        assert float(row[2]) == pytest.approx(cruise_speed(float(row[0]), float(row[1]), done), abs=0.002)


def test_changes_have_the_signs_that_symmetry_and_the_rules_demand(responses):
    for name, one in responses.items():
        if 'right' not in name and 'left' not in name:  # both fins alike: nothing sideways
            np.testing.assert_allclose(one.wrench[[1, 3, 5]], 0.0, atol=1e-6)
            assert abs(one.yaw_rate) < 0.01 and abs(one.roll) < 0.01
        elif 'of the right fin -' in name and 'bias' not in name:  # weaker on the right: to the right
            assert one.yaw_rate < -1.0 and one.wrench[5] < 0.0
    rules = ' '.join(page.rules(list(responses.values())).split())
    assert all(value in rules for value in (
        f'{responses[RIGHT_PHASE.name].yaw_rate:.1f}', 'turns to the right', 'A negative phase reverses it: -0.'))


def test_what_a_change_does_is_measured_with_its_sign(responses):
    back = responses[next(name for name in responses if '- 40°' in name)]
    assert back.speed < -0.1 and back.wrench[0] < 0.0
    assert math.isclose(back.change.commands[0].phase, math.radians(-40.0))

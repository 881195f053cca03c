"""docs/controller.md has what is measured now; its rules follow from the numbers, and say where configurations differ.

With config/manta.yaml all rows are measured again, with config/freshwater.yaml those of the rules and some speeds.
"""

import math
from pathlib import Path

import numpy as np
import pytest

from evidence.report import read_table
from evidence.steering import page
from evidence.steering.responses import (
    CHAINS,
    CHANGES,
    CONFIGURATIONS,
    FRONT_BIAS,
    GRID,
    OPPOSITE_BIASES,
    REVERSED,
    RIGHT_AMPLITUDE,
    RIGHT_PHASE,
    TURNS,
    cruise_speed,
    response,
    yaw_rate,
)

PAGE = (Path(__file__).parents[2] / 'docs' / 'controller.md').read_text(encoding='utf-8')
MEASURED = {'manta': CHANGES, 'freshwater': (REVERSED, RIGHT_AMPLITUDE, RIGHT_PHASE, FRONT_BIAS, OPPOSITE_BIASES)}
SPEEDS = {'manta': GRID, 'freshwater': GRID[1::4]}
# Below these, rounding on another machine may change a number: in turns, the chordwise instability amplifies it.
FORCE_TOLERANCE, MOMENT_TOLERANCE = 0.1, 0.05  # [N], [N m]
MOTION_TOLERANCES = [0.3, 0.01, 0.2, 0.5, 0.003]  # yaw rate [°/s], speed [m/s], pitch, roll [°], climb [m/s]
INDEPENDENT = 0.1  # largest difference of yaw rates with different numbers of chains [°/s]; measured: 0.02

pytestmark = pytest.mark.parametrize('configuration', CONFIGURATIONS)


def done():
    """Take the report of a finished job."""


@pytest.fixture(scope='module')
def all_responses():
    return {name: {change.name: response(CONFIGURATIONS[name], change, done) for change in changes}
            for name, changes in MEASURED.items()}


@pytest.fixture
def responses(all_responses, configuration):
    return all_responses[configuration]


def numbers(configuration, first_column):
    """Return the rows of the table of a configuration that begins with a heading: names and numbers."""
    section = PAGE[PAGE.index(f'### {page.TITLES[configuration]}\n'):]
    _, *rows = read_table(section[section.index(f'| {first_column} |'):])
    assert [row[0] for row in rows] == [change.name for change in CHANGES]
    return {row[0]: [float(cell) for cell in row[1:]] for row in rows}


def test_the_forces_are_those_that_are_measured_now(responses, configuration):
    written = numbers(configuration, 'change | F_x [N]')
    for name, one in responses.items():
        np.testing.assert_allclose(written[name][:3], one.wrench[:3], rtol=0.0, atol=FORCE_TOLERANCE)
        np.testing.assert_allclose(written[name][3:], one.wrench[3:], rtol=0.0, atol=MOMENT_TOLERANCE)


def test_the_motions_are_those_that_are_measured_now(responses, configuration):
    written = numbers(configuration, 'change | yaw rate [°/s]')
    for name, one in responses.items():
        row, measured = written[name], [one.yaw_rate, one.speed, one.pitch, one.roll, one.climb]
        assert np.all(np.abs(np.subtract(row, measured)) <= MOTION_TOLERANCES), (name, row, measured)


def test_the_speeds_are_those_that_are_measured_now(configuration):
    head, *rows = read_table(PAGE[PAGE.index('| amplitude [°] |'):])
    written = {(float(row[0]), float(row[1])): float(row[head.index(configuration)]) for row in rows}
    assert tuple(written) == GRID
    for case in SPEEDS[configuration]:
        assert written[case] == pytest.approx(cruise_speed(CONFIGURATIONS[configuration], *case, done), abs=0.002)


def test_yaw_rates_depend_on_the_number_of_chains_with_the_fins_of_the_paper_only(responses, configuration):
    _, *rows = read_table(PAGE[PAGE.index('| configuration |'):])
    rates = {row[1]: [float(cell) for cell in row[2:]] for row in rows if row[0] == configuration}
    assert list(rates) == [change.name for change in TURNS]
    parameters = CONFIGURATIONS[configuration]
    few, own = yaw_rate(parameters, CHAINS[0], RIGHT_PHASE, done), responses[RIGHT_PHASE.name].yaw_rate
    assert rates[RIGHT_PHASE.name][0] == pytest.approx(few, abs=MOTION_TOLERANCES[0])
    of_own = rates[RIGHT_PHASE.name][CHAINS.index(parameters.fin.chains)]
    assert of_own == pytest.approx(own, abs=MOTION_TOLERANCES[0])
    apart = max(max(row) - min(row) for row in rates.values())
    if configuration == 'freshwater':
        assert apart < INDEPENDENT and abs(few - own) < INDEPENDENT
    else:
        assert apart > 10.0 * INDEPENDENT and abs(few - own) > 10.0 * INDEPENDENT


def test_changes_have_the_signs_that_symmetry_and_the_rules_demand(responses):
    for name, one in responses.items():
        if 'right' not in name and 'left' not in name:  # both fins alike: nothing sideways
            np.testing.assert_allclose(one.wrench[[1, 3, 5]], 0.0, atol=1e-6)
            assert abs(one.yaw_rate) < 0.01 and abs(one.roll) < 0.01
        elif 'of the right fin -' in name and 'bias' not in name:  # weaker on the right: to the right
            assert one.yaw_rate < -1.0 and one.wrench[5] < 0.0
    assert responses[FRONT_BIAS.name].wrench[2] > 1.0 and responses[OPPOSITE_BIASES.name].roll > 5.0


def test_a_bias_lifts_the_robot_of_the_paper_and_lowers_that_in_fresh_water(responses, configuration):
    one = responses[FRONT_BIAS.name]
    assert one.climb > 0.005 if configuration == 'manta' else one.climb < -0.005 and one.pitch > 3.0


def test_the_rules_have_the_numbers_of_both_configurations(all_responses, configuration):
    rules = ' '.join(page.rules({name: list(found.values()) for name, found in all_responses.items()}).split())
    one = all_responses[configuration]
    assert 'turns to the right' in rules and 'A negative phase reverses it: -0.' in rules
    for value in (f'{one[RIGHT_PHASE.name].yaw_rate:.1f}', f'{one[RIGHT_AMPLITUDE.name].yaw_rate:.1f}',
                  f'{one[REVERSED.name].speed:.2f}', f'{abs(one[FRONT_BIAS.name].climb):.3f} m/s'):
        assert value in rules
    assert rules.split(' - ')[:2] == ' '.join(PAGE[PAGE.index('## Rules'):].split()).removeprefix(
        '## Rules ').split(' - ')[:2]


def test_what_a_change_does_is_measured_with_its_sign(responses):
    back = responses[REVERSED.name]
    assert back.speed < -0.1 and back.wrench[0] < 0.0
    assert math.isclose(back.change.commands[0].phase, math.radians(-40.0))

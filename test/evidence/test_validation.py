"""docs/validation.md has what is measured now; its verdicts and its deciding values follow from the numbers."""

import dataclasses
import math
from pathlib import Path

import pytest

from evidence.report import read_table
from evidence.validation import page
from evidence.validation.facts import FACTS, TOLERANCE, Fact, about
from evidence.validation.figures import FRESHWATER, written
from evidence.validation.measurements import CONFIGURATIONS, RESULTS, VARIED, Measured, configuration, measure
from evidence.validation.sensitivity import (
    CHAINS,
    DAMPING,
    FACTORS,
    VALUES,
    Sensitivity,
    Value,
    Variant,
    exponent,
    run,
    variants,
)
from manta_sim_ros.dynamics import Parameters

PAGE = (Path(__file__).parents[2] / 'docs' / 'validation.md').read_text(encoding='utf-8')
MANTA = CONFIGURATIONS[0]
DIGIT = 1.01
"""Units of the last digit by which a number may differ: rounding differs between machines."""
OF_TURNS = 0.02
"""Relative tolerance of the turns of the paper's robot, which the chordwise instability amplifies rounding in."""


@pytest.fixture(scope='module')
def results():
    """Return the results of both configurations, without those that need further swims."""
    return {name: measure(configuration(name)) for name in CONFIGURATIONS}


@pytest.fixture(scope='module')
def damped():
    """Return the results in fresh water with the quadratic damping of yaw halved and doubled."""
    return [run(Variant(FRESHWATER, DAMPING, factor), lambda: None) for factor in FACTORS]


def rows():
    """Return the rows of the table of facts."""
    return read_table(PAGE[PAGE.index('| quantity |'):])[1:]


def exponents(name):
    """Return the exponents of a configuration as the page has them: by value, the cells by key."""
    table = read_table(PAGE[PAGE.index(f'### {name}'):])
    assert table[0][1:] == [RESULTS[key].name for key in VARIED]
    return {row[0]: dict(zip(VARIED, row[1:], strict=True)) for row in table[1:]}


def number(cell):
    return float(cell.split(', ')[0].split(': ')[-1].split()[0].removesuffix('°/s'))


def test_the_page_has_every_fact_with_its_source():
    assert [row[:3] for row in rows()] == [[fact.quantity, fact.text, fact.source] for fact in FACTS]


@pytest.mark.parametrize('name', CONFIGURATIONS)
def test_the_numbers_beside_the_facts_are_those_measured_now(results, name):
    for row, fact in zip(rows(), FACTS, strict=True):
        cells = row[3 + CONFIGURATIONS.index(name)].split('; ')
        for cell, key in zip(cells, fact.results, strict=True):
            if key in results[name]:
                tolerance = OF_TURNS * abs(results[name][key]) * (name == MANTA and key[-1].isdigit())
                assert number(cell) == pytest.approx(
                    abs(results[name][key]), abs=tolerance + DIGIT * 10.0**-RESULTS[key].digits)
                assert (', **agrees**' in cell) == (page.verdict(fact, key, results[name]) is True), cell
                assert ('cannot be judged' in cell) == (fact.low is None)


def test_both_robots_swim_forward_and_turn_right(results):
    for one in results.values():
        assert one['thrust'] > 0.0 and one['speed'] > 0.0 and one['power'] > 0.0
        assert one['rate 1'] < one['rate 2'] < 0.0
        assert one['radius 1'] < one['radius 2']
        assert one['cost'] == pytest.approx(one['power'] / (20.0 * 9.81 * one['speed']))


def test_the_yaw_damping_in_fresh_water_has_the_exponents_of_the_page(damped):
    halved, doubled = damped
    cells = exponents(FRESHWATER)[str(DAMPING)]
    for key in VARIED:
        assert float(cells[key]) == pytest.approx(exponent(halved[key], doubled[key]), abs=0.011), key
    assert abs(halved['rate 2']) > 1.3 * abs(doubled['rate 2'])  # a smaller damping: a faster turn; measured: 1.9
    assert abs(float(exponents(FRESHWATER)[str(CHAINS)]['rate 2'])) < 0.02 < 1.0 < abs(
        float(exponents(MANTA)[str(CHAINS)]['rate 1']))


def test_every_value_of_a_configuration_is_varied():
    for name in CONFIGURATIONS:
        present = [str(value) for value in VALUES if value.of(configuration(name)) != 0.0]
        assert list(exponents(name)) == present
    assert len(variants()) == len(FACTORS) * sum(len(exponents(name)) for name in CONFIGURATIONS)


@pytest.mark.parametrize('value', VALUES, ids=str)
def test_a_variant_has_one_value_changed_by_its_factor(value):
    base = configuration(FRESHWATER)
    scaled = value.scaled(base, 2.0)
    assert value.of(scaled) == 2.0 * value.of(base) != 0.0
    assert value.scaled(scaled, 0.5) == base


def test_values_are_named_with_their_axis():
    assert str(Value('body.drag_coefficient', 0)) == '`body.drag_coefficient`, x'
    assert str(Value('body.angular_damping', 2)) == '`body.angular_damping`, yaw'
    assert str(DAMPING) == '`body.quadratic_damping`, yaw' and DAMPING.of(Parameters()) == 0.0


def test_an_exponent_is_that_of_a_power_law_and_missing_when_the_sign_changes():
    assert exponent(-3.0 * 0.5**-0.45, -3.0 * 2.0**-0.45) == pytest.approx(-0.45)
    assert math.isnan(exponent(-1.0, 1.0)) and math.isnan(exponent(math.nan, 1.0))
    assert [written(value) for value in (math.nan, -0.001, -0.456, 1.0)] == ['?', '0', '-0.46', '1.00']


def with_exponents(**by_value):
    """Return a sensitivity in which the speed of the paper's robot has these exponents."""
    names = {'density': VALUES[0], 'fin_drag': VALUES[2], 'chains': CHAINS}
    return Sensitivity({Variant(MANTA, names[name], factor): dict.fromkeys(VARIED, factor**power)
                        for name, power in by_value.items() for factor in FACTORS})


@pytest.mark.parametrize(('by_value', 'deciding'), [
    ({'density': 0.6, 'fin_drag': 0.58, 'chains': 0.1}, [VALUES[0], VALUES[2]]),
    ({'density': -0.6, 'fin_drag': 0.3, 'chains': 0.0}, [VALUES[0]]),
    ({'density': 0.2, 'fin_drag': -0.3, 'chains': 1.0}, [CHAINS, VALUES[2]])])
def test_the_values_with_the_largest_exponents_decide(by_value, deciding):
    assert list(with_exponents(**by_value).deciding(MANTA, 'speed')) == deciding


def test_a_wrong_factor_is_not_what_the_page_says(results):
    """The verdicts of the page change when a result does."""
    written_now = page.disagreements({name: Measured((), one | {'fastest': 0.5}) for name, one in results.items()})
    doubled = {name: Measured((), {key: 2.0 * value for key, value in one.items()} | {'fastest': 0.5})
               for name, one in results.items()}
    assert 'cruise speed' not in written_now and 'thrust' not in written_now
    assert 'freshwater.yaml, cruise speed: 0.900 m/s' in ' '.join(page.disagreements(doubled).split())
    assert 'No turn agrees in both.' == page.turns_that_agree(doubled)
    assert 'set 2 of freshwater.yaml' in page.turns_that_agree(
        {name: Measured((), one) for name, one in results.items()})


def test_a_fact_judges_magnitudes_within_its_bounds_only():
    single = Fact('', '', '', (), **about(10.0))
    assert single.agrees(-10.0 * (1.0 + TOLERANCE)) is True
    assert single.agrees(10.0 * (1.01 + TOLERANCE)) is False
    assert dataclasses.replace(single, low=None, high=None).agrees(10.0) is None


def test_the_page_names_what_to_use_for_what_and_shows_its_pictures():
    assert [part.split(')')[0] for part in PAGE.split('](validation/')[1:]] == [f'{name}.png' for name in page.PLOTS]
    for name in page.PLOTS:
        assert 10_000 < (Path(__file__).parents[2] / 'docs' / 'validation' / f'{name}.png').stat().st_size < 1_000_000
    last = PAGE.split('## Which configuration for what')[1]
    assert all(f'`config/{name}`' in last for name in CONFIGURATIONS)

"""Parameters have the model's values, are checked when made, and never change."""

import dataclasses
import math
import re
from fractions import Fraction

import numpy as np
import pytest

from manta_sim_ros.dynamics import Parameters
from manta_sim_ros.dynamics.parameters import Fin, Rods, Water

DEFAULTS = {  # Table 1 of the paper, and what the model supplies where the paper is silent
    'water': {
        'density': 9800.0, 'current': (0.0, 0.0, 0.0), 'current_deviation': (0.0, 0.0, 0.0),
        'current_correlation_time': 10.0, 'current_seed': 0, 'surface_height': 5.0,
        'added_mass_coefficient': 0.0, 'added_mass_density': 1000.0},
    'body': {
        'mass': 20.0, 'inertia': (1.33, 1.93, 2.73), 'drag_area': (0.32, 0.4, 0.8),
        'drag_coefficient': (0.02, 0.04, 0.1), 'angular_damping': (0.015, 0.01, 0.02),
        'buoyancy_center': (0.0, 0.0, 0.05), 'gravity': 9.81, 'added_mass': 6 * (0.0,), 'linear_damping': 6 * (0.0,),
        'quadratic_damping': 6 * (0.0,), 'net_buoyancy': 0.0},
    'rods': {
        'front_radius': 0.235, 'rear_radius': 0.185, 'support_length': 0.315, 'rear_motor_position': (-0.16, 0.3, 0.0),
        'command_time_constant': 0.2, 'servo_time_constant': 0.05, 'servo_rate_limit': 6.0},
    'fin': {
        'chains': 30, 'links': 3, 'span': 0.30, 'thickness': 0.012, 'youngs_modulus': 1e8, 'joint_damping': 0.1,
        'drag_coefficient': 1.2, 'density': 1000.0, 'shear_modulus': 0.0, 'twist_damping': 0.0},
    'solver': {'time_step': 0.002, 'fixed_base': False, 'coupling': 'sequential'},
}
GROUPS = Parameters.groups()
QUANTITIES = [(*full_name.split('.'), about) for full_name, about in Parameters.quantities().items()]
NUMBERS = [case for case in QUANTITIES if case[2].kind in (int, float)]
VECTORS = [case for case in QUANTITIES if case[2].kind is tuple]


def ids(cases):
    return [f'{group}.{name}' for group, name, _ in cases]


def just_below(about):
    return about.low - 1 if about.kind is int else math.nextafter(about.low, -math.inf)


def just_above(about):
    return about.high + 1 if about.kind is int else math.nextafter(about.high, math.inf)


def assert_refused(group, name, value, where='', why='must be'):
    with pytest.raises(ValueError) as refusal:
        GROUPS[group](**{name: value})
    assert str(refusal.value).startswith(f'{group}.{name}{where} is ')
    assert why in str(refusal.value)


def test_names_and_defaults_are_those_of_the_model():
    assert dataclasses.asdict(Parameters()) == DEFAULTS


@pytest.mark.parametrize(('group', 'name', 'about'), QUANTITIES, ids=ids(QUANTITIES))
def test_every_parameter_is_described(group, name, about):
    assert about.description and about.source and about.low <= about.high
    assert about.kind is type(DEFAULTS[group][name])


@pytest.mark.parametrize(('group', 'name', 'about'), NUMBERS, ids=ids(NUMBERS))
def test_an_invalid_number_is_refused_by_name_with_its_bounds(group, name, about):
    bounds = f'from {about.low:g} to {about.high:g} {about.unit}'.rstrip()
    for invalid in (just_below(about), just_above(about)):
        assert_refused(group, name, invalid, why=bounds)
    for invalid in (math.nan, math.inf, -math.inf, True, np.True_, '1', None, [1.0], 1j):
        assert_refused(group, name, invalid)
    if about.kind is int:
        assert_refused(group, name, 3.0, why='must be a whole number')


@pytest.mark.parametrize(('group', 'name', 'about'), VECTORS, ids=ids(VECTORS))
def test_an_invalid_vector_is_refused_by_name_with_its_bounds(group, name, about):
    good = list(DEFAULTS[group][name])
    for invalid in (1.0, None, '123', True, good[:-1], good + [1.0], [], np.zeros((3, 3))[:2], {'x': 1.0}):
        assert_refused(group, name, invalid, why=f'must be a list of {len(good)} numbers')
    bounds = f'from {about.low:g} to {about.high:g} {about.unit}'.rstrip()
    for axis in range(len(good)):
        for invalid in (just_below(about), just_above(about), math.nan, math.inf, True, '1', None, [1.0]):
            assert_refused(group, name, good[:axis] + [invalid] + good[axis + 1:], where=f'[{axis}]', why=bounds)


@pytest.mark.parametrize('invalid', [0, 1, 'false', None, np.True_])
def test_a_switch_takes_true_and_false_only(invalid):
    assert_refused('solver', 'fixed_base', invalid, why='true or false')


@pytest.mark.parametrize('invalid', ['', 'Monolithic', 'both', 1, None, True])
def test_the_coupling_is_one_of_two(invalid):
    for good in ('sequential', 'monolithic'):
        assert GROUPS['solver'](coupling=good).coupling == good
    is_text = isinstance(invalid, str) and invalid
    assert_refused('solver', 'coupling', invalid, why='sequential or monolithic' if is_text else 'text')


def test_added_mass_is_refused_with_the_sequential_coupling_and_the_reason():
    with pytest.raises(ValueError, match=r'^water\.added_mass_coefficient is 0\.5, but must be 0 with solver\.coupling '
                                         r'sequential: .* diverge; set solver\.coupling to monolithic'):
        Parameters().replace(water={'added_mass_coefficient': 0.5})
    made = Parameters().replace(water={'added_mass_coefficient': 0.5}, solver={'coupling': 'monolithic'})
    assert made.water.added_mass_coefficient == 0.5


@pytest.mark.parametrize(('group', 'name', 'about'), NUMBERS, ids=ids(NUMBERS))
def test_bounds_are_included(group, name, about):
    for bound in (about.low, about.high):
        values = {name: bound}
        if group == 'rods' and about.unit == 'm':  # the rods must fit each other
            values = {'front_radius': bound, 'rear_radius': bound, 'support_length': bound}
        assert getattr(GROUPS[group](**values), name) == bound


@pytest.mark.parametrize(('group', 'name', 'value'), [
    ('body', 'mass', 0.0), ('body', 'inertia', (1.0, 0.0, 1.0)), ('body', 'drag_area', (-1.0, 0.0, 0.0)),
    ('body', 'angular_damping', (0.0, -1e-9, 0.0)), ('rods', 'front_radius', 0.0), ('rods', 'rear_radius', -0.1),
    ('rods', 'support_length', 0.0), ('rods', 'command_time_constant', -0.1), ('fin', 'chains', 1), ('fin', 'links', 0),
    ('fin', 'span', 0.0), ('fin', 'thickness', 0.0), ('fin', 'density', 0.0), ('fin', 'youngs_modulus', -1.0),
    ('fin', 'joint_damping', -0.1), ('fin', 'drag_coefficient', -1.0), ('water', 'density', -1.0),
    ('solver', 'time_step', 0.0), ('body', 'mass', 10**400), ('water', 'current', (0, 10**400, 0)),
])
def test_what_no_robot_can_have_is_refused(group, name, value):
    with pytest.raises(ValueError, match=rf'^{group}\.{name}'):
        GROUPS[group](**{name: value})


def test_a_support_that_cannot_reach_from_rod_to_rod_is_refused():
    Rods(front_radius=0.3, rear_radius=0.1, support_length=0.2001)
    for front_radius, rear_radius in ((0.3, 0.1), (0.1, 0.3)):
        with pytest.raises(ValueError, match=r'^rods\.support_length is 0\.1999, .*rods\.rear_radius, 0\.2 m'):
            Rods(front_radius=front_radius, rear_radius=rear_radius, support_length=0.1999)
    with pytest.raises(ValueError, match=r'^rods\.support_length is 0\.05'):  # equal, but for 0.235 - 0.185 rounded
        Rods(support_length=0.05)


def test_numbers_of_numpy_and_lists_become_plain_numbers_and_tuples():
    fin = Fin(chains=np.int64(12), links=np.int32(4), span=np.float64(0.25), thickness=Fraction(1, 64), density=900)
    assert fin == Fin(chains=12, links=4, span=0.25, thickness=0.015625, density=900.0)
    assert [type(value) for value in dataclasses.astuple(fin)] == [int, int] + [float] * 8
    for current in ([1, 2.0, np.float32(3.0)], np.array([1.0, 2.0, 3.0]), np.array([1, 2, 3])):
        made = Water(current=current).current
        assert made == (1.0, 2.0, 3.0)
        assert type(made) is tuple and {type(part) for part in made} == {float}


@pytest.mark.parametrize('group', GROUPS)
def test_parameters_are_frozen(group):
    parameters = Parameters()
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(parameters, group, getattr(parameters, group))
    for name in DEFAULTS[group]:
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(getattr(parameters, group), name, DEFAULTS[group][name])


def test_replace_makes_a_checked_variant_and_leaves_the_original():
    parameters = Parameters()
    other = parameters.replace(fin={'chains': 12}, water={'density': 1000.0})
    assert (other.fin.chains, other.fin.links, other.water.density) == (12, 3, 1000.0)
    assert parameters == Parameters() != other
    with pytest.raises(ValueError, match=r'^fin\.chains is 0'):
        parameters.replace(fin={'chains': 0})
    assert parameters.replace() == parameters


def test_replace_on_the_dataclasses_makes_the_same_variant():
    parameters = Parameters()
    fin = dataclasses.replace(parameters.fin, chains=12)
    assert dataclasses.replace(parameters, fin=fin) == parameters.replace(fin={'chains': 12})


@pytest.mark.parametrize(('groups', 'reason'), [
    ({'finn': {'chains': 8}}, 'finn is no group of parameters; the groups are water, body, rods, fin, solver'),
    ({'fin': {'chain': 8}}, 'fin.chain is no parameter; fin has chains, links, '),
    ({'fin': 8}, 'fin is 8, but must be a group of named values'),
    ({'fin': {8: 8}}, 'fin.8 is no parameter'),
    ({'imu': {'seed': 1}}, 'imu is no group of parameters'),
])
def test_replace_refuses_what_is_unknown_and_names_what_is_known(groups, reason):
    with pytest.raises(ValueError, match=f'^{re.escape(reason)}'):
        Parameters().replace(**groups)


@pytest.mark.parametrize('group', GROUPS)
def test_a_group_of_another_class_is_refused(group):
    for invalid in (None, {}, Fin() if group != 'fin' else Water()):
        with pytest.raises(ValueError, match=f'^{group} is .* must be a '):
            Parameters(**{group: invalid})


@pytest.mark.parametrize(('groups', 'bound'), [
    ({'fin': {'span': 'x' * 10**6}}, 'a number from 0.001 to 10 m'),
    ({'fin': {'chains': 10**5000}}, 'must be from 2 to 2000'),
    ({'body': {'inertia': [1.0] * 10**5}}, 'a list of 3 numbers kg m^2'),
    ({'solver': {'coupling': 'x' * 10**6}}, 'sequential or monolithic'),
    ({'fin': {'x' * 10**6: 1.0}}, 'fin has chains'), ({'x' * 10**6: {}}, 'the groups are water'),
    ({'fin': ['x' * 10**6]}, 'a group of named values')])
def test_an_endless_value_is_refused_in_a_short_line_with_its_bound(groups, bound):
    with pytest.raises(ValueError) as refusal:
        Parameters().replace(**groups)
    assert len(str(refusal.value)) < 450 and bound in str(refusal.value)


def test_equal_parameters_have_the_same_bits():
    """Robots with equal parameters share what is computed from them."""
    negative, positive = (
        Parameters().replace(body={'gravity': zero}, rods={'rear_motor_position': (zero, 0.1, zero)})
        for zero in (-0.0, 0.0))
    assert negative == positive and str(negative) == str(positive)

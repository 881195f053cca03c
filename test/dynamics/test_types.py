"""Whatever is given in the place of a number, an array or an object is refused by name, in a short line."""

import dataclasses
import inspect

import numpy as np
import pytest

from evidence.scenarios import assert_same_bits, sized
from manta_sim_ros.dynamics import (
    REST,
    FinCommand,
    Parameters,
    Simulator,
    State,
    fin_dynamics,
    fin_loads,
    simulate_batch,
)
from manta_sim_ros.dynamics.quantity import LONGEST_ECHO, real_array

PARAMETERS = sized(4, 2)
STATE = State.at_rest(PARAMETERS)
NO_NUMBERS = [
    10**400, -10**400, 10**5000, 1j, np.complex128(1.0), '1', b'1', True, np.True_, object(), {'a': 1}, {1.0, 2.0},
    np.ma.masked, np.datetime64('2026-01-01'), float('nan'), float('inf'), np.float64('nan'), 'x' * 10**6]
NO_ARRAYS = [
    ['1', '2', '3'], [b'1', b'2', b'3'], [True, False, True], [1.0, None, 3.0], [1.0, [2.0], 3.0], [1j, 0.0, 0.0],
    [10**400, 0, 0], np.ma.array([1.0, 2.0, 3.0], mask=[False, True, False]), np.array(['1', '2', '3']),
    np.array([b'1', b'2', b'3']), np.array([1.0 + 0.0j, 0.0, 0.0]), np.array([1, '2', 3], dtype=object),
    np.array(['2026-01-01'] * 3, dtype='datetime64[D]'), np.zeros(3, dtype=[('x', float)]), [float('nan')] * 3,
    [1.0] * 10**5]


def refused(name, call, value):
    """Assert that a call with this value is refused, by name and shortly."""
    with pytest.raises(ValueError) as refusal:
        call(value)
    message = str(refusal.value)
    assert name in message and len(message) < 3 * LONGEST_ECHO, message


def kind(value):
    return f'{type(value).__name__} {str(value)[:20]}' if not isinstance(value, int) else type(value).__name__


NUMBERS = {
    'time': lambda value: dataclasses.replace(STATE, time=value),
    'start_time': lambda value: dataclasses.replace(STATE, start_time=value),
    'step_count': lambda value: dataclasses.replace(STATE, step_count=value),
    'duration': lambda value: Simulator(PARAMETERS).advance(value),
    'robot 0: duration': lambda value: simulate_batch(PARAMETERS, [STATE], None, value),
    'side': lambda value: fin_dynamics(
        PARAMETERS, value, np.zeros((2, 3)), np.zeros((4, 2)), np.zeros((4, 2)), np.zeros(6), np.zeros(6)),
    'fin.span': lambda value: Parameters().replace(fin={'span': value}),
    'fin.chains': lambda value: Parameters().replace(fin={'chains': value}),
    'water.current_seed': lambda value: Parameters().replace(water={'current_seed': value}),
    'amplitude': lambda value: FinCommand(amplitude=value, frequency=0.5, phase=0.1),
    'frequency': lambda value: FinCommand(amplitude=0.5, frequency=value, phase=0.1),
    'rear_bias': lambda value: FinCommand(amplitude=0.5, frequency=0.5, phase=0.1, rear_bias=value),
}
ARRAYS = {
    **{name: lambda value, name=name: dataclasses.replace(STATE, **{name: value})
       for name in ('position', 'twist', 'orientation', 'joint_angles', 'gait', 'rod_torques', 'current_deviation')},
    **{name: lambda value, name=name: Simulator(PARAMETERS).advance(0.002, **{name: value})
       for name in ('current', 'body_wrench', 'world_wrench')},
    'left command': lambda value: Simulator(PARAMETERS).command_rods(left=value, right=(0.0, 0.0)),
    **{name: lambda value, name=name: fin_dynamics(**{
        'parameters': PARAMETERS, 'side': 0, 'rod_motion': np.zeros((2, 3)), 'joint_angles': np.zeros((4, 2)),
        'joint_rates': np.zeros((4, 2)), 'body_twist': np.zeros(6), 'body_acceleration': np.zeros(6), name: value})
       for name in ('rod_motion', 'joint_rates', 'body_twist', 'body_acceleration')},
    'robot 0: every': lambda value: simulate_batch(PARAMETERS, [STATE], None, 0.002, every=value),
    'body.inertia': lambda value: Parameters().replace(body={'inertia': value}),
    'body.added_mass': lambda value: Parameters().replace(body={'added_mass': value}),
}
OBJECTS = {
    'parameters': lambda value: Simulator(value),
    'state': lambda value: Simulator(PARAMETERS, state=value),
    'right command': lambda value: Simulator(PARAMETERS).command(left=REST, right=value),
    'fin': lambda value: Parameters(fin=value),
    'robot 1: parameters': lambda value: simulate_batch([PARAMETERS, value], [STATE, STATE], None, 0.002),
    'robot 1: state': lambda value: simulate_batch(PARAMETERS, [STATE, value], None, 0.002),
    'robot 1: ': lambda value: simulate_batch(PARAMETERS, [STATE, STATE], [None, value], 0.002),
    'robot 0: the right command': lambda value: simulate_batch(PARAMETERS, [STATE], [(REST, value)], 0.002),
}


@pytest.mark.parametrize('name', NUMBERS)
@pytest.mark.parametrize('value', [*NO_NUMBERS, *NO_ARRAYS, None], ids=kind)
def test_what_is_no_number_is_refused_by_name(name, value):
    refused(name, NUMBERS[name], value)


@pytest.mark.parametrize('name', ARRAYS)
@pytest.mark.parametrize('value', [*NO_NUMBERS, *NO_ARRAYS], ids=kind)
def test_what_is_no_array_of_numbers_is_refused_by_name(name, value):
    refused(name, ARRAYS[name], value)


@pytest.mark.parametrize('name', OBJECTS)
@pytest.mark.parametrize('value', [1.0, 'x' * 10**6, {'fin': {}}, [1.0, 2.0], Parameters, object()], ids=kind)
def test_an_object_of_another_class_is_refused_by_name(name, value):
    refused(name, OBJECTS[name], value)


@pytest.mark.parametrize('function', [fin_dynamics, fin_loads])
def test_functions_refuse_what_are_no_parameters(function):
    others = [None] * (len(inspect.signature(function).parameters) - 1)
    refused('parameters', lambda value: function(value, *others), {'fin': {}})


@pytest.mark.parametrize('values', [
    (1, 2, 3), [1.0, np.float32(2.0), np.int64(3)], np.array([1, 2, 3], dtype=np.uint8),
    np.array([1, 2.0, 3], dtype=object), np.ma.array([1.0, 2.0, 3.0]), np.float16([1.0, 2.0, 3.0])], ids=kind)
def test_real_numbers_of_any_type_are_taken(values):
    np.testing.assert_array_equal(real_array('values', values), [1.0, 2.0, 3.0])
    assert_same_bits(dataclasses.replace(STATE, position=values), dataclasses.replace(STATE, position=(1.0, 2.0, 3.0)))

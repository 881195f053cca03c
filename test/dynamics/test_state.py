"""A state is checked when made, frozen, and survives a copy or a file."""

import copy
import dataclasses
import pickle

import numpy as np
import pytest

from evidence.scenarios import STATE_FIELDS, SWIM, TURN, assert_same_bits, sized
from manta_sim_ros.dynamics import Parameters, Simulator, State

SHAPES = {
    'position': (3,), 'orientation': (4,), 'twist': (6,), 'acceleration': (6,), 'joint_angles': (2, 5, 3),
    'joint_rates': (2, 5, 3), 'rod_angles': (2, 2), 'fin_wrenches': (2, 6), 'gait': (2, 5), 'gait_rates': (2, 5),
    'gait_commands': (2, 5), 'cycle_angles': (2,), 'current_deviation': (3,), 'rod_rates': (2, 2),
    'rod_torques': (2, 2),
}


@pytest.fixture(scope='module')
def state():
    simulator = Simulator(sized(5, 3, water={'current_deviation': (0.1, 0.1, 0.1)}))
    simulator.command(left=SWIM, right=TURN)
    return simulator.advance(0.7)


def test_a_state_has_the_arrays_of_the_interface(state):
    assert {name: getattr(state, name).shape for name in SHAPES} == SHAPES
    assert set(STATE_FIELDS) == {*SHAPES, 'time', 'start_time', 'step_count', 'servos'}
    assert state.time == pytest.approx(0.7, abs=1e-12)
    for name in SHAPES:
        assert np.any(getattr(state, name) != 0.0), f'{name} holds nothing'


def test_the_wrench_is_the_sum_of_both_fins(state):
    assert state.wrench.shape == (6,)
    np.testing.assert_array_equal(state.wrench, state.fin_wrenches.sum(axis=0))


def test_a_state_is_frozen(state):
    for name in STATE_FIELDS:
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(state, name, getattr(state, name))
    for name in SHAPES:
        with pytest.raises(ValueError, match='read-only'):
            getattr(state, name)[...] = 0.0


def test_a_state_keeps_copies_of_what_it_was_made_of(state):
    position = np.array([1.0, 2.0, 3.0])
    made = dataclasses.replace(state, position=position)
    position[0] = 9.0
    assert made.position[0] == 1.0


@pytest.mark.parametrize('through', [
    copy.deepcopy, lambda state: pickle.loads(pickle.dumps(state)), lambda state: dataclasses.replace(state),
    lambda state: State(**{name: np.asarray(getattr(state, name)).tolist() for name in STATE_FIELDS}),
])
def test_a_copy_is_the_same_to_the_last_bit(state, through):
    assert_same_bits(through(state), state)


@pytest.mark.parametrize('invalid', [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize('name', SHAPES)
def test_values_that_are_not_finite_are_refused_by_name(state, name, invalid):
    values = getattr(state, name).copy()
    values.flat[-1] = invalid
    with pytest.raises(ValueError, match=rf'^state\.{name} must be finite, but has {invalid}'):
        dataclasses.replace(state, **{name: values})


@pytest.mark.parametrize('name', SHAPES)
def test_arrays_of_a_wrong_shape_are_refused_by_name(state, name):
    values = getattr(state, name)
    for wrong in (values[..., :-1], values[np.newaxis], values.ravel()[0]):
        with pytest.raises(ValueError, match=rf'^state\.(joint_rates|{name}) has shape'):
            dataclasses.replace(state, **{name: wrong})


@pytest.mark.parametrize('invalid', [np.nan, np.inf, '0', None])
def test_a_time_that_is_no_finite_number_is_refused(state, invalid):
    with pytest.raises(ValueError, match=r'^state\.time is'):
        dataclasses.replace(state, time=invalid)


def test_an_orientation_that_is_no_unit_quaternion_is_refused(state):
    dataclasses.replace(state, orientation=state.orientation * (1.0 + 5e-7))
    for factor in (0.0, 1.0 + 2e-6, 1.0 - 2e-6, 2.0):
        with pytest.raises(ValueError, match=r'^state\.orientation has norm'):
            dataclasses.replace(state, orientation=state.orientation * factor)


def test_rest_is_at_the_origin_with_flat_fins():
    rest = State.at_rest(Parameters())
    for name in STATE_FIELDS:
        expected = [0.0, 0.0, 0.0, 1.0] if name == 'orientation' else 0.0
        np.testing.assert_array_equal(getattr(rest, name), expected)
    assert rest.joint_angles.shape == rest.joint_rates.shape == (2, 30, 3)
    assert_same_bits(Simulator().state, rest)


@pytest.mark.parametrize(('name', 'invalid'), [
    ('start_time', None), ('start_time', 10**400), ('time', 10**400), ('step_count', 'x'), ('step_count', 2.5),
    ('step_count', -1), ('position', 'abc'), ('twist', [1.0, [2.0]]),
])
def test_what_is_no_number_is_refused_by_name(state, name, invalid):
    with pytest.raises(ValueError, match=f'^state.{name}'):
        dataclasses.replace(state, **{name: invalid})

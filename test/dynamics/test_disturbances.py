"""Current and external wrenches: against the reference implementation, exact laws and themselves."""

import dataclasses
import math

import numpy as np
import pytest

from evidence.references import equations
from evidence.scenarios import (
    COMMANDS,
    NO_WATER,
    SWIM,
    TURN,
    any_state,
    assert_close,
    assert_same_bits,
    bits,
    sized,
    smoothed_rods,
)
from manta_sim_ros.dynamics import MONOLITHIC, SEQUENTIAL, DivergenceError, Simulator, State
from manta_sim_ros.dynamics.current import INTERVAL, deviation_at, steps_left
from manta_sim_ros.dynamics.parameters import Water

CURRENT = (0.3, -0.2, 0.1)
BODY_WRENCH = (4.0, -3.0, 2.0, 0.5, -0.4, 0.3)
WORLD_WRENCH = (-1.0, 5.0, 2.0, -0.2, 0.1, 0.6)
VARYING = {'current': CURRENT, 'current_deviation': (0.2, 0.1, 0.05), 'current_correlation_time': 0.5}


def swimmer(parameters):
    simulator = Simulator(parameters)
    simulator.command(left=SWIM, right=TURN)
    return simulator


def test_steps_with_a_current_and_wrenches_agree_with_the_reference_implementation():
    parameters = sized(3, 2)
    start = any_state(parameters)
    simulator = Simulator(parameters, state=start)
    simulator.command(left=COMMANDS[0], right=COMMANDS[1])
    rods = smoothed_rods(parameters, start)
    names = [field.name for field in dataclasses.fields(equations.ReferenceState)]
    expected = equations.ReferenceState(**{name: getattr(start, name) for name in names})
    in_current = parameters.replace(water={'current': CURRENT})
    for _ in range(25):
        expected = equations.step(in_current, expected, rods, np.array(BODY_WRENCH), np.array(WORLD_WRENCH))
        state = simulator.advance(
            parameters.solver.time_step, current=CURRENT, body_wrench=BODY_WRENCH, world_wrench=WORLD_WRENCH)
        for name in names:
            assert_close(getattr(state, name), getattr(expected, name), 1e-10)  # measured: below 1e-13


@pytest.mark.parametrize('coupling', [SEQUENTIAL, MONOLITHIC])
@pytest.mark.parametrize('wrench', [(3.0, -2.0, 1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.4, -0.3, 0.2)])
def test_without_water_the_momentum_of_body_and_fins_grows_by_the_impulse(coupling, wrench, pinocchio_tree):
    parameters = sized(4, 3, **NO_WATER, solver={'coupling': coupling, 'time_step': 1e-4})
    tree = pinocchio_tree.swimmer_tree(parameters)
    start = dataclasses.replace(any_state(parameters), acceleration=np.zeros(6))
    free, pushed = (
        pinocchio_tree.momentum(tree, Simulator(parameters, state=start).advance(0.2, world_wrench=acting))
        for acting in (np.zeros(6), wrench))
    gained, part = pushed - free, slice(0, 3) if any(wrench[:3]) else slice(3, 6)
    # measured, of the impulse: 6e-5 and 2e-4 with the sequential coupling, of first order; 6e-13 and 2e-11 together
    tolerance = 1e-3 if coupling == SEQUENTIAL else 1e-9
    assert_close(gained[part], 0.2 * np.array(wrench)[part], tolerance)
    if part == slice(3, 6):
        assert np.abs(gained[:3]).max() < tolerance * 0.2 * np.abs(wrench).max()


@pytest.mark.parametrize('coupling', [SEQUENTIAL, MONOLITHIC])
def test_a_wrench_in_the_body_frame_is_the_turned_one_in_the_world_frame(coupling):
    time_step = 1e-6
    parameters = sized(3, 2, solver={'coupling': coupling, 'time_step': time_step})
    start = any_state(parameters)
    turned = equations.orientation_matrix(start.orientation) @ np.reshape(BODY_WRENCH, (2, 3)).T
    in_body = Simulator(parameters, state=start).advance(time_step, body_wrench=BODY_WRENCH)
    in_world = Simulator(parameters, state=start).advance(time_step, world_wrench=turned.T.ravel())
    free = Simulator(parameters, state=start).advance(time_step)
    # derived: in a step the body turns by its rate, below 1 rad/s, times the step
    assert_close(in_world.twist - free.twist, in_body.twist - free.twist, 10.0 * time_step)
    assert np.abs(in_body.twist - free.twist).max() > 0.1 * time_step


def test_a_current_that_is_given_takes_the_place_of_that_of_the_parameters():
    of_parameters, of_call = swimmer(sized(4, 2, water={'current': CURRENT})), swimmer(sized(4, 2))
    assert_same_bits(of_parameters.advance(0.5), of_call.advance(0.5, current=CURRENT))
    assert_same_bits(of_parameters.advance(0.5, current=(0.0, 0.0, 0.0)), of_call.advance(0.5))


def test_a_current_and_external_wrenches_act_for_the_duration_of_their_call_only():
    simulator, other = swimmer(sized(4, 2)), swimmer(sized(4, 2))
    simulator.advance(0.1, body_wrench=BODY_WRENCH, current=CURRENT)
    other.reset(simulator.state)
    assert_same_bits(simulator.advance(0.1), other.advance(0.1))


def test_a_body_that_is_held_feels_no_wrench():
    held = [swimmer(sized(4, 2, solver={'fixed_base': True})) for _ in range(2)]
    assert_same_bits(held[0].advance(0.2), held[1].advance(0.2, body_wrench=BODY_WRENCH, world_wrench=WORLD_WRENCH))


@pytest.mark.parametrize(('arguments', 'words'), [
    ({'current': (0.0, math.nan, 0.0)}, 'current must be finite, but has nan'),
    ({'current': (0.0, 1.0)}, r'current has shape \(2,\), but must have \(3,\)'),
    ({'body_wrench': (0.0, 0.0, math.inf, 0.0, 0.0, 0.0)}, 'body_wrench must be finite, but has inf'),
    ({'world_wrench': (1.0, 2.0, 3.0)}, r'world_wrench has shape \(3,\), but must have \(6,\)'),
])
def test_what_is_no_disturbance_is_refused_and_changes_nothing(arguments, words):
    simulator = swimmer(sized(4, 2))
    before = simulator.advance(0.1)
    with pytest.raises(ValueError, match=words):
        simulator.advance(0.1, **arguments)
    assert simulator.state is before


def test_a_wrench_beyond_all_bounds_ends_in_an_error_and_leaves_the_state():
    simulator = swimmer(sized(4, 2))
    before = simulator.advance(0.1)
    with pytest.raises(DivergenceError):
        simulator.advance(1.0, body_wrench=(1e6, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert simulator.state is before


def test_the_deviation_of_the_current_is_a_gauss_markov_process():
    water = Water(current_deviation=(0.2, 0.1, 0.05), current_correlation_time=0.5, current_seed=7)
    count, values = 100_000, [np.zeros(3)]
    for number in range(count):
        values.append(deviation_at(water, values[-1], number * INTERVAL, (number + 1) * INTERVAL))
    values = np.array(values[1000:])  # the start at 0 is long forgotten
    # of 1000 s with a correlation of 0.5 s about 1000 values are independent: 5 standard deviations of an estimate
    scatter = 5.0 / math.sqrt(len(values) * INTERVAL / (2.0 * water.current_correlation_time))
    np.testing.assert_allclose(values.std(axis=0), water.current_deviation, rtol=scatter / math.sqrt(2.0))
    np.testing.assert_allclose(values.mean(axis=0) / water.current_deviation, 0.0, atol=scatter)
    for lag in (10, 50, 100):
        correlation = (values[lag:] * values[:-lag]).mean(axis=0) / values.var(axis=0)
        np.testing.assert_allclose(correlation, math.exp(-lag * INTERVAL / 0.5), atol=scatter)
    across = np.corrcoef(values.T)[np.triu_indices(3, 1)]
    np.testing.assert_allclose(across, 0.0, atol=scatter)


def test_the_current_that_varies_is_the_mean_and_its_deviation_interval_by_interval():
    varying, steady = swimmer(sized(4, 2, water=VARYING)), swimmer(sized(4, 2))
    for _ in range(30):
        deviation = varying.state.current_deviation
        expected = steady.advance(INTERVAL, current=np.add(CURRENT, deviation))
        state = varying.advance(INTERVAL)
        assert np.all(state.current_deviation != deviation)
        assert bits(state)['twist'] == bits(expected)['twist']
        assert bits(state)['joint_rates'] == bits(expected)['joint_rates']


@pytest.mark.parametrize('groups', [{}, {'solver': {'coupling': MONOLITHIC}}, {'solver': {'time_step': 0.003}}])
def test_a_current_that_varies_is_the_same_at_once_in_parts_and_after_a_restart(groups):
    parameters = sized(3, 2, **{'water': VARYING, **groups})
    at_once = swimmer(parameters).advance(0.3)
    parts = swimmer(parameters)
    for _ in range(10):
        parts.advance(0.03)
    assert_same_bits(parts.state, at_once)
    half = swimmer(parameters).advance(0.15)
    assert_same_bits(Simulator(parameters, state=half).advance(0.15), at_once)
    assert np.all(at_once.current_deviation != 0.0)


def test_another_seed_is_another_current_and_no_deviation_is_none():
    one, same, other, none = (
        swimmer(sized(3, 2, water=water)).advance(0.2).current_deviation
        for water in (VARYING, VARYING, {**VARYING, 'current_seed': 1}, {'current': CURRENT}))
    assert np.array_equal(one, same) and np.all(one != other)
    np.testing.assert_array_equal(none, 0.0)


def test_a_deviation_ends_when_the_parameters_ask_for_none():
    state = swimmer(sized(3, 2, water=VARYING)).advance(0.2)
    calm = Simulator(sized(3, 2, water={'current': CURRENT}), state=state)
    np.testing.assert_array_equal(calm.advance(0.002).current_deviation, 0.0)
    rest = dataclasses.replace(state, current_deviation=np.zeros(3))
    assert_same_bits(calm.state, Simulator(calm.parameters, state=rest).advance(0.002))


@pytest.mark.parametrize('time_step', [0.0005, 0.002, 0.003, 0.02])
def test_every_interval_begins_at_the_first_step_in_it(time_step):
    step = 0
    for _ in range(200):
        time = step * time_step
        left = steps_left(time, time_step)
        ended = math.floor(time / INTERVAL + 1e-9) + 1
        assert (step + left) * time_step >= ended * INTERVAL - 1e-9
        assert left == 1 or (step + left - 1) * time_step < ended * INTERVAL - 1e-9
        step += left


def test_rest_is_without_a_deviation():
    np.testing.assert_array_equal(State.at_rest(sized(3, 2)).current_deviation, 0.0)

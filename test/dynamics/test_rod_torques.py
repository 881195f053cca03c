"""Torques and power of the rods: by virtual power, by the balance of energy, by the mirror, and after a restart."""

import dataclasses
import pickle

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

from evidence.references.mechanism import support_pose
from evidence.scenarios import SWIM, TURN, TWIST, WATER_OF_BODY, in_transition, sized
from evidence.verification import mechanics
from manta_sim_ros.dynamics import Parameters, Simulator
from manta_sim_ros.figures.gaits import STRAIGHT

AT_ONCE = {'command_time_constant': 0.0}
ADDED_MASS = {'added_mass_coefficient': 0.8}
BEYOND = {'fin': TWIST, 'body': WATER_OF_BODY}
CASES = pytest.mark.parametrize('groups', [
    {'solver': {'time_step': 5e-4}}, {'solver': {'fixed_base': True}},
    {'water': ADDED_MASS, 'solver': {'coupling': 'monolithic'}, **BEYOND},
], ids=['staggered', 'held', 'monolithic, all that is beyond the paper'])


def swimming(parameters, left=SWIM, right=TURN, duration=0.9):
    simulator = Simulator(parameters)
    simulator.command(left=left, right=right)
    simulator.advance(duration)
    return simulator


def relative_twist(parameters, side, angles, rates):
    """Return the twist (6,) of a support relative to the body, about the center of mass, from the mechanism's pose."""
    rotation, position = support_pose(parameters, side, np.stack([angles, rates, np.zeros(2)], axis=1))
    spin = rotation.first @ rotation.value.T
    omega = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
    return np.hstack([position.first - np.cross(omega, position.value), omega])


@CASES
def test_each_torque_is_minus_the_wrench_on_the_motion_of_its_rod(groups):
    state = swimming(sized(5, 2, rods=AT_ONCE, **groups)).state
    parameters = sized(5, 2)
    for side in range(2):
        for rod, unit in enumerate(np.eye(2)):
            motion = relative_twist(parameters, side, state.rod_angles[side], unit)
            expected = -state.fin_wrenches[side] @ motion
            assert abs(expected) > 1e-3
            assert state.rod_torques[side, rod] == pytest.approx(expected, rel=1e-11)  # rounding; measured: 2e-14


@CASES
def test_rates_and_power_are_those_of_the_gait(groups):
    parameters = sized(5, 2, rods=AT_ONCE, **groups)
    simulator = swimming(parameters)
    history = mechanics.recorded(simulator, (SWIM, TURN), 10 * parameters.solver.time_step)
    for side, gait in enumerate((SWIM, TURN)):
        rates = mechanics.rods_of(parameters, gait, history.time)[-1, :, 1]
        np.testing.assert_allclose(simulator.state.rod_rates[side], rates, rtol=0.0, atol=1e-12)
    expected = mechanics.power(parameters, history)['rods'][-1]
    assert abs(expected) > 0.05
    assert simulator.state.rod_power == pytest.approx(expected, rel=1e-11)  # rounding; measured: 3e-14


def test_peaks_and_mean_power_of_the_default_robot():
    simulator = swimming(Parameters().replace(rods=AT_ONCE), STRAIGHT, STRAIGHT, 10.0)
    states = [simulator.advance(0.02) for _ in range(250)]  # three periods
    front, rear = np.abs([state.rod_torques for state in states]).max(axis=(0, 1))
    assert front == pytest.approx(2.4, abs=0.05)
    assert rear == pytest.approx(1.1, abs=0.05)
    assert np.mean([state.rod_power for state in states]) == pytest.approx(6.5, abs=0.05)


def test_the_work_of_the_rods_is_stored_or_dissipated():
    parameters = sized(4, 3, rods=AT_ONCE, solver={'coupling': 'monolithic', 'time_step': 1e-3}, **BEYOND)
    simulator = swimming(parameters, duration=0.2)
    gaits = SWIM, TURN
    states = [simulator.state]
    checkpoint = Simulator(parameters, state=simulator.state)
    for _ in range(400):
        states.append(simulator.advance(1e-3))
    history = mechanics.recorded(checkpoint, gaits, 0.4)
    work = cumulative_simpson([state.rod_power for state in states], dx=1e-3)[-1]
    stored = sum(mechanics.energy(parameters, history).values())
    losses = mechanics.power(parameters, history)
    lost = -cumulative_simpson(losses['drag'] + losses['dampers'], dx=1e-3)[-1]
    assert work > 0.5 and lost > 0.3
    assert work == pytest.approx(stored[-1] - stored[0] + lost, rel=1e-6)  # fourth order; measured: 2e-8


@pytest.mark.parametrize('coupling', ['sequential', 'monolithic'])
def test_both_sides_of_a_symmetric_gait_and_of_exchanged_gaits_have_the_same_bits(coupling):
    parameters = sized(7, 2, solver={'coupling': coupling})
    alike = swimming(parameters, SWIM, SWIM).state
    one, other = swimming(parameters, SWIM, TURN).state, swimming(parameters, TURN, SWIM).state
    for name in ('rod_rates', 'rod_torques'):
        assert np.all(getattr(one, name) != 0.0)
        np.testing.assert_array_equal(getattr(alike, name)[0], getattr(alike, name)[1])
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name)[::-1])


@pytest.mark.parametrize('coupling', ['sequential', 'monolithic'])
def test_torques_are_the_same_bits_after_a_restart_and_do_not_act_on_the_motion(coupling):
    simulator = in_transition(sized(5, 2, solver={'coupling': coupling}))
    saved = pickle.loads(pickle.dumps(simulator.state))
    changed = dataclasses.replace(saved, rod_torques=np.ones((2, 2)), rod_rates=np.ones((2, 2)))
    reference = simulator.advance(0.3)
    for start in (saved, changed):
        state = Simulator(simulator.parameters, state=start).advance(0.3)
        for name in ('rod_rates', 'rod_torques', 'joint_angles', 'twist'):
            np.testing.assert_array_equal(getattr(state, name), getattr(reference, name))


def test_a_robot_at_rest_needs_no_torque():
    state = Simulator(sized(4, 2)).advance(0.1)
    np.testing.assert_array_equal(state.rod_torques, 0.0)
    assert state.rod_power == 0.0

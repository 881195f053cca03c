"""A command becomes a smooth motion of the rods: (38), smoothed by a critically damped filter."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from evidence.scenarios import SWIM, TURN, sized
from manta_sim_ros.dynamics import FinCommand, Parameters, Simulator, State
from manta_sim_ros.dynamics._kernels.constants import constants
from manta_sim_ros.dynamics._kernels.gait import Gait, rod_motion

TIME_CONSTANT = 0.3
RODS = constants(sized(2, 1, rods={'command_time_constant': TIME_CONSTANT})).rods
RATIO = RODS.rear_radius / RODS.front_radius
H = 1e-3  # [s], step of the fourth-order differences below


def small_fin(**groups):
    """Return parameters whose fin costs nothing: these tests look at the rods."""
    return sized(2, 1).replace(solver={'fixed_base': True, **groups.pop('solver', {})}, **groups)


def in_transition(seed):
    """Return gait, its rate, command and psi of a fin somewhere between two gaits."""
    random = np.random.default_rng(seed)
    gait = np.array([0.5, 0.8, 0.4, 0.1, -0.1]) + random.uniform(-0.2, 0.2, 5)
    return gait, random.uniform(-1.0, 1.0, 5), gait + random.uniform(-0.3, 0.3, 5), random.uniform(0.0, 6.0)


def rods_at(transition, time):
    """Return (2, 3): front and rear rod; angle, rate and acceleration."""
    return np.array(rod_motion(RODS, Gait(*transition), time))


def filtered(start, start_rate, command, times):
    """Return gait, its rate and psi [rad] by integrating x'' = (u - x) / T^2 - 2 x' / T and psi' = 2 pi f."""
    def slope(_, y):
        x, x_1 = y[:5], y[5:10]
        x_2 = (command - x) / TIME_CONSTANT**2 - 2.0 * x_1 / TIME_CONSTANT
        return np.concatenate([x_1, x_2, [2.0 * math.pi * x[1]]])

    y = solve_ivp(
        slope, (0.0, times[-1]), [*start, *start_rate, 0.0], method='DOP853', t_eval=times, rtol=1e-12, atol=1e-13).y
    return y[:5].T, y[5:10].T, y[10]


@pytest.mark.parametrize('seed', range(5))
def test_rates_and_accelerations_of_the_rods_are_derivatives_in_the_middle_of_a_transition(seed):
    transition = in_transition(seed)
    for time in (0.1, 0.25, 0.6):
        far_before, before, after, far_after = (rods_at(transition, time + n * H) for n in (-2, -1, 1, 2))
        derivative = (8.0 * (after - before) - (far_after - far_before)) / (12.0 * H)
        rods = rods_at(transition, time)
        # derived: H^4 / 30 times a fifth derivative of some (2 pi)^5, 3e-10; rounding 2e-16 / H. Measured: below 2e-9
        np.testing.assert_allclose(rods[:, 1], derivative[:, 0], rtol=0.0, atol=1e-8)
        np.testing.assert_allclose(rods[:, 2], derivative[:, 1], rtol=0.0, atol=1e-7)


@pytest.mark.parametrize('seed', range(3))
def test_gait_and_cycle_angle_follow_the_critically_damped_filter(seed):
    start, start_rate, command, psi = in_transition(seed)
    parameters = small_fin(rods={'command_time_constant': TIME_CONSTANT})
    rest = State.at_rest(parameters)
    simulator = Simulator(parameters, state=dataclasses.replace(
        rest, gait=[start, SWIM.as_array()], gait_rates=[start_rate, np.zeros(5)],
        gait_commands=[command, SWIM.as_array()], cycle_angles=[psi, 0.0]))
    times = np.arange(1, 21) * 0.1
    gait, rate, turned = filtered(start, start_rate, command, times)
    for index in range(len(times)):
        state = simulator.advance(0.1)
        # measured: below 1e-12, which is solve_ivp's
        np.testing.assert_allclose(state.gait[0], gait[index], rtol=0.0, atol=1e-10)
        np.testing.assert_allclose(state.gait_rates[0], rate[index], rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(
            np.exp(1j * state.cycle_angles[0]), np.exp(1j * (psi + turned[index])), rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(state.gait[1], SWIM.as_array(), rtol=1e-15)
        front, rear = rods_at((start, start_rate, command, psi), times[index])
        np.testing.assert_allclose(state.rod_angles[0], [front[0], rear[0]], rtol=0.0, atol=1e-10)


def test_a_settled_gait_is_equation_38():
    gait = FinCommand(amplitude=0.6, frequency=0.7, phase=0.5, front_bias=0.1, rear_bias=-0.2)
    simulator = Simulator(small_fin(rods={'command_time_constant': 0.0}))
    simulator.command(left=gait, right=SWIM)
    front_amplitude = math.asin(RODS.rear_radius * math.sin(0.6) / RODS.front_radius)
    for time in np.arange(1, 30) * 0.1:
        front, rear = simulator.advance(0.1).rod_angles[0]
        psi = 2.0 * math.pi * 0.7 * time
        assert rear == pytest.approx(0.6 * math.sin(psi) - 0.2, abs=1e-11)  # measured: 1e-13, the sum of many steps
        assert front == pytest.approx(front_amplitude * math.sin(psi + 0.5) + 0.1, abs=1e-11)


def test_both_rod_ends_reach_the_same_height():
    simulator = Simulator(small_fin(rods={'command_time_constant': 0.0}))
    gait = FinCommand(amplitude=0.9, frequency=0.5, phase=0.3)
    simulator.command(left=gait, right=gait)
    angles = np.array([simulator.advance(0.002).rod_angles[0] for _ in range(1000)])
    front, rear = np.abs(angles).max(axis=0)
    # derived: a crest falls between two of 1000 samples a cycle, 0.9 (0.0031)^2 / 2 below it at most
    assert RODS.front_radius * math.sin(front) == pytest.approx(RODS.rear_radius * math.sin(rear), abs=1e-6)
    assert rear == pytest.approx(0.9, abs=1e-5)


def test_rod_angle_and_rate_never_jump_at_a_new_command():
    time_step, time_constant = 2e-4, 0.2
    simulator = Simulator(small_fin(rods={'command_time_constant': time_constant}, solver={'time_step': time_step}))
    angles = []
    for left, right in ((SWIM, TURN), (TURN, SWIM), (FinCommand(0.9, 2.0, -0.8, rear_bias=0.3), TURN), (SWIM, SWIM)):
        simulator.command(left=left, right=right)
        angles += [simulator.advance(time_step).rod_angles for _ in range(1500)]
    rates = np.diff(angles, axis=0) / time_step
    # derived: the largest is A (2 pi f)^2, 142, or twice that while frequency and phase change at once
    assert np.abs(np.diff(rates, axis=0) / time_step).max() < 400.0
    # a jump of the rate by 0.1 rad/s would be 500 rad/s^2 here, of the angle by 1e-4 rad 2500


def test_without_a_time_constant_a_command_is_taken_at_once():
    simulator = Simulator(small_fin(rods={'command_time_constant': 0.0}))
    simulator.command(left=SWIM, right=TURN)
    for state in (simulator.state, simulator.advance(0.002)):
        np.testing.assert_array_equal(state.gait, [SWIM.as_array(), TURN.as_array()])
        np.testing.assert_array_equal(state.gait_rates, 0.0)


def test_a_new_frequency_goes_on_at_the_angle_in_the_cycle_that_was_reached():
    for time_constant in (0.0, 0.2):
        simulator = Simulator(small_fin(rods={'command_time_constant': time_constant}))
        slow, fast = FinCommand(0.7, 0.5, 0.3), FinCommand(0.7, 2.0, 0.3)
        simulator.command(left=slow, right=slow)
        before = simulator.advance(3.4)
        simulator.command(left=fast, right=slow)
        np.testing.assert_array_equal(simulator.state.cycle_angles, before.cycle_angles)
        after = simulator.advance(0.002)
        turned = (after.cycle_angles - before.cycle_angles) / (2.0 * math.pi * 0.002)
        assert turned[0] == pytest.approx(2.0 if time_constant == 0.0 else 0.5, abs=1e-3)
        assert turned[1] == pytest.approx(0.5, abs=1e-6)


@pytest.mark.parametrize('phase', [0.3, 0.7])
def test_a_positive_phase_lets_the_front_rod_lead_and_drives_the_robot_forward(phase):
    thrusts = []
    for sign in (1.0, -1.0):
        simulator = Simulator(Parameters().replace(rods={'command_time_constant': 0.0}, solver={'fixed_base': True}))
        gait = FinCommand(amplitude=0.7, frequency=0.6, phase=sign * phase)
        simulator.command(left=gait, right=gait)
        simulator.advance(5.0)
        states = [simulator.advance(0.01) for _ in range(500)]  # three cycles
        front, rear = np.array([state.rod_angles[0] for state in states]).T
        cycle = np.exp(-2j * math.pi * 0.6 * np.array([state.time for state in states]))
        assert np.angle(np.sum(front * cycle) / np.sum(rear * cycle)) == pytest.approx(sign * phase, abs=1e-9)
        thrusts.append(np.mean([state.wrench[0] for state in states]))
    assert thrusts[0] > 1.0 > thrusts[1]  # [N]

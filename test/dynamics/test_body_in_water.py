"""The body in water: its added mass in both couplings, Munk's moment, damping, net buoyancy, and a current."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.optimize import brentq

from evidence.references import equations
from evidence.scenarios import BARE, COMMANDS, SWIM, TURN, WATER_OF_BODY, any_state, assert_close, sized
from evidence.verification import mechanics
from manta_sim_ros.dynamics import FinCommand, Parameters, Simulator, State, largest_stable_step

COUPLINGS = pytest.mark.parametrize('coupling', ['sequential', 'monolithic'])
AT_ONCE = {'command_time_constant': 0.0}
ADDED_MASS = (1.4, 2.1, 106.0, 1.15, 2.4, 0.01)  # of config/freshwater.yaml
LAMB = (1.367, 2.140, 105.667, 1.154, 2.380, 0.010)  # the same, with more digits
UNDAMPED = {'angular_damping': (0.0, 0.0, 0.0)}


def bare(coupling='monolithic', **body):
    """Return parameters of a body alone, without drag and damping."""
    return Parameters().replace(**BARE, solver={'coupling': coupling}, body={**UNDAMPED, **body})


def turning(parameters, duration):
    simulator = Simulator(parameters)
    simulator.command(left=COMMANDS[0], right=COMMANDS[1])
    return simulator.advance(duration)


@COUPLINGS
@pytest.mark.parametrize('times', [1.0, 10.0, 1000.0])
def test_added_mass_far_above_the_mass_of_the_body_stays_stable(times, coupling):
    body = Parameters().body
    damping = (0.0, 0.0, 0.0, 5.0, 5.0, 5.0)
    parameters = sized(6, 2, solver={'coupling': coupling}, body={
        'added_mass': tuple(times * value for value in (*3 * (body.mass,), *body.inertia)), 'linear_damping': damping})
    simulator = Simulator(parameters)
    simulator.command(left=SWIM, right=TURN)
    for _ in range(10):
        state = simulator.advance(1.0)
        assert np.abs(state.twist).max() < 2.0


def test_added_mass_of_the_body_makes_the_staggered_coupling_stable_with_heavy_fins():
    heavy = sized(4, 2, fin={'density': 10_000.0}, body={'mass': 2.0, 'inertia': (0.13, 0.19, 0.27)})
    in_water = heavy.replace(body={
        'added_mass': (60.0, 60.0, 60.0, 10.0, 10.0, 10.0), 'linear_damping': (0.0, 0.0, 0.0, 5.0, 5.0, 5.0)})
    assert largest_stable_step(heavy, SWIM, SWIM) == 0.0
    assert largest_stable_step(in_water, SWIM, SWIM) > in_water.solver.time_step
    simulator = Simulator(in_water)
    simulator.command(left=SWIM, right=SWIM)
    assert np.abs(simulator.advance(4.0).twist).max() < 2.0


@COUPLINGS
@pytest.mark.parametrize('current', [(0.0, 0.0, 0.0), (0.3, -0.2, 0.1)], ids=['still water', 'a current'])
def test_the_added_mass_of_a_sphere_is_as_a_heavier_body(coupling, current):
    # the momentum of the water is parallel to the velocity, so that there is no Munk moment
    body, added, more = Parameters().body, 12.0, (0.7, 0.8, 0.9)
    common = {'solver': {'coupling': coupling}, 'water': {'current': current}, 'rods': AT_ONCE}
    in_water = sized(5, 2, **common, body={'added_mass': (added, added, added, *more)})
    heavier = sized(5, 2, **common, body={
        'mass': body.mass + added, 'inertia': tuple(np.add(body.inertia, more)),
        'gravity': body.gravity * body.mass / (body.mass + added)})
    one, other = turning(in_water, 2.0), turning(heavier, 2.0)
    assert np.abs(one.twist).min() > 1e-3
    for name in ('position', 'twist', 'acceleration', 'joint_angles', 'fin_wrenches'):
        assert_close(getattr(one, name), getattr(other, name), 1e-12)  # rounding; measured: 1e-15


@COUPLINGS
@pytest.mark.parametrize('axis', range(6))
def test_a_force_from_rest_accelerates_the_body_and_its_added_mass(axis, coupling):
    parameters = bare(coupling, added_mass=ADDED_MASS)
    wrench = np.zeros(6)
    wrench[axis] = 3.0
    simulator = Simulator(parameters.replace(solver={'time_step': 1e-4}))
    acceleration = simulator.advance(1e-4, body_wrench=wrench).acceleration
    inertia = np.array([parameters.body.mass] * 3 + list(parameters.body.inertia)) + ADDED_MASS
    # at the end of the step the righting moment has begun: measured 2e-8. The fins have a mass of 6e-9 kg
    assert acceleration[axis] == pytest.approx(3.0 / inertia[axis], rel=1e-7)
    np.testing.assert_allclose(np.delete(acceleration, axis), 0.0, atol=1e-7)


@COUPLINGS
@pytest.mark.parametrize('turned', [False, True])
def test_net_buoyancy_acts_upward_at_the_center_of_buoyancy(turned, coupling):
    center = np.array([0.03, -0.02, 0.07])
    parameters = bare(coupling, added_mass=ADDED_MASS, net_buoyancy=5.0, buoyancy_center=center, gravity=8.0)
    parameters = parameters.replace(solver={'time_step': 1e-5})
    orientation = np.array([0.1, -0.2, 0.3, 0.9]) / 0.95**0.5 if turned else np.array([0.0, 0.0, 0.0, 1.0])
    start = dataclasses.replace(State.at_rest(parameters), orientation=orientation)
    acceleration = Simulator(parameters, state=start).advance(1e-5).acceleration
    body, up = parameters.body, equations.orientation_matrix(orientation).T @ [0.0, 0.0, 1.0]
    force, moment = 5.0 * up, np.cross(center, (5.0 + body.mass * 8.0) * up)
    inertia = np.array([body.mass] * 3 + list(body.inertia)) + ADDED_MASS
    expected = np.hstack([force, moment]) / inertia
    if not turned:
        assert expected[2] == 5.0 / (20.0 + 106.0)
    # the motion of one step, and the fins; measured: 6e-10
    np.testing.assert_allclose(acceleration, expected, rtol=0.0, atol=1e-8)


@pytest.mark.parametrize('axis', range(6))
def test_each_axis_slows_down_by_its_own_linear_and_quadratic_damping(axis):
    start_speed, duration, inertia = -0.8, 2.0, (20.0, 20.0, 20.0, 1.33, 1.93, 2.73)[axis]
    for name, value, expected in (
            ('linear_damping', 0.5 * inertia, start_speed * math.exp(-0.5 * duration)),
            ('quadratic_damping', 0.5 * inertia, start_speed / (1.0 + 0.5 * abs(start_speed) * duration))):
        damping, twist = np.zeros(6), np.zeros(6)
        damping[axis], twist[axis] = value, start_speed
        parameters = bare(gravity=0.0, **{name: tuple(damping)})
        state = dataclasses.replace(State.at_rest(parameters), twist=twist)
        after = Simulator(parameters, state=state).advance(duration).twist
        assert after[axis] == pytest.approx(expected, rel=1e-8)  # the fins, 6e-9 kg; measured: 1e-9
        np.testing.assert_allclose(np.delete(after, axis), 0.0, atol=1e-7)


def test_a_robot_that_a_current_carries_moves_as_in_still_water():
    current = np.array([0.4, -0.3, 0.2])
    still = sized(4, 2, solver={'coupling': 'monolithic', 'time_step': 1e-3}, rods=AT_ONCE, body=WATER_OF_BODY)
    flowing = still.replace(water={'current': current})
    spin = (0.5, -1.0, 2.0)
    states = []
    for parameters, velocity in ((still, np.zeros(3)), (flowing, current)):
        start = dataclasses.replace(State.at_rest(parameters), twist=np.hstack([velocity, spin]))
        simulator = Simulator(parameters, state=start)
        simulator.command(left=COMMANDS[0], right=COMMANDS[1])
        states.append(simulator.advance(1.0))
    one, other = states
    carried = equations.orientation_matrix(one.orientation).T @ current
    for actual, desired in (
            (other.position - 1.0 * current, one.position), (other.orientation, one.orientation),
            (other.twist[:3] - carried, one.twist[:3]), (other.twist[3:], one.twist[3:]),
            (other.joint_angles, one.joint_angles)):
        assert_close(actual, desired, 3e-9)  # fourth order; measured: 6e-10


def test_a_drifting_robot_feels_nothing_of_the_current():
    current = np.array([0.4, -0.3, 0.2])
    for coupling in ('sequential', 'monolithic'):
        parameters = sized(4, 2, solver={'coupling': coupling}, water={'current': current}, body={
            **WATER_OF_BODY, 'net_buoyancy': 0.0, 'added_mass': (7.0, 7.0, 7.0, 1.2, 2.5, 0.6)})
        start = dataclasses.replace(State.at_rest(parameters), twist=[*current, 0.0, 0.0, 0.0])
        state = Simulator(parameters, state=start).advance(5.0)
        np.testing.assert_allclose(state.twist, [*current, 0.0, 0.0, 0.0], rtol=0.0, atol=1e-14)


def test_the_impulse_of_body_fins_and_water_is_kept_to_fourth_order():
    """It sees a wrong sign of Munk's moment, to which the balance of energy is blind."""
    locked = FinCommand(0.0, 0.0, 0.0, front_bias=0.3, rear_bias=0.1), FinCommand(0.0, 0.0, 0.0, -0.1, 0.2)
    base = sized(
        4, 3, water={'density': 0.0}, rods=AT_ONCE, solver={'coupling': 'monolithic'},
        body={**UNDAMPED, 'gravity': 0.0, 'added_mass': WATER_OF_BODY['added_mass']})
    drifts = []
    for time_step in (1e-3, 5e-4):
        parameters = base.replace(solver={'time_step': time_step})
        simulator = Simulator(parameters, state=dataclasses.replace(any_state(parameters), time=0.0))
        simulator.command(left=locked[0], right=locked[1])
        simulator.advance(0.01)
        impulse = mechanics.momentum(parameters, mechanics.recorded(simulator, locked, 0.4, every=20))
        scale = np.repeat(np.linalg.norm(impulse[0].reshape(2, 3), axis=1), 3)
        drifts.append(float(np.abs((impulse - impulse[0]) / scale).max()))
    # order 4 divides by 16. Measured: 2.1e-7 and 1.1e-8
    assert drifts[0] < 1e-6, drifts
    assert 12.0 < drifts[0] / drifts[1] < 24.0, drifts


@pytest.mark.parametrize('added_mass', [ADDED_MASS, LAMB, (5.0, 2.1, 60.0, 1.15, 1.0, 0.01)])
def test_the_body_turns_unstable_in_pitch_at_munks_speed(added_mass):
    parameters = bare(added_mass=added_mass)
    body, (ax, _, az, *_) = parameters.body, added_mass
    expected = math.sqrt(
        body.mass * body.gravity * body.buoyancy_center[2] * (body.mass + az) / ((az - ax) * (body.mass + ax)))

    def growth(speed):
        """Return the growth of a small pitch rate: below 0, it oscillates."""
        start = dataclasses.replace(State.at_rest(parameters), twist=[speed, 0.0, 0.0, 0.0, 1e-6, 0.0])
        return Simulator(parameters, state=start).advance(4.0).twist[4] / 1e-6 - 1.0

    assert growth(0.95 * expected) < 0.0 < growth(1.05 * expected)
    # measured: 1e-10
    assert brentq(growth, 0.9 * expected, 1.1 * expected, xtol=1e-10) == pytest.approx(expected, rel=1e-8)
    by_hand = {ADDED_MASS: 0.743100, LAMB: 0.743757}
    if added_mass in by_hand:
        assert expected == pytest.approx(by_hand[added_mass], abs=5e-7)

"""Fins and body step by step: against the reference implementation, in order of convergence, and against mechanics."""

import dataclasses

import numpy as np
import pytest

from evidence.references import equations
from evidence.scenarios import (
    COMMANDS,
    NO_WATER,
    OTHER_BODY,
    SWIM,
    TURN,
    TWIST,
    WATER_OF_BODY,
    any_state,
    assert_close,
    settled_rods,
    sized,
    smoothed_rods,
)
from manta_sim_ros.dynamics import Simulator, State


@pytest.mark.parametrize(('chains', 'links', 'groups'), [
    (4, 2, {'rods': {'command_time_constant': 0.0}}),
    (3, 3, {'rods': {'command_time_constant': 0.0}, 'solver': {'fixed_base': True}}),
    (2, 1, {'rods': {'command_time_constant': 0.05}}),
    (2, 2, OTHER_BODY),
    (4, 2, {'fin': TWIST, 'body': WATER_OF_BODY, 'rods': {'command_time_constant': 0.0}}),
    (3, 1, {**OTHER_BODY, 'fin': TWIST, 'body': {**OTHER_BODY['body'], **WATER_OF_BODY}}),
])
def test_steps_agree_with_the_reference_implementation(chains, links, groups):
    parameters = sized(chains, links, **{'water': {'current': (0.3, -0.2, 0.1)}, **groups})
    start = any_state(parameters)
    if parameters.solver.fixed_base:
        start = dataclasses.replace(start, twist=np.zeros(6), acceleration=np.zeros(6))
    simulator = Simulator(parameters, state=start)
    simulator.command(left=COMMANDS[0], right=COMMANDS[1])
    smoothed = parameters.rods.command_time_constant > 0.0
    rods = (smoothed_rods if smoothed else settled_rods)(parameters, start)
    names = [field.name for field in dataclasses.fields(equations.ReferenceState)]
    expected = equations.ReferenceState(**{name: getattr(start, name) for name in names})
    for _ in range(25):
        expected = equations.step(parameters, expected, rods)
        state = simulator.advance(parameters.solver.time_step)
        for name in names:
            if np.any(getattr(expected, name)):
                assert_close(getattr(state, name), getattr(expected, name), 1e-10)  # measured: below 1e-13
            else:
                np.testing.assert_array_equal(getattr(state, name), 0.0)
        for side in range(2):
            np.testing.assert_allclose(state.rod_angles[side], rods(side, expected.time)[:, 0], rtol=0.0, atol=1e-11)


def joints_after(parameters, start, duration):
    simulator = Simulator(parameters, state=start)
    simulator.command(left=SWIM, right=TURN)
    return simulator.advance(duration)


def test_fins_converge_with_the_fourth_order_of_runge_and_kutta():
    # without drag, whose |V.n| (V.n) is not smooth; steps well below the stability limit of the stiffest mode
    base = sized(3, 2, water={'density': 0.0}, rods={'command_time_constant': 0.0}, solver={'fixed_base': True})
    start = dataclasses.replace(any_state(base), time=0.0, twist=np.zeros(6), acceleration=np.zeros(6))

    def joints(time_step):
        return joints_after(base.replace(solver={'time_step': time_step}), start, 0.2).joint_angles

    exact = joints(1.5625e-5)
    errors = [np.abs(joints(step) - exact).max() for step in (5e-4, 2.5e-4, 1.25e-4)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[0] > 1e-10  # above rounding
    np.testing.assert_allclose(orders, 4.0, atol=0.2)  # measured: 3.87, 3.94, rising to 4 as the step falls


def test_the_coupled_scheme_converges_with_first_order():
    base = sized(3, 2, rods={'command_time_constant': 0.0})

    def twist(time_step):
        parameters = base.replace(solver={'time_step': time_step})
        return joints_after(parameters, State.at_rest(parameters), 0.5).twist

    exact = twist(5e-6)
    errors = [np.abs(twist(step) - exact).max() for step in (1e-3, 5e-4, 2.5e-4)]
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 1.0, atol=0.15)  # measured: 1.007, 1.014


def energy(parameters, state):
    """Return elastic and kinetic energy [J] of both fins on supports at rest."""
    total = np.sum(equations.elastic_energy(parameters, state.joint_angles))
    for side in range(2):
        for angles, rates in zip(state.joint_angles[side], state.joint_rates[side]):
            total += 0.5 * rates @ equations.mass_matrix(parameters, angles) @ rates
    return total * parameters.rods.support_length / parameters.fin.chains


@pytest.mark.parametrize(('damping', 'density'), [(0.0, 0.0), (0.1, 0.0), (0.0, 1000.0)])
def test_bent_fins_on_held_rods_keep_their_energy_unless_damping_or_water_takes_it(damping, density):
    parameters = sized(
        3, 3, fin={'joint_damping': damping}, water={'density': density},
        solver={'fixed_base': True, 'time_step': 1e-4})
    start = dataclasses.replace(any_state(parameters), twist=np.zeros(6), acceleration=np.zeros(6))
    simulator = Simulator(parameters, state=start)
    energies = [energy(parameters, start)]
    for _ in range(20):
        energies.append(energy(parameters, simulator.advance(0.02)))
    if damping == density == 0.0:
        np.testing.assert_allclose(energies, energies[0], rtol=5e-6)  # measured: 6e-7; a step loses O(dt^6)
    else:
        assert np.all(np.diff(energies) < 0.0) and energies[-1] < 0.9 * energies[0]


def test_without_water_body_and_fins_keep_their_momentum(pinocchio_tree):
    base = sized(4, 3, **NO_WATER, rods={'command_time_constant': 0.0})
    tree = pinocchio_tree.swimmer_tree(base)
    errors = []
    for time_step in (2e-4, 1e-4):
        parameters = base.replace(solver={'time_step': time_step})
        start = dataclasses.replace(any_state(parameters), acceleration=np.zeros(6))
        simulator = Simulator(parameters, state=start)
        at_start = pinocchio_tree.momentum(tree, start)
        errors.append(np.abs(pinocchio_tree.momentum(tree, simulator.advance(0.2)) - at_start).max())
    # the coupling is of first order: what it loses halves with the step. Measured: 0.015 and 0.0077 of 7.5 N s
    assert errors[0] < 0.02 * np.abs(at_start).max()
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.2), errors


def test_a_robot_that_drifts_with_the_current_feels_nothing_of_it():
    current = np.array([0.4, -0.3, 0.2])
    parameters = sized(4, 2, water={'current': current})
    simulator = Simulator(parameters, state=dataclasses.replace(State.at_rest(parameters), twist=[*current, 0, 0, 0]))
    state = simulator.advance(10.0)
    np.testing.assert_allclose(state.position, 10.0 * current, rtol=1e-12)  # derived: the rounding of 5000 sums
    np.testing.assert_array_equal(state.twist, [*current, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(state.wrench, 0.0)
    np.testing.assert_array_equal(state.joint_angles, 0.0)


@pytest.mark.parametrize('axis', range(3))
def test_a_robot_at_rest_in_a_current_begins_to_drift_with_it(axis):
    current = np.zeros(3)
    current[axis] = 0.5
    simulator = Simulator(sized(6, 2, water={'current': current, 'surface_height': 100.0}))  # far above its drift
    drift = []
    for _ in range(20):
        simulator.advance(1.0)
        state = simulator.state
        drift.append((equations.orientation_matrix(state.orientation) @ state.twist[:3])[axis])
    assert drift[0] > 0.05
    assert 0.4 < drift[-1] < 0.5 + 1e-3

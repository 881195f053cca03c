"""Body and fins solved together: against reference implementations, in order of convergence, and against mechanics."""

import dataclasses

import numpy as np
import pytest

from evidence.references import equations
from evidence.references import monolithic as reference_monolithic
from evidence.scenarios import (
    COMMANDS,
    MIRROR,
    NO_WATER,
    OTHER_BODY,
    SOFT_TWIST,
    SWIM,
    TURN,
    TWIST,
    WATER_OF_BODY,
    any_state,
    assert_close,
    assert_same_bits,
    in_transition,
    mirrored,
    rods_of,
    settled_rods,
    sized,
    smoothed_rods,
)
from manta_sim_ros.dynamics import DivergenceError, Simulator, State, fin_dynamics

AT_ONCE = {'command_time_constant': 0.0}
ADDED_MASS = {'added_mass_coefficient': 0.8, 'added_mass_density': 1100.0}
BEYOND = {'fin': TWIST, 'body': WATER_OF_BODY}
GENTLE = {'fin': SOFT_TWIST, 'body': WATER_OF_BODY}
CURRENT = (0.3, -0.2, 0.1)  # [m/s]
REFERENCE_FIELDS = tuple(field.name for field in dataclasses.fields(equations.ReferenceState))


def monolithic(chains, links, **groups):
    return sized(chains, links, **{**groups, 'solver': {'coupling': 'monolithic', **groups.get('solver', {})}})


def reference_state(state):
    return equations.ReferenceState(**{name: getattr(state, name) for name in REFERENCE_FIELDS})


def integrated(state):
    """Return what a step integrates: position, orientation, twist, joint angles and rates, by name."""
    return {name: getattr(state, name) for name in ('position', 'orientation', 'twist', 'joint_angles', 'joint_rates')}


def commanded(parameters, start):
    simulator = Simulator(parameters, state=start)
    simulator.command(left=COMMANDS[0], right=COMMANDS[1])
    return simulator


def start_of(parameters, seed=1):
    start = any_state(parameters, seed)
    if parameters.solver.fixed_base:
        return dataclasses.replace(start, twist=np.zeros(6), acceleration=np.zeros(6))
    return start


def fin_dynamics_in_current(
    parameters, side, rods, joint_angles, joint_rates, body_twist, body_acceleration, water_velocity,
):
    """`fin_dynamics` of the library, which knows still water, in the inertial frame that goes with the water."""
    relative, turned = np.array(body_twist), np.array(body_acceleration)
    relative[:3] -= water_velocity
    turned[:3] += np.cross(relative[3:], water_velocity)  # minus the rate of the current's components in F_b
    return fin_dynamics(parameters, side, rods, joint_angles, joint_rates, relative, turned)


@pytest.mark.parametrize(('reference', 'chains', 'links', 'steps', 'groups'), [
    ('equations', 3, 2, 1, {'water': {'current': CURRENT}, 'rods': AT_ONCE}),
    ('equations', 4, 3, 1, {'water': {'current': CURRENT, **ADDED_MASS}}),
    ('equations', 2, 1, 25, {'water': {'current': CURRENT, **ADDED_MASS}}),
    ('equations', 3, 2, 25, {'water': {'current': CURRENT, **ADDED_MASS}, 'solver': {'fixed_base': True}}),
    ('pinocchio_tree', 2, 1, 25, {'water': {'current': CURRENT}}),
    ('pinocchio_tree', 2, 2, 25, {**OTHER_BODY, 'water': {**OTHER_BODY['water'], **ADDED_MASS}}),
    ('equations', 4, 2, 2, {'water': {'current': CURRENT, **ADDED_MASS}, **BEYOND}),
    ('equations', 2, 1, 25, {'water': {'current': CURRENT}, **BEYOND}),
    ('pinocchio_tree', 3, 2, 5, {**OTHER_BODY, **BEYOND, 'body': {**OTHER_BODY['body'], **WATER_OF_BODY}}),
])
def test_steps_agree_with_the_reference_implementation(reference, chains, links, steps, groups):
    reference = pytest.importorskip(f'evidence.references.{reference}')
    parameters = monolithic(chains, links, **groups)
    start = start_of(parameters)
    start = dataclasses.replace(start, twist=start.twist * [1.0, 1.0, 1.0, 8.0, 8.0, 8.0])  # quick turns within a step
    simulator = commanded(parameters, start)
    smoothed = parameters.rods.command_time_constant > 0.0
    rods = (smoothed_rods if smoothed else settled_rods)(parameters, start)
    expected = reference_state(start)
    for _ in range(steps):
        expected = reference_monolithic.step(parameters, expected, rods, reference.fin_dynamics)
        state = simulator.advance(parameters.solver.time_step)
        for name in REFERENCE_FIELDS:
            if np.any(getattr(expected, name)):
                assert_close(getattr(state, name), getattr(expected, name), 5e-12)  # measured: below 4e-13
            else:
                np.testing.assert_array_equal(getattr(state, name), 0.0)
        for side in range(2):
            np.testing.assert_allclose(state.rod_angles[side], rods(side, expected.time)[:, 0], rtol=0.0, atol=1e-11)


@pytest.mark.parametrize(('water', 'others'), [({}, {}), (ADDED_MASS, {}), (ADDED_MASS, BEYOND)], ids=[
    'without added mass', 'with added mass', 'with all that is beyond the paper'])
def test_the_trajectory_is_that_of_an_integrator_of_eighth_order(water, others):
    # the step is so small that what Runge and Kutta lose where the drag changes its sign is below the tolerance
    parameters = monolithic(
        2, 1, rods=AT_ONCE, water={'current': CURRENT, **water}, solver={'time_step': 5e-5}, **others)
    start = any_state(parameters)
    exact = reference_monolithic.trajectory(
        parameters, reference_state(start), settled_rods(parameters, start), 0.3, fin_dynamics_in_current)
    state = commanded(parameters, start).advance(0.3)
    for name in REFERENCE_FIELDS:
        assert_close(getattr(state, name), getattr(exact, name), 2e-11)  # measured: below 5e-12
    assert np.abs(state.joint_angles - start.joint_angles).max() > 0.1


@pytest.mark.parametrize('groups', [
    # no drag, whose |V.n| (V.n) is not smooth where V.n changes its sign, or one that goes one way through the fin
    {'water': {'density': 0.0, **ADDED_MASS}},
    {'water': {'density': 200.0, 'current': (0.0, 0.0, -2.0)}},
    {'water': {'density': 200.0, 'current': (0.0, 0.0, -2.0), **ADDED_MASS}},
    {'water': {'density': 0.0, **ADDED_MASS}, 'fin': TWIST, 'body': {'added_mass': WATER_OF_BODY['added_mass']}},
], ids=['added mass', 'drag', 'drag and added mass', 'added mass of fins and body, and twist'])
def test_the_whole_state_converges_with_fourth_order(groups):
    base = monolithic(3, 2, rods=AT_ONCE, **groups)
    start = dataclasses.replace(any_state(base), orientation=np.array([0.1, -0.2, 0.1, 1.0]) / 1.06**0.5)

    def after(time_step):
        return integrated(commanded(base.replace(solver={'time_step': time_step}), start).advance(0.1))

    exact = after(1.5625e-5)
    coarse, middle, fine = (
        {name: np.abs(value - exact[name]).max() for name, value in after(step).items()}
        for step in (1e-3, 5e-4, 2.5e-4))
    for name in exact:
        orders = np.log2([coarse[name] / middle[name], middle[name] / fine[name]])
        # measured: 3.88 to 4.16, and for the position, whose error is 2e-12 m with the smallest step, 3.76 to 4.03
        np.testing.assert_allclose(orders, 4.0, atol=0.3, err_msg=name)


def equations_hold(parameters, state):
    """Check that acceleration and wrenches of a state satisfy the equations of motion at its time, in still water."""
    for side in range(2):
        wrench = fin_dynamics(
            parameters, side, rods_of(parameters, state, side), state.joint_angles[side], state.joint_rates[side],
            state.twist, state.acceleration)[1]
        assert_close(state.fin_wrenches[side], wrench, 1e-11)  # measured: below 1e-13
    if not parameters.solver.fixed_base:
        assert_close(state.acceleration, equations.body_acceleration(
            parameters, state.orientation, state.twist, state.wrench), 1e-11)


@pytest.mark.parametrize('groups', [
    {}, {'water': ADDED_MASS}, {'water': ADDED_MASS, 'solver': {'fixed_base': True}},
    {**OTHER_BODY, 'water': {'density': 3000.0, **ADDED_MASS}},
    {'water': ADDED_MASS, **GENTLE},
])
def test_acceleration_and_wrenches_satisfy_the_equations_of_motion_at_the_states_time(groups):
    parameters = monolithic(17, 3, **groups)
    simulator = commanded(parameters, start_of(parameters))
    for duration in (parameters.solver.time_step, 0.1, 0.5):
        equations_hold(parameters, simulator.advance(duration))


def test_the_acceleration_before_a_step_is_in_nothing_that_follows():
    parameters = monolithic(5, 2, water=ADDED_MASS)
    start = any_state(parameters)
    other = dataclasses.replace(start, acceleration=-3.0 * start.acceleration, fin_wrenches=np.ones((2, 6)))
    assert_same_bits(commanded(parameters, start).advance(0.01), commanded(parameters, other).advance(0.01))


def test_a_fixed_base_keeps_the_body_where_it_is():
    parameters = monolithic(4, 2, water={'current': CURRENT, **ADDED_MASS}, solver={'fixed_base': True})
    start = start_of(parameters)
    state = commanded(parameters, start).advance(0.5)
    for name in ('position', 'orientation', 'twist', 'acceleration'):
        np.testing.assert_array_equal(getattr(state, name), getattr(start, name))
    assert np.all(state.joint_angles != start.joint_angles)


def test_the_orientation_of_a_spinning_robot_stays_a_unit_quaternion():
    parameters = monolithic(3, 2, **NO_WATER)
    start = dataclasses.replace(State.at_rest(parameters), twist=[0.0, 0.0, 0.0, 3.0, -4.0, 10.0])
    state = Simulator(parameters, state=start).advance(2.0)
    assert np.linalg.norm(state.twist[3:]) > 5.0
    # rounding; a step itself loses (|Omega| dt)^6 / 9216 of it, in all 1e-11
    assert np.linalg.norm(state.orientation) == pytest.approx(1.0, abs=3e-16)


def test_without_water_body_and_fins_keep_their_momentum_to_fourth_order(pinocchio_tree):
    base = monolithic(4, 3, **NO_WATER, rods=AT_ONCE)
    tree = pinocchio_tree.swimmer_tree(base)
    errors = []
    for time_step in (4e-4, 2e-4):
        parameters = base.replace(solver={'time_step': time_step})
        start = any_state(parameters)
        at_start = pinocchio_tree.momentum(tree, start)
        state = Simulator(parameters, state=start).advance(0.2)
        errors.append(np.abs(pinocchio_tree.momentum(tree, state) - at_start).max() / np.abs(at_start).max())
    # order 4 divides what is lost by 16. Measured: 1.1e-7 and 7.7e-9 of the largest component, falling to 16 times less
    assert errors[0] < 3e-7
    assert 12.0 < errors[0] / errors[1] < 20.0, errors


def test_both_couplings_tend_to_the_same_motion_as_the_step_falls():
    def twist(coupling, time_step):
        parameters = sized(3, 2, rods=AT_ONCE, solver={'coupling': coupling, 'time_step': time_step})
        return commanded(parameters, State.at_rest(parameters)).advance(0.2).twist

    exact = twist('monolithic', 1e-4)
    errors = [np.abs(twist('sequential', step) - exact).max() for step in (4e-4, 2e-4, 1e-4)]
    assert errors[0] < 0.01 * np.abs(exact).max()
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 1.0, atol=0.15)  # measured: 1.001, 1.000


def test_fins_heavier_than_the_body_swim_only_when_both_are_solved_together():
    # one after the other, the body gets the wrench that its last acceleration made of the fins: each step multiplies it
    # by about their mass over the body's, however small the step
    heavy = sized(4, 2, fin={'density': 10_000.0}, body={'mass': 2.0, 'inertia': (0.13, 0.19, 0.27)})

    def swim(parameters):
        simulator = Simulator(parameters)
        simulator.command(left=SWIM, right=SWIM)
        return simulator.advance(2.0)

    for time_step in (2e-3, 5e-4, 1e-4):
        with pytest.raises(DivergenceError, match='the body moves faster'):
            swim(heavy.replace(solver={'time_step': time_step}))
    states = [swim(heavy.replace(solver={'coupling': 'monolithic', 'time_step': step})) for step in (2e-3, 5e-4)]
    assert np.linalg.norm(states[1].position) > 0.05
    assert_close(states[0].position, states[1].position, 1e-7)  # measured: 1.3e-9


@pytest.mark.filterwarnings('ignore::manta_sim_ros.dynamics.StabilityWarning')
def test_a_step_too_large_ends_in_an_error_and_leaves_the_state():
    parameters = monolithic(6, 3, water=ADDED_MASS, solver={'time_step': 0.03})
    simulator = commanded(parameters, State.at_rest(parameters))
    before = simulator.state
    with pytest.raises(DivergenceError, match=r'a joint of chain \d of the (left|right) fin .* try 0\.00\d+ s'):
        simulator.advance(30.0)
    assert simulator.state is before


def test_a_robot_that_drifts_with_the_current_feels_nothing_of_it():
    current = np.array([0.4, -0.3, 0.2])
    parameters = monolithic(4, 2, water={'current': current, **ADDED_MASS})
    simulator = Simulator(parameters, state=dataclasses.replace(State.at_rest(parameters), twist=[*current, 0, 0, 0]))
    state = simulator.advance(10.0)
    np.testing.assert_allclose(state.position, 10.0 * current, rtol=1e-12)  # derived: the rounding of 5000 sums
    np.testing.assert_allclose(state.twist, [*current, 0.0, 0.0, 0.0], rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(state.wrench, 0.0, atol=1e-12)
    np.testing.assert_allclose(state.joint_angles, 0.0, atol=1e-15)


def test_added_mass_makes_a_difference_to_the_swimming():
    with_and_without = [monolithic(6, 3, water=water) for water in ({}, ADDED_MASS)]
    positions = []
    for parameters in with_and_without:
        simulator = Simulator(parameters)
        simulator.command(left=SWIM, right=SWIM)
        positions.append(simulator.advance(4.0).position)
    assert np.abs(positions[1] - positions[0]).max() > 0.01


@pytest.mark.parametrize('water', [{}, {'current': (0.3, 0.0, -0.2), **ADDED_MASS}])
def test_a_symmetric_gait_never_leaves_the_plane_of_symmetry(water):
    simulator = Simulator(monolithic(17, 3, water=water))
    simulator.command(left=TURN, right=TURN)
    for _ in range(4):
        state = simulator.advance(1.0)
        assert np.linalg.norm(state.twist[[0, 2, 4]]) > 1e-3  # it moves
        assert state.position[1] == 0.0
        np.testing.assert_array_equal(state.orientation[[0, 2]], 0.0)  # neither roll nor yaw
        for six in (state.twist, state.acceleration, state.wrench):
            np.testing.assert_array_equal(six[[1, 3, 5]], 0.0)
        np.testing.assert_array_equal(state.joint_angles[0], state.joint_angles[1])
        np.testing.assert_array_equal(state.fin_wrenches[0], MIRROR * state.fin_wrenches[1])


@pytest.mark.parametrize(('added_mass', 'others'), [({}, {}), (ADDED_MASS, {}), (ADDED_MASS, BEYOND)], ids=[
    'without added mass', 'with added mass', 'with all that is beyond the paper'])
def test_exchanged_commands_make_the_mirrored_motion_to_the_last_bit(added_mass, others):
    parameters = monolithic(17, 2, water={'current': (0.2, 0.1, -0.1), **added_mass}, **others)
    start = any_state(parameters)
    one = Simulator(parameters, state=start)
    other = Simulator(parameters.replace(water={'current': (0.2, -0.1, -0.1)}), state=mirrored(start))
    for left, right in ((SWIM, TURN), (TURN, TURN), (SWIM, SWIM)):
        one.command(left=left, right=right)
        other.command(left=right, right=left)
        assert_same_bits(dataclasses.replace(one.advance(0.5)), mirrored(other.advance(0.5)))


@pytest.mark.parametrize('groups', [{}, {'solver': {'coupling': 'monolithic', 'fixed_base': True}}, GENTLE])
def test_steps_at_once_one_by_one_and_after_a_restart_have_the_same_bits(groups):
    parameters = monolithic(17, 3, water={'current': (0.1, 0.2, 0.3), **ADDED_MASS}).replace(**groups)
    at_once, one_by_one = in_transition(parameters), in_transition(parameters)
    reference = at_once.advance(0.2)
    middle = None
    for step in range(100):
        if step == 37:
            middle = one_by_one.state
        one_by_one.advance(0.002)
    assert_same_bits(one_by_one.state, reference)
    restarted = Simulator(parameters, state=middle)
    assert_same_bits(restarted.advance(63 * 0.002), reference)

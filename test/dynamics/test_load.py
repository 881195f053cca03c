"""The load of the water on the fins: against the reference implementation, by hand, and against its wrench."""

import dataclasses
import math

import numpy as np
import pytest

from evidence.references.equations import LEFT, RIGHT, X, link_normals, orientation_matrix, support_motion
from evidence.scenarios import MIRROR, SWIM, TURN, assert_close, rods_of, run_python, sized
from manta_sim_ros.dynamics import FinCommand, Parameters, Simulator, State, fin_dynamics, fin_loads

CURRENT = (0.3, -0.2, 0.15)
AGREEMENT = 1e-12  # relative to the largest load; measured: below 1e-14 in all the cases below
SETTLED = 1e-11  # relative to the largest entry; measured: 1e-13 after 10 s, and falling by 1e3 in each 2 s before
SIZES = [(2, 1), (2, 3), (7, 4), (30, 3)]


def any_state(parameters, seed):
    """Return a state in the middle of a change of gait, its motion larger than a robot has it."""
    random = np.random.default_rng(seed)
    joints = (2, parameters.fin.chains, parameters.fin.links)
    gait = np.array([0.5, 0.8, 0.4, 0.1, -0.1]) + random.uniform(-0.2, 0.2, (2, 5))
    orientation = random.normal(size=4)
    state = dataclasses.replace(
        State.at_rest(parameters), position=random.uniform(-9.0, 3.0, 3),  # under water
        orientation=orientation / np.linalg.norm(orientation), twist=random.uniform(-1.0, 1.0, 6),
        joint_angles=random.uniform(-0.6, 0.6, joints), joint_rates=random.uniform(-4.0, 4.0, joints),
        gait=gait, gait_rates=random.uniform(-1.0, 1.0, (2, 5)), gait_commands=gait + random.uniform(-0.3, 0.3, (2, 5)),
        cycle_angles=random.uniform(0.0, 6.0, 2), current_deviation=random.uniform(-0.3, 0.3, 3))
    return dataclasses.replace(
        state, rod_angles=[rods_of(parameters, state, side)[:, 0] for side in (LEFT, RIGHT)])


def reference_loads(parameters, state, side, water):
    """Return the loads (n, m) [Pa] of one fin, link by link from root to tip; `water` is its velocity in the world."""
    mirror = MIRROR if side == RIGHT else np.ones(6)
    rotation, _, eta_0, _ = support_motion(
        parameters, rods_of(parameters, state, side), mirror * state.twist, np.zeros(6))
    V_0, Omega_0 = eta_0[:3], eta_0[3:]
    V_water = rotation.T @ (mirror[:3] * (orientation_matrix(state.orientation).T @ water))
    fin, length = parameters.fin, parameters.rods.support_length
    normals = link_normals(parameters, state.joint_angles[side])
    loads = np.empty((fin.chains, fin.links))
    for k in range(fin.chains):
        s = length - (k + 0.5) * length / fin.chains
        V = V_0 + np.cross(Omega_0, s * X)
        angle, rate = 0.0, 0.0
        for j in range(fin.links):
            angle += state.joint_angles[side, k, j]
            rate += state.joint_rates[side, k, j]
            link = fin.span / fin.links * np.array([0.0, np.cos(angle), np.sin(angle)])
            turning = np.cross(Omega_0 + rate * X, link)
            through = (V + 0.5 * turning - V_water) @ normals[k, j]
            loads[k, j] = -0.5 * parameters.water.density * fin.drag_coefficient * abs(through) * through
            V = V + turning
    return loads


def forces_of(parameters, side, rods, joint_angles, loads):
    """Return force and moment (6,) on the body about the center of mass, in F_b, of the loads (n, m) of one fin."""
    mirror = MIRROR if side == RIGHT else np.ones(6)
    rotation, position, _, _ = support_motion(parameters, rods, np.zeros(6), np.zeros(6))
    fin, length = parameters.fin, parameters.rods.support_length
    area = fin.span / fin.links * length / fin.chains
    normals = link_normals(parameters, joint_angles)
    wrench = np.zeros(6)
    for k in range(fin.chains):
        middle = position + rotation @ ((length - (k + 0.5) * length / fin.chains) * X)
        for j in range(fin.links):
            angle = np.sum(joint_angles[k, :j + 1])
            half = 0.5 * fin.span / fin.links * rotation @ np.array([0.0, np.cos(angle), np.sin(angle)])
            force = loads[k, j] * area * rotation @ normals[k, j]
            wrench += np.concatenate([force, np.cross(middle + half, force)])
            middle = middle + 2.0 * half
    return mirror * wrench


@pytest.mark.parametrize('current', [None, CURRENT])
@pytest.mark.parametrize(('chains', 'links'), SIZES)
def test_loads_are_the_drag_of_the_reference_implementation_in_any_state(chains, links, current):
    parameters = sized(
        chains, links, water={'density': 700.0, 'current': (-0.1, 0.4, 0.2)},
        rods={'front_radius': 0.26, 'support_length': 0.5, 'rear_motor_position': (-0.2, 0.25, 0.05)},
        fin={'span': 0.35, 'drag_coefficient': 0.9})
    for seed in range(5):
        state = any_state(parameters, 10 * chains + seed)
        water = np.add((-0.1, 0.4, 0.2) if current is None else current, state.current_deviation)
        loads = fin_loads(parameters, state, current)
        assert loads.shape == (2, chains, links)
        for side in (LEFT, RIGHT):
            assert_close(loads[side], reference_loads(parameters, state, side, water), AGREEMENT)


def test_loads_follow_the_rods_of_a_simulation():
    simulator = Simulator(sized(5, 2))
    simulator.command(left=SWIM, right=TURN)
    before, state, after = (simulator.advance(duration) for duration in (0.3, 0.002, 0.002))
    for side in (LEFT, RIGHT):  # in the middle of the change of gait; a central difference: 0.002^2 / 6 times a jerk
        rates = (after.rod_angles[side] - before.rod_angles[side]) / 0.004
        np.testing.assert_allclose(rods_of(sized(5, 2), state, side)[:, 1], rates, rtol=0.0, atol=1e-3)
        assert_close(fin_loads(sized(5, 2), state)[side],
                     reference_loads(sized(5, 2), state, side, np.zeros(3)), AGREEMENT)


def test_loads_of_mirrored_states_are_each_other_to_the_last_bit():
    parameters = sized(7, 3)
    state = any_state(parameters, 1)
    exchanged = ('joint_angles', 'joint_rates', 'rod_angles', 'gait', 'gait_rates', 'gait_commands', 'cycle_angles')
    mirrored = dataclasses.replace(
        state, orientation=state.orientation * [-1.0, 1.0, -1.0, 1.0], twist=state.twist * MIRROR,
        current_deviation=state.current_deviation * MIRROR[:3],
        **{name: getattr(state, name)[::-1] for name in exchanged})
    loads = fin_loads(parameters, state, CURRENT)
    np.testing.assert_array_equal(fin_loads(parameters, mirrored, CURRENT * MIRROR[:3])[::-1], loads)
    assert not np.allclose(loads[0], loads[1], rtol=0.1)


def test_at_rest_in_still_water_there_is_no_load():
    bent = dataclasses.replace(State.at_rest(Parameters()), joint_angles=np.full((2, 30, 3), 0.3))
    np.testing.assert_array_equal(fin_loads(Parameters(), bent), np.zeros((2, 30, 3)))


@pytest.mark.parametrize('speed', [0.5, -0.5])
def test_water_that_rises_pushes_level_fins_up_with_its_dynamic_pressure(speed):
    parameters = Parameters().replace(
        water={'density': 1000.0, 'current': (0.0, 0.0, speed)}, fin={'drag_coefficient': 1.2})
    loads = fin_loads(parameters, State.at_rest(parameters))
    # by hand: 1.2 * 1000 kg/m^3 / 2 * (0.5 m/s)^2 = 150 Pa, to a few roundings
    np.testing.assert_allclose(loads, np.copysign(150.0, speed), rtol=1e-14)


def test_a_body_upside_down_feels_rising_water_as_falling():
    parameters = Parameters().replace(water={'current': (0.0, 0.0, 0.5)})
    level = State.at_rest(parameters)
    rolled = dataclasses.replace(level, orientation=(1.0, 0.0, 0.0, 0.0))
    np.testing.assert_allclose(fin_loads(parameters, rolled), -fin_loads(parameters, level), rtol=1e-14)


def test_water_along_a_level_fin_does_not_load_it():
    parameters = Parameters().replace(water={'current': (0.7, -0.4, 0.0)})
    assert np.abs(fin_loads(parameters, State.at_rest(parameters))).max() < 1e-20  # Pa: the square of a rounding


@pytest.mark.parametrize('side', [LEFT, RIGHT])
def test_loads_make_the_force_along_the_support_that_drag_makes(side):
    """The joints turn about the support and cannot accelerate along it: there drag changes nothing but the force."""
    parameters = sized(7, 3)
    for seed in range(5):
        state = dataclasses.replace(any_state(parameters, seed), current_deviation=np.zeros(3))
        rods = rods_of(parameters, state, side)
        moment = rods, state.joint_angles[side], state.joint_rates[side], state.twist, np.zeros(6)
        with_drag = fin_dynamics(parameters, side, *moment)[1]
        without = fin_dynamics(parameters.replace(water={'density': 0.0}), side, *moment)[1]
        of_loads = forces_of(parameters, side, rods, state.joint_angles[side], fin_loads(parameters, state)[side])
        rotation = support_motion(parameters, rods, np.zeros(6), np.zeros(6))[0]
        along = rotation[:, 0] * (MIRROR[:3] if side == RIGHT else 1.0)
        # relative to the forces that are subtracted; measured: below 1e-15
        size = np.linalg.norm(with_drag[:3]) + np.linalg.norm(without[:3])
        assert along @ of_loads[:3] == pytest.approx(along @ (with_drag - without)[:3], rel=0.0, abs=1e-13 * size)
        assert abs(along @ of_loads[:3]) > 1e-3 * size


def test_loads_of_a_settled_fin_in_a_current_add_up_to_its_wrench():
    parameters = sized(9, 3, water={'current': (-0.2, 0.1, 0.3)}, solver={'fixed_base': True},
                       rods={'command_time_constant': 0.0}, fin={'youngs_modulus': 2e7, 'joint_damping': 0.2})
    simulator = Simulator(parameters)
    bias = FinCommand(amplitude=0.0, frequency=0.0, phase=0.0, front_bias=0.4, rear_bias=0.1)
    simulator.command(left=bias, right=bias)
    state = simulator.advance(10.0)  # until the joint rates are below 1e-11 rad/s
    loads = fin_loads(parameters, state)
    for side in (LEFT, RIGHT):
        wrench = forces_of(parameters, side, rods_of(parameters, state, side), state.joint_angles[side], loads[side])
        assert_close(wrench[:3], state.fin_wrenches[side, :3], SETTLED)
        assert_close(wrench[3:], state.fin_wrenches[side, 3:], SETTLED)
    assert np.abs(state.joint_angles).max() > 0.1  # it is bent


def test_nothing_is_compiled_for_the_loads(tmp_path):
    code = """
from numba.core import event
from manta_sim_ros.dynamics import Parameters, State, fin_loads
with event.install_recorder('numba:compile') as compiled:
    fin_loads(Parameters(), State.at_rest(Parameters()))
print(len(compiled.buffer))
"""
    assert run_python(code, tmp_path).stdout.split() == ['0']


@pytest.mark.parametrize(('current', 'words'), [
    (0.3, r'current has shape \(\), but must have \(3,\)'),
    ((0.0, 0.0, math.nan), 'current must be finite, but has nan'),
])
def test_an_invalid_current_is_refused(current, words):
    parameters = sized(3, 2)
    with pytest.raises(ValueError, match=words):
        fin_loads(parameters, State.at_rest(parameters), current)


def test_a_state_of_other_fins_is_refused():
    with pytest.raises(ValueError, match=r'joint_angles has shape \(2, 3, 2\), but fin.chains and fin.links ask'):
        fin_loads(sized(4, 2), State.at_rest(sized(3, 2)))

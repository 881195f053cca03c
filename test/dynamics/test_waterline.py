"""The surface of the water: what is above it falls, the robot floats, and nothing changes for a robot below it."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from evidence.references.mechanism import link_normals
from evidence.scenarios import SWIM, TURN, bits, sized
from evidence.verification.mechanics import ENDS, MIDPOINT, energy, fin_motion, recorded, to_world
from manta_sim_ros.dynamics import REST, Simulator, State, fin_loads, immersed_shares
from manta_sim_ros.dynamics._kernels.constants import constants

FRESH = {
    'water': {'density': 1000.0, 'added_mass_coefficient': 0.6},
    'body': {'added_mass': (1.4, 2.1, 106.0, 1.15, 2.4, 0.01), 'quadratic_damping': (0.0, 0.0, 0.0, 2.7, 6.4, 1.28)},
    'fin': {'drag_coefficient': 6.0, 'shear_modulus': 1e6},
    'solver': {'coupling': 'monolithic', 'time_step': 0.0005},
}
ROBOTS = {'the paper': {}, 'the paper, monolithic': {'solver': {'coupling': 'monolithic'}}, 'fresh water': FRESH}
TOGETHER = {name: ROBOTS[name] for name in ('the paper, monolithic', 'fresh water')}


def robot(groups, surface=0.0):
    return sized(6, 3).replace(**groups).replace(
        water={**groups.get('water', {}), 'surface_height': surface}, rods={'command_time_constant': 0.0})


def put(parameters, height, angles=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0)):
    """Return a state at `height` [m] above the surface, at rest but for its velocity in F_b [m/s]."""
    return dataclasses.replace(
        State.at_rest(parameters), position=(0.0, 0.0, parameters.water.surface_height + height),
        orientation=Rotation.from_euler('xyz', angles).as_quat(), twist=(*velocity, 0.0, 0.0, 0.0))


def below(height, thickness):
    """Return the integral of the immersed share up to a height [m] above the surface, and the share."""
    inside = np.clip(height, -0.5 * thickness, 0.5 * thickness)
    crossing = 0.5 * inside - 0.5 * inside**2 / thickness - thickness / 8.0
    share = np.clip(0.5 - height / thickness, 0.0, 1.0)
    return np.minimum(height, -0.5 * thickness) + 0.5 * thickness + crossing, share


def total_energy(parameters, history):
    """Return the energy (T,) [J] of the robot and of the water that it moves, weight and buoyancy included."""
    body, fin, known = parameters.body, parameters.fin, constants(parameters)
    of_robot, rotations = energy(parameters, history), to_world(history)
    height = history.position[:, 2] - parameters.water.surface_height
    weight = body.mass * body.gravity
    depth, share = below(height + rotations[:, 2] @ np.array(body.buoyancy_center), known.body.height)
    total = of_robot['kinetic'] + of_robot['elastic'] + weight * (height - depth)
    total -= 0.5 * (1.0 - share) * np.sum(np.array(body.added_mass) * history.twist**2, axis=1)
    for side in range(2):
        middles, ends = (fin_motion(parameters, history, side, points) for points in (MIDPOINT, ENDS))
        above = height[:, None] + np.einsum('tb,ntmb->ntm', rotations[:, 2], middles.positions[..., 0, :])
        depth, share = below(above, fin.thickness)
        normals = np.stack([link_normals(*np.moveaxis(ends.positions[:, t], 2, 0)) for t in range(len(height))], axis=1)
        normal_speed = np.sum(middles.velocities[..., 0, :] * normals, axis=-1)
        moved = 0.5 * known.fin.added_mass * share * normal_speed**2
        total += known.fin.chain_spacing * np.sum(known.fin.link_weight * (above - depth) + moved, axis=(0, 2))
    return total


@pytest.mark.parametrize('groups', ROBOTS.values(), ids=ROBOTS)
def test_a_robot_above_the_surface_falls_freely(groups):
    parameters = robot(groups)
    state = Simulator(parameters, state=put(parameters, 3.0)).advance(0.5)
    np.testing.assert_allclose(state.position[2], 3.0 - 0.5 * 9.81 * 0.5**2, rtol=0.0, atol=3e-3)  # the first step
    np.testing.assert_allclose(state.twist[2], -9.81 * 0.5, rtol=1e-3)
    np.testing.assert_allclose(state.joint_angles, 0.0, atol=3e-3)


@pytest.mark.parametrize('groups', TOGETHER.values(), ids=TOGETHER)
@pytest.mark.parametrize(('height', 'angles', 'velocity'), [
    (2.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), (1.0, (1.0, 0.5, 0.0), (0.0, 0.0, 0.0)),
    (-0.5, (0.0, -1.2, 0.0), (4.0, 0.0, 0.0))], ids=['dropped', 'tilted', 'leaping'])
def test_energy_never_grows_in_the_air_at_the_surface_and_below_it(groups, height, angles, velocity):
    parameters = robot(groups)
    simulator = Simulator(parameters, state=put(parameters, height, angles, velocity))
    total = total_energy(parameters, recorded(simulator, (REST, REST), 1.5, every=4))
    # the force of the fins' added mass is not the gradient of an energy, measured: 1.4e-4; all else is rounding
    assert np.diff(total).max() < (5e-4 if groups is FRESH else 1e-12) * np.ptp(total)
    assert total[-1] < total[0] - 100.0


@pytest.mark.parametrize('groups', ROBOTS.values(), ids=ROBOTS)
def test_it_falls_back_floats_and_swims_on(groups):
    parameters = robot(groups)
    simulator = Simulator(parameters, state=put(parameters, 5.0))
    simulator.command(left=SWIM, right=SWIM)
    simulator.advance(8.0)
    heights = []
    for _ in range(100):
        state = simulator.advance(0.02)
        heights.append(state.position[2])
    assert -1.5 < min(heights) and max(heights) < 0.0
    assert state.twist[0] > 0.2


@pytest.mark.parametrize('groups', ROBOTS.values(), ids=ROBOTS)
def test_a_robot_under_water_moves_the_same_to_the_last_bit_wherever_the_surface_is(groups):
    states = []
    for surface in (1e4, 5.0, 1.0):  # out of reach, and within it, with all parts under water
        parameters = robot(groups, surface)
        simulator = Simulator(parameters)
        simulator.command(left=SWIM, right=TURN)
        states.append(bits(simulator.advance(1.5)))
    assert states[0] == states[1] == states[2]


def test_shares_of_body_and_links_are_those_below_the_surface():
    parameters = robot({})
    assert immersed_shares(parameters, put(parameters, -1.0))[0] == 1.0
    assert np.all(immersed_shares(parameters, put(parameters, -1.0))[1] == 1.0)
    body, links = immersed_shares(parameters, put(parameters, 0.0))
    np.testing.assert_allclose(links, 0.5)  # flat, in the surface
    assert body == 0.0  # its center of buoyancy is 5 cm above the center of mass
    body, links = immersed_shares(parameters, put(parameters, 0.0, (math.pi / 2.0, 0.0, 0.0)))
    np.testing.assert_allclose(body, 0.5)
    np.testing.assert_array_equal(links[0], 0.0)  # the left fin points up
    np.testing.assert_array_equal(links[1], 1.0)


def test_the_water_does_not_load_what_is_in_the_air():
    parameters = robot({})
    moving = put(parameters, 0.0, (0.3, 0.0, 0.0), (0.0, 0.0, 1.0))
    loads = fin_loads(parameters, moving)
    np.testing.assert_array_equal(loads[0], 0.0)
    assert np.all(loads[1] < 0.0)


@pytest.mark.parametrize('groups', ROBOTS.values(), ids=ROBOTS)
def test_a_fin_in_the_air_hangs_under_its_weight_and_the_body_carries_it(groups):
    parameters = robot(groups).replace(
        solver={'fixed_base': True}, fin={'joint_damping': 0.5})
    state = Simulator(parameters, state=put(parameters, 3.0)).advance(6.0)
    fin = parameters.fin
    weight = fin.density * fin.thickness * fin.span * parameters.rods.support_length * 9.81
    for side in range(2):
        np.testing.assert_allclose(state.fin_wrenches[side, :3], [0.0, 0.0, -weight], atol=1e-3 * weight)
    assert np.all(state.joint_angles < 0.0)
    torque = weight / parameters.rods.support_length * fin.span / 2.0  # at the root, per unit chord, of a level chain
    angle = 2.0 * math.atan(torque * fin.span / fin.links / 2.0 / (1e8 * fin.thickness**3 / 12.0))
    np.testing.assert_allclose(state.joint_angles[:, :, 0], -angle, rtol=0.02)  # measured: 0.3 %

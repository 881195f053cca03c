"""The fins' added mass: two independent references, hand-computed cases, and the library against them all."""

import numpy as np
import pytest

from evidence.references import equations, mechanism
from evidence.references.mechanism import fin_points
from evidence.scenarios import (
    SIZES,
    any_moment,
    assert_close,
    assert_same_dynamics,
    other_parameters,
    sized,
    twisting,
)
from manta_sim_ros.dynamics import fin_dynamics

ROUNDING = 1e-12  # relative; measured: below 2e-14 in all cases below
REFERENCES = ['equations', 'pinocchio_tree']
of_each_reference = pytest.mark.parametrize('dynamics', REFERENCES, indirect=True)
of_each = pytest.mark.parametrize('dynamics', [*REFERENCES, 'library'], indirect=True)


@pytest.fixture
def dynamics(request):
    """`fin_dynamics` of a reference or of the library."""
    if request.param == 'library':
        return fin_dynamics
    return pytest.importorskip(f'evidence.references.{request.param}').fin_dynamics


def added(parameters, coefficient=1.0, density=1000.0):
    return parameters.replace(solver={'coupling': 'monolithic'}, water={
        'added_mass_coefficient': coefficient, 'added_mass_density': density})


def any_parameters(chains, links):
    """Return the defaults and parameters of which none is at its default, both with added mass."""
    random = np.random.default_rng(chains + links)
    other = twisting(other_parameters(chains, links, seed=chains))
    return added(sized(chains, links)), added(other, random.uniform(0.3, 3.0), random.uniform(500.0, 2000.0))


@pytest.mark.parametrize('side', [0, 1])
@pytest.mark.parametrize(('chains', 'links'), [(2, 1), (2, 3), (3, 10), (7, 4), (30, 3)])
def test_the_two_references_agree(chains, links, side, pinocchio_tree):
    for parameters in any_parameters(chains, links):
        moment = any_moment(parameters, seed=300 * chains + 10 * links)
        water_velocity = np.random.default_rng(links).uniform(-1.0, 1.0, 3)
        assert_same_dynamics(
            pinocchio_tree.fin_dynamics(parameters, side, *moment, water_velocity),
            equations.fin_dynamics(parameters, side, *moment, water_velocity))


@of_each_reference
@pytest.mark.parametrize('side', [0, 1])
@pytest.mark.parametrize(('chains', 'links'), SIZES)
def test_fin_dynamics_of_the_monolithic_coupling_agree_with_the_reference(chains, links, side, dynamics):
    for parameters in (added(sized(chains, links), coefficient=0.0), *any_parameters(chains, links)):
        moment = any_moment(parameters, seed=400 * chains + 10 * links)
        assert_same_dynamics(fin_dynamics(parameters, side, *moment), dynamics(parameters, side, *moment))


@of_each
@pytest.mark.parametrize('side', [0, 1])
@pytest.mark.parametrize(('chains', 'links'), [(2, 1), (5, 2), (7, 4)])
def test_every_joint_and_the_body_obey_d_alembert_with_the_forces_of_the_added_mass(chains, links, side, dynamics):
    # as in test_pinocchio_tree.py: points' accelerations are exact derivatives of their positions
    parameters = any_parameters(chains, links)[1]
    rod_motion, angles, rates, *_ = state = any_moment(parameters, seed=chains + links)
    joint_accelerations, wrench = dynamics(parameters, side, *state)
    root, tip, middle, *halves = (
        fin_points(parameters, side, state, joint_accelerations, part)
        for part in (0.0, 1.0, 0.5, 0.5 - 0.5 / np.sqrt(3.0), 0.5 + 0.5 / np.sqrt(3.0)))
    fin, water, chord = parameters.fin, parameters.water, parameters.rods.support_length
    width, length = chord / chains, fin.span / links

    normals = mechanism.link_normals(root.value, tip.value)
    along_normals = np.sum(middle.second * normals, axis=-1, keepdims=True) * normals
    mass_of_water = water.added_mass_density * np.pi / 4.0 * chord**2 * length / chains
    on_middles = mechanism.drag_forces(parameters, root.value, tip.value, middle.first) * width
    on_middles -= water.added_mass_coefficient * mass_of_water * along_normals
    half_mass = 0.5 * fin.density * fin.thickness * length * width
    force = on_middles - half_mass * sum(half.second for half in halves)
    moment = np.cross(middle.value, on_middles) - half_mass * sum(np.cross(half.value, half.second) for half in halves)
    assert_close(wrench[:3], force.sum(axis=(0, 1)), 1e-11)  # measured: below 1e-14 of the largest component
    assert_close(wrench[3:], moment.sum(axis=(0, 1)), 1e-11)

    rotation, _ = mechanism.support_pose(parameters, side, rod_motion)
    axis = mechanism.OUTWARD[side] * rotation.value[:, 0]
    torques = mechanism.joint_torques(parameters, angles, rates) * width
    for j in range(links):  # all that hangs beyond joint j
        about_joint = moment[:, j:].sum(axis=1) - np.cross(root.value[:, j], force[:, j:].sum(axis=1))
        assert_close(about_joint @ axis, -torques[:, j], 1e-10)  # measured: below 2e-13


def one_link(**groups):
    """Return parameters of a fin of one link a chain whose support equal rods hold parallel to the body, without drag.

    Also the link's length [m], its mass and its added mass per unit chord [kg/m], and where the support's middle is.
    """
    radius, coefficient, density = 0.2, 0.8, 900.0
    parameters = sized(3, 1, rods={'front_radius': radius, 'rear_radius': radius}, **groups).replace(
        solver={'coupling': 'monolithic'},
        water={'density': 0.0, 'added_mass_coefficient': coefficient, 'added_mass_density': density})
    fin, rods = parameters.fin, parameters.rods
    x, y, z = rods.rear_motor_position
    middle = np.array([x + rods.support_length / 2.0, y + radius, z])
    added_mass = coefficient * density * np.pi / 4.0 * rods.support_length * fin.span
    return parameters, fin.span, fin.density * fin.thickness * fin.span, added_mass, middle


HEAVE = 7.0  # [m/s^2] up
FORWARD_SPEED, PITCH_RATE = 3.5, -2.0  # [m/s, rad/s], whose velocity product is HEAVE


@of_each
@pytest.mark.parametrize(('twist', 'acceleration'), [
    ((0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, HEAVE, 0.0, 0.0, 0.0)),
    ((FORWARD_SPEED, 0.0, 0.0, 0.0, PITCH_RATE, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
], ids=['heaved', 'carried round a circle'])
def test_a_flat_hinged_link_lags_behind_its_hinge_as_computed_by_hand(twist, acceleration, dynamics):
    parameters, length, mass, added_mass, middle = one_link()
    joint_accelerations, wrench = dynamics(
        parameters, 0, np.zeros((2, 3)), np.zeros((3, 1)), np.zeros((3, 1)), np.array(twist), np.array(acceleration))
    # about the hinge: a thin rod's inertia and a point mass of water in its middle, both left behind
    expected = -(mass + added_mass) * HEAVE * length / 2.0 / (mass * length**2 / 3.0 + added_mass * length**2 / 4.0)
    np.testing.assert_allclose(joint_accelerations, expected, rtol=ROUNDING)
    force = -parameters.rods.support_length * (mass + added_mass) * (HEAVE + expected * length / 2.0)
    assert wrench[2] == pytest.approx(force, rel=ROUNDING)
    if not any(twist):
        assert_close(wrench, np.hstack([0.0, 0.0, force, np.cross(middle, [0.0, 0.0, force])]), ROUNDING)


@of_each
@pytest.mark.parametrize('angle', [-1e-4, 0.4])
def test_a_link_that_its_spring_holds_against_the_acceleration_bears_both_masses(angle, dynamics):
    parameters, length, mass, added_mass, middle = one_link()
    torque = equations.elastic_torque(parameters, angle)
    heave = torque / ((mass + added_mass) * np.cos(angle) * length / 2.0)
    joint_accelerations, wrench = dynamics(
        parameters, 0, np.zeros((2, 3)), np.full((3, 1), angle), np.zeros((3, 1)), np.zeros(6),
        np.array([0.0, 0.0, heave, 0.0, 0.0, 0.0]))
    stiff = abs(torque) / (mass * length**2 / 3.0)
    np.testing.assert_allclose(joint_accelerations, 0.0, atol=ROUNDING * stiff)
    # the mass resists along z, the water only along the link's normal; for a nearly straight fin that is the same
    up, normal = np.array([0.0, 0.0, 1.0]), np.array([0.0, -np.sin(angle), np.cos(angle)])
    force = -parameters.rods.support_length * heave * (mass * up + added_mass * np.cos(angle) * normal)
    moment = np.cross(middle, force) - parameters.rods.support_length * np.array([torque, 0.0, 0.0])
    assert_close(wrench, np.hstack([force, moment]), ROUNDING)


@of_each
def test_moving_within_its_plane_a_flat_fin_sets_no_water_in_motion(dynamics):
    parameters = one_link()[0]
    without = parameters.replace(water={'added_mass_coefficient': 0.0})
    still, flat = np.zeros((2, 3)), np.zeros((3, 1))
    twist, acceleration = np.array([1.0, 2.0, 0.0, 0.0, 0.0, 3.0]), np.array([5.0, -4.0, 0.0, 0.0, 0.0, 6.0])
    bare = dynamics(without, 0, still, flat, flat, twist, acceleration)
    wet = dynamics(parameters, 0, still, flat, flat, twist, acceleration)
    assert np.abs(bare[1][[0, 1, 5]]).min() > 1.0
    np.testing.assert_array_equal(wet[0], 0.0)
    assert_close(wet[1], bare[1], ROUNDING)


@of_each
def test_coefficient_and_density_of_the_added_mass_count_as_their_product(dynamics):
    one, same, more = (added(sized(4, 2), *values) for values in ((0.5, 1000.0), (2.0, 250.0), (0.75, 1000.0)))
    moment = any_moment(one, seed=1)
    first, second, third = (dynamics(parameters, 1, *moment) for parameters in (one, same, more))
    for a, b, c in zip(first, second, third):
        np.testing.assert_array_equal(a, b)
        assert np.all(a != c)


@of_each
def test_without_the_coefficient_the_density_of_the_added_mass_makes_no_difference(dynamics):
    plain, with_density = sized(4, 2), added(sized(4, 2), coefficient=0.0, density=5e3)
    moment = any_moment(plain, seed=2)
    for desired, actual in zip(dynamics(plain, 0, *moment), dynamics(with_density, 0, *moment)):
        assert_close(actual, desired, ROUNDING)


@of_each
@pytest.mark.parametrize('side', [0, 1])
def test_the_apparent_inertia_of_a_fin_is_symmetric_and_grows_with_the_added_mass(side, dynamics):
    def apparent_inertia(parameters):
        rods, angles, rates, twist, _ = any_moment(parameters, seed=3)
        # it is large, so that the differences do not drown in the wrench of all that does not depend on it
        wrenches = [dynamics(parameters, side, rods, angles, rates, twist, 1e4 * unit)[1]
                    for unit in (np.zeros(6), *np.eye(6))]
        return -(np.array(wrenches[1:]) - wrenches[0]).T / 1e4

    light, heavy = (apparent_inertia(added(sized(4, 2), coefficient)) for coefficient in (0.5, 1.0))
    for inertia in (light, heavy, heavy - light):
        assert_close(inertia, inertia.T, 1e-11)
        assert np.linalg.eigvalsh(inertia + inertia.T).min() > -1e-11 * np.abs(heavy).max()


@of_each_reference
def test_a_steady_current_and_the_body_in_it_move_as_in_still_water(dynamics):
    """Galileo: a frame that goes with the water is as inertial as the ground."""
    parameters = added(sized(3, 2))
    rods, angles, rates, twist, acceleration = any_moment(parameters, seed=4)
    current = np.array([0.7, -0.5, 0.3])
    carried = twist + [*current, 0.0, 0.0, 0.0]
    turned = acceleration - [*np.cross(twist[3:], current), 0.0, 0.0, 0.0]  # the current's components change in F_b
    assert_same_dynamics(
        dynamics(parameters, 1, rods, angles, rates, carried, turned, current),
        dynamics(parameters, 1, rods, angles, rates, twist, acceleration))

"""The Pinocchio and MuJoCo trees are correct: cases computed by hand, and d'Alembert's principle for point masses."""

import dataclasses

import numpy as np
import pytest

from evidence.references.mechanism import (
    OUTWARD,
    drag_forces,
    fin_points,
    joint_torques,
    support_motion,
    support_pose,
)
from manta_sim_ros.dynamics import Parameters

mujoco = pytest.importorskip('mujoco')
pinocchio = pytest.importorskip('pinocchio')
mujoco_tree = pytest.importorskip('evidence.references.mujoco_tree')
pinocchio_tree = pytest.importorskip('evidence.references.pinocchio_tree')

AT_REST = np.zeros(6)
ROUNDING = 1e-11  # relative; sums of some hundred terms and an m x m solve stay two orders below it


def sized(chains, links, **groups):
    """Parameters with n and m set, and other groups' values: `sized(4, 2, water={'density': 0.0})`."""
    groups['fin'] = {**groups.get('fin', {}), 'chains': chains, 'links': links}
    parameters = Parameters()
    return dataclasses.replace(parameters, **{
        name: dataclasses.replace(getattr(parameters, name), **values) for name, values in groups.items()})


def random_state(parameters, seed):
    """Rod motion, joint angles and rates, body twist and acceleration, as large as a hard-driven robot has them."""
    random = np.random.default_rng(seed)
    shape = (parameters.fin.chains, parameters.fin.links)
    rod_motion = random.uniform(-1.0, 1.0, (2, 3)) * [0.5, 3.0, 15.0]
    return (rod_motion, random.uniform(-0.5, 0.5, shape), random.uniform(-5.0, 5.0, shape),
            random.uniform(-1.0, 1.0, 6), random.uniform(-3.0, 3.0, 6))


def bending_stiffness(parameters):
    """EI/dl [N]: torque per angle and unit chord of a joint, at small angles."""
    fin = parameters.fin
    return fin.youngs_modulus * fin.thickness**3 / 12.0 * fin.links / fin.span


@pytest.mark.parametrize('side', [0, 1])
@pytest.mark.parametrize(('chains', 'links'), [(2, 1), (5, 2), (30, 3), (7, 6)])
def test_every_joint_and_the_body_obey_d_alembert_on_the_fins_mass_points(side, chains, links):
    # A uniform rod moves as two half masses at its middle -+ length/(2 sqrt 3); so the fin is a cloud of mass points
    # whose accelerations are exact derivatives of their positions, and needs no multibody algorithm.
    parameters = sized(chains, links)
    rod_motion, angles, rates, *_ = state = random_state(parameters, seed=10 * chains + links + side)
    joint_accelerations, wrench = pinocchio_tree.fin_dynamics(parameters, side, *state)
    motion = (parameters, side, state, joint_accelerations)
    root, tip, middle = (fin_points(*motion, part) for part in (0.0, 1.0, 0.5))
    width, length = parameters.rods.support_length / chains, parameters.fin.span / links
    half_mass = 0.5 * parameters.fin.density * parameters.fin.thickness * length * width
    halves = [fin_points(*motion, 0.5 + offset) for offset in (-0.5 / np.sqrt(3.0), 0.5 / np.sqrt(3.0))]
    drag = drag_forces(parameters, root.value, tip.value, middle.first) * width

    force = drag - half_mass * sum(half.second for half in halves)
    moment = np.cross(middle.value, drag) - half_mass * sum(np.cross(half.value, half.second) for half in halves)
    expected = np.concatenate([force.sum(axis=(0, 1)), moment.sum(axis=(0, 1))])
    np.testing.assert_allclose(wrench, expected, rtol=0.0, atol=ROUNDING * np.abs(expected).max())

    rotation, _ = support_pose(parameters, side, rod_motion)
    axis = OUTWARD[side] * rotation.value[:, 0]
    torques = joint_torques(parameters, angles, rates) * width
    for j in range(links):  # all that hangs beyond joint j
        about_joint = moment[:, j:].sum(axis=1) - np.cross(root.value[:, j], force[:, j:].sum(axis=1))
        np.testing.assert_allclose(about_joint @ axis, -torques[:, j], rtol=0.0, atol=ROUNDING * np.abs(torques).max())


def test_one_link_in_water_accelerates_as_computed_by_hand():
    # Equal rods at rest hold the support parallel to the body; both chains alike, so the normal is across the link.
    parameters = sized(2, 1, rods={'front_radius': 0.2, 'rear_radius': 0.2})
    fin, rods, angle, rate = parameters.fin, parameters.rods, 0.3, 2.0
    acceleration, wrench = pinocchio_tree.fin_dynamics(
        parameters, 0, np.zeros((2, 3)), np.full((2, 1), angle), np.full((2, 1), rate), AT_REST, AT_REST)
    length, mass = fin.span, fin.density * fin.thickness * fin.span  # per meter of chord, as the forces below
    drag = 0.5 * parameters.water.density * fin.drag_coefficient * length * (rate * length / 2.0)**2
    joint = (-2.0 * bending_stiffness(parameters) * np.tan(angle / 2.0) / np.cos(angle / 2.0)**2
             - fin.joint_damping * rate)
    expected = (joint - drag * length / 2.0) / (mass * length**2 / 3.0)
    np.testing.assert_allclose(acceleration, expected, rtol=ROUNDING)

    along, across = np.array([0.0, np.cos(angle), np.sin(angle)]), np.array([0.0, -np.sin(angle), np.cos(angle)])
    force = mass * length / 2.0 * (rate**2 * along - expected * across) - drag * across
    x, y, z = rods.rear_motor_position
    hinge = np.array([x + rods.support_length / 2.0, y + rods.rear_radius, z])
    moment = np.cross(hinge, force) - [joint, 0.0, 0.0]
    np.testing.assert_allclose(wrench, rods.support_length * np.concatenate([force, moment]), rtol=ROUNDING, atol=1e-12)


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_drag_is_along_the_fins_normal_and_against_the_motion(sign):
    # Two chains 0.1 m apart in x and as much in z, links along y: the normal is at 45 degrees between x and z.
    parameters = sized(2, 2)
    roots = np.array([[[0.1, 0.0, 0.0]], [[0.0, 0.0, 0.1]]])
    tips = roots + [0.0, 0.15, 0.0]
    velocities = sign * np.broadcast_to([0.0, 5.0, 2.0], (2, 1, 3))
    speed = 2.0 / np.sqrt(2.0)
    size = 0.5 * parameters.water.density * parameters.fin.drag_coefficient * parameters.fin.span / 2 * speed**2
    expected = np.broadcast_to(-sign * size / np.sqrt(2.0) * np.array([1.0, 0.0, 1.0]), (2, 1, 3))
    np.testing.assert_allclose(drag_forces(parameters, roots, tips, velocities), expected, rtol=1e-13, atol=1e-9)


@pytest.mark.parametrize('side', [0, 1])
def test_equal_rods_carry_the_support_around_a_circle_without_turning_it(side):
    parameters = sized(2, 1, rods={'front_radius': 0.2, 'rear_radius': 0.2})
    angle, rate, acceleration = 0.4, 3.0, -7.0
    motion = support_motion(parameters, side, [[angle, rate, acceleration]] * 2, AT_REST, AT_REST)
    sine, cosine, out = np.sin(angle), np.cos(angle), OUTWARD[side]
    np.testing.assert_allclose(motion.rotation, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(motion.twist, 0.2 * rate * np.array([0, -out * sine, cosine, 0, 0, 0]), atol=1e-14)
    expected = 0.2 * (acceleration * np.array([0, -out * sine, cosine, 0, 0, 0])
                      - rate**2 * np.array([0, out * cosine, sine, 0, 0, 0]))
    np.testing.assert_allclose(motion.acceleration, expected, atol=1e-13)


@pytest.mark.parametrize('side', [0, 1])
def test_support_motion_is_the_difference_quotient_of_its_pose(side):
    parameters = Parameters()
    rod_motion, _, _, twist, acceleration = random_state(sized(2, 1), seed=side)
    step = 1e-3

    def moved(time):
        """The support's motion later: rods of constant acceleration, a body twist of constant derivative."""
        angle, rate, rod_acceleration = rod_motion.T
        rods = np.stack([angle + rate * time + rod_acceleration * time**2 / 2.0, rate + rod_acceleration * time,
                         rod_acceleration], axis=1)
        return support_motion(parameters, side, rods, twist + acceleration * time, acceleration)

    now, samples = moved(0.0), {i: moved(i * step) for i in (-2, -1, 1, 2)}

    def slope(read):  # fourth order
        return (8.0 * (read(samples[1]) - read(samples[-1])) - read(samples[2]) + read(samples[-2])) / (12.0 * step)

    np.testing.assert_allclose(now.acceleration, slope(lambda s: s.twist), atol=1e-7)
    carried = np.concatenate([twist[:3] + np.cross(twist[3:], now.position) + slope(lambda s: s.position), twist[3:]])
    np.testing.assert_allclose(now.rotation @ now.twist[:3], carried[:3], atol=1e-8)
    turning = slope(lambda s: s.rotation) @ now.rotation.T
    relative = np.array([turning[2, 1], turning[0, 2], turning[1, 0]])
    np.testing.assert_allclose(now.rotation @ now.twist[3:], carried[3:] + relative, atol=1e-8)

    motor = np.array(parameters.rods.rear_motor_position) * [1.0, OUTWARD[side], 1.0]
    front_end = now.position + parameters.rods.support_length * now.rotation[:, 0] - motor
    circle = OUTWARD[side] * np.cos(rod_motion[0, 0]), np.sin(rod_motion[0, 0])
    np.testing.assert_allclose(front_end[1:], parameters.rods.front_radius * np.array(circle), atol=1e-14)


def test_a_fin_without_losses_keeps_its_energy():
    parameters = sized(2, 2, water={'density': 0.0}, fin={'joint_damping': 0.0})
    model = pinocchio_tree.fin_tree(parameters)
    data = model.createData()
    width = parameters.rods.support_length / 2

    def energy(angles, rates):
        configuration = np.concatenate([pinocchio.neutral(model)[:7], angles.ravel()])
        kinetic = pinocchio.computeKineticEnergy(model, data, configuration, np.concatenate([AT_REST, rates.ravel()]))
        return kinetic + width * 2.0 * bending_stiffness(parameters) * np.sum(np.tan(angles / 2.0)**2)

    def change(state):
        accelerations, _ = pinocchio_tree.fin_dynamics(parameters, 0, np.zeros((2, 3)), *state, AT_REST, AT_REST)
        return np.stack([state[1], accelerations])

    def drift(steps):
        state, step = np.array([[[0.4, -0.2], [0.1, 0.5]], [[3.0, -4.0], [0.0, 10.0]]]), 0.02 / steps
        start = energy(*state)
        for _ in range(steps):
            k1 = change(state)
            k2 = change(state + step / 2.0 * k1)
            k3 = change(state + step / 2.0 * k2)
            k4 = change(state + step * k3)
            state = state + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        assert np.abs(state[0] - [[0.4, -0.2], [0.1, 0.5]]).max() > 0.1  # it did swing
        return abs(energy(*state) / start - 1.0)

    coarse, fine = drift(40), drift(80)
    assert fine < 1e-5
    assert coarse / fine > 14.0  # RK4 loses energy at fourth order or better: what drifts is the integrator


@pytest.mark.parametrize('side', [0, 1])
@pytest.mark.parametrize(('chains', 'links'), [(2, 1), (30, 3)])
def test_a_fin_has_its_freedoms_and_its_mass(side, chains, links):
    parameters = sized(chains, links)
    model = pinocchio_tree.fin_tree(parameters, side)
    assert (model.nq, model.nv) == (7 + chains * links, 6 + chains * links)
    mass = parameters.fin.density * parameters.fin.thickness * parameters.fin.span * parameters.rods.support_length
    assert pinocchio.computeTotalMass(model) == pytest.approx(mass, rel=1e-12)
    center = pinocchio.centerOfMass(model, model.createData(), pinocchio.neutral(model))
    expected = [parameters.rods.support_length / 2.0, OUTWARD[side] * parameters.fin.span / 2.0, 0.0]
    np.testing.assert_allclose(center, expected, atol=1e-14)


def test_the_swimmer_is_a_body_that_carries_both_fins():
    parameters = Parameters()
    swimmer, count = pinocchio_tree.swimmer_tree(parameters), parameters.fin.chains * parameters.fin.links
    assert swimmer.nv == 186
    angles = np.random.default_rng(3).uniform(-0.5, 0.5, (2, count))

    def inertia(model, *joints):
        matrix = pinocchio.crba(model, model.createData(), np.concatenate([pinocchio.neutral(model)[:7], *joints]))
        return np.triu(matrix) + np.triu(matrix, 1).T

    whole = inertia(swimmer, *angles)
    base = np.diag([parameters.body.mass] * 3 + list(parameters.body.inertia))
    for side in 0, 1:
        alone = inertia(pinocchio_tree.fin_tree(parameters, side), angles[side])
        joints = slice(6 + side * count, 6 + (side + 1) * count)
        np.testing.assert_allclose(whole[joints, joints], alone[6:, 6:], atol=1e-14)
        support = support_motion(parameters, side, np.zeros((2, 3)), AT_REST, AT_REST)
        adjoint = pinocchio.SE3(support.rotation, support.position).toActionMatrixInverse()
        np.testing.assert_allclose(whole[:6, joints], adjoint.T @ alone[:6, 6:], atol=1e-14)
        base += adjoint.T @ alone[:6, :6] @ adjoint
    np.testing.assert_allclose(whole[:6, :6], base, atol=1e-13)


def test_mujocos_swimmer_is_the_same_tree():
    parameters = Parameters()
    tree, model = pinocchio_tree.swimmer_tree(parameters), mujoco_tree.swimmer_model(parameters, time_step=0.002)
    assert model.nv == tree.nv == 186
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4
    data, random = mujoco.MjData(model), np.random.default_rng(4)
    angles, rates = random.uniform(-0.5, 0.5, 180), random.uniform(-5.0, 5.0, 180)
    data.qpos[7:], data.qvel[6:] = angles, rates
    mujoco.mj_forward(model, data)
    assert np.abs(data.qfrc_fluid[:6]).max() > 0.1  # the water acts
    assert data.ncon == data.nefc == 0

    configuration = np.concatenate([pinocchio.neutral(tree)[:7], angles])
    velocity = np.concatenate([AT_REST, rates])
    width = parameters.rods.support_length / parameters.fin.chains
    joint = bending_stiffness(parameters) * angles + parameters.fin.joint_damping * rates
    torques = np.concatenate([AT_REST, -width * joint])
    model.opt.density = model.opt.viscosity = 0.0
    mujoco.mj_forward(model, data)
    expected = pinocchio.aba(tree, tree.createData(), configuration, velocity, torques)
    np.testing.assert_allclose(data.qacc, expected, rtol=1e-6)  # MuJoCo's rods are not quite thin, by SLIMNESS

"""The fins and the whole robot as Pinocchio trees: a reference that does not use the paper's recursion.

Pinocchio solves the tree. The support's motion follows from the position of its mechanism alone, which is
differentiated by exact second-order arithmetic. Drag, added mass, elasticity and damping are plain NumPy. The right fin
is modeled directly, hinged about -x_0 with its chains along -y_0. It is not mirrored from the left one, so the mirror
rule of the model is verified too.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pinocchio
from numpy.typing import ArrayLike, NDArray

from manta_sim_ros.dynamics import Parameters, State

OUTWARD = (1.0, -1.0)  # the direction of each fin's chains along y_0: left, right


@dataclasses.dataclass(frozen=True)
class Jet:
    """A number, vector or matrix that depends on time: its value and its exact first and second time derivatives."""

    value: NDArray
    first: NDArray
    second: NDArray

    def __add__(self, other: Jet) -> Jet:
        return Jet(self.value + other.value, self.first + other.first, self.second + other.second)

    def __sub__(self, other: Jet) -> Jet:
        return Jet(self.value - other.value, self.first - other.first, self.second - other.second)

    def __mul__(self, other: Jet) -> Jet:
        return _product(np.multiply, self, other)

    def __matmul__(self, other: Jet) -> Jet:
        return _product(np.matmul, self, other)

    def __pow__(self, exponent: float) -> Jet:
        return self.through(self.value**exponent, exponent * self.value ** (exponent - 1.0),
                            exponent * (exponent - 1.0) * self.value ** (exponent - 2.0))

    def through(self, value: ArrayLike, slope: ArrayLike, curvature: ArrayLike) -> Jet:
        """Return f(self), given the value and the first and second derivative of f at self.value."""
        return Jet(np.asarray(value), slope * self.first, curvature * self.first**2 + slope * self.second)


def constant(value: ArrayLike) -> Jet:
    """Return the jet of a constant."""
    value = np.asarray(value, dtype=float)
    return Jet(value, np.zeros_like(value), np.zeros_like(value))


def stack(*parts: Jet) -> Jet:
    """Return scalars joined to a vector, or vectors joined as the columns of a matrix."""
    return Jet(*(np.stack([getattr(part, name) for part in parts], axis=-1) for name in ('value', 'first', 'second')))


def _product(multiply: Callable[[NDArray, NDArray], NDArray], a: Jet, b: Jet) -> Jet:
    return Jet(multiply(a.value, b.value), multiply(a.first, b.value) + multiply(a.value, b.first),
               multiply(a.second, b.value) + 2.0 * multiply(a.first, b.first) + multiply(a.value, b.second))


def _hat(v: ArrayLike) -> NDArray:
    x, y, z = np.asarray(v, dtype=float)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _vee(matrix: NDArray) -> NDArray:
    return 0.5 * np.array([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])


def body_pose(body_twist: ArrayLike, body_acceleration: ArrayLike) -> tuple[Jet, Jet]:
    """Return rotation (3, 3) and position (3,) [m] of F_b in the inertial frame that coincides with it at this instant.

    `body_twist` (6,) [m/s, rad/s] and `body_acceleration` (6,), the derivative of its components, are in F_b.
    """
    velocity, spin = np.split(np.asarray(body_twist, dtype=float), 2)
    velocity_dot, spin_dot = np.split(np.asarray(body_acceleration, dtype=float), 2)
    rotation = Jet(np.eye(3), _hat(spin), _hat(spin) @ _hat(spin) + _hat(spin_dot))
    position = Jet(np.zeros(3), velocity, velocity_dot + np.cross(spin, velocity))
    return rotation, position


def support_pose(parameters: Parameters, side: int, rod_motion: ArrayLike) -> tuple[Jet, Jet]:
    """Return rotation (3, 3) and position (3,) [m] of the support frame F_0 in F_b, from the closure |AB| = L.

    On both sides x_0 points from A to B, and y_0 is level in F_b: this is (7) to (9) without the angles theta and beta.
    `rod_motion` (2, 3): rows front, rear; angle [rad], rate [rad/s], acceleration [rad/s^2], positive with the tip up.
    """
    rods = parameters.rods
    ends = []
    for radius, motion in zip((rods.front_radius, rods.rear_radius), np.asarray(rod_motion, dtype=float), strict=True):
        angle, (sine, cosine) = Jet(*motion), (np.sin(motion[0]), np.cos(motion[0]))
        ends.append((constant(OUTWARD[side] * radius) * angle.through(cosine, -sine, -cosine),
                     constant(radius) * angle.through(sine, cosine, -sine)))
    (y_front, z_front), (y_rear, z_rear) = ends
    across, up = y_front - y_rear, z_front - z_rear
    along = (constant(rods.support_length**2) - across * across - up * up) ** 0.5
    x_axis = stack(along, across, up) * constant(1.0 / rods.support_length)
    level = (along * along + across * across) ** -0.5
    y_axis = stack(constant(0.0) - across * level, along * level, constant(0.0))
    z_axis = _product(np.cross, x_axis, y_axis)
    motor = np.array(rods.rear_motor_position) * (1.0, OUTWARD[side], 1.0)
    return stack(x_axis, y_axis, z_axis), constant(motor) + stack(constant(0.0), y_rear, z_rear)


class SupportMotion(NamedTuple):
    """Pose of the support frame F_0 in F_b, and its motion relative to the inertial frame, with components in F_0."""

    rotation: NDArray  # (3, 3)
    position: NDArray  # (3,) [m]
    twist: NDArray  # (6,) [m/s, rad/s]: eta_0
    acceleration: NDArray  # (6,) [m/s^2, rad/s^2]: the derivative of eta_0's components


def support_motion(parameters: Parameters, side: int, rod_motion: ArrayLike, body_twist: ArrayLike,
                   body_acceleration: ArrayLike) -> SupportMotion:
    """Return the support's twist and its derivative, the exact form of (10), from the derivatives of its pose alone.

    The arguments are those of `fin_dynamics`.
    """
    rotation_in_body, position_in_body = support_pose(parameters, side, rod_motion)
    body_rotation, body_position = body_pose(body_twist, body_acceleration)
    rotation = body_rotation @ rotation_in_body
    position = body_position + body_rotation @ position_in_body
    back, back_dot = rotation.value.T, rotation.first.T
    twist = np.concatenate([back @ position.first, _vee(back @ rotation.first)])
    acceleration = np.concatenate([back_dot @ position.first + back @ position.second,
                                   _vee(back_dot @ rotation.first + back @ rotation.second)])
    return SupportMotion(rotation_in_body.value, position_in_body.value, twist, acceleration)


def _add_fin(model: pinocchio.Model, parent: int, placement: pinocchio.SE3, parameters: Parameters, side: int) -> None:
    """Add a fin's chains to joint `parent`, in whose frame F_0 is at `placement`; frames mark midpoints and tips."""
    fin, outward = parameters.fin, OUTWARD[side]
    width, length = parameters.rods.support_length / fin.chains, fin.span / fin.links
    mass = fin.density * fin.thickness * length * width
    along, middle = np.array([0.0, outward * length, 0.0]), np.array([0.0, 0.5 * outward * length, 0.0])
    rod = pinocchio.Inertia(mass, middle, np.diag([1.0, 0.0, 1.0]) * mass * length**2 / 12.0)
    hinge = pinocchio.JointModelRX() if side == 0 else pinocchio.JointModelRevoluteUnaligned(-1.0, 0.0, 0.0)
    for k in range(fin.chains):
        root = np.array([parameters.rods.support_length - (k + 0.5) * width, 0.0, 0.0])
        joint, origin = parent, placement * pinocchio.SE3(np.eye(3), root)
        for j in range(fin.links):
            name = f'{side}_{k}_{j}'
            joint = model.addJoint(joint, hinge, origin, f'joint_{name}')
            model.appendBodyToJoint(joint, rod, pinocchio.SE3.Identity())
            for mark, point in ('midpoint', middle), ('tip', along):
                model.addFrame(pinocchio.Frame(f'{mark}_{name}', joint, pinocchio.SE3(np.eye(3), point),
                                               pinocchio.FrameType.OP_FRAME))
            origin = pinocchio.SE3(np.eye(3), along)


def fin_tree(parameters: Parameters, side: int = 0) -> pinocchio.Model:
    """Return one fin with 6 + n m degrees of freedom.

    F_0 is a massless free-flyer, and joint j of chain k has the index 6 + k m + j. The chains are placed along x_0 by
    the midpoint rule. The links are uniform thin rods; each has its chain's share ds of the chord, so its mass is
    rho_f h dl ds [kg]. There is no gravity. Each link has the frames `midpoint_{side}_{k}_{j}` and
    `tip_{side}_{k}_{j}`.
    """
    model = pinocchio.Model()
    model.gravity.setZero()
    root = model.addJoint(0, pinocchio.JointModelFreeFlyer(), pinocchio.SE3.Identity(), 'support')
    _add_fin(model, root, pinocchio.SE3.Identity(), parameters, side)
    return model


def swimmer_tree(parameters: Parameters) -> pinocchio.Model:
    """Return the whole robot with 6 + 2 n m degrees of freedom.

    The body is a free-flyer at its center of mass; the left fin and then the right fin follow. The supports are fixed
    to the body where rods at zero angle hold them. There is neither gravity nor water.
    """
    model = pinocchio.Model()
    model.gravity.setZero()
    root = model.addJoint(0, pinocchio.JointModelFreeFlyer(), pinocchio.SE3.Identity(), 'body')
    body = pinocchio.Inertia(parameters.body.mass, np.zeros(3), np.diag(parameters.body.inertia))
    model.appendBodyToJoint(root, body, pinocchio.SE3.Identity())
    for side in 0, 1:
        rotation, position = support_pose(parameters, side, np.zeros((2, 3)))
        _add_fin(model, root, pinocchio.SE3(rotation.value, position.value), parameters, side)
    return model


def link_normals(roots: NDArray, tips: NDArray) -> NDArray:
    """Return the unit normals of the links (n, m, 3), (11), from their ends (n, m, 3) [m], in the same frame."""
    ends = roots + tips
    tangents = np.empty_like(ends)
    tangents[1:-1] = ends[:-2] - ends[2:]
    tangents[0] = ends[0] - ends[1]
    tangents[-1] = ends[-2] - ends[-1]
    normals = np.cross(tangents, tips - roots)
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def drag_forces(parameters: Parameters, roots: NDArray, tips: NDArray, velocities: NDArray) -> NDArray:
    """Return Morison's drag at each link's midpoint, (11) and (12), per unit chord (n, m, 3) [N/m].

    `roots` and `tips` (n, m, 3) [m] are the links' ends, and `velocities` (n, m, 3) [m/s] are those of the midpoints
    relative to the water. All are in one frame, which is also that of the result.
    """
    fin, normals = parameters.fin, link_normals(roots, tips)
    speeds = np.sum(velocities * normals, axis=-1, keepdims=True)
    area = fin.span / fin.links  # per unit chord
    return -0.5 * parameters.water.density * fin.drag_coefficient * area * np.abs(speeds) * speeds * normals


def added_mass(parameters: Parameters) -> float:
    """Return the added mass m_a of a link along its normal, per unit chord [kg/m]."""
    water, fin, chord = parameters.water, parameters.fin, parameters.rods.support_length
    return water.added_mass_coefficient * water.added_mass_density * np.pi * (chord / 2.0)**2 / chord * (
        fin.span / fin.links)


def added_mass_forces(parameters: Parameters, roots: NDArray, tips: NDArray, accelerations: NDArray) -> NDArray:
    """Return Morison's inertia term at each link's midpoint, per unit chord (n, m, 3) [N/m].

    The arguments are those of `drag_forces`, but with the midpoints' `accelerations` (n, m, 3) [m/s^2] relative to the
    inertial frame. They are the same relative to water in uniform motion.
    """
    normals = link_normals(roots, tips)
    return -added_mass(parameters) * np.sum(accelerations * normals, axis=-1, keepdims=True) * normals


def joint_torques(parameters: Parameters, joint_angles: NDArray, joint_rates: NDArray) -> NDArray:
    """Return the elastic and damping torque of each joint, (13) to (15), per unit chord (n, m) [N]."""
    fin = parameters.fin
    bending_stiffness = fin.youngs_modulus * fin.thickness**3 / 12.0
    slope = np.tan(0.5 * joint_angles)
    elastic = -2.0 * bending_stiffness * fin.links / fin.span * slope * (1.0 + slope**2)
    return elastic - fin.joint_damping * joint_rates


def _accelerations(model: pinocchio.Model, data: pinocchio.Data, marks: NDArray) -> NDArray:
    """Return the accelerations (n, m, 3) [m/s^2] of the frames `marks` (n, m), after forwardKinematics."""
    accelerations = np.empty((*marks.shape, 3))
    for k, j in np.ndindex(marks.shape):
        accelerations[k, j] = pinocchio.getFrameClassicalAcceleration(
            model, data, int(marks[k, j]), pinocchio.LOCAL_WORLD_ALIGNED).linear
    return accelerations


def _on_joints(model: pinocchio.Model, data: pinocchio.Data, marks: NDArray, points: NDArray,
               forces: NDArray) -> pinocchio.StdVec_Force:
    """Return forces (n, m, 3) [N] at points (n, m, 3) [m] of the links with the frames `marks`, in the form of rnea."""
    external = pinocchio.StdVec_Force([pinocchio.Force.Zero() for _ in range(model.njoints)])
    for k, j in np.ndindex(marks.shape):
        joint = int(model.frames[int(marks[k, j])].parentJoint)
        wrench = pinocchio.Force(forces[k, j], np.cross(points[k, j], forces[k, j]))
        external[joint] = data.oMi[joint].actInv(wrench)
    return external


def fin_dynamics(parameters: Parameters, side: int, rod_motion: ArrayLike, joint_angles: ArrayLike,
                 joint_rates: ArrayLike, body_twist: ArrayLike, body_acceleration: ArrayLike,
                 water_velocity: ArrayLike = (0.0, 0.0, 0.0)) -> tuple[NDArray, NDArray]:
    """Return the joint accelerations (n, m) [rad/s^2] and the fin's wrench on the body (6,) [N, N m].

    `side` 0 left, 1 right; `rod_motion` (2, 3): rows front, rear, columns angle, rate, acceleration [rad, s];
    `joint_angles`, `joint_rates` (n, m) [rad, rad/s]; `body_twist`, `body_acceleration` (6,) in F_b, with the linear
    part first. The acceleration is the derivative of the twist's components, the spatial acceleration that Pinocchio
    uses for a free-flyer. `water_velocity` (3,) [m/s] is relative to the ground, in F_b. The wrench is about the center
    of mass, in F_b.

    The motion of the base is prescribed. The joints' rows of the equations of motion give the joint accelerations, and
    the base's rows then give the wrench that the support must exert. The added mass enters the joints' rows as
    G^T m_a G, where G is the Jacobian of the midpoints' speeds along their normals, and the base's rows as its forces.
    Pinocchio's workspace takes about 32 (6 + n m)^3 bytes: keep n m below 300.
    """
    fin, width = parameters.fin, parameters.rods.support_length / parameters.fin.chains
    angles, rates = (np.asarray(x, dtype=float).reshape(fin.chains, fin.links) for x in (joint_angles, joint_rates))
    support = support_motion(parameters, side, rod_motion, body_twist, body_acceleration)
    model = fin_tree(parameters, side)
    data = model.createData()
    q = np.concatenate([pinocchio.neutral(model)[:7], angles.ravel()])  # the world frame is F_0 at this instant
    v = np.concatenate([support.twist, rates.ravel()])

    a = np.concatenate([support.acceleration, np.zeros(fin.chains * fin.links)])

    pinocchio.forwardKinematics(model, data, q, v, a)
    pinocchio.updateFramePlacements(model, data)
    pinocchio.computeJointJacobians(model, data, q)
    roots, tips, midpoints, velocities = np.empty((4, fin.chains, fin.links, 3))
    jacobians = np.empty((fin.chains, fin.links, 3, model.nv))
    marks = np.empty((fin.chains, fin.links), dtype=int)
    for k, j in np.ndindex(fin.chains, fin.links):
        tip, marks[k, j] = (model.getFrameId(f'{mark}_{side}_{k}_{j}') for mark in ('tip', 'midpoint'))
        midpoint = int(marks[k, j])
        roots[k, j] = data.oMi[model.frames[tip].parentJoint].translation
        tips[k, j], midpoints[k, j] = data.oMf[tip].translation, data.oMf[midpoint].translation
        velocities[k, j] = pinocchio.getFrameVelocity(model, data, midpoint, pinocchio.LOCAL_WORLD_ALIGNED).linear
        jacobians[k, j] = pinocchio.getFrameJacobian(model, data, midpoint, pinocchio.LOCAL_WORLD_ALIGNED)[:3]
    velocities -= support.rotation.T @ np.asarray(water_velocity, dtype=float)

    forces = drag_forces(parameters, roots, tips, velocities) * width
    torques = joint_torques(parameters, angles, rates).ravel() * width
    bias_forces = added_mass_forces(parameters, roots, tips, _accelerations(model, data, marks)) * width
    bias = pinocchio.rnea(model, data, q, v, a, _on_joints(model, data, marks, midpoints, forces + bias_forces))
    bias = bias[6:].copy()
    inertia = pinocchio.crba(model, data, q)
    inertia = np.triu(inertia) + np.triu(inertia, 1).T
    along_normals = np.einsum('kjx,kjxv->kjv', link_normals(roots, tips), jacobians).reshape(-1, model.nv)
    inertia += added_mass(parameters) * width * along_normals.T @ along_normals
    a[6:] = np.linalg.solve(inertia[6:, 6:], torques - bias)

    pinocchio.forwardKinematics(model, data, q, v, a)
    forces += added_mass_forces(parameters, roots, tips, _accelerations(model, data, marks)) * width
    on_support = -pinocchio.rnea(model, data, q, v, a, _on_joints(model, data, marks, midpoints, forces))[:6]
    on_body = pinocchio.SE3(support.rotation, support.position).act(pinocchio.Force(on_support))
    return a[6:].reshape(fin.chains, fin.links), on_body.vector.copy()


def fin_points(
    parameters: Parameters, side: int, state: tuple[NDArray, ...], joint_accelerations: NDArray, part: float,
) -> Jet:
    """Return the points at `part` (0 root, 1 tip) of every link as a jet (n, m, 3) [m], in the frame of `body_pose`."""
    fin, (rod_motion, joint_angles, joint_rates, body_twist, body_acceleration) = parameters.fin, state
    directions = Jet(*(np.cumsum(x, axis=1) for x in (joint_angles, joint_rates, joint_accelerations)))
    sine, cosine = np.sin(directions.value), np.cos(directions.value)
    length = constant(fin.span / fin.links)
    out = constant(OUTWARD[side]) * length * directions.through(cosine, -sine, -cosine)
    up = length * directions.through(sine, cosine, -sine)
    y, z = (Jet(*(np.cumsum(x, axis=1) - (1.0 - part) * x for x in (step.value, step.first, step.second)))
            for step in (out, up))
    width = parameters.rods.support_length / fin.chains
    chords = parameters.rods.support_length - (np.arange(fin.chains) + 0.5) * width
    x = constant(np.repeat(chords, fin.links))
    points = Jet(*(np.stack([getattr(c, name).ravel() for c in (x, y, z)]) for name in ('value', 'first', 'second')))
    for rotation, position in support_pose(parameters, side, rod_motion), body_pose(body_twist, body_acceleration):
        points = rotation @ points + Jet(*(d[:, None] for d in (position.value, position.first, position.second)))
    return Jet(*(d.T.reshape(fin.chains, fin.links, 3) for d in (points.value, points.first, points.second)))


def momentum(tree: pinocchio.Model, state: State) -> NDArray:
    """Return the linear and angular momentum (6,) [N s, N m s] of a `swimmer_tree` about the world's origin.

    The components are those in the world frame.
    """
    q = np.concatenate([state.position, state.orientation, state.joint_angles.ravel()])
    v = np.concatenate([state.twist, state.joint_rates.ravel()])
    data = tree.createData()
    about_center = pinocchio.computeCentroidalMomentum(tree, data, q, v)
    return np.concatenate([
        about_center.linear, about_center.angular + np.cross(data.com[0], about_center.linear)])

"""The fins and the whole robot as Pinocchio trees: a reference that does not use the paper's recursion.

Pinocchio solves the tree. The motion of the support and the forces on the links come from `mechanism`.
"""

from __future__ import annotations

import numpy as np
import pinocchio
from numpy.typing import ArrayLike

from evidence.references.mechanism import (
    OUTWARD,
    added_mass,
    added_mass_forces,
    drag_forces,
    joint_torques,
    link_normals,
    support_motion,
    support_pose,
)
from manta_sim_ros.dynamics import FloatArray, Parameters, State


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


def _accelerations(model: pinocchio.Model, data: pinocchio.Data, marks: FloatArray) -> FloatArray:
    """Return the accelerations (n, m, 3) [m/s^2] of the frames `marks` (n, m), after forwardKinematics."""
    accelerations = np.empty((*marks.shape, 3))
    for k, j in np.ndindex(marks.shape):
        accelerations[k, j] = pinocchio.getFrameClassicalAcceleration(
            model, data, int(marks[k, j]), pinocchio.LOCAL_WORLD_ALIGNED).linear
    return accelerations


def _on_joints(model: pinocchio.Model, data: pinocchio.Data, marks: FloatArray, points: FloatArray,
               forces: FloatArray) -> pinocchio.StdVec_Force:
    """Return forces (n, m, 3) [N] at points (n, m, 3) [m] of the links with the frames `marks`, in the form of rnea."""
    external = pinocchio.StdVec_Force([pinocchio.Force.Zero() for _ in range(model.njoints)])
    for k, j in np.ndindex(marks.shape):
        joint = int(model.frames[int(marks[k, j])].parentJoint)
        wrench = pinocchio.Force(forces[k, j], np.cross(points[k, j], forces[k, j]))
        external[joint] = data.oMi[joint].actInv(wrench)
    return external


def fin_dynamics(parameters: Parameters, side: int, rod_motion: ArrayLike, joint_angles: ArrayLike,
                 joint_rates: ArrayLike, body_twist: ArrayLike, body_acceleration: ArrayLike,
                 water_velocity: ArrayLike = (0.0, 0.0, 0.0)) -> tuple[FloatArray, FloatArray]:
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


def momentum(tree: pinocchio.Model, state: State) -> FloatArray:
    """Return the linear and angular momentum (6,) [N s, N m s] of a `swimmer_tree` about the world's origin.

    The components are those in the world frame.
    """
    q = np.concatenate([state.position, state.orientation, state.joint_angles.ravel()])
    v = np.concatenate([state.twist, state.joint_rates.ravel()])
    data = tree.createData()
    about_center = pinocchio.computeCentroidalMomentum(tree, data, q, v)
    return np.concatenate([
        about_center.linear, about_center.angular + np.cross(data.com[0], about_center.linear)])

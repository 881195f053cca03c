"""The reference equations: those of the paper in plain NumPy, a slow implementation to verify the simulator against.

It takes one chain at a time, with 6 x 6 matrices and without closed forms. Equation numbers are those of Qu et al.,
J. Mar. Sci. Eng. 2024, 12, 292. Twists are (V, Omega) and wrenches are (F, M), with the linear part first and with
components in the frame that the name or the docstring gives. eta_dot is the derivative of eta's components. Frames: F_b
is the body's, F_l is at the motor of the rear rod and parallel to F_b, F_0 is on the support with its origin at A, and
F_j is on link j with its origin at the root O_j and its y axis along the link.

Everything is written for the left fin. The right fin is the left fin mirrored at the plane y = 0.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from manta_sim_ros.dynamics import FloatArray, Parameters

X, Y, Z = np.eye(3)
JOINT_AXIS = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0])  # A_j of (16): every joint turns about x
MIRROR = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])  # of a twist or a wrench: the polar part, then the axial part
STILL_WATER = np.zeros(3)  # [m/s]
LEFT, RIGHT = 0, 1
NO_WRENCH = np.zeros(6)
FRONT, REAR = 0, 1

RodMotion = Callable[[int, float], FloatArray]


@dataclasses.dataclass(frozen=True)
class ReferenceState:
    """The robot's state at one time; n chains of m links a fin, fin 0 left and 1 right.

    `time` [s]; `position` (3,) [m] and `orientation` (4,) xyzw of F_b in the world; `twist` (6,) [m/s, rad/s] and
    `acceleration` (6,), its derivative, in F_b; `joint_angles` (2, n, m) [rad] and `joint_rates` (2, n, m) [rad/s],
    positive with the tip up; `fin_wrenches` (2, 6) [N, N m] in F_b about the center of mass.
    """

    time: float
    position: FloatArray
    orientation: FloatArray
    twist: FloatArray
    acceleration: FloatArray
    joint_angles: FloatArray
    joint_rates: FloatArray
    fin_wrenches: FloatArray


def _hat(v: FloatArray) -> FloatArray:
    """Return the matrix of v x ..., the hat of (4)."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def _Ad(rotation: FloatArray, position: FloatArray) -> FloatArray:
    """Return Ad of the transform (rotation, position), (2)."""
    return np.block([[rotation, _hat(position) @ rotation], [np.zeros((3, 3)), rotation]])


def _ad(twist: FloatArray) -> FloatArray:
    """Return ad of a twist, (4)."""
    return np.block([[_hat(twist[3:]), _hat(twist[:3])], [np.zeros((3, 3)), _hat(twist[3:])]])


def _rotation_x(angle: float) -> FloatArray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def _rotation_y(angle: float) -> FloatArray:
    """Return the second matrix of (9)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def _rotation_z(angle: float) -> FloatArray:
    """Return the first matrix of (9)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _rod_end(radius: float, rod: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return position (7), velocity and acceleration (3,) [m, s] of a rod's end in F_l, without the sliding along x.

    `rod` (3,) is angle, rate and acceleration [rad, s].
    """
    angle, rate, acceleration = rod
    position = radius * np.array([0.0, np.cos(angle), np.sin(angle)])
    velocity = rate * np.cross(X, position)
    return position, velocity, acceleration * np.cross(X, position) + rate * np.cross(X, velocity)


def _support_angles(
    length: float, gap: FloatArray, gap_dot: FloatArray, gap_ddot: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return beta and theta of (9), each as (angle, first derivative, second derivative).

    `gap` (3,) [m] is B - A in F_l. Its y and z determine the two angles, because |AB| is the support's length L at all
    times: L sin(beta) = -gap_z and L cos(beta) sin(theta) = gap_y. Both equations are differentiated twice.
    """
    beta = np.arcsin(-gap[2] / length)
    sin_beta, cos_beta = np.sin(beta), np.cos(beta)
    beta_dot = -gap_dot[2] / (length * cos_beta)
    beta_ddot = (-gap_ddot[2] / length + sin_beta * beta_dot**2) / cos_beta

    theta = np.arcsin(gap[1] / (length * cos_beta))
    sin_theta, cos_theta = np.sin(theta), np.cos(theta)
    theta_dot = (gap_dot[1] / length + sin_theta * sin_beta * beta_dot) / (cos_theta * cos_beta)
    theta_ddot = (
        gap_ddot[1] / length
        + sin_theta * cos_beta * (theta_dot**2 + beta_dot**2)
        + 2.0 * cos_theta * sin_beta * theta_dot * beta_dot
        + sin_theta * sin_beta * beta_ddot
    ) / (cos_theta * cos_beta)
    return np.array([beta, beta_dot, beta_ddot]), np.array([theta, theta_dot, theta_ddot])


def support_motion(
    parameters: Parameters, rod_motion: FloatArray, body_twist: FloatArray, body_acceleration: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the motion of the left support AB, (6) to (10).

    `rod_motion` (2, 3): rows front, rear; columns angle [rad], rate [rad/s], acceleration [rad/s^2]. `body_twist` and
    `body_acceleration` (6,): eta_b and eta_b_dot in F_b.

    Returns the rotation lR0 (3, 3) from F_0 to F_b, the position of A (3,) [m] in F_b, and the twist eta_0 (6,) of F_0
    at A and its derivative eta_0_dot (6,), both in F_0.

    V_0_dot is the derivative of V_0's components; the printed (10) lacks the velocity products and a rotation.
    """
    rods = parameters.rods
    motor = np.array(rods.rear_motor_position)
    P_0, P_0_dot, P_0_ddot = _rod_end(rods.rear_radius, rod_motion[REAR])
    P_B, P_B_dot, P_B_ddot = _rod_end(rods.front_radius, rod_motion[FRONT])
    (beta, beta_dot, beta_ddot), (theta, theta_dot, theta_ddot) = _support_angles(
        rods.support_length, P_B - P_0, P_B_dot - P_0_dot, P_B_ddot - P_0_ddot)

    # (6)
    V_b, Omega_b = body_twist[:3], body_twist[3:]
    V_b_dot, Omega_b_dot = body_acceleration[:3], body_acceleration[3:]
    V_l = V_b + np.cross(Omega_b, motor)
    V_l_dot = V_b_dot + np.cross(Omega_b_dot, motor)
    Omega_l, Omega_l_dot = Omega_b, Omega_b_dot

    # (8), (9); F_0bar is F_l rotated by theta
    R_l_0bar = _rotation_z(theta)
    R_0bar_0 = _rotation_y(beta)
    R_l_0 = R_l_0bar @ R_0bar_0
    R_0_l, R_0_0bar, R_0bar_l = R_l_0.T, R_0bar_0.T, R_l_0bar.T

    # (10)
    V_0 = R_0_l @ (V_l + np.cross(Omega_l, P_0) + P_0_dot)
    Omega_0 = R_0_l @ Omega_l + R_0_0bar @ (theta_dot * Z) + beta_dot * Y
    acceleration_of_A = (
        V_l_dot + np.cross(Omega_l, V_l)
        + np.cross(Omega_l_dot, P_0) + np.cross(Omega_l, np.cross(Omega_l, P_0))
        + 2.0 * np.cross(Omega_l, P_0_dot) + P_0_ddot
    )
    V_0_dot = R_0_l @ acceleration_of_A - np.cross(Omega_0, V_0)
    Omega_0bar = R_0bar_l @ Omega_l + theta_dot * Z
    Omega_0_dot = (
        R_0_l @ Omega_l_dot
        + R_0_0bar @ np.cross(Omega_0bar, theta_dot * Z) + R_0_0bar @ (theta_ddot * Z)
        + np.cross(Omega_0, beta_dot * Y) + beta_ddot * Y
    )
    return R_l_0, motor + P_0, np.hstack([V_0, Omega_0]), np.hstack([V_0_dot, Omega_0_dot])


def _link_length(parameters: Parameters) -> float:
    return parameters.fin.span / parameters.fin.links


def _chord_positions(parameters: Parameters) -> FloatArray:
    """Return s (n,) [m] of each chain along x_0 from A, leading edge first: the midpoint rule of (33)."""
    length, chains = parameters.rods.support_length, parameters.fin.chains
    return length - (np.arange(chains) + 0.5) * length / chains


def _bending_stiffness(parameters: Parameters) -> float:
    """Return EI [N m], per unit chord."""
    return parameters.fin.youngs_modulus * parameters.fin.thickness**3 / 12.0


def elastic_energy(parameters: Parameters, joint_angles: FloatArray) -> FloatArray:
    """Return E_j [J/m], per unit chord, of each joint angle [rad], in the shape of `joint_angles`, (13)."""
    link_length = _link_length(parameters)
    curvature = 2.0 * np.tan(joint_angles / 2.0) / link_length
    return 0.5 * _bending_stiffness(parameters) * curvature**2 * link_length


def elastic_torque(parameters: Parameters, joint_angles: FloatArray) -> FloatArray:
    """Return tau_{j,e} [N], a torque per unit chord, of each joint angle [rad]: minus the derivative of (13), (14)."""
    tangent = np.tan(joint_angles / 2.0)
    return -2.0 * _bending_stiffness(parameters) / _link_length(parameters) * tangent * (1.0 + tangent**2)


def _damping_torque(parameters: Parameters, joint_rates: FloatArray) -> FloatArray:
    """Return tau_{j,d} [N], a torque per unit chord, (15)."""
    return -parameters.fin.joint_damping * joint_rates


def _twist_gradient(parameters: Parameters, coefficient: float, joints: FloatArray) -> FloatArray:
    """Return the gradient (n, m), by `joints` (n, m), of the energy of the twist of a fin, or of its damping.

    With Theta_kj = q_k1 + ... + q_kj the angle of a link to y_0, it is that of
    coefficient / 2 sum_j sum_k (Theta_kj - Theta_k+1,j)^2 dl / ds, term by term.
    """
    (chains, links), ds = joints.shape, parameters.rods.support_length / parameters.fin.chains
    gradient = np.zeros((chains, links))
    for j in range(links):
        for k in range(chains - 1):
            difference = np.sum(joints[k, :j + 1]) - np.sum(joints[k + 1, :j + 1])
            for i in range(j + 1):  # the joints on which Theta_kj depends
                gradient[k, i] += coefficient * difference * _link_length(parameters) / ds
                gradient[k + 1, i] -= coefficient * difference * _link_length(parameters) / ds
    return gradient


def twist_energy(parameters: Parameters, joint_angles: FloatArray) -> float:
    """Return the energy [J] of the twist of a fin along its chord, `joint_angles` (n, m) [rad] (Saint-Venant).

    The links of one row are a strip of the width dl, which resists twist with G h^3 dl / 3. It is not of the paper.
    """
    fin, ds = parameters.fin, parameters.rods.support_length / parameters.fin.chains
    angles = np.cumsum(joint_angles, axis=1)
    squares = sum((angles[k, j] - angles[k + 1, j])**2 for k in range(fin.chains - 1) for j in range(fin.links))
    return 0.5 * fin.shear_modulus * fin.thickness**3 / 3.0 * squares * _link_length(parameters) / ds


def twist_torques(parameters: Parameters, joint_angles: FloatArray, joint_rates: FloatArray) -> FloatArray:
    """Return the torques (n, m) [N], per unit chord, of the stiffness and the damping of the twist of a fin.

    Those of the stiffness are minus the derivative of `twist_energy`. Those of the damping are the same with the rates
    in the place of the angles, and c_t in that of G h^3 / 3.
    """
    fin, ds = parameters.fin, parameters.rods.support_length / parameters.fin.chains
    elastic = _twist_gradient(parameters, fin.shear_modulus * fin.thickness**3 / 3.0, joint_angles)
    damping = _twist_gradient(parameters, fin.twist_damping, joint_rates)
    return -(elastic + damping) / ds


def _center_of_mass(parameters: Parameters) -> FloatArray:
    """Return Cm_j (3,) [m], the middle of a link, in F_j."""
    return 0.5 * _link_length(parameters) * Y


def _link_inertia(parameters: Parameters) -> FloatArray:
    """Return M_j of (18), (6, 6) per unit chord, in F_j about its origin: a uniform thin rod along y."""
    fin, link_length = parameters.fin, _link_length(parameters)
    mass = fin.density * fin.thickness * link_length
    center = _hat(_center_of_mass(parameters))
    inertia_at_center = mass * link_length**2 / 12.0 * np.diag([1.0, 0.0, 1.0])
    return np.block([
        [mass * np.eye(3), -mass * center],
        [mass * center, inertia_at_center - mass * center @ center],
    ])


def _gyroscopic_wrench(inertia: FloatArray, twist: FloatArray) -> FloatArray:
    """Return beta_j of (18) (6,): the Coriolis and centrifugal wrench in F_j."""
    return -_ad(twist).T @ inertia @ twist


def _link_transforms(parameters: Parameters, joint_angles: FloatArray) -> list[FloatArray]:
    """Return Ad of jg_{j-1}, j = 1 to m, of one chain with `joint_angles` (m,): from F_{j-1}'s twists to F_j's.

    For j = 1, F_{j-1} is the support's frame at the chain, whose origin is O_1.
    """
    transforms = []
    for j, angle in enumerate(joint_angles):
        rotation = _rotation_x(angle).T
        origin_in_parent = _link_length(parameters) * Y if j > 0 else np.zeros(3)
        transforms.append(_Ad(rotation, -rotation @ origin_in_parent))
    return transforms


def _transform(transforms: list[FloatArray], j: int, i: int) -> FloatArray:
    """Return Ad of jg_i, i <= j, as the product over the links between them; i = -1 is the support."""
    product = np.eye(6)
    for between in range(i + 1, j + 1):
        product = transforms[between] @ product
    return product


def _composite_inertias(inertias: list[FloatArray], transforms: list[FloatArray]) -> list[FloatArray]:
    """Return M*_j of (26), from tip to root, of links with `inertias` M_j."""
    composite = list(inertias)
    for j in reversed(range(len(transforms) - 1)):
        composite[j] = composite[j] + transforms[j + 1].T @ composite[j + 1] @ transforms[j + 1]
    return composite


def _mass_matrix(transforms: list[FloatArray], composite: list[FloatArray]) -> FloatArray:
    """Return M of (30)."""
    links = len(transforms)
    matrix = np.empty((links, links))
    for j in range(links):
        for i in range(j + 1):
            matrix[j, i] = JOINT_AXIS @ composite[j] @ _transform(transforms, j, i) @ JOINT_AXIS
        for i in range(j + 1, links):
            matrix[j, i] = JOINT_AXIS @ _transform(transforms, i, j).T @ composite[i] @ JOINT_AXIS
    return matrix


def mass_matrix(parameters: Parameters, joint_angles: FloatArray) -> FloatArray:
    """Return M (m, m) [kg m], per unit chord, of one chain with `joint_angles` (m,) [rad], (30), without added mass."""
    transforms = _link_transforms(parameters, joint_angles)
    return _mass_matrix(transforms, _composite_inertias([_link_inertia(parameters)] * len(transforms), transforms))


def _link_twists(transforms: list[FloatArray], joint_rates: FloatArray, base_twist: FloatArray) -> list[FloatArray]:
    """Return eta_j of each link in F_j, (16); `base_twist` is that of the support at the chain, in F_0."""
    twists, twist = [], base_twist
    for transform, rate in zip(transforms, joint_rates, strict=True):
        twist = transform @ twist + JOINT_AXIS * rate
        twists.append(twist)
    return twists


def _nodes(parameters: Parameters, joint_angles: FloatArray) -> FloatArray:
    """Return O_1 to O_m and the tip of each chain (n, m + 1, 3) [m], in F_0 from A."""
    chains, links = joint_angles.shape
    nodes = np.empty((chains, links + 1, 3))
    nodes[:, 0] = np.outer(_chord_positions(parameters), X)
    for k in range(chains):
        for j in range(links):
            direction = _rotation_x(np.sum(joint_angles[k, :j + 1])) @ Y
            nodes[k, j + 1] = nodes[k, j] + _link_length(parameters) * direction
    return nodes


def link_normals(parameters: Parameters, joint_angles: FloatArray) -> FloatArray:
    """Return the unit normal n_j (n, m, 3) of each link, in F_0, of a fin with `joint_angles` (n, m) [rad], (11).

    The chordwise tangent points toward the leading edge. It is the sum of the tangents at the link's root and at its
    tip: each is taken between the two neighboring chains inside the fin, and between the chain and its only neighbor at
    the edges.
    """
    nodes = _nodes(parameters, joint_angles)
    chains, links = joint_angles.shape
    normals = np.empty((chains, links, 3))
    for k in range(chains):
        ahead, behind = max(k - 1, 0), min(k + 1, chains - 1)
        for j in range(links):
            tangent = (nodes[ahead, j] - nodes[behind, j]) + (nodes[ahead, j + 1] - nodes[behind, j + 1])
            normal = np.cross(tangent, nodes[k, j + 1] - nodes[k, j])
            normals[k, j] = normal / np.linalg.norm(normal)
    return normals


def _drag_wrench(
    parameters: Parameters, twist: FloatArray, normal: FloatArray, water_velocity: FloatArray,
) -> FloatArray:
    """Return the wrench (6,) of the water on a link, per unit chord, (12) in (19). All are in F_j, about O_j."""
    center = _center_of_mass(parameters)
    velocity = twist[:3] + np.cross(twist[3:], center) - water_velocity
    speed = velocity @ normal
    area = _link_length(parameters)
    force = -0.5 * parameters.water.density * parameters.fin.drag_coefficient * area * abs(speed) * speed * normal
    return np.hstack([force, np.cross(center, force)])


def _added_mass(parameters: Parameters) -> float:
    """Return m_a [kg/m], per unit chord: C_a times the mass of water in a cylinder on the chord, over L.

    The volume of the cylinder is (pi / 4) L^2 dl.
    """
    water, length = parameters.water, parameters.rods.support_length
    return water.added_mass_coefficient * water.added_mass_density * np.pi / 4.0 * length * _link_length(parameters)


def _added_inertia(parameters: Parameters, twist: FloatArray, normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the added mass of a link as an inertia (6, 6) and a bias (6,), per unit chord.

    The load on the midpoint c is -m_a n (n . a), Morison's inertia term, where a is the midpoint's acceleration in the
    inertial frame: V_dot + Omega x V + Omega_dot x c + Omega x (Omega x c). The part of a that is linear in eta_j_dot
    gives an inertia of rank one, and the rest gives a bias; (18) does not apply to it. `twist` and `normal` are in F_j,
    and so are the results, which are about O_j.
    """
    center, (V, Omega) = _center_of_mass(parameters), np.split(twist, 2)
    direction = np.hstack([normal, np.cross(center, normal)])
    velocity_products = np.cross(Omega, V) + np.cross(Omega, np.cross(Omega, center))
    mass = _added_mass(parameters)
    return mass * np.outer(direction, direction), mass * direction * (normal @ velocity_products)


def _chain_dynamics(
    parameters: Parameters, joint_angles: FloatArray, joint_rates: FloatArray, twist_torque: FloatArray,
    normals: FloatArray, base_twist: FloatArray, base_acceleration: FloatArray, water_velocity: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the joint accelerations (m,) and f_0 (6,), per unit chord, of one chain, (16) to (32).

    `normals` (m, 3), `base_twist`, `base_acceleration` (6,), `water_velocity` (3,) and f_0 are in the frame of the
    support at the chain. f_0 is the wrench of the chain on the support, about O_1. `twist_torque` (m,) [N] is that of
    the neighboring chains.

    The torque of a joint's spring and damper acts between two links: +tau_j on link j, and -tau_j on link j - 1 or on
    the support. So it is the component of f_j along the joint, A_j^T f_j = tau_j, and not an external wrench as in the
    printed (19). Q is then minus the gradient of the elastic energy, as (14) and (29) require.

    The added mass is not part of the paper. It is added to each link's M_j and beta_j.
    """
    links = len(joint_angles)
    transforms = _link_transforms(parameters, joint_angles)

    # forward: (16), zeta of (17), beta of (18), the external wrench (19)
    twists = _link_twists(transforms, joint_rates, base_twist)
    zeta = [_ad(twist) @ JOINT_AXIS * rate for twist, rate in zip(twists, joint_rates, strict=True)]
    inertias, beta, external = [], [], []
    for j in range(links):
        rotation = _transform(transforms, j, -1)[3:, 3:]
        inertia = _link_inertia(parameters)
        added_inertia, added_bias = _added_inertia(parameters, twists[j], rotation @ normals[j])
        inertias.append(inertia + added_inertia)
        beta.append(_gyroscopic_wrench(inertia, twists[j]) + added_bias)
        external.append(_drag_wrench(parameters, twists[j], rotation @ normals[j], rotation @ water_velocity))

    # backward: (26)
    composite = _composite_inertias(inertias, transforms)
    beta_star = [beta[j] - external[j] for j in range(links)]
    for j in reversed(range(links - 1)):
        beta_star[j] = beta_star[j] + transforms[j + 1].T @ (beta_star[j + 1] + composite[j + 1] @ zeta[j + 1])

    # (28) to (30)
    torque = elastic_torque(parameters, joint_angles) + _damping_torque(parameters, joint_rates) + twist_torque
    Q = np.empty(links)
    for j in range(links):
        bias = _transform(transforms, j, -1) @ base_acceleration
        for i in range(j + 1):
            bias = bias + _transform(transforms, j, i) @ zeta[i]
        Q[j] = torque[j] - JOINT_AXIS @ composite[j] @ bias - JOINT_AXIS @ beta_star[j]
    joint_accelerations = np.linalg.solve(_mass_matrix(transforms, composite), Q)

    # (17), (32), (31)
    first_acceleration = transforms[0] @ base_acceleration + zeta[0] + JOINT_AXIS * joint_accelerations[0]
    f_1 = composite[0] @ first_acceleration + beta_star[0]
    for i in range(1, links):
        f_1 = f_1 + _transform(transforms, i, 0).T @ composite[i] @ JOINT_AXIS * joint_accelerations[i]
    f_0 = -transforms[0].T @ f_1
    return joint_accelerations, f_0


def fin_dynamics(
    parameters: Parameters, side: int, rod_motion: FloatArray, joint_angles: FloatArray, joint_rates: FloatArray,
    body_twist: FloatArray, body_acceleration: FloatArray, water_velocity: FloatArray = STILL_WATER,
) -> tuple[FloatArray, FloatArray]:
    """Return the joint accelerations (n, m) [rad/s^2] and the wrench (6,) [N, N m] of one fin, (6) to (33).

    `side` 0 left, 1 right; `rod_motion` (2, 3) as in `support_motion`, positive with the tip up; `joint_angles` and
    `joint_rates` (n, m) [rad, rad/s], leading edge and root first; `body_twist` and `body_acceleration` (6,) in F_b;
    `water_velocity` (3,) [m/s] of the water over the ground, in F_b. The wrench is that of the fin on the body, in F_b
    about the center of mass. Neither the arguments nor the results are mirrored.
    """
    if side == RIGHT:
        joint_accelerations, wrench = fin_dynamics(
            parameters, LEFT, rod_motion, joint_angles, joint_rates,
            MIRROR * body_twist, MIRROR * body_acceleration, MIRROR[:3] * water_velocity)
        return joint_accelerations, MIRROR * wrench

    rotation, position, eta_0, eta_0_dot = support_motion(parameters, rod_motion, body_twist, body_acceleration)
    normals = link_normals(parameters, joint_angles)
    twist = twist_torques(parameters, joint_angles, joint_rates)
    ds = parameters.rods.support_length / parameters.fin.chains
    joint_accelerations = np.empty(joint_angles.shape)
    wrench = np.zeros(6)
    for k, s in enumerate(_chord_positions(parameters)):
        to_chain = _Ad(np.eye(3), -s * X)
        joint_accelerations[k], f_0 = _chain_dynamics(
            parameters, joint_angles[k], joint_rates[k], twist[k], normals[k],
            to_chain @ eta_0, to_chain @ eta_0_dot, rotation.T @ water_velocity)
        position_of_chain = position + rotation @ (s * X)
        from_body = _Ad(rotation.T, -rotation.T @ position_of_chain)  # Ad of the inverse of bg_0(s)
        wrench += from_body.T @ f_0 * ds  # (33)
    return joint_accelerations, wrench


def orientation_matrix(orientation: FloatArray) -> FloatArray:
    """Return the rotation (3, 3) from F_b to the world of a unit quaternion (4,) xyzw."""
    v, w = orientation[:3], orientation[3]
    return (w**2 - v @ v) * np.eye(3) + 2.0 * np.outer(v, v) + 2.0 * w * _hat(v)


def body_inertia(parameters: Parameters) -> tuple[FloatArray, FloatArray]:
    """Return the inertia M_RB of the body and its added mass M_A, both (6, 6), in F_b about the center of mass."""
    body = parameters.body
    return np.diag(np.hstack([np.full(3, body.mass), body.inertia])), np.diag(body.added_mass)


def _water_load(parameters: Parameters, twist: FloatArray, current: FloatArray, to_body: FloatArray) -> FloatArray:
    """Return the load (6,) of the water on the body in F_b beyond the paper, but for -M_A nu_dot (Fossen).

    With nu_r = nu - (v_c, 0), it is -C_A(nu_r) nu_r - D_l nu_r - D_q |nu_r| nu_r, and -M_A (Omega x v_c, 0), as the
    components of a steady current v_c (3,) change when the body turns; and the net buoyancy.
    """
    body, (_, M_A) = parameters.body, body_inertia(parameters)
    relative = twist - np.hstack([current, np.zeros(3)])
    p, h = np.split(M_A @ relative, 2)
    C_A = np.block([[np.zeros((3, 3)), -_hat(p)], [-_hat(p), -_hat(h)]])
    D = np.diag(body.linear_damping) + np.diag(body.quadratic_damping) @ np.diag(np.abs(relative))
    turning = np.hstack([np.cross(twist[3:], current), np.zeros(3)])
    lift = to_body @ (body.net_buoyancy * Z)
    return (
        -M_A @ turning - C_A @ relative - D @ relative
        + np.hstack([lift, np.cross(np.array(body.buoyancy_center), lift)]))


def body_acceleration(
    parameters: Parameters, orientation: FloatArray, twist: FloatArray, fin_wrench: FloatArray,
    body_wrench: FloatArray = NO_WRENCH, world_wrench: FloatArray = NO_WRENCH,
) -> FloatArray:
    """Return eta_b_dot (6,) [m/s^2, rad/s^2] in F_b, (34) to (37).

    `orientation` (4,) is xyzw, and `twist` (6,) is in F_b. All wrenches (6,) are about the center of mass: `fin_wrench`
    is the sum of both fins, in F_b; `body_wrench` and `world_wrench` are external wrenches, with components in F_b and
    in the world frame. The drag (34) is that of the velocity relative to the water. The added mass of the body, its
    damping beside that of the paper, and its net buoyancy are not of the paper.
    """
    body, water = parameters.body, parameters.water
    to_body = orientation_matrix(orientation).T
    V, Omega = twist[:3], twist[3:]
    J = np.diag(body.inertia)

    current = to_body @ np.array(water.current)
    velocity = V - current
    drag_area = np.diag(body.drag_area) @ np.diag(body.drag_coefficient)
    F_d = -0.5 * water.density * np.linalg.norm(velocity) * drag_area @ velocity
    M_d = -np.diag(body.angular_damping) @ Omega
    F_buo = body.mass * body.gravity * Z
    M_buo = np.cross(np.array(body.buoyancy_center), to_body @ F_buo)

    F = F_d + fin_wrench[:3] + body_wrench[:3] + to_body @ world_wrench[:3]
    M = M_d + M_buo + fin_wrench[3:] + body_wrench[3:] + to_body @ world_wrench[3:]
    bias = np.hstack([np.cross(Omega, body.mass * V), np.cross(Omega, J @ Omega)])
    M_RB, M_A = body_inertia(parameters)
    return np.linalg.solve(M_RB + M_A, np.hstack([F, M]) - bias + _water_load(parameters, twist, current, to_body))


def rest_state(parameters: Parameters) -> ReferenceState:
    """Return the robot at rest at the world's origin at time 0, with straight chains."""
    joints = np.zeros((2, parameters.fin.chains, parameters.fin.links))
    return ReferenceState(
        time=0.0, position=np.zeros(3), orientation=np.array([0.0, 0.0, 0.0, 1.0]), twist=np.zeros(6),
        acceleration=np.zeros(6), joint_angles=joints, joint_rates=joints, fin_wrenches=np.zeros((2, 6)))


def quaternion_dot(orientation: FloatArray, angular_velocity: FloatArray) -> FloatArray:
    """Return the time derivative (4,) of a quaternion xyzw: half its product with (Omega, 0), with Omega in F_b."""
    v, w = orientation[:3], orientation[3]
    return 0.5 * np.hstack([w * angular_velocity + np.cross(v, angular_velocity), -v @ angular_velocity])


def _step_fin(
    parameters: Parameters, state: ReferenceState, side: int, rod_motion: RodMotion,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return joint angles (n, m), joint rates (n, m) and wrench (6,) of one fin at the end of the step."""
    dt = parameters.solver.time_step
    water_velocity = orientation_matrix(state.orientation).T @ np.array(parameters.water.current)

    def dynamics(time: float, angles: FloatArray, rates: FloatArray) -> tuple[FloatArray, FloatArray]:
        return fin_dynamics(
            parameters, side, rod_motion(side, time), angles, rates, state.twist, state.acceleration, water_velocity)

    def slope(time: float, joints: FloatArray) -> FloatArray:
        angles, rates = joints
        return np.stack([rates, dynamics(time, angles, rates)[0]])

    t = state.time
    joints = np.stack([state.joint_angles[side], state.joint_rates[side]])
    k_1 = slope(t, joints)
    k_2 = slope(t + dt / 2.0, joints + dt / 2.0 * k_1)
    k_3 = slope(t + dt / 2.0, joints + dt / 2.0 * k_2)
    k_4 = slope(t + dt, joints + dt * k_3)
    angles, rates = joints + dt / 6.0 * (k_1 + 2.0 * k_2 + 2.0 * k_3 + k_4)
    return angles, rates, dynamics(t + dt, angles, rates)[1]


def step(
    parameters: Parameters, state: ReferenceState, rod_motion: RodMotion,
    body_wrench: FloatArray = NO_WRENCH, world_wrench: FloatArray = NO_WRENCH,
) -> ReferenceState:
    """Return the state one `solver.time_step` later, by the staggered coupling of Section 4 and Figure 6.

    `rod_motion(side, time)` gives each fin's rods (2, 3) as in `support_motion`. `body_wrench` and `world_wrench` are
    those of `body_acceleration`.

    The fins are advanced by the classical fourth-order Runge-Kutta method, with the body's motion and the water's
    velocity in F_b held at their values at t. Their wrench is that at t + dt, with the same motion of the body. The
    body is advanced by the forward Euler method, with (36) at t and that wrench; with `solver.fixed_base` it keeps its
    motion and its pose.
    """
    dt = parameters.solver.time_step
    of_fins = [_step_fin(parameters, state, side, rod_motion) for side in (LEFT, RIGHT)]
    angles, rates, wrenches = zip(*of_fins, strict=True)
    moved = dataclasses.replace(
        state, time=state.time + dt, joint_angles=np.stack(angles), joint_rates=np.stack(rates),
        fin_wrenches=np.stack(wrenches))
    if parameters.solver.fixed_base:
        return moved

    acceleration = body_acceleration(
        parameters, state.orientation, state.twist, np.sum(wrenches, axis=0), body_wrench, world_wrench)
    orientation = state.orientation + dt * quaternion_dot(state.orientation, state.twist[3:])
    return dataclasses.replace(
        moved,
        position=state.position + dt * orientation_matrix(state.orientation) @ state.twist[:3],
        orientation=orientation / np.linalg.norm(orientation),
        twist=state.twist + dt * acceleration,
        acceleration=acceleration)

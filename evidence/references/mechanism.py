"""The mechanism, the shape of the fins and the forces on them in plain NumPy, for references.

The motion of the support follows from the position of its mechanism alone, which is differentiated by exact
second-order arithmetic. The right fin is modeled directly, hinged about -x_0 with its chains along -y_0. It is not
mirrored from the left one, so the mirror rule of the model is verified too.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from manta_sim_ros.dynamics import FloatArray, Parameters

OUTWARD = (1.0, -1.0)  # the direction of each fin's chains along y_0: left, right


@dataclasses.dataclass(frozen=True)
class Jet:
    """A number, vector or matrix that depends on time: its value and its exact first and second time derivatives."""

    value: FloatArray
    first: FloatArray
    second: FloatArray

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


def _product(multiply: Callable[[FloatArray, FloatArray], FloatArray], a: Jet, b: Jet) -> Jet:
    return Jet(multiply(a.value, b.value), multiply(a.first, b.value) + multiply(a.value, b.first),
               multiply(a.second, b.value) + 2.0 * multiply(a.first, b.first) + multiply(a.value, b.second))


def _hat(v: ArrayLike) -> FloatArray:
    x, y, z = np.asarray(v, dtype=float)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _vee(matrix: FloatArray) -> FloatArray:
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

    rotation: FloatArray  # (3, 3)
    position: FloatArray  # (3,) [m]
    twist: FloatArray  # (6,) [m/s, rad/s]: eta_0
    acceleration: FloatArray  # (6,) [m/s^2, rad/s^2]: the derivative of eta_0's components


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


def link_normals(roots: FloatArray, tips: FloatArray) -> FloatArray:
    """Return the unit normals of the links (n, m, 3), (11), from their ends (n, m, 3) [m], in the same frame."""
    ends = roots + tips
    tangents = np.empty_like(ends)
    tangents[1:-1] = ends[:-2] - ends[2:]
    tangents[0] = ends[0] - ends[1]
    tangents[-1] = ends[-2] - ends[-1]
    normals = np.cross(tangents, tips - roots)
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def drag_forces(parameters: Parameters, roots: FloatArray, tips: FloatArray, velocities: FloatArray) -> FloatArray:
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


def added_mass_forces(
    parameters: Parameters, roots: FloatArray, tips: FloatArray, accelerations: FloatArray,
) -> FloatArray:
    """Return Morison's inertia term at each link's midpoint, per unit chord (n, m, 3) [N/m].

    The arguments are those of `drag_forces`, but with the midpoints' `accelerations` (n, m, 3) [m/s^2] relative to the
    inertial frame. They are the same relative to water in uniform motion.
    """
    normals = link_normals(roots, tips)
    return -added_mass(parameters) * np.sum(accelerations * normals, axis=-1, keepdims=True) * normals


def joint_torques(parameters: Parameters, joint_angles: FloatArray, joint_rates: FloatArray) -> FloatArray:
    """Return the torque of each joint, per unit chord (n, m) [N]: spring and damper, (13) to (15), and the twist."""
    fin = parameters.fin
    bending_stiffness = fin.youngs_modulus * fin.thickness**3 / 12.0
    slope = np.tan(0.5 * joint_angles)
    elastic = -2.0 * bending_stiffness * fin.links / fin.span * slope * (1.0 + slope**2)
    return elastic - fin.joint_damping * joint_rates + twist_torques(parameters, joint_angles, joint_rates)


def twist_torques(parameters: Parameters, joint_angles: FloatArray, joint_rates: FloatArray) -> FloatArray:
    """Return the torques of the twist of the fin along the chord, per unit chord (n, m) [N], from two matrices.

    A sums the joints of a chain to the links' angles, and B takes the differences of neighboring chains.
    """
    fin, width = parameters.fin, parameters.rods.support_length / parameters.fin.chains
    A, B = np.tri(fin.links), np.diff(np.eye(fin.chains), axis=0)
    twisted = fin.shear_modulus * fin.thickness**3 / 3.0 * joint_angles + fin.twist_damping * joint_rates
    return -(B.T @ B) @ twisted @ A.T @ A * (fin.span / fin.links) / width**2


def fin_points(
    parameters: Parameters, side: int, state: tuple[FloatArray, ...], joint_accelerations: FloatArray, part: float,
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

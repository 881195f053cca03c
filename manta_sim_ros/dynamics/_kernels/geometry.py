"""Three-vectors, rotations and quaternions, Section 2. Vectors are tuples of three floats."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from manta_sim_ros.dynamics._kernels.compilation import kernel
from manta_sim_ros.dynamics.quantity import FloatArray, Vector

Rotation = tuple[Vector, Vector, Vector]
"""A rotation matrix as its three rows."""


class Wrench(NamedTuple):
    """Force [N] and moment [N m]."""

    force: Vector
    moment: Vector


@kernel
def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product a x b, with a hat in (4) and (5)."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def dot(a: Vector, b: Vector) -> float:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def add(a: Vector, b: Vector) -> Vector:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@kernel
def subtract(a: Vector, b: Vector) -> Vector:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def rotate(rotation: Rotation, a: Vector) -> Vector:
    """Return R a."""
    x, y, z = rotation
    return (
        x[0] * a[0] + x[1] * a[1] + x[2] * a[2],
        y[0] * a[0] + y[1] * a[1] + y[2] * a[2],
        z[0] * a[0] + z[1] * a[1] + z[2] * a[2],
    )


@kernel
def rotate_back(rotation: Rotation, a: Vector) -> Vector:
    """Return R^T a."""
    x, y, z = rotation
    return (
        x[0] * a[0] + y[0] * a[1] + z[0] * a[2],
        x[1] * a[0] + y[1] * a[1] + z[1] * a[2],
        x[2] * a[0] + y[2] * a[1] + z[2] * a[2],
    )


@kernel
def vector_at(a: FloatArray, start: int) -> Vector:
    """Return three entries of an array as a vector."""
    return a[start], a[start + 1], a[start + 2]


@kernel
def rotation_of(quaternion: FloatArray) -> Rotation:
    """Return the rotation R of (1) of a unit quaternion (x, y, z, w): body to world components."""
    x, y, z, w = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)),
        (2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)),
        (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)),
    )


@kernel
def integrate_quaternion(quaternion: FloatArray, omega: Vector, time_step: float) -> None:
    """Advance a quaternion (x, y, z, w) in place by forward Euler, q-dot = q (Omega, 0) / 2, (5), and normalize it.

    `omega` is the angular velocity in the moving frame [rad/s].
    """
    x, y, z, w = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    half = 0.5 * time_step
    p, q, r = omega
    x_new = x + half * (w * p + y * r - z * q)
    y_new = y + half * (w * q + z * p - x * r)
    z_new = z + half * (w * r + x * q - y * p)
    w_new = w - half * (x * p + y * q + z * r)
    norm = sqrt(x_new * x_new + y_new * y_new + z_new * z_new + w_new * w_new)
    quaternion[0] = x_new / norm
    quaternion[1] = y_new / norm
    quaternion[2] = z_new / norm
    quaternion[3] = w_new / norm


@kernel
def mirror_polar(a: Vector, side: int) -> Vector:
    """Return a velocity, force or position as the left fin's code sees it, or back: mirrored at y = 0 on the right."""
    return (a[0], -a[1], a[2]) if side == 1 else a


@kernel
def mirror_axial(a: Vector, side: int) -> Vector:
    """Return an angular velocity or moment as the left fin's code sees it, or back: mirrored at y = 0 on the right."""
    return (-a[0], a[1], -a[2]) if side == 1 else a

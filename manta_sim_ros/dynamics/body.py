"""The rigid body, (34) to (37)."""

from __future__ import annotations

from math import sqrt

import numpy as np

from manta_sim_ros.dynamics.compilation import kernel
from manta_sim_ros.dynamics.geometry import Rotation, add, cross, rotate, rotate_back, rotation_rows, subtract
from manta_sim_ros.dynamics.parameters import Vector

BodyConstants = tuple[float, Vector, Vector, Vector, Vector, float]
"""Mass, inertia, rho S_B C_B / 2, C_M, r_b and m_b g."""

OutsideWrench = tuple[Vector, Vector, Vector, Vector]
"""Force [N] and moment [N m] from outside on the body about the centre of mass, in F_b, and such a pair in F_w."""

LEAST_PIVOT = 1e-300
"""Below it an inertia is not positive definite."""


@kernel
def body_load(
    body: BodyConstants, rotation: Rotation, velocity: Vector, omega: Vector, water_velocity: Vector,
) -> tuple[Vector, Vector]:
    """Return force [N] and moment [N m] in F_b of all in (36) but the fins and the acceleration.

    `rotation` is R_b; `velocity` and `omega` the twist, `water_velocity` the current, components in F_b.
    """
    mass, inertia, drag, damping, buoyancy_center, buoyancy = body
    through_water = subtract(velocity, water_velocity)
    speed = sqrt(through_water[0] ** 2 + through_water[1] ** 2 + through_water[2] ** 2)
    turning = cross(omega, velocity)
    force = (  # (34), (37); weight and buoyancy cancel
        -speed * drag[0] * through_water[0] - mass * turning[0],
        -speed * drag[1] * through_water[1] - mass * turning[1],
        -speed * drag[2] * through_water[2] - mass * turning[2],
    )
    righting = cross(buoyancy_center, rotate_back(rotation, (0.0, 0.0, buoyancy)))  # (35)
    damped = (-damping[0] * omega[0], -damping[1] * omega[1], -damping[2] * omega[2])
    spin = (inertia[0] * omega[0], inertia[1] * omega[1], inertia[2] * omega[2])
    return force, subtract(add(damped, righting), cross(omega, spin))


@kernel
def add_outside(
    outside: OutsideWrench, rotation: Rotation, force: Vector, moment: Vector,
) -> tuple[Vector, Vector]:
    """Return force [N] and moment [N m] in F_b with the wrench from outside added; `rotation` is R_b."""
    return (
        add(force, add(outside[0], rotate_back(rotation, outside[2]))),
        add(moment, add(outside[1], rotate_back(rotation, outside[3]))),
    )


@kernel
def body_acceleration(body: BodyConstants, force: Vector, moment: Vector) -> tuple[Vector, Vector]:
    """Return the derivative of the twist's components in F_b [m/s^2, rad/s^2], (36), of the whole load on the body."""
    mass, inertia = body[0], body[1]
    return (
        (force[0] / mass, force[1] / mass, force[2] / mass),
        (moment[0] / inertia[0], moment[1] / inertia[1], moment[2] / inertia[2]),
    )


@kernel
def _solve(matrix: np.ndarray, right: np.ndarray) -> bool:
    """Solve a symmetric positive definite system in place, `right` becoming the solution; return whether it is one.

    By Cholesky's factors, whose order of operations keeps the zeros of a motion in the plane of symmetry.
    """
    size = right.shape[0]
    for j in range(size):
        pivot = matrix[j, j]
        for k in range(j):
            pivot -= matrix[j, k] * matrix[j, k]
        if not pivot > LEAST_PIVOT:  # also refuses nan
            return False
        root = sqrt(pivot)
        matrix[j, j] = root
        for i in range(j + 1, size):
            entry = matrix[i, j]
            for k in range(j):
                entry -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = entry / root
    for i in range(size):
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]
    return True


@kernel
def solve_body(
    body: BodyConstants, force: Vector, moment: Vector, inertia: np.ndarray, wrench: np.ndarray, matrix: np.ndarray,
    acceleration: np.ndarray,
) -> bool:
    """Fill `acceleration` (6,), that of the twist's components, from (36) with the fins' wrenches affine in it.

    `force` and `moment` are the load but for the fins; `wrench` (2, 6) is that of each fin at no acceleration and
    `inertia` (2, 6, 6) how it falls with it, in F_b; `matrix` (6, 6) is scratch. Return whether there is a solution.
    """
    mass, moments = body[0], body[1]
    for i in range(6):
        acceleration[i] = (force[i] if i < 3 else moment[i - 3]) + (wrench[0, i] + wrench[1, i])
        for j in range(6):
            matrix[i, j] = inertia[0, i, j] + inertia[1, i, j]
        matrix[i, i] += mass if i < 3 else moments[i - 3]
    return _solve(matrix, acceleration)


@kernel
def attitude(state: np.ndarray) -> Rotation:
    """Return R_b of the body's state (13,): position, orientation x, y, z, w, of any norm between stages, and twist."""
    x, y, z, w = state[3], state[4], state[5], state[6]
    norm = sqrt(x * x + y * y + z * z + w * w)
    return rotation_rows((x / norm, y / norm, z / norm, w / norm))


@kernel
def body_derivative(state: np.ndarray, rotation: Rotation, acceleration: np.ndarray, derivative: np.ndarray) -> None:
    """Fill the time derivative (13,) of the body's state: x-dot = R V, q-dot = q (Omega, 0) / 2, and `acceleration`."""
    x, y, z, w = state[3], state[4], state[5], state[6]
    p, q, r = 0.5 * state[10], 0.5 * state[11], 0.5 * state[12]
    derivative[0], derivative[1], derivative[2] = rotate(rotation, (state[7], state[8], state[9]))
    derivative[3] = w * p + y * r - z * q
    derivative[4] = w * q + z * p - x * r
    derivative[5] = w * r + x * q - y * p
    derivative[6] = -(x * p + y * q + z * r)
    for i in range(6):
        derivative[7 + i] = acceleration[i]


@kernel
def normalise(state: np.ndarray) -> None:
    """Bring the quaternion of the body's state (13,) back to the unit sphere."""
    norm = sqrt(state[3] ** 2 + state[4] ** 2 + state[5] ** 2 + state[6] ** 2)
    for i in range(4):
        state[3 + i] /= norm


@kernel
def slower_than(state: np.ndarray, fastest: float) -> bool:
    """Return whether every component of the twist [m/s, rad/s] in the body's state (13,) is below `fastest`."""
    slower = True
    for i in range(6):
        slower = slower and abs(state[7 + i]) < fastest  # also refuses nan
    return slower

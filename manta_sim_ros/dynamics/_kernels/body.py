"""The rigid body, (34) to (37).

The body's state (13,) holds position, orientation x, y, z, w, and twist. Between stages its quaternion has any norm.
"""

from __future__ import annotations

from math import sqrt

from manta_sim_ros.dynamics._kernels.compilation import kernel
from manta_sim_ros.dynamics._kernels.constants import BodyConstants
from manta_sim_ros.dynamics._kernels.geometry import (
    Rotation,
    Wrench,
    add,
    cross,
    rotate,
    rotate_back,
    rotation_of,
    subtract,
)
from manta_sim_ros.dynamics._kernels.inputs import Inputs
from manta_sim_ros.dynamics._kernels.layout import BodyArrays
from manta_sim_ros.dynamics.quantity import FloatArray, Vector

LEAST_PIVOT = 1e-300
"""Below it an inertia is not positive definite."""


@kernel
def body_wrench(
    body: BodyConstants, inputs: Inputs, rotation: Rotation, velocity: Vector, omega: Vector, current: Vector,
) -> Wrench:
    """Return the load on the body but for the fins, in F_b: drag (34), righting moment (35) and the bias (37) of (36).

    It includes the external wrenches. `rotation` is R_b; `velocity` and `omega` are the twist, `current` is the
    velocity of the water, components in F_b.
    """
    drag, damping, inertia = body.drag, body.angular_damping, body.inertia
    relative = subtract(velocity, current)
    speed = sqrt(relative[0] ** 2 + relative[1] ** 2 + relative[2] ** 2)
    turning = cross(omega, velocity)
    force = (  # (34), (37); weight and buoyancy cancel
        -speed * drag[0] * relative[0] - body.mass * turning[0],
        -speed * drag[1] * relative[1] - body.mass * turning[1],
        -speed * drag[2] * relative[2] - body.mass * turning[2],
    )
    righting = cross(body.buoyancy_center, rotate_back(rotation, (0.0, 0.0, body.buoyancy)))  # (35)
    damped = (-damping[0] * omega[0], -damping[1] * omega[1], -damping[2] * omega[2])
    spin = (inertia[0] * omega[0], inertia[1] * omega[1], inertia[2] * omega[2])
    moment = subtract(add(damped, righting), cross(omega, spin))
    if body.moves_water:
        in_water = _water_load(body, rotation, relative, omega, current)
        force, moment = add(force, in_water.force), add(moment, in_water.moment)
    if body.unsupported_weight != 0.0:
        force = add(force, rotate_back(rotation, (0.0, 0.0, -body.unsupported_weight)))
    of_body, of_world = inputs.body_wrench, inputs.world_wrench
    return Wrench(
        add(force, add(of_body.force, rotate_back(rotation, of_world.force))),
        add(moment, add(of_body.moment, rotate_back(rotation, of_world.moment))),
    )


@kernel
def _water_load(
    body: BodyConstants, rotation: Rotation, relative: Vector, omega: Vector, current: Vector,
) -> Wrench:
    """Return what the water does to the body beyond the paper, but for its added mass times its acceleration, in F_b.

    Fossen's equations of a body in a steady, uniform current. The momentum of the added mass, (p, h) = M_A nu_r, gives
    -(Omega x p, Omega x h + V_r x p), and -M_A (Omega x v_c, 0), because nu_r-dot = nu-dot + (Omega x v_c, 0). Damping,
    linear and quadratic, acts by component, and the net buoyancy at r_b. `relative` is V_r.
    """
    mass, linear, quadratic = body.added_mass, body.linear_damping, body.quadratic_damping
    p = (mass[0] * relative[0], mass[1] * relative[1], mass[2] * relative[2])
    h = (mass[3] * omega[0], mass[4] * omega[1], mass[5] * omega[2])
    carried, turning = cross(omega, current), cross(omega, p)
    munk, gyroscopic = cross(relative, p), cross(omega, h)
    lift = rotate_back(rotation, (0.0, 0.0, body.net_buoyancy))
    force = (
        lift[0] - mass[0] * carried[0] - turning[0] - (linear[0] + quadratic[0] * abs(relative[0])) * relative[0],
        lift[1] - mass[1] * carried[1] - turning[1] - (linear[1] + quadratic[1] * abs(relative[1])) * relative[1],
        lift[2] - mass[2] * carried[2] - turning[2] - (linear[2] + quadratic[2] * abs(relative[2])) * relative[2],
    )
    righting = cross(body.buoyancy_center, lift)
    moment = (
        righting[0] - gyroscopic[0] - munk[0] - (linear[3] + quadratic[3] * abs(omega[0])) * omega[0],
        righting[1] - gyroscopic[1] - munk[1] - (linear[4] + quadratic[4] * abs(omega[1])) * omega[1],
        righting[2] - gyroscopic[2] - munk[2] - (linear[5] + quadratic[5] * abs(omega[2])) * omega[2],
    )
    return Wrench(force, moment)


@kernel
def body_acceleration(body: BodyConstants, load: Wrench) -> tuple[Vector, Vector]:
    """Return the derivative of the twist's components in F_b [m/s^2, rad/s^2], (36), of the whole load on the body."""
    force, moment, mass, inertia, added = load.force, load.moment, body.mass, body.inertia, body.added_mass
    return (
        (force[0] / (mass + added[0]), force[1] / (mass + added[1]), force[2] / (mass + added[2])),
        (moment[0] / (inertia[0] + added[3]), moment[1] / (inertia[1] + added[4]), moment[2] / (inertia[2] + added[5])),
    )


@kernel
def solve_body(body: BodyConstants, load: Wrench, arrays: BodyArrays) -> bool:
    """Fill the acceleration that satisfies (36) with the fins' wrenches affine in it; return whether there is one.

    `load` is the load on the body but for the fins, in F_b.
    """
    force, moment, mass, moments = load.force, load.moment, body.mass, body.inertia
    matrix, acceleration, inertia, wrench = arrays.matrix, arrays.acceleration, arrays.inertia, arrays.wrench
    for i in range(6):
        acceleration[i] = (force[i] if i < 3 else moment[i - 3]) + (wrench[0, i] + wrench[1, i])
        for j in range(6):
            matrix[i, j] = inertia[0, i, j] + inertia[1, i, j]
        matrix[i, i] += (mass if i < 3 else moments[i - 3]) + body.added_mass[i]
    return _solve(matrix, acceleration)


@kernel
def _solve(matrix: FloatArray, right: FloatArray) -> bool:
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
def attitude(state: FloatArray) -> Rotation:
    """Return R_b of the body's state (13,)."""
    x, y, z, w = state[3], state[4], state[5], state[6]
    norm = sqrt(x * x + y * y + z * z + w * w)
    return rotation_of((x / norm, y / norm, z / norm, w / norm))


@kernel
def body_derivative(state: FloatArray, rotation: Rotation, acceleration: FloatArray, derivative: FloatArray) -> None:
    """Fill the time derivative (13,) of the state: x-dot = R V, q-dot = q (Omega, 0) / 2, (5), and `acceleration`."""
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
def normalize(state: FloatArray) -> None:
    """Bring the quaternion of the body's state (13,) back to the unit sphere."""
    norm = sqrt(state[3] ** 2 + state[4] ** 2 + state[5] ** 2 + state[6] ** 2)
    for i in range(4):
        state[3 + i] /= norm


@kernel
def slower_than(fastest: float, twist: FloatArray) -> bool:
    """Return whether every component of a twist (6,) [m/s, rad/s] is below `fastest`."""
    slower = True
    for i in range(6):
        slower = slower and abs(twist[i]) < fastest  # also refuses nan
    return slower

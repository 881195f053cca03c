"""The rigid body, (34) to (37)."""

from __future__ import annotations

from math import sqrt

from manta_sim_ros.dynamics.compilation import kernel
from manta_sim_ros.dynamics.geometry import Rotation, add, cross, rotate_back, subtract
from manta_sim_ros.dynamics.parameters import Vector

BodyConstants = tuple[float, Vector, Vector, Vector, Vector, float]
"""Mass, inertia, rho S_B C_B / 2, C_M, r_b and m_b g."""


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
def body_acceleration(body: BodyConstants, force: Vector, moment: Vector) -> tuple[Vector, Vector]:
    """Return the derivative of the twist's components in F_b [m/s^2, rad/s^2], (36), of the whole load on the body."""
    mass, inertia = body[0], body[1]
    return (
        (force[0] / mass, force[1] / mass, force[2] / mass),
        (moment[0] / inertia[0], moment[1] / inertia[1], moment[2] / inertia[2]),
    )

"""The rigid body, (34) to (37)."""

from __future__ import annotations

from math import sqrt

from manta_sim_ros.dynamics.compilation import kernel
from manta_sim_ros.dynamics.geometry import Rotation, add, cross, rotate_back, subtract
from manta_sim_ros.dynamics.parameters import Vector

BodyConstants = tuple[float, Vector, Vector, Vector, Vector, float]
"""Mass, inertia, rho S_B C_B / 2, C_M, r_b and m_b g."""


@kernel
def body_acceleration(
    body: BodyConstants, rotation: Rotation, velocity: Vector, omega: Vector, water_velocity: Vector,
    force: Vector, moment: Vector,
) -> tuple[Vector, Vector]:
    """Return the derivative of the twist's components in F_b [m/s^2, rad/s^2], (36).

    `rotation` is R_b; `velocity` and `omega` the twist, `water_velocity` the current, `force` and `moment` the
    wrench of both fins about the centre of mass, components in F_b.
    """
    mass, inertia, drag, damping, buoyancy_center, buoyancy = body
    through_water = subtract(velocity, water_velocity)
    speed = sqrt(through_water[0] ** 2 + through_water[1] ** 2 + through_water[2] ** 2)
    total_force = (  # (34), (37); weight and buoyancy cancel
        force[0] - speed * drag[0] * through_water[0],
        force[1] - speed * drag[1] * through_water[1],
        force[2] - speed * drag[2] * through_water[2],
    )
    righting = cross(buoyancy_center, rotate_back(rotation, (0.0, 0.0, buoyancy)))  # (35)
    damped = (-damping[0] * omega[0], -damping[1] * omega[1], -damping[2] * omega[2])
    total_moment = add(add(damped, righting), moment)

    turning = cross(omega, velocity)
    spin = (inertia[0] * omega[0], inertia[1] * omega[1], inertia[2] * omega[2])
    gyroscopic = cross(omega, spin)
    return (
        total_force[0] / mass - turning[0],
        total_force[1] / mass - turning[1],
        total_force[2] / mass - turning[2],
    ), (
        (total_moment[0] - gyroscopic[0]) / inertia[0],
        (total_moment[1] - gyroscopic[1]) / inertia[1],
        (total_moment[2] - gyroscopic[2]) / inertia[2],
    )

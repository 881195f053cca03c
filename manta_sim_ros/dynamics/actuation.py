"""From the rods to the motion of the support, (6) to (10), for the left fin."""

from __future__ import annotations

from math import cos, sin, sqrt

from manta_sim_ros.dynamics.compilation import kernel
from manta_sim_ros.dynamics.geometry import Rotation, add, cross, rotate_back, subtract
from manta_sim_ros.dynamics.parameters import Vector

Rod = Vector
"""Angle [rad], rate and acceleration of a rod."""

RodConstants = tuple[float, float, float, Vector]
"""Front radius r_1, rear radius r_2, support length L and motor position bP_l [m]."""

SupportMotion = tuple[Rotation, Vector, Vector, Vector, Vector, Vector]
"""lR_0, position of A in F_b [m], then V_0, Omega_0 and the derivatives of their components, in F_0."""


@kernel
def support_attitude(
    front: Rod, rear: Rod, front_radius: float, rear_radius: float, length: float,
) -> tuple[Rotation, Vector, Vector]:
    """Return rotation lR_0 (rows), angular velocity and acceleration of F_0 against the body, components in F_0.

    `front` and `rear` hold angle, rate and acceleration of the rods [rad, rad/s, rad/s^2]. From |AB| = L with
    sin(beta) = -dz / L and sin(theta) = dy / (L cos(beta)), (8), (9); x_0 points from A to B.
    """
    front_end = _rod_end(front, front_radius)
    rear_end = _rod_end(rear, rear_radius)
    dy, dz = subtract(front_end[0], rear_end[0]), subtract(front_end[1], rear_end[1])

    sin_beta = -dz[0] / length
    plan = sqrt(length * length - dz[0] * dz[0])  # L cos(beta), the support's length in plan view
    cos_beta = plan / length
    beta_1 = -dz[1] / plan
    beta_2 = (-dz[2] + length * sin_beta * beta_1**2) / plan
    plan_1 = -length * sin_beta * beta_1
    plan_2 = -length * (cos_beta * beta_1**2 + sin_beta * beta_2)

    sin_theta = dy[0] / plan
    ahead = sqrt(plan * plan - dy[0] * dy[0])  # L cos(beta) cos(theta), how far B is in front of A
    cos_theta = ahead / plan
    theta_1 = (dy[1] - sin_theta * plan_1) / ahead
    theta_2 = (dy[2] - 2.0 * cos_theta * theta_1 * plan_1 + sin_theta * theta_1**2 * plan - sin_theta * plan_2) / ahead

    rotation = (
        (cos_theta * cos_beta, -sin_theta, cos_theta * sin_beta),
        (sin_theta * cos_beta, cos_theta, sin_theta * sin_beta),
        (-sin_beta, 0.0, cos_beta),
    )
    omega = (-sin_beta * theta_1, beta_1, cos_beta * theta_1)
    omega_1 = (
        -cos_beta * beta_1 * theta_1 - sin_beta * theta_2,
        beta_2,
        -sin_beta * beta_1 * theta_1 + cos_beta * theta_2,
    )
    return rotation, omega, omega_1


@kernel
def _rod_end(rod: Rod, radius: float) -> tuple[Vector, Vector]:
    """Return y and z of a rod's end from O_l, each with its first two derivatives, (7)."""
    angle, angle_1, angle_2 = rod
    y, z = radius * cos(angle), radius * sin(angle)
    return (y, -z * angle_1, -z * angle_2 - y * angle_1**2), (z, y * angle_1, y * angle_2 - z * angle_1**2)


@kernel
def support_motion(
    rods: RodConstants, front: Rod, rear: Rod, velocity: Vector, omega: Vector, velocity_1: Vector,
    omega_1: Vector,
) -> SupportMotion:
    """Return the support's pose and motion, (6) to (10).

    `velocity`, `omega` are the body's twist and `velocity_1`, `omega_1` its derivative, components in F_b. The
    derivatives returned are exact: (10) in print drops the rotation of V_l-dot into F_0 and the products of velocities.
    """
    front_radius, rear_radius, length, motor = rods
    rotation, turning, turning_1 = support_attitude(front, rear, front_radius, rear_radius, length)
    y, z = _rod_end(rear, rear_radius)
    position = add(motor, (0.0, y[0], z[0]))
    sliding, sliding_1 = (0.0, y[1], z[1]), (0.0, y[2], z[2])

    # (6) and (7): the point A, in body components
    velocity_a = add(add(velocity, cross(omega, position)), sliding)
    velocity_a_1 = add(add(velocity_1, cross(omega_1, position)), add(cross(omega, sliding), sliding_1))

    # (10): into F_0, which turns against the body
    velocity_0 = rotate_back(rotation, velocity_a)
    velocity_0_1 = subtract(rotate_back(rotation, velocity_a_1), cross(turning, velocity_0))
    body_omega = rotate_back(rotation, omega)
    omega_0 = add(body_omega, turning)
    omega_0_1 = add(subtract(rotate_back(rotation, omega_1), cross(turning, body_omega)), turning_1)
    return rotation, position, velocity_0, omega_0, velocity_0_1, omega_0_1

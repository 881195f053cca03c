"""From the rods to the motion of the support, (6) to (10), for the left fin."""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import NamedTuple

import numpy as np

from manta_sim_ros.dynamics._kernels.compilation import kernel
from manta_sim_ros.dynamics._kernels.constants import RodConstants
from manta_sim_ros.dynamics._kernels.gait import Rod
from manta_sim_ros.dynamics._kernels.geometry import (
    Rotation,
    Vector,
    add,
    cross,
    mirror_axial,
    mirror_polar,
    rotate_back,
    subtract,
    vector_at,
)


class BodyMotion(NamedTuple):
    """The twist of the body and the time derivative of its components, in F_b [m/s, rad/s]."""

    velocity: Vector
    omega: Vector
    velocity_dot: Vector
    omega_dot: Vector


class Attitude(NamedTuple):
    """How F_0 is turned against the body, and turns: components in F_0."""

    rotation: Rotation  # lR_0, from F_0 to F_b
    omega: Vector  # [rad/s]
    omega_dot: Vector


class SupportMotion(NamedTuple):
    """The support's pose in F_b, and its twist with the derivative of its components in F_0."""

    rotation: Rotation  # lR_0, from F_0 to F_b
    position: Vector  # of A [m]
    velocity: Vector  # V_0 [m/s]
    omega: Vector  # Omega_0 [rad/s]
    velocity_dot: Vector
    omega_dot: Vector


@kernel
def body_motion(side: int, twist: np.ndarray, acceleration: np.ndarray) -> BodyMotion:
    """Return the body's motion as one side's fin sees it, in the left fin's coordinates; arrays (6,) in F_b."""
    return BodyMotion(
        mirror_polar(vector_at(twist, 0), side), mirror_axial(vector_at(twist, 3), side),
        mirror_polar(vector_at(acceleration, 0), side), mirror_axial(vector_at(acceleration, 3), side),
    )


@kernel
def support_attitude(rods: RodConstants, front: Rod, rear: Rod) -> Attitude:
    """Return how F_0 is turned against the body, (8), (9).

    From |AB| = L with sin(beta) = -dz / L and sin(theta) = dy / (L cos(beta)); x_0 points from A to B.
    """
    length = rods.support_length
    front_end = _rod_end(front, rods.front_radius)
    rear_end = _rod_end(rear, rods.rear_radius)
    dy, dz = subtract(front_end[0], rear_end[0]), subtract(front_end[1], rear_end[1])

    sin_beta = -dz[0] / length
    plan = sqrt(length * length - dz[0] * dz[0])  # L cos(beta), the support's length in plan view
    cos_beta = plan / length
    beta_dot = -dz[1] / plan
    beta_ddot = (-dz[2] + length * sin_beta * beta_dot**2) / plan
    plan_dot = -length * sin_beta * beta_dot
    plan_ddot = -length * (cos_beta * beta_dot**2 + sin_beta * beta_ddot)

    sin_theta = dy[0] / plan
    ahead = sqrt(plan * plan - dy[0] * dy[0])  # L cos(beta) cos(theta), how far B is in front of A
    cos_theta = ahead / plan
    theta_dot = (dy[1] - sin_theta * plan_dot) / ahead
    theta_ddot = (
        dy[2] - 2.0 * cos_theta * theta_dot * plan_dot + sin_theta * theta_dot**2 * plan - sin_theta * plan_ddot
    ) / ahead

    rotation = (
        (cos_theta * cos_beta, -sin_theta, cos_theta * sin_beta),
        (sin_theta * cos_beta, cos_theta, sin_theta * sin_beta),
        (-sin_beta, 0.0, cos_beta),
    )
    omega = (-sin_beta * theta_dot, beta_dot, cos_beta * theta_dot)
    omega_dot = (
        -cos_beta * beta_dot * theta_dot - sin_beta * theta_ddot,
        beta_ddot,
        -sin_beta * beta_dot * theta_dot + cos_beta * theta_ddot,
    )
    return Attitude(rotation, omega, omega_dot)


@kernel
def _rod_end(rod: Rod, radius: float) -> tuple[Vector, Vector]:
    """Return y and z of a rod's end from O_l, each with its first two derivatives, (7)."""
    y, z = radius * cos(rod.angle), radius * sin(rod.angle)
    return (
        (y, -z * rod.angle_dot, -z * rod.angle_ddot - y * rod.angle_dot**2),
        (z, y * rod.angle_dot, y * rod.angle_ddot - z * rod.angle_dot**2),
    )


@kernel
def support_motion(rods: RodConstants, front: Rod, rear: Rod, body: BodyMotion) -> SupportMotion:
    """Return the support's pose and motion, (6) to (10).

    The derivatives are exact: (10) in print drops the rotation of V_l-dot into F_0 and the products of velocities.
    """
    rotation, turning, turning_dot = support_attitude(rods, front, rear)
    y, z = _rod_end(rear, rods.rear_radius)
    position = add(rods.motor_position, (0.0, y[0], z[0]))
    sliding, sliding_dot = (0.0, y[1], z[1]), (0.0, y[2], z[2])

    # (6) and (7): the point A, in body components
    velocity_a = add(add(body.velocity, cross(body.omega, position)), sliding)
    velocity_a_dot = add(
        add(body.velocity_dot, cross(body.omega_dot, position)), add(cross(body.omega, sliding), sliding_dot))

    # (10): into F_0, which turns against the body
    velocity = rotate_back(rotation, velocity_a)
    velocity_dot = subtract(rotate_back(rotation, velocity_a_dot), cross(turning, velocity))
    body_omega = rotate_back(rotation, body.omega)
    omega = add(body_omega, turning)
    omega_dot = add(subtract(rotate_back(rotation, body.omega_dot), cross(turning, body_omega)), turning_dot)
    return SupportMotion(rotation, position, velocity, omega, velocity_dot, omega_dot)

"""From the rods to the motion of the support, (6) to (10), for the left fin."""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import NamedTuple

from manta_sim_ros.dynamics._kernels.compilation import kernel
from manta_sim_ros.dynamics._kernels.constants import RodConstants
from manta_sim_ros.dynamics._kernels.gait import Rod
from manta_sim_ros.dynamics._kernels.geometry import (
    Rotation,
    Wrench,
    add,
    cross,
    dot,
    mirror_axial,
    mirror_polar,
    rotate_back,
    subtract,
    vector_at,
)
from manta_sim_ros.dynamics.quantity import FloatArray, Vector


class BodyMotion(NamedTuple):
    """The twist of the body and the time derivative of its components, in F_b [m/s, rad/s]."""

    velocity: Vector
    omega: Vector
    velocity_dot: Vector
    omega_dot: Vector


class RodEnd(NamedTuple):
    """Where a rod ends in the plane of its motion, from O_l [m], with the first two time derivatives."""

    y: float
    z: float
    y_dot: float
    z_dot: float
    y_ddot: float
    z_ddot: float


class Attitude(NamedTuple):
    """How F_0 is rotated against the body, and how it rotates; components in F_0."""

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
def body_motion(side: int, twist: FloatArray, acceleration: FloatArray) -> BodyMotion:
    """Return the body's motion as one side's fin sees it, in the left fin's coordinates; arrays (6,) in F_b."""
    return BodyMotion(
        mirror_polar(vector_at(twist, 0), side), mirror_axial(vector_at(twist, 3), side),
        mirror_polar(vector_at(acceleration, 0), side), mirror_axial(vector_at(acceleration, 3), side),
    )


@kernel
def support_attitude(rods: RodConstants, front: Rod, rear: Rod) -> Attitude:
    """Return how F_0 is rotated against the body, (8), (9).

    From |AB| = L with sin(beta) = -dz / L and sin(theta) = dy / (L cos(beta)); x_0 points from A to B.
    """
    length = rods.support_length
    b, a = _rod_end(front, rods.front_radius), _rod_end(rear, rods.rear_radius)
    dy, dy_dot, dy_ddot = b.y - a.y, b.y_dot - a.y_dot, b.y_ddot - a.y_ddot
    dz, dz_dot, dz_ddot = b.z - a.z, b.z_dot - a.z_dot, b.z_ddot - a.z_ddot

    sin_beta = -dz / length
    plan = sqrt(length * length - dz * dz)  # L cos(beta), the support's length in plan view
    cos_beta = plan / length
    beta_dot = -dz_dot / plan
    beta_ddot = (-dz_ddot + length * sin_beta * beta_dot**2) / plan
    plan_dot = -length * sin_beta * beta_dot
    plan_ddot = -length * (cos_beta * beta_dot**2 + sin_beta * beta_ddot)

    sin_theta = dy / plan
    ahead = sqrt(plan * plan - dy * dy)  # L cos(beta) cos(theta), how far B is in front of A
    cos_theta = ahead / plan
    theta_dot = (dy_dot - sin_theta * plan_dot) / ahead
    theta_ddot = (
        dy_ddot - 2.0 * cos_theta * theta_dot * plan_dot + sin_theta * theta_dot**2 * plan - sin_theta * plan_ddot
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
def _rod_end(rod: Rod, radius: float) -> RodEnd:
    """Return where a rod ends, (7)."""
    y, z = radius * cos(rod.angle), radius * sin(rod.angle)
    return RodEnd(
        y, z, -z * rod.angle_dot, y * rod.angle_dot,
        -z * rod.angle_ddot - y * rod.angle_dot**2, y * rod.angle_ddot - z * rod.angle_dot**2,
    )


@kernel
def support_motion(rods: RodConstants, front: Rod, rear: Rod, body: BodyMotion) -> SupportMotion:
    """Return the support's pose and motion, (6) to (10).

    The derivatives are exact: (10) in print drops the rotation of V_l-dot into F_0 and the products of velocities.
    """
    attitude, a = support_attitude(rods, front, rear), _rod_end(rear, rods.rear_radius)
    position = add(rods.motor_position, (0.0, a.y, a.z))
    p_dot, p_ddot = (0.0, a.y_dot, a.z_dot), (0.0, a.y_ddot, a.z_ddot)  # of A against the body

    # (6) and (7): the point A, in body components
    velocity_a = add(add(body.velocity, cross(body.omega, position)), p_dot)
    velocity_a_dot = add(
        add(body.velocity_dot, cross(body.omega_dot, position)), add(cross(body.omega, p_dot), p_ddot))

    # (10): into F_0, which rotates against the body
    rotation = attitude.rotation
    velocity = rotate_back(rotation, velocity_a)
    velocity_dot = subtract(rotate_back(rotation, velocity_a_dot), cross(attitude.omega, velocity))
    body_omega = rotate_back(rotation, body.omega)
    omega = add(body_omega, attitude.omega)
    omega_dot = add(
        subtract(rotate_back(rotation, body.omega_dot), cross(attitude.omega, body_omega)), attitude.omega_dot)
    return SupportMotion(rotation, position, velocity, omega, velocity_dot, omega_dot)


@kernel
def rod_torques(rods: RodConstants, front: Rod, rear: Rod, on_body: Wrench) -> tuple[float, float]:
    """Return the torques of the front and the rear motor [N m] that balance the wrench of the left fin on the body.

    The mechanism has no mass. So by virtual power the torque of a rod is minus the wrench on the support about A times
    the support's twist at a unit rate of this rod. `on_body` is about the center of mass, in F_b.
    """
    return _rod_torque(rods, front, rear, on_body, 1.0, 0.0), _rod_torque(rods, front, rear, on_body, 0.0, 1.0)


@kernel
def _rod_torque(
    rods: RodConstants, front: Rod, rear: Rod, on_body: Wrench, front_rate: float, rear_rate: float,
) -> float:
    none = (0.0, 0.0, 0.0)
    support = support_motion(
        rods, Rod(front.angle, front_rate, 0.0), Rod(rear.angle, rear_rate, 0.0),
        BodyMotion(none, none, none, none))
    force = rotate_back(support.rotation, on_body.force)
    moment = rotate_back(support.rotation, subtract(on_body.moment, cross(support.position, on_body.force)))
    return -(dot(force, support.velocity) + dot(moment, support.omega))

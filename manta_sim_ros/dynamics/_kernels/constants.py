"""The parameters as the kernels take them: what does not change while a simulation runs."""

from __future__ import annotations

import functools
from math import acos, hypot, inf, pi
from typing import NamedTuple

import numpy as np

from manta_sim_ros.dynamics._kernels.layout import stations
from manta_sim_ros.dynamics.parameters import Parameters, Rods
from manta_sim_ros.dynamics.quantity import FloatArray, SixVector, Vector

LEAST_HEIGHT, GREATEST_HEIGHT = 0.01, 1.0
"""Bounds of the height of the body as a slab [m]."""

SERVO_SHARE = 0.95
"""Share of the closure angle up to which servos turn the rods against each other: beyond it, the support whips."""


class FinConstants(NamedTuple):
    """One fin, per unit chord."""

    chains: int  # n
    station: FloatArray  # (row,), s of each chain from A [m]
    chain_spacing: float  # ds [m]
    link_length: float  # dl [m]
    link_mass: float  # rho_f h dl [kg/m]
    stiffness: float  # 2 E I / dl [N], with I = h^3 / 12
    damping: float  # c [N s]
    drag: float  # rho C_D dl / 2 [kg/m^2]
    added_mass: float  # C_a rho_a pi L dl / 4 [kg/m]
    twist_stiffness: float  # G h^3 dl / (3 ds^2) [N]
    twist_damping: float  # c_t dl / ds^2 [N s]
    span: float  # [m]
    thickness: float  # h [m]
    link_weight: float  # rho_f h dl g, out of the water [N/m]


class RodConstants(NamedTuple):
    """The rods and the support of the left fin."""

    front_radius: float  # r_1 [m]
    rear_radius: float  # r_2 [m]
    support_length: float  # L [m]
    motor_position: Vector  # bP_l [m]
    time_constant: float  # of the smoothing of commands [s]
    servos: bool  # whether the biases of a gait are angles that servos follow, in place of a gait
    servo_time_constant: float  # [s]
    servo_rate_limit: float  # [rad/s]
    largest_difference: float  # of the angles of the two rods to which servos go [rad]


class BodyConstants(NamedTuple):
    """The rigid body."""

    mass: float  # m_b [kg]
    inertia: Vector  # J_b [kg m^2]
    drag: Vector  # rho S_B C_B / 2 [kg/m]
    angular_damping: Vector  # C_M [N m s]
    buoyancy_center: Vector  # r_b [m]
    buoyancy: float  # m_b g [N]
    moves_water: bool  # whether any of the following is not 0
    added_mass: SixVector  # [kg, kg m^2]
    linear_damping: SixVector  # [N s/m, N m s]
    quadratic_damping: SixVector  # [N s^2/m^2, N m s^2]
    net_buoyancy: float  # [N]
    unsupported_weight: float  # that buoyancy does not carry, 0 under water [N]
    height: float  # of the slab that crosses the surface [m]


class Constants(NamedTuple):
    """All of them."""

    fin: FinConstants
    rods: RodConstants
    body: BodyConstants
    time_step: float  # [s]
    fixed_base: bool
    surface_height: float  # world frame [m]
    reach: float  # no part of the robot is farther from the center of mass [m]


@functools.lru_cache(maxsize=16)
def constants(parameters: Parameters) -> Constants:
    """Return the parameters as the kernels take them. The kernels only read them, so that robots may share them."""
    fin, rods, body, water = parameters.fin, parameters.rods, parameters.body, parameters.water
    link_length, chain_spacing = fin.span / fin.links, rods.support_length / fin.chains
    bending_stiffness = fin.youngs_modulus * fin.thickness**3 / 12.0
    drag = 0.5 * water.density * np.multiply(body.drag_area, body.drag_coefficient)
    return Constants(
        fin=FinConstants(
            chains=fin.chains,
            station=stations(fin.chains, rods.support_length),
            chain_spacing=chain_spacing,
            link_length=link_length,
            link_mass=fin.density * fin.thickness * link_length,
            stiffness=2.0 * bending_stiffness / link_length,
            damping=fin.joint_damping,
            drag=0.5 * water.density * fin.drag_coefficient * link_length,
            added_mass=(
                water.added_mass_coefficient * water.added_mass_density * pi / 4.0 * rods.support_length * link_length
            ),
            twist_stiffness=fin.shear_modulus * fin.thickness**3 / 3.0 * link_length / chain_spacing**2,
            twist_damping=fin.twist_damping * link_length / chain_spacing**2,
            span=fin.span,
            thickness=fin.thickness,
            link_weight=fin.density * fin.thickness * link_length * body.gravity,
        ),
        rods=RodConstants(
            rods.front_radius, rods.rear_radius, rods.support_length, rods.rear_motor_position,
            rods.command_time_constant, False, rods.servo_time_constant, rods.servo_rate_limit,
            largest_difference(rods),
        ),
        body=BodyConstants(
            body.mass, body.inertia, tuple(drag.tolist()), body.angular_damping,
            body.buoyancy_center, body.mass * body.gravity,
            any((*body.added_mass, *body.linear_damping, *body.quadratic_damping, body.net_buoyancy)),
            body.added_mass, body.linear_damping, body.quadratic_damping, body.net_buoyancy, 0.0,
            slab_height(parameters),
        ),
        time_step=parameters.solver.time_step,
        fixed_base=parameters.solver.fixed_base,
        surface_height=water.surface_height,
        reach=max(
            hypot(*rods.rear_motor_position) + max(rods.front_radius, rods.rear_radius)
            + rods.support_length + fin.span + fin.thickness,
            hypot(*body.buoyancy_center) + slab_height(parameters)),
    )


def with_servos(values: Constants) -> Constants:
    """Return the same constants of a robot whose rods follow servos."""
    return values._replace(rods=values.rods._replace(servos=True))


def closure_angle(rods: Rods) -> float:
    """Return the difference of the rod angles [rad] at which the support lies in the y-z plane, where it cannot close.

    From dy^2 + dz^2 = r_1^2 + r_2^2 - 2 r_1 r_2 cos(a_1 - a_2) = L^2; infinite if the rod ends are never so far apart.
    """
    front, rear = rods.front_radius, rods.rear_radius
    cosine = (front**2 + rear**2 - rods.support_length**2) / (2 * front * rear)
    return acos(cosine) if cosine > -1.0 else inf


def largest_difference(rods: Rods) -> float:
    """Return the largest difference of the rod angles to which servos go [rad]: before the support cannot close."""
    return SERVO_SHARE * closure_angle(rods)


def slab_height(parameters: Parameters) -> float:
    """Return the height of the body as a slab that crosses the surface [m]: its displacement over its plan area."""
    displacement = parameters.body.mass / max(parameters.water.added_mass_density, 1.0)
    return min(max(displacement / max(parameters.body.drag_area[2], 1e-3), LEAST_HEIGHT), GREATEST_HEIGHT)

"""What both ways to couple fins and body share: the parameters and the state as kernels take them, and RK4."""

from __future__ import annotations

from math import pi
from typing import NamedTuple

import numpy as np

from manta_sim_ros.dynamics.actuation import Rod, RodConstants, SupportMotion, support_motion
from manta_sim_ros.dynamics.body import BodyConstants, OutsideWrench
from manta_sim_ros.dynamics.compilation import kernel
from manta_sim_ros.dynamics.fin import FinConstants, stations
from manta_sim_ros.dynamics.geometry import mirror_axial, mirror_polar
from manta_sim_ros.dynamics.parameters import Parameters, Vector

FIN_FAILED, BODY_FAILED, SOLUTION_FAILED = 1, 2, 3
"""What failed in a step."""

RK4_WEIGHTS = (1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0)
"""Of the four stages of the classical Runge-Kutta scheme."""

RK4_AHEAD = (0.5, 0.5, 1.0, 0.0)
"""How far a stage's slope is followed to the next one, in steps."""

FASTEST = 1e3
"""Velocity [m/s] and angular velocity [rad/s] of the body that no motion of the robot comes near: it has diverged."""


class Constants(NamedTuple):
    """The parameters as the kernels take them, and what acts from outside."""

    fin: FinConstants
    rods: RodConstants
    body: BodyConstants
    current: Vector  # of the water, world frame [m/s]
    outside: OutsideWrench
    time_constant: float
    time_step: float
    fixed_base: bool


class Motion(NamedTuple):
    """The state of a simulation as the kernels take and change it; fields as in `State`."""

    position: np.ndarray  # (3,)
    orientation: np.ndarray  # (4,), x, y, z, w
    twist: np.ndarray  # (6,)
    acceleration: np.ndarray  # (6,)
    joint_angles: np.ndarray  # (2, n, m)
    joint_rates: np.ndarray  # (2, n, m)
    gait: np.ndarray  # (2, 5)
    gait_rates: np.ndarray  # (2, 5)
    gait_commands: np.ndarray  # (2, 5)
    cycle_angles: np.ndarray  # (2,)
    rod_angles: np.ndarray  # (2, 2)
    fin_wrenches: np.ndarray  # (2, 6)


def constants(parameters: Parameters) -> Constants:
    """Return the parameters as the kernels take them."""
    fin, rods, body, water = parameters.fin, parameters.rods, parameters.body, parameters.water
    link_length = fin.span / fin.links
    bending_stiffness = fin.youngs_modulus * fin.thickness**3 / 12.0
    drag = 0.5 * water.density * np.multiply(body.drag_area, body.drag_coefficient)
    return Constants(
        fin=FinConstants(
            chains=fin.chains,
            station=stations(fin.chains, rods.support_length),
            chain_spacing=rods.support_length / fin.chains,
            link_length=link_length,
            link_mass=fin.density * fin.thickness * link_length,
            stiffness=2.0 * bending_stiffness / link_length,
            damping=fin.joint_damping,
            drag=0.5 * water.density * fin.drag_coefficient * link_length,
            added_mass=(
                water.added_mass_coefficient * water.added_mass_density * pi / 4.0 * rods.support_length * link_length
            ),
        ),
        rods=(rods.front_radius, rods.rear_radius, rods.support_length, rods.rear_motor_position),
        body=(
            body.mass, body.inertia, tuple(drag.tolist()), body.angular_damping,
            body.buoyancy_center, body.mass * body.gravity,
        ),
        current=water.current,
        outside=((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        time_constant=rods.command_time_constant,
        time_step=parameters.solver.time_step,
        fixed_base=parameters.solver.fixed_base,
    )


@kernel
def to_rows(joints: np.ndarray, rows: np.ndarray) -> None:
    """Lay (n, m) out as [link, chain]; the rest of a row repeats the last chain."""
    last = joints.shape[0] - 1
    for j in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            rows[j, k] = joints[min(k, last), j]


@kernel
def from_rows(rows: np.ndarray, joints: np.ndarray) -> None:
    """Lay [link, chain] out as (n, m), without what pads a row."""
    for k in range(joints.shape[0]):
        for j in range(joints.shape[1]):
            joints[k, j] = rows[j, k]


@kernel
def triple(a: np.ndarray, start: int) -> Vector:
    """Return three entries of an array as a vector."""
    return a[start], a[start + 1], a[start + 2]


@kernel
def polar(a: Vector, side: int) -> Vector:
    """Return a velocity or force as the left fin's code sees it, or back: mirrored for the right fin."""
    return mirror_polar(a) if side == 1 else a


@kernel
def axial(a: Vector, side: int) -> Vector:
    """Return an angular velocity or moment as the left fin's code sees it, or back."""
    return mirror_axial(a) if side == 1 else a


@kernel
def support_of(
    rods: RodConstants, side: int, front: Rod, rear: Rod, twist: np.ndarray, acceleration: np.ndarray,
) -> SupportMotion:
    """Return the support's motion of one side, in the left fin's coordinates, from the body's in F_b."""
    return support_motion(
        rods, front, rear,
        polar(triple(twist, 0), side), axial(triple(twist, 3), side),
        polar(triple(acceleration, 0), side), axial(triple(acceleration, 3), side),
    )


@kernel
def next_stage(
    q: np.ndarray, q_rate: np.ndarray, q_acceleration: np.ndarray, base_q: np.ndarray, base_rate: np.ndarray,
    sum_q: np.ndarray, sum_rate: np.ndarray, weight: float, ahead: float,
) -> None:
    """Add a stage's slope to the sums, and follow it from the base to the next stage."""
    for j in range(q.shape[0]):
        for k in range(q.shape[1]):
            sum_q[j, k] += weight * q_rate[j, k]
            sum_rate[j, k] += weight * q_acceleration[j, k]
            q[j, k] = base_q[j, k] + ahead * q_rate[j, k]
            q_rate[j, k] = base_rate[j, k] + ahead * q_acceleration[j, k]


@kernel
def first_bad_chain(q: np.ndarray, q_rate: np.ndarray, chains: int) -> int:
    """Return the first chain with a joint at or past +-pi or not finite, or -1."""
    bad = 0
    for j in range(q.shape[0]):
        for k in range(chains):
            bad += 0 if abs(q[j, k]) < pi and abs(q_rate[j, k]) < np.inf else 1
    if bad:
        for k in range(chains):
            for j in range(q.shape[0]):
                if not (abs(q[j, k]) < pi and abs(q_rate[j, k]) < np.inf):
                    return k
    return -1

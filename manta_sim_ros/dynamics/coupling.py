"""Fins and body coupled step by step, Section 4 and Figure 6, and the compiled entry points."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite, pi
from typing import Any, NamedTuple

import numpy as np

from manta_sim_ros.dynamics.actuation import Rod, RodConstants, SupportMotion, support_motion
from manta_sim_ros.dynamics.body import BodyConstants, body_acceleration
from manta_sim_ros.dynamics.compilation import entry_kernel, inlined_kernel, kernel, source_digest
from manta_sim_ros.dynamics.fin import (
    FinConstants,
    InertialMotion,
    Links,
    Tips,
    accelerate,
    row_length,
    stations,
    working_arrays,
    wrench_on_body,
)
from manta_sim_ros.dynamics.gait import advance_gait, rod_motion
from manta_sim_ros.dynamics.geometry import mirror_axial, mirror_polar, rotate, rotate_back, rotation_rows, turn
from manta_sim_ros.dynamics.parameters import Parameters, Vector


class Constants(NamedTuple):
    """The parameters as the kernels take them."""

    chains: int
    station: np.ndarray  # (row,), s of each chain from A [m]
    fin: FinConstants
    rods: RodConstants
    body: BodyConstants
    current: Vector  # of the water, world frame [m/s]
    time_constant: float
    time_step: float
    fixed_base: bool


class Motion(NamedTuple):
    """The state of a simulation as the kernels take it; rows of chains are padded and link-major."""

    position: np.ndarray  # (3,)
    orientation: np.ndarray  # (4,), x, y, z, w
    twist: np.ndarray  # (6,)
    acceleration: np.ndarray  # (6,)
    q: np.ndarray  # (2, links, row) [rad]
    q_rate: np.ndarray  # (2, links, row) [rad/s]
    gait: np.ndarray  # (2, 5)
    gait_rate: np.ndarray  # (2, 5)
    command: np.ndarray  # (2, 5)
    cycle_angle: np.ndarray  # (2,)
    rod_angles: np.ndarray  # (2, 2)
    fin_wrenches: np.ndarray  # (2, 6)


def constants(parameters: Parameters) -> Constants:
    """Return the parameters as the kernels take them."""
    fin, rods, body, water = parameters.fin, parameters.rods, parameters.body, parameters.water
    link_length = fin.span / fin.links
    bending_stiffness = fin.youngs_modulus * fin.thickness**3 / 12.0
    drag = 0.5 * water.density * np.multiply(body.drag_area, body.drag_coefficient)
    return Constants(
        chains=fin.chains,
        station=stations(fin.chains, rods.support_length),
        fin=FinConstants(
            chain_spacing=rods.support_length / fin.chains,
            link_length=link_length,
            link_mass=fin.density * fin.thickness * link_length,
            stiffness=2.0 * bending_stiffness / link_length,
            damping=fin.joint_damping,
            drag=0.5 * water.density * fin.drag_coefficient * link_length,
        ),
        rods=(rods.front_radius, rods.rear_radius, rods.support_length, rods.rear_motor_position),
        body=(
            body.mass, body.inertia, tuple(drag.tolist()), body.angular_damping,
            body.buoyancy_center, body.mass * body.gravity,
        ),
        current=water.current,
        time_constant=rods.command_time_constant,
        time_step=parameters.solver.time_step,
        fixed_base=parameters.solver.fixed_base,
    )


def padded(chains_by_links: np.ndarray) -> np.ndarray:
    """Return (..., chains, links) as (..., links, row): link-major, the rest of a row repeating the last chain."""
    by_links = np.swapaxes(chains_by_links, -1, -2)
    chains = by_links.shape[-1]
    widths = [(0, 0)] * (by_links.ndim - 1) + [(0, row_length(chains) - chains)]
    return np.ascontiguousarray(np.pad(by_links, widths, mode='edge'))


def unpadded(rows: np.ndarray, chains: int) -> np.ndarray:
    """Return (..., links, row) as (..., chains, links)."""
    return np.ascontiguousarray(np.swapaxes(rows[..., :chains], -1, -2))


@kernel
def _triple(a: np.ndarray, start: int) -> Vector:
    return a[start], a[start + 1], a[start + 2]


@kernel
def _polar(a: Vector, side: int) -> Vector:
    """Return a velocity or force as the left fin's code sees it, or back: mirrored for the right fin."""
    return mirror_polar(a) if side == 1 else a


@kernel
def _axial(a: Vector, side: int) -> Vector:
    return mirror_axial(a) if side == 1 else a


@kernel
def _support(
    rods: RodConstants, side: int, front: Rod, rear: Rod, twist: np.ndarray, acceleration: np.ndarray,
) -> SupportMotion:
    """Return the support's motion of one side, in the left fin's coordinates, from the body's in F_b."""
    return support_motion(
        rods, front, rear,
        _polar(_triple(twist, 0), side), _axial(_triple(twist, 3), side),
        _polar(_triple(acceleration, 0), side), _axial(_triple(acceleration, 3), side),
    )


@inlined_kernel
def _fin(
    constants: Constants, links: Links, tips: Tips, side: int, rods: tuple[Rod, Rod], twist: np.ndarray,
    acceleration: np.ndarray, current: Vector, q: np.ndarray, q_rate: np.ndarray, q_acceleration: np.ndarray,
) -> tuple[SupportMotion, InertialMotion]:
    """Fill `q_acceleration` of one fin; return what its wrench needs. `current`: the water's velocity in F_b."""
    support = _support(constants.rods, side, rods[0], rods[1], twist, acceleration)
    water_velocity = rotate_back(support[0], _polar(current, side))
    inertial = accelerate(
        constants.fin, constants.chains, constants.station, links, tips, q, q_rate, q_acceleration,
        support, water_velocity,
    )
    return support, inertial


@inlined_kernel
def _wrench(
    constants: Constants, links: Links, tips: Tips, side: int, evaluated: tuple[SupportMotion, InertialMotion],
) -> tuple[Vector, Vector]:
    """Return force and moment of one fin on the body in F_b, after `_fin` with the same working arrays."""
    support, inertial = evaluated
    force, moment = wrench_on_body(
        constants.fin, constants.chains, constants.station, links, tips, support, inertial)
    return _polar(force, side), _axial(moment, side)


@kernel
def _collect(
    q_sum: np.ndarray, rate_sum: np.ndarray, rate: np.ndarray, acceleration: np.ndarray, weight: float,
) -> None:
    """Add a stage's slope to the weighted sums."""
    for j in range(q_sum.shape[0]):
        for k in range(q_sum.shape[1]):
            q_sum[j, k] += weight * rate[j, k]
            rate_sum[j, k] += weight * acceleration[j, k]


@kernel
def _first_bad_joint(q: np.ndarray, q_rate: np.ndarray, chains: int) -> int:
    """Return the first chain with a joint at or past +-pi or not finite, or -1."""
    worst = 0.0
    for j in range(q.shape[0]):
        for k in range(chains):
            worst += 0.0 if abs(q[j, k]) < pi and isfinite(q_rate[j, k]) else 1.0
    if worst > 0.0:
        for k in range(chains):
            for j in range(q.shape[0]):
                if not (abs(q[j, k]) < pi and isfinite(q_rate[j, k])):
                    return k
    return -1


FIN_FAILED, BODY_FAILED = 1, 2
STILL = (0.0, 0.0, 0.0)  # water velocity


def _build_advance(digest: str) -> Callable[..., Any]:
    @entry_kernel
    def advance(constants: Constants, motion: Motion, steps: int) -> tuple[int, int, int, int]:
        """Take `steps` steps in place; return steps taken, what failed (0 nothing), and its side and chain."""
        _ = digest
        position, orientation, twist, acceleration, q_both, rate_both = motion[:6]
        gait, gait_rate, command, cycle_angle, rod_angles, fin_wrenches = motion[6:]
        dt = constants.time_step
        ratio = constants.rods[1] / constants.rods[0]
        links, tips = working_arrays(q_both.shape[1], q_both.shape[2])
        shape = q_both.shape[1:]
        q, q_rate, q_acceleration = np.empty(shape), np.empty(shape), np.empty(shape)
        q_sum, rate_sum = np.empty(shape), np.empty(shape)
        for step in range(steps):
            rotation = rotation_rows(orientation)
            current = rotate_back(rotation, constants.current)
            for side in range(2):
                base_q, base_rate = q_both[side], rate_both[side]
                # 1. the fin: classical Runge-Kutta, the body's motion held
                for j in range(shape[0]):
                    for k in range(shape[1]):
                        q[j, k], q_rate[j, k] = base_q[j, k], base_rate[j, k]
                        q_sum[j, k], rate_sum[j, k] = 0.0, 0.0
                for stage in range(4):
                    elapsed = 0.5 * dt * ((stage + 1) // 2)
                    rods = rod_motion(
                        ratio, constants.time_constant, gait[side], gait_rate[side], command[side], cycle_angle[side],
                        elapsed,
                    )
                    _fin(constants, links, tips, side, rods, twist, acceleration, current, q, q_rate, q_acceleration)
                    _collect(q_sum, rate_sum, q_rate, q_acceleration, 1.0 if stage == 0 or stage == 3 else 2.0)
                    if stage < 3:
                        ahead = 0.5 * dt * (stage // 2 + 1)
                        for j in range(shape[0]):
                            for k in range(shape[1]):
                                q[j, k] = base_q[j, k] + ahead * q_rate[j, k]
                                q_rate[j, k] = base_rate[j, k] + ahead * q_acceleration[j, k]
                for j in range(shape[0]):
                    for k in range(shape[1]):
                        base_q[j, k] += dt / 6.0 * q_sum[j, k]
                        base_rate[j, k] += dt / 6.0 * rate_sum[j, k]
                bad_chain = _first_bad_joint(base_q, base_rate, constants.chains)
                if bad_chain >= 0:
                    return step, FIN_FAILED, side, bad_chain
                # 2. its wrench at the end of the step
                rods = rod_motion(
                    ratio, constants.time_constant, gait[side], gait_rate[side], command[side], cycle_angle[side], dt,
                )
                evaluated = _fin(
                    constants, links, tips, side, rods, twist, acceleration, current, base_q, base_rate, q_acceleration)
                force, moment = _wrench(constants, links, tips, side, evaluated)
                for axis in range(3):
                    fin_wrenches[side, axis], fin_wrenches[side, 3 + axis] = force[axis], moment[axis]
                rod_angles[side, 0], rod_angles[side, 1] = rods[0][0], rods[1][0]
                cycle_angle[side] = advance_gait(
                    gait[side], gait_rate[side], command[side], cycle_angle[side], constants.time_constant, dt)
            # 3. the body: forward Euler
            if not constants.fixed_base:
                total = fin_wrenches[0] + fin_wrenches[1]
                velocity, omega = _triple(twist, 0), _triple(twist, 3)
                linear, angular = body_acceleration(
                    constants.body, rotation, velocity, omega, current, _triple(total, 0), _triple(total, 3))
                moved = rotate(rotation, velocity)
                turn(orientation, omega, dt)
                sound = True
                for axis in range(3):
                    position[axis] += dt * moved[axis]
                    acceleration[axis], acceleration[3 + axis] = linear[axis], angular[axis]
                    twist[axis] += dt * linear[axis]
                    twist[3 + axis] += dt * angular[axis]
                    sound = sound and isfinite(twist[axis]) and isfinite(twist[3 + axis]) and isfinite(position[axis])
                if not sound:
                    return step, BODY_FAILED, 0, 0
        return steps, 0, 0, 0

    return advance


def _build_evaluate(digest: str) -> Callable[..., Any]:
    @entry_kernel
    def evaluate(
        constants: Constants, side: int, rods: np.ndarray, q: np.ndarray, q_rate: np.ndarray, twist: np.ndarray,
        acceleration: np.ndarray, wrench: np.ndarray,
    ) -> np.ndarray:
        """Return joint accelerations (links, row) of one fin in still water, and fill its wrench on the body (6,)."""
        _ = digest
        links, tips = working_arrays(q.shape[0], q.shape[1])
        q_acceleration = np.empty(q.shape)
        front, rear = _triple(rods[0], 0), _triple(rods[1], 0)
        evaluated = _fin(
            constants, links, tips, side, (front, rear), twist, acceleration, STILL, q, q_rate, q_acceleration)
        force, moment = _wrench(constants, links, tips, side, evaluated)
        for axis in range(3):
            wrench[axis], wrench[3 + axis] = force[axis], moment[axis]
        return q_acceleration

    return evaluate


advance_kernel = _build_advance(source_digest())
evaluate_kernel = _build_evaluate(source_digest())

"""Fins and body coupled step by step, Section 4 and Figure 6, and the compiled entry points."""

from __future__ import annotations

from collections.abc import Callable
from math import pi
from typing import Any, NamedTuple

import numpy as np

from manta_sim_ros.dynamics.actuation import Rod, RodConstants, SupportMotion, support_motion
from manta_sim_ros.dynamics.body import BodyConstants, body_acceleration
from manta_sim_ros.dynamics.compilation import entry_kernel, kernel, source_digest
from manta_sim_ros.dynamics.fin import (
    FinConstants,
    accelerate,
    root_wrench,
    stations,
    working_arrays,
    wrench_on_body,
)
from manta_sim_ros.dynamics.gait import advance_gait, rod_motion
from manta_sim_ros.dynamics.geometry import (
    Rotation,
    add,
    mirror_axial,
    mirror_polar,
    rotate,
    rotate_back,
    rotation_rows,
    turn,
)
from manta_sim_ros.dynamics.parameters import Parameters, Vector

FASTEST = 1e3
"""Velocity [m/s] and angular velocity [rad/s] of the body that no motion of the robot comes near: it has diverged."""


class Constants(NamedTuple):
    """The parameters as the kernels take them."""

    fin: FinConstants
    rods: RodConstants
    body: BodyConstants
    current: Vector  # of the water, world frame [m/s]
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


@kernel
def _to_rows(joints: np.ndarray, rows: np.ndarray) -> None:
    """Lay (n, m) out as [link, chain]; the rest of a row repeats the last chain."""
    last = joints.shape[0] - 1
    for j in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            rows[j, k] = joints[min(k, last), j]


@kernel
def _from_rows(rows: np.ndarray, joints: np.ndarray) -> None:
    for k in range(joints.shape[0]):
        for j in range(joints.shape[1]):
            joints[k, j] = rows[j, k]


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


@kernel
def _copy(source: np.ndarray, target: np.ndarray) -> None:
    for j in range(source.shape[0]):
        for k in range(source.shape[1]):
            target[j, k] = source[j, k]


@kernel
def _next_stage(
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
def _first_bad_chain(q: np.ndarray, q_rate: np.ndarray, chains: int) -> int:
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


@kernel
def _step_body(
    constants: Constants, motion: Motion, rotation: Rotation, current: Vector, force: Vector, moment: Vector,
) -> bool:
    """Forward Euler of the body, the wrench of both fins given; return whether it stays slower than `FASTEST`."""
    position, orientation, twist, acceleration = motion[:4]
    dt = constants.time_step
    velocity, omega = _triple(twist, 0), _triple(twist, 3)
    linear, angular = body_acceleration(constants.body, rotation, velocity, omega, current, force, moment)
    moved = rotate(rotation, velocity)
    turn(orientation, omega, dt)
    sound = True
    for axis in range(3):
        position[axis] += dt * moved[axis]
        acceleration[axis], acceleration[3 + axis] = linear[axis], angular[axis]
        twist[axis] += dt * linear[axis]
        twist[3 + axis] += dt * angular[axis]
        sound = sound and abs(twist[axis]) < FASTEST and abs(twist[3 + axis]) < FASTEST  # also refuses nan
    return sound


FIN_FAILED, BODY_FAILED = 1, 2
RK4_TIMES = (0.0, 0.5, 0.5, 1.0, 1.0)  # of the four stages and of the wrench, in steps
RK4_WEIGHTS = (1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0)
RK4_AHEAD = (0.5, 0.5, 1.0, 0.0)  # how far a stage's slope is followed to the next one, in steps


def _build_advance(digest: str) -> Callable[..., Any]:
    @entry_kernel
    def advance(constants: Constants, motion: Motion, steps: int) -> tuple[int, int, int, int]:
        """Take `steps` steps in place; return steps taken, what failed (0 nothing), and its side and chain."""
        _ = digest
        orientation, twist, acceleration, joint_angles, joint_rates = motion[1:6]
        gait, gait_rate, command, cycle_angle, rod_angles, fin_wrenches = motion[6:]
        fin, time_constant = constants.fin, constants.time_constant
        dt = constants.time_step
        ratio = constants.rods[1] / constants.rods[0]
        links, row = joint_angles.shape[2], fin.station.shape[0]
        link_arrays, row_arrays = working_arrays(links, row)
        c, s, w, y, z, y_rate, z_rate, torque, slope, drag, h_y, h_z, d_inverse, q_bias, g_y, g_z = link_arrays
        m_yy, m_yz, m_zz, p_y, p_z, first, second, third = row_arrays
        shape = (links, row)
        q, q_rate, q_acceleration = np.empty(shape), np.empty(shape), np.empty(shape)
        sum_q, sum_rate = np.empty(shape), np.empty(shape)
        q_fins, q_rate_fins = np.empty((2, links, row)), np.empty((2, links, row))
        for side in range(2):
            _to_rows(joint_angles[side], q_fins[side])
            _to_rows(joint_rates[side], q_rate_fins[side])
        for step in range(steps):
            rotation = rotation_rows(orientation)
            current = rotate_back(rotation, constants.current)
            total_force, total_moment = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
            for side in range(2):
                base_q, base_rate = q_fins[side], q_rate_fins[side]
                _copy(base_q, q)
                _copy(base_rate, q_rate)
                _copy(base_q, sum_q)
                _copy(base_rate, sum_rate)
                # 1. the fin: classical Runge-Kutta, the body's motion held; 2. a fifth evaluation for its wrench
                for stage in range(5):
                    front, rear = rod_motion(
                        ratio, time_constant, gait[side], gait_rate[side], command[side], cycle_angle[side],
                        RK4_TIMES[stage] * dt,
                    )
                    support = _support(constants.rods, side, front, rear, twist, acceleration)
                    a, a_slope = accelerate(
                        fin, support, rotate_back(support[0], _polar(current, side)),
                        q, q_rate, q_acceleration, c, s, w, y, z, y_rate, z_rate, torque, slope, drag,
                        h_y, h_z, d_inverse, q_bias, g_y, g_z, m_yy, m_yz, m_zz, p_y, p_z, first, second, third,
                    )
                    if stage < 4:
                        _next_stage(
                            q, q_rate, q_acceleration, base_q, base_rate, sum_q, sum_rate,
                            RK4_WEIGHTS[stage] * dt, RK4_AHEAD[stage] * dt,
                        )
                    if stage == 3:
                        _copy(sum_q, q)
                        _copy(sum_rate, q_rate)
                _copy(q, base_q)
                _copy(q_rate, base_rate)
                bad_chain = _first_bad_chain(q, q_rate, fin.chains)
                if bad_chain >= 0:
                    return step, FIN_FAILED, side, bad_chain
                force_0, moment_0 = root_wrench(
                    fin, c, s, w, y, z, y_rate, z_rate, torque, slope, drag,
                    m_yy, m_yz, m_zz, p_y, p_z, support[3], a, a_slope, support[5],
                )
                force, moment = wrench_on_body(support, force_0, moment_0)
                force, moment = _polar(force, side), _axial(moment, side)
                total_force, total_moment = add(total_force, force), add(total_moment, moment)
                for axis in range(3):
                    fin_wrenches[side, axis], fin_wrenches[side, 3 + axis] = force[axis], moment[axis]
                rod_angles[side, 0], rod_angles[side, 1] = front[0], rear[0]
                cycle_angle[side] = advance_gait(
                    gait[side], gait_rate[side], command[side], cycle_angle[side], time_constant, dt)
            # 3. the body
            if not constants.fixed_base and not _step_body(
                constants, motion, rotation, current, total_force, total_moment,
            ):
                return step, BODY_FAILED, 0, 0
        for side in range(2):
            _from_rows(q_fins[side], joint_angles[side])
            _from_rows(q_rate_fins[side], joint_rates[side])
        return steps, 0, 0, 0

    return advance


def _build_evaluate(digest: str) -> Callable[..., Any]:
    @entry_kernel
    def evaluate(
        constants: Constants, side: int, rods: np.ndarray, joint_angles: np.ndarray, joint_rates: np.ndarray,
        twist: np.ndarray, acceleration: np.ndarray,
    ) -> tuple[np.ndarray, Vector, Vector]:
        """Return joint accelerations (n, m), force and moment on the body of one fin in still water."""
        _ = digest
        fin = constants.fin
        shape = (joint_angles.shape[1], fin.station.shape[0])
        link_arrays, row_arrays = working_arrays(shape[0], shape[1])
        c, s, w, y, z, y_rate, z_rate, torque, slope, drag, h_y, h_z, d_inverse, q_bias, g_y, g_z = link_arrays
        m_yy, m_yz, m_zz, p_y, p_z, first, second, third = row_arrays
        q, q_rate, q_acceleration = np.empty(shape), np.empty(shape), np.empty(shape)
        _to_rows(joint_angles, q)
        _to_rows(joint_rates, q_rate)
        support = _support(constants.rods, side, _triple(rods[0], 0), _triple(rods[1], 0), twist, acceleration)
        a, a_slope = accelerate(
            fin, support, (0.0, 0.0, 0.0),
            q, q_rate, q_acceleration, c, s, w, y, z, y_rate, z_rate, torque, slope, drag,
            h_y, h_z, d_inverse, q_bias, g_y, g_z, m_yy, m_yz, m_zz, p_y, p_z, first, second, third,
        )
        force_0, moment_0 = root_wrench(
            fin, c, s, w, y, z, y_rate, z_rate, torque, slope, drag,
            m_yy, m_yz, m_zz, p_y, p_z, support[3], a, a_slope, support[5],
        )
        force, moment = wrench_on_body(support, force_0, moment_0)
        joint_accelerations = np.empty(joint_angles.shape)
        _from_rows(q_acceleration, joint_accelerations)
        return joint_accelerations, _polar(force, side), _axial(moment, side)

    return evaluate


advance_kernel = _build_advance(source_digest())
evaluate_kernel = _build_evaluate(source_digest())

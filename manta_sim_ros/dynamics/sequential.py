"""Fins and body one after the other in each step, Section 4 and Figure 6: the paper's coupling, of first order."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from manta_sim_ros.dynamics.body import add_outside, body_acceleration, body_load
from manta_sim_ros.dynamics.compilation import entry_kernel, kernel, source_digest
from manta_sim_ros.dynamics.coupling import (
    BODY_FAILED,
    FASTEST,
    FIN_FAILED,
    RK4_AHEAD,
    RK4_WEIGHTS,
    Constants,
    Motion,
    axial,
    first_bad_chain,
    from_rows,
    next_stage,
    polar,
    support_of,
    to_rows,
    triple,
)
from manta_sim_ros.dynamics.fin import accelerate, root_wrench, working_arrays, wrench_on_body
from manta_sim_ros.dynamics.gait import advance_gait, rod_motion
from manta_sim_ros.dynamics.geometry import Rotation, add, rotate, rotate_back, rotation_rows, turn
from manta_sim_ros.dynamics.parameters import Vector

TIMES = (0.0, 0.5, 0.5, 1.0, 1.0)
"""Of the four stages and of the wrench, in steps."""


@kernel
def _step_body(
    constants: Constants, motion: Motion, rotation: Rotation, current: Vector, force: Vector, moment: Vector,
) -> bool:
    """Forward Euler of the body, the wrench of both fins given; return whether it stays slower than `FASTEST`."""
    position, orientation, twist, acceleration = motion[:4]
    dt = constants.time_step
    velocity, omega = triple(twist, 0), triple(twist, 3)
    load, load_moment = body_load(constants.body, rotation, velocity, omega, current)
    load, load_moment = add_outside(constants.outside, rotation, load, load_moment)
    linear, angular = body_acceleration(constants.body, add(load, force), add(load_moment, moment))
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
            to_rows(joint_angles[side], q_fins[side])
            to_rows(joint_rates[side], q_rate_fins[side])
        for step in range(steps):
            rotation = rotation_rows(orientation)
            current = rotate_back(rotation, constants.current)
            total_force, total_moment = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
            for side in range(2):
                base_q, base_rate = q_fins[side], q_rate_fins[side]
                q[:] = base_q
                q_rate[:] = base_rate
                sum_q[:] = base_q
                sum_rate[:] = base_rate
                # 1. the fin: classical Runge-Kutta, the body's motion held; 2. a fifth evaluation for its wrench
                for stage in range(5):
                    front, rear = rod_motion(
                        ratio, time_constant, gait[side], gait_rate[side], command[side], cycle_angle[side],
                        TIMES[stage] * dt,
                    )
                    support = support_of(constants.rods, side, front, rear, twist, acceleration)
                    a, a_slope = accelerate(
                        fin, support, rotate_back(support[0], polar(current, side)),
                        q, q_rate, q_acceleration, c, s, w, y, z, y_rate, z_rate, torque, slope, drag,
                        h_y, h_z, d_inverse, q_bias, g_y, g_z, m_yy, m_yz, m_zz, p_y, p_z, first, second, third,
                    )
                    if stage < 4:
                        next_stage(
                            q, q_rate, q_acceleration, base_q, base_rate, sum_q, sum_rate,
                            RK4_WEIGHTS[stage] * dt, RK4_AHEAD[stage] * dt,
                        )
                    if stage == 3:
                        q[:] = sum_q
                        q_rate[:] = sum_rate
                base_q[:] = q
                base_rate[:] = q_rate
                bad_chain = first_bad_chain(q, q_rate, fin.chains)
                if bad_chain >= 0:
                    return step, FIN_FAILED, side, bad_chain
                force_0, moment_0 = root_wrench(
                    fin, c, s, w, y, z, y_rate, z_rate, torque, slope, drag,
                    m_yy, m_yz, m_zz, p_y, p_z, support[3], a, a_slope, support[5],
                )
                force, moment = wrench_on_body(support, force_0, moment_0)
                force, moment = polar(force, side), axial(moment, side)
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
            from_rows(q_fins[side], joint_angles[side])
            from_rows(q_rate_fins[side], joint_rates[side])
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
        to_rows(joint_angles, q)
        to_rows(joint_rates, q_rate)
        support = support_of(constants.rods, side, triple(rods[0], 0), triple(rods[1], 0), twist, acceleration)
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
        from_rows(q_acceleration, joint_accelerations)
        return joint_accelerations, polar(force, side), axial(moment, side)

    return evaluate


advance_kernel = _build_advance(source_digest())
evaluate_kernel = _build_evaluate(source_digest())

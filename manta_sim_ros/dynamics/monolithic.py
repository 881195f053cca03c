"""Fins and body solved together: the whole state by the classical Runge-Kutta scheme, of fourth order.

The wrench of a fin is affine in the body's acceleration: `articulated` gives both parts, and (36) with them is six
linear equations for that acceleration, at every stage.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from manta_sim_ros.dynamics.actuation import SupportMotion
from manta_sim_ros.dynamics.articulated import (
    add_oblique_mass,
    chain_inertia_arrays,
    eliminate_joints,
    follow_support,
    inertia_about_body,
    inertia_along_support,
    support_inertia,
)
from manta_sim_ros.dynamics.body import (
    add_outside,
    attitude,
    body_derivative,
    body_load,
    normalise,
    slower_than,
    solve_body,
)
from manta_sim_ros.dynamics.compilation import entry_kernel, kernel, source_digest
from manta_sim_ros.dynamics.coupling import (
    BODY_FAILED,
    FASTEST,
    FIN_FAILED,
    RK4_AHEAD,
    RK4_WEIGHTS,
    SOLUTION_FAILED,
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
from manta_sim_ros.dynamics.fin import link_motion, support_acceleration, surface_slopes, wrench_on_body
from manta_sim_ros.dynamics.gait import advance_gait, rod_motion
from manta_sim_ros.dynamics.geometry import rotate_back, subtract
from manta_sim_ros.dynamics.parameters import Vector

TIMES = (0.0, 0.5, 0.5, 1.0)
"""Of the four stages, in steps."""

MIRROR = (1.0, -1.0, 1.0, -1.0, 1.0, -1.0)
"""Signs of the components of a twist or wrench in the mirror y = 0."""


@kernel
def _apparent_inertia(
    side: int, support: SupportMotion, a: Vector, omega_1: Vector, in_frame_0: np.ndarray, bias: np.ndarray,
    transform: np.ndarray, product: np.ndarray, inertia: np.ndarray, wrench: np.ndarray,
) -> None:
    """Fill `wrench` (6,) of a fin on the body when the body's acceleration is 0, and `inertia` (6, 6) that resists it.

    About the centre of mass, components in F_b. `in_frame_0`, `bias` are H and p, and are overwritten; `a`, `omega_1`
    the support's acceleration without the body's; the rest is scratch.
    """
    b = (a[0], a[1], a[2], omega_1[0], omega_1[1], omega_1[2])
    for i in range(6):
        for j in range(6):
            bias[i] += in_frame_0[i, j] * b[j]
    inertia_about_body(support, transform, product, in_frame_0)
    force, moment = wrench_on_body(support, (-bias[0], -bias[1], -bias[2]), (-bias[3], -bias[4], -bias[5]))
    force, moment = polar(force, side), axial(moment, side)
    for i in range(3):
        wrench[i], wrench[3 + i] = force[i], moment[i]
    for i in range(6):
        for j in range(6):
            inertia[i, j] = in_frame_0[i, j] * MIRROR[i] * MIRROR[j] if side == 1 else in_frame_0[i, j]


def _build_advance(digest: str) -> Callable[..., Any]:
    @entry_kernel
    def advance(constants: Constants, motion: Motion, steps: int) -> tuple[int, int, int, int]:
        """Take `steps` steps in place; return steps taken, what failed (0 nothing), and its side and chain."""
        _ = digest
        if steps == 0:
            return 0, 0, 0, 0
        joint_angles, joint_rates = motion[4:6]
        gait, gait_rate, command, cycle_angle, rod_angles, fin_wrenches = motion[6:]
        fin, rods, time_constant, dt = constants.fin, constants.rods, constants.time_constant, constants.time_step
        dl, station = fin.link_length, fin.station
        ratio = rods[1] / rods[0]
        links, row = joint_angles.shape[2], station.shape[0]
        shape, pair = (links, row), (2, links, row)
        q, q_rate, q_acceleration = np.empty(pair), np.empty(pair), np.empty(pair)
        base_q, base_rate, sum_q, sum_rate = np.empty(pair), np.empty(pair), np.empty(pair), np.empty(pair)
        c, s, g_y, g_z = np.empty(pair), np.empty(pair), np.empty(pair), np.empty(pair)
        w_0, w_y, w_z = np.empty(pair), np.empty(pair), np.empty(pair)
        w_1, w_2, w_3 = np.zeros(pair), np.zeros(pair), np.zeros(pair)  # without added mass they stay 0
        w, y, z, y_rate, z_rate = np.empty(shape), np.empty(shape), np.empty(shape), np.empty(shape), np.empty(shape)
        torque, slope, normal, d_inverse = np.empty(shape), np.empty(shape), np.empty(shape), np.empty(shape)
        chain = chain_inertia_arrays(row)
        m_yy, m_yz, m_zz, b_y1, b_y2, b_y3, b_z1, b_z2, b_z3, c_11, c_12, c_13, c_22, c_23, c_33 = chain[:15]
        p_y, p_z, r_1, r_2, r_3, beyond = chain[15:]
        first, second = np.empty(row), np.empty(row)
        body, base_body, sum_body, body_slope = np.empty(13), np.empty(13), np.empty(13), np.empty(13)
        matrix, right, acceleration = np.empty((6, 6)), np.empty(6), np.zeros(6)
        at_support, product, bias = np.empty((6, 6)), np.empty((6, 6)), np.empty(6)
        inertia, wrench, transform = np.empty((2, 6, 6)), np.empty((2, 6)), np.empty((2, 6, 6))
        support_0, omega_0 = np.empty((2, 6)), np.empty((2, 3))
        still = np.zeros(6)

        body[:3], body[3:7], body[7:] = motion[0], motion[1], motion[2]
        for side in range(2):
            to_rows(joint_angles[side], q[side])
            to_rows(joint_rates[side], q_rate[side])
        for step in range(steps + 1):  # the last one is the evaluation of what the steps end in
            base_body[:], sum_body[:] = body, body
            base_q[:], base_rate[:], sum_q[:], sum_rate[:] = q, q_rate, q, q_rate
            for stage in range(4):
                elapsed = TIMES[stage] * dt
                rotation = attitude(body)
                current = rotate_back(rotation, constants.current)
                load, load_moment = body_load(constants.body, rotation, triple(body, 7), triple(body, 10), current)
                load, load_moment = add_outside(constants.outside, rotation, load, load_moment)
                for side in range(2):
                    front, rear = rod_motion(
                        ratio, time_constant, gait[side], gait_rate[side], command[side], cycle_angle[side], elapsed)
                    rod_angles[side, 0], rod_angles[side, 1] = front[0], rear[0]
                    support = support_of(rods, side, front, rear, body[7:], still)
                    a, _ = support_acceleration(support)
                    omega, omega_1 = support[3], support[5]
                    water = rotate_back(support[0], polar(current, side))
                    link_motion(
                        q[side], q_rate[side], c[side], s[side], w, y, z, y_rate, z_rate, torque,
                        m_yy, m_yz, m_zz, p_y, p_z, first, second, dl, fin.stiffness, fin.damping,
                    )
                    surface_slopes(c[side], s[side], y, z, slope, fin.chains, fin.chain_spacing)
                    eliminate_joints(
                        c[side], s[side], w, y, z, y_rate, z_rate, torque, slope, normal,
                        w_0[side], w_y[side], w_z[side], d_inverse, g_y[side], g_z[side],
                        m_yy, m_yz, m_zz, p_y, p_z, beyond, station, subtract(support[2], water), omega, dl,
                        fin.link_mass, fin.added_mass, fin.drag,
                    )
                    inertia_along_support(
                        c[side], s[side], w, y, z, y_rate, z_rate, slope, normal, c_11, c_12, c_13, c_22, c_23, c_33,
                        r_1, r_2, r_3, station, omega, dl, fin.link_mass,
                    )
                    if fin.added_mass > 0.0:
                        add_oblique_mass(
                            c[side], s[side], y, z, slope, w_0[side], w_y[side], w_z[side], d_inverse,
                            g_y[side], g_z[side], w_1[side], w_2[side], w_3[side], b_y1, b_y2, b_y3, b_z1, b_z2, b_z3,
                            c_11, c_12, c_13, c_22, c_23, c_33, r_1, r_2, r_3, dl, fin.added_mass,
                        )
                    support_inertia(
                        fin, omega, m_yy, m_yz, m_zz, b_y1, b_y2, b_y3, b_z1, b_z2, b_z3, c_11, c_12, c_13, c_22, c_23,
                        c_33, p_y, p_z, r_1, r_2, r_3, beyond, at_support, bias,
                    )
                    _apparent_inertia(
                        side, support, a, omega_1, at_support, bias, transform[side], product, inertia[side],
                        wrench[side],
                    )
                    for i in range(3):
                        support_0[side, i], support_0[side, 3 + i], omega_0[side, i] = a[i], omega_1[i], omega[i]

                if not constants.fixed_base and not solve_body(
                    constants.body, load, load_moment, inertia, wrench, matrix, acceleration,
                ):
                    for side in range(2):
                        bad_chain = first_bad_chain(q[side], q_rate[side], fin.chains)
                        if bad_chain >= 0:
                            return step, FIN_FAILED, side, bad_chain
                    return step, SOLUTION_FAILED, 0, 0
                for side in range(2):
                    for i in range(6):
                        right[i] = support_0[side, i]
                        for j in range(6):
                            sign = MIRROR[j] if side == 1 else 1.0
                            right[i] += transform[side, i, j] * (sign * acceleration[j])
                    follow_support(
                        c[side], s[side], w_0[side], w_y[side], w_z[side], w_1[side], w_2[side], w_3[side], g_y[side],
                        g_z[side], first, second, beyond, station, q_acceleration[side], triple(omega_0[side], 0),
                        triple(right, 0), triple(right, 3), dl,
                    )
                if step == steps:
                    break
                if not constants.fixed_base:
                    body_derivative(body, rotation, acceleration, body_slope)
                    for i in range(13):
                        sum_body[i] += RK4_WEIGHTS[stage] * dt * body_slope[i]
                        body[i] = base_body[i] + RK4_AHEAD[stage] * dt * body_slope[i]
                for side in range(2):
                    next_stage(
                        q[side], q_rate[side], q_acceleration[side], base_q[side], base_rate[side], sum_q[side],
                        sum_rate[side], RK4_WEIGHTS[stage] * dt, RK4_AHEAD[stage] * dt,
                    )
            if step == steps:
                break
            q[:], q_rate[:], body[:] = sum_q, sum_rate, sum_body
            for side in range(2):
                bad_chain = first_bad_chain(q[side], q_rate[side], fin.chains)
                if bad_chain >= 0:
                    return step, FIN_FAILED, side, bad_chain
                cycle_angle[side] = advance_gait(
                    gait[side], gait_rate[side], command[side], cycle_angle[side], time_constant, dt)
            if not constants.fixed_base:
                normalise(body)
            if not slower_than(body, FASTEST):
                return step, BODY_FAILED, 0, 0

        position, orientation, twist, acceleration_found = motion[:4]
        position[:], orientation[:], twist[:], acceleration_found[:] = body[:3], body[3:7], body[7:], acceleration
        for side in range(2):
            from_rows(q[side], joint_angles[side])
            from_rows(q_rate[side], joint_rates[side])
            for i in range(6):
                fin_wrenches[side, i] = wrench[side, i]
                for j in range(6):
                    fin_wrenches[side, i] -= inertia[side, i, j] * acceleration[j]
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
        dl, station = fin.link_length, fin.station
        shape, row = (joint_angles.shape[1], station.shape[0]), station.shape[0]
        q, q_rate, q_acceleration = np.empty(shape), np.empty(shape), np.empty(shape)
        c, s, w, y, z = np.empty(shape), np.empty(shape), np.empty(shape), np.empty(shape), np.empty(shape)
        y_rate, z_rate, torque, slope = np.empty(shape), np.empty(shape), np.empty(shape), np.empty(shape)
        normal, w_0, w_y, w_z = np.empty(shape), np.empty(shape), np.empty(shape), np.empty(shape)
        d_inverse, g_y, g_z = np.empty(shape), np.empty(shape), np.empty(shape)
        w_1, w_2, w_3 = np.zeros(shape), np.zeros(shape), np.zeros(shape)  # without added mass they stay 0
        chain = chain_inertia_arrays(row)
        m_yy, m_yz, m_zz, b_y1, b_y2, b_y3, b_z1, b_z2, b_z3, c_11, c_12, c_13, c_22, c_23, c_33 = chain[:15]
        p_y, p_z, r_1, r_2, r_3, beyond = chain[15:]
        first, second = np.empty(row), np.empty(row)
        inertia, bias = np.empty((6, 6)), np.empty(6)
        to_rows(joint_angles, q)
        to_rows(joint_rates, q_rate)
        support = support_of(constants.rods, side, triple(rods[0], 0), triple(rods[1], 0), twist, acceleration)
        a, _ = support_acceleration(support)
        omega, omega_1 = support[3], support[5]
        link_motion(
            q, q_rate, c, s, w, y, z, y_rate, z_rate, torque, m_yy, m_yz, m_zz, p_y, p_z, first, second,
            dl, fin.stiffness, fin.damping,
        )
        surface_slopes(c, s, y, z, slope, fin.chains, fin.chain_spacing)
        eliminate_joints(
            c, s, w, y, z, y_rate, z_rate, torque, slope, normal, w_0, w_y, w_z, d_inverse, g_y, g_z,
            m_yy, m_yz, m_zz, p_y, p_z, beyond, station, support[2], omega, dl, fin.link_mass, fin.added_mass, fin.drag,
        )
        inertia_along_support(
            c, s, w, y, z, y_rate, z_rate, slope, normal, c_11, c_12, c_13, c_22, c_23, c_33, r_1, r_2, r_3,
            station, omega, dl, fin.link_mass,
        )
        if fin.added_mass > 0.0:
            add_oblique_mass(
                c, s, y, z, slope, w_0, w_y, w_z, d_inverse, g_y, g_z, w_1, w_2, w_3, b_y1, b_y2, b_y3,
                b_z1, b_z2, b_z3, c_11, c_12, c_13, c_22, c_23, c_33, r_1, r_2, r_3, dl, fin.added_mass,
            )
        support_inertia(
            fin, omega, m_yy, m_yz, m_zz, b_y1, b_y2, b_y3, b_z1, b_z2, b_z3, c_11, c_12, c_13, c_22, c_23, c_33,
            p_y, p_z, r_1, r_2, r_3, beyond, inertia, bias,
        )
        follow_support(
            c, s, w_0, w_y, w_z, w_1, w_2, w_3, g_y, g_z, first, second, beyond, station, q_acceleration,
            omega, a, omega_1, dl,
        )
        b = (a[0], a[1], a[2], omega_1[0], omega_1[1], omega_1[2])
        for i in range(6):
            for j in range(6):
                bias[i] += inertia[i, j] * b[j]
        force, moment = wrench_on_body(support, (-bias[0], -bias[1], -bias[2]), (-bias[3], -bias[4], -bias[5]))
        joint_accelerations = np.empty(joint_angles.shape)
        from_rows(q_acceleration, joint_accelerations)
        return joint_accelerations, polar(force, side), axial(moment, side)

    return evaluate


advance_kernel = _build_advance(source_digest())
evaluate_kernel = _build_evaluate(source_digest())

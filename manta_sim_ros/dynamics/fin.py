"""One flexible fin, (11) to (33): joint accelerations and the wrench on the body, for the left fin.

All hinges of a chain are parallel to x_0, so in the components of F_0 the recursion is planar plus the motion of the
support, which the whole fin shares. Arrays are link-major, [link, chain], so that the compiler's vector units run
across chains; link 0 is at the root, chain 0 at the leading edge. Every chain quantity is per unit chord.

Letters of the kernels, after the paper: c, s = cosine and sine of a link's angle to y_0; w its rate; u = (c, s) its
direction in the y-z plane of F_0 and u' = (-s, c) the normal to it; y, z its midpoint; V, W = V_0, Omega_0;
tau = joint torque; M, h, D, p, nu = inertia and bias of a link with all beyond it, reflected to its hinge.
"""

from __future__ import annotations

from math import factorial, sqrt
from typing import NamedTuple

import numpy as np

from manta_sim_ros.dynamics.actuation import SupportMotion
from manta_sim_ros.dynamics.compilation import inlined_kernel, kernel
from manta_sim_ros.dynamics.geometry import add, cross, rotate, subtract
from manta_sim_ros.dynamics.parameters import Vector

LANES = 16
"""Rows are as long as the next multiple of this many chains, so that no loop has a remainder."""


class FinConstants(NamedTuple):
    """What a fin's kernels need of the parameters, per unit chord."""

    chains: int  # n
    station: np.ndarray  # (row,), s of each chain from A [m]
    chain_spacing: float  # ds [m]
    link_length: float  # dl [m]
    link_mass: float  # rho_f h dl [kg/m]
    stiffness: float  # 2 E I / dl [N], with I = h^3 / 12
    damping: float  # c [N s]
    drag: float  # rho C_D dl / 2 [kg/m^2]
    added_mass: float  # C_a rho_a pi L dl / 4 [kg/m]


class Links(NamedTuple):
    """Working arrays of one fin, [link, chain]: the state of each link as an evaluation finds it."""

    c: np.ndarray
    s: np.ndarray
    w: np.ndarray  # rate of the link's angle [rad/s]
    y: np.ndarray  # midpoint [m]
    z: np.ndarray
    y_rate: np.ndarray  # its velocity in F_0 [m/s]
    z_rate: np.ndarray
    torque: np.ndarray  # elastic and damping torque of the link's joint [N]
    slope: np.ndarray  # chordwise slope of the surface normal to the link, n = (slope, -s, c) / sqrt(1 + slope^2)
    drag: np.ndarray  # drag along (slope, -s, c) [N/m]
    h_y: np.ndarray
    h_z: np.ndarray
    d_inverse: np.ndarray  # 1 / D
    q_bias: np.ndarray  # tau - nu
    g_y: np.ndarray  # acceleration gradient along the link, without the joints' accelerations [1/s^2]
    g_z: np.ndarray


class Rows(NamedTuple):
    """Working arrays of one fin, [chain]: what a recursion hands from link to link.

    Named by what `reflected_inertia` leaves there for the wrench; the other recursions use them before or leave them.
    """

    m_yy: np.ndarray  # mass that the support feels [kg/m]
    m_yz: np.ndarray
    m_zz: np.ndarray
    p_y: np.ndarray  # force that it must exert when it does not accelerate [N/m]
    p_z: np.ndarray
    first: np.ndarray
    second: np.ndarray
    third: np.ndarray


@kernel
def working_arrays(links: int, row: int) -> tuple[Links, Rows]:
    """Return new working arrays for rows of `row` chains."""
    shape = (links, row)
    return Links(
        np.empty(shape), np.empty(shape), np.empty(shape), np.empty(shape), np.empty(shape), np.empty(shape),
        np.empty(shape), np.empty(shape), np.empty(shape), np.empty(shape), np.empty(shape), np.empty(shape),
        np.empty(shape), np.empty(shape), np.empty(shape), np.empty(shape),
    ), Rows(
        np.empty(row), np.empty(row), np.empty(row), np.empty(row), np.empty(row), np.empty(row), np.empty(row),
        np.empty(row),
    )


def row_length(chains: int) -> int:
    """Return the length of a row that holds `chains` chains; the rest repeats the last chain."""
    return -(-chains // LANES) * LANES


def stations(chains: int, support_length: float) -> np.ndarray:
    """Return where the chains stand on the support, s from A [m], midpoint rule, padded to `row_length(chains)`."""
    spacing = support_length / chains
    real = support_length - (np.arange(chains) + 0.5) * spacing
    return np.concatenate((real, np.full(row_length(chains) - chains, real[-1])))


# Taylor's coefficients: for |x| <= pi / 2 what is left out is below 2e-18.
S1, S3, S5, S7, S9, S11, S13, S15, S17, S19, S21 = ((-1) ** k / factorial(2 * k + 1) for k in range(11))
C0, C2, C4, C6, C8, C10, C12, C14, C16, C18, C20, C22 = ((-1) ** k / factorial(2 * k) for k in range(12))


@kernel
def sine_cosine(x: float) -> tuple[float, float]:
    """Return sin x and cos x for |x| <= pi / 2, to rounding, in arithmetic that runs in vector units.

    Numba's own call the C library for one number at a time. Even and odd halves keep the chains of operations short.
    """
    x2 = x * x
    x4 = x2 * x2
    sine = S1 + x4 * (S5 + x4 * (S9 + x4 * (S13 + x4 * (S17 + x4 * S21))))
    sine += x2 * (S3 + x4 * (S7 + x4 * (S11 + x4 * (S15 + x4 * S19))))
    cosine = C0 + x4 * (C4 + x4 * (C8 + x4 * (C12 + x4 * (C16 + x4 * C20))))
    cosine += x2 * (C2 + x4 * (C6 + x4 * (C10 + x4 * (C14 + x4 * (C18 + x4 * C22)))))
    return x * sine, cosine


@kernel
def link_motion(
    q: np.ndarray, q_rate: np.ndarray, c: np.ndarray, s: np.ndarray, w: np.ndarray, y: np.ndarray, z: np.ndarray,
    y_rate: np.ndarray, z_rate: np.ndarray, torque: np.ndarray, tip_c: np.ndarray, tip_s: np.ndarray,
    tip_w: np.ndarray, tip_y: np.ndarray, tip_z: np.ndarray, tip_y_rate: np.ndarray, tip_z_rate: np.ndarray,
    dl: float, stiffness: float, damping: float,
) -> None:
    """From root to tip: direction, midpoint and velocity of each link in F_0, (16), and joint torque, (14), (15)."""
    links, row = q.shape
    for k in range(row):
        tip_c[k], tip_s[k], tip_w[k] = 1.0, 0.0, 0.0
        tip_y[k], tip_z[k], tip_y_rate[k], tip_z_rate[k] = 0.0, 0.0, 0.0, 0.0
    for j in range(links):
        for k in range(row):
            half_s, half_c = sine_cosine(0.5 * q[j, k])
            half_c2 = half_c * half_c
            q_c, q_s = half_c2 - half_s * half_s, 2.0 * half_s * half_c
            torque[j, k] = -stiffness * half_s / (half_c2 * half_c) - damping * q_rate[j, k]
            cj = tip_c[k] * q_c - tip_s[k] * q_s
            sj = tip_s[k] * q_c + tip_c[k] * q_s
            wj = tip_w[k] + q_rate[j, k]
            along_y, along_z = 0.5 * dl * cj, 0.5 * dl * sj
            y[j, k] = tip_y[k] + along_y
            z[j, k] = tip_z[k] + along_z
            y_rate[j, k] = tip_y_rate[k] - along_z * wj
            z_rate[j, k] = tip_z_rate[k] + along_y * wj
            tip_y[k] += 2.0 * along_y
            tip_z[k] += 2.0 * along_z
            tip_y_rate[k] -= 2.0 * along_z * wj
            tip_z_rate[k] += 2.0 * along_y * wj
            c[j, k], s[j, k], w[j, k] = cj, sj, wj
            tip_c[k], tip_s[k], tip_w[k] = cj, sj, wj


@kernel
def surface_slopes(
    c: np.ndarray, s: np.ndarray, y: np.ndarray, z: np.ndarray, slope: np.ndarray, chains: int, ds: float,
) -> None:
    """Chordwise slope of each link's normal, (11): n = t x u = (slope, -s, c), normalised where it is used.

    The sum of the tangents at root and tip of a link is twice the difference of its neighbours' midpoints.
    """
    links, row = c.shape
    last = chains - 1
    for j in range(links):
        slope[j, 0] = ((y[j, 0] - y[j, 1]) * s[j, 0] - (z[j, 0] - z[j, 1]) * c[j, 0]) / ds
        for k in range(1, last):
            slope[j, k] = ((y[j, k - 1] - y[j, k + 1]) * s[j, k] - (z[j, k - 1] - z[j, k + 1]) * c[j, k]) / (2.0 * ds)
        slope[j, last] = (
            (y[j, last - 1] - y[j, last]) * s[j, last] - (z[j, last - 1] - z[j, last]) * c[j, last]
        ) / ds
        for k in range(chains, row):
            slope[j, k] = slope[j, last]


@kernel
def link_drag(
    c: float, s: float, y: float, z: float, y_rate: float, z_rate: float, slope: float, station: float,
    through_water: Vector, omega: Vector, drag_factor: float,
) -> float:
    """Return the drag on a link along (slope, -s, c), which is not of unit length, per unit chord [N/m], (12)."""
    vx, vy, vz = through_water
    wx, wy, wz = omega
    normal_velocity = (
        slope * (vx + wy * z - wz * y)
        - s * (vy + wz * station - wx * z + y_rate)
        + c * (vz + wx * y - wy * station + z_rate)
    )
    n2 = 1.0 + slope * slope
    return -drag_factor * abs(normal_velocity) * normal_velocity / (n2 * sqrt(n2))


@kernel
def reflected_inertia(
    c: np.ndarray, s: np.ndarray, w: np.ndarray, y: np.ndarray, z: np.ndarray, y_rate: np.ndarray,
    z_rate: np.ndarray, torque: np.ndarray, slope: np.ndarray, drag: np.ndarray, h_y: np.ndarray, h_z: np.ndarray,
    d_inverse: np.ndarray, q_bias: np.ndarray, g_y: np.ndarray, g_z: np.ndarray, m_yy: np.ndarray,
    m_yz: np.ndarray, m_zz: np.ndarray, p_y: np.ndarray, p_z: np.ndarray, beyond: np.ndarray, station: np.ndarray,
    through_water: Vector, omega: Vector, roll_acceleration: float, dl: float, mass: float, drag_factor: float,
) -> None:
    """From tip to root: drag (12), then inertia and bias of each link with all beyond it, (18) to (26).

    With a the acceleration of the link's hinge, f the force and tau the torque that it must get there:
    f = M a + h w-dot + p and tau = h.a + D w-dot + nu. Eliminating w-dot link by link is (29) solved from the tip, at a
    cost linear in the number of links. Afterwards m, p hold the root's f = M a + p with w-dot eliminated.
    """
    links, row = c.shape
    wx, wy, wz = omega
    moment, inertia = 0.5 * mass * dl, mass * dl * dl / 3.0  # first and second, of the link's mass about its hinge
    for k in range(row):
        m_yy[k], m_yz[k], m_zz[k], p_y[k], p_z[k], beyond[k] = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(links - 1, -1, -1):
        for k in range(row):
            cj, sj, n_x = c[j, k], s[j, k], slope[j, k]
            force = link_drag(
                cj, sj, y[j, k], z[j, k], y_rate[j, k], z_rate[j, k], n_x, station[k],
                through_water, omega, drag_factor,
            )

            spin = w[j, k] + wx
            spin2 = spin * spin
            gy = -roll_acceleration * sj - spin2 * cj + wz * (wy * sj - wz * cj)
            gz = roll_acceleration * cj - spin2 * sj + wy * (wz * cj - wy * sj)
            ey = p_y[k] + dl * (m_yy[k] * gy + m_yz[k] * gz)
            ez = p_z[k] + dl * (m_yz[k] * gy + m_zz[k] * gz)
            ny = dl * (m_yz[k] * cj - m_yy[k] * sj)
            nz = dl * (m_zz[k] * cj - m_yz[k] * sj)

            hy = ny - moment * sj
            hz = nz + moment * cj
            inverse = 1.0 / (inertia + dl * (nz * cj - ny * sj))
            nu = inertia * (cj * gz - sj * gy) - 0.5 * dl * force + dl * (cj * ez - sj * ey) + beyond[k]
            bias = torque[j, k] - nu
            drag[j, k], h_y[j, k], h_z[j, k], d_inverse[j, k], q_bias[j, k] = force, hy, hz, inverse, bias
            g_y[j, k], g_z[j, k] = gy, gz

            by, bz = hy * inverse, hz * inverse
            m_yy[k] += mass - hy * by
            m_yz[k] -= hy * bz
            m_zz[k] += mass - hz * bz
            p_y[k] = ey + moment * gy + force * sj + by * bias
            p_z[k] = ez + moment * gz - force * cj + bz * bias
            beyond[k] = torque[j, k]


@kernel
def joint_accelerations(
    c: np.ndarray, s: np.ndarray, h_y: np.ndarray, h_z: np.ndarray, d_inverse: np.ndarray, q_bias: np.ndarray,
    g_y: np.ndarray, g_z: np.ndarray, a_y: np.ndarray, a_z: np.ndarray, w_dot: np.ndarray, station: np.ndarray,
    q_acceleration: np.ndarray, root: tuple[float, float], root_slope: tuple[float, float], dl: float,
) -> None:
    """From root to tip: joint accelerations [rad/s^2], (27) to (29).

    `root` is the acceleration of A and `root_slope` its change along x_0, y and z components in F_0.
    """
    links, row = c.shape
    for k in range(row):
        a_y[k] = root[0] + root_slope[0] * station[k]
        a_z[k] = root[1] + root_slope[1] * station[k]
        w_dot[k] = 0.0
    for j in range(links):
        for k in range(row):
            found = (q_bias[j, k] - h_y[j, k] * a_y[k] - h_z[j, k] * a_z[k]) * d_inverse[j, k]
            q_acceleration[j, k] = found - w_dot[k]
            w_dot[k] = found
            a_y[k] += dl * (g_y[j, k] - found * s[j, k])
            a_z[k] += dl * (g_z[j, k] + found * c[j, k])


@kernel
def root_wrench(
    fin: FinConstants,
    c: np.ndarray, s: np.ndarray, w: np.ndarray, y: np.ndarray, z: np.ndarray, y_rate: np.ndarray, z_rate: np.ndarray,
    torque: np.ndarray, slope: np.ndarray, drag: np.ndarray,
    m_yy: np.ndarray, m_yz: np.ndarray, m_zz: np.ndarray, p_y: np.ndarray, p_z: np.ndarray,
    omega: Vector, a: Vector, a_slope: Vector, omega_1: Vector,
) -> tuple[Vector, Vector]:
    """Return force and moment of the fin on its support about A, components in F_0, (31) to (33).

    `a` is the inertial acceleration of A; `a_slope` its derivative along x_0; after `reflected_inertia`.
    """
    dl, mass, chains, station = fin.link_length, fin.link_mass, fin.chains, fin.station
    wx, wy, wz = omega
    # how the x component of the acceleration of a point at rest in F_0 changes with its y and z
    xy, xz = wx * wy - omega_1[2], wx * wz + omega_1[1]
    fx, fy, fz, mx, my, mz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(chains):
        ay, az = a[1] + a_slope[1] * station[k], a[2] + a_slope[2] * station[k]
        root_fy = m_yy[k] * ay + m_yz[k] * az + p_y[k]
        root_fz = m_yz[k] * ay + m_zz[k] * az + p_z[k]
        fy -= root_fy
        fz -= root_fz
        mx -= torque[0, k]
        my += station[k] * root_fz
        mz -= station[k] * root_fy
    for j in range(c.shape[0]):
        for k in range(chains):
            ax = a[0] + a_slope[0] * station[k] + xy * y[j, k] + xz * z[j, k]
            ax += 2.0 * (wy * z_rate[j, k] - wz * y_rate[j, k])
            gx = xy * c[j, k] + xz * s[j, k] + 2.0 * w[j, k] * (wy * c[j, k] + wz * s[j, k])
            force = mass * ax - drag[j, k] * slope[j, k]
            fx -= force
            my -= z[j, k] * force + mass * dl * dl / 12.0 * s[j, k] * gx
            mz += y[j, k] * force + mass * dl * dl / 12.0 * c[j, k] * gx
    ds = fin.chain_spacing
    return (ds * fx, ds * fy, ds * fz), (ds * mx, ds * my, ds * mz)


@kernel
def support_acceleration(support: SupportMotion) -> tuple[Vector, Vector]:
    """Return the inertial acceleration of A, and how it changes along x_0, components in F_0."""
    _, _, velocity, omega, velocity_1, omega_1 = support
    along = (1.0, 0.0, 0.0)
    return add(velocity_1, cross(omega, velocity)), add(cross(omega_1, along), cross(omega, cross(omega, along)))


@inlined_kernel
def accelerate(
    fin: FinConstants, support: SupportMotion, water_velocity: Vector,
    q: np.ndarray, q_rate: np.ndarray, q_acceleration: np.ndarray,
    c: np.ndarray, s: np.ndarray, w: np.ndarray, y: np.ndarray, z: np.ndarray, y_rate: np.ndarray, z_rate: np.ndarray,
    torque: np.ndarray, slope: np.ndarray, drag: np.ndarray, h_y: np.ndarray, h_z: np.ndarray, d_inverse: np.ndarray,
    q_bias: np.ndarray, g_y: np.ndarray, g_z: np.ndarray,
    m_yy: np.ndarray, m_yz: np.ndarray, m_zz: np.ndarray, p_y: np.ndarray, p_z: np.ndarray,
    first: np.ndarray, second: np.ndarray, third: np.ndarray,
) -> tuple[Vector, Vector]:
    """Fill `q_acceleration` [rad/s^2] of one fin from `q`, `q_rate`, all [link, chain]; return support_acceleration.

    `water_velocity` is the water's, components in F_0; then the fields of `Links` and `Rows`, one by one: to take an
    array out of a tuple costs a count of its users, and so many in each evaluation as much as the arithmetic.
    """
    dl, station = fin.link_length, fin.station
    omega, omega_1 = support[3], support[5]
    a, a_slope = support_acceleration(support)
    link_motion(
        q, q_rate, c, s, w, y, z, y_rate, z_rate, torque, m_yy, m_yz, m_zz, p_y, p_z, first, second,
        dl, fin.stiffness, fin.damping,
    )
    surface_slopes(c, s, y, z, slope, fin.chains, fin.chain_spacing)
    reflected_inertia(
        c, s, w, y, z, y_rate, z_rate, torque, slope, drag, h_y, h_z, d_inverse, q_bias, g_y, g_z,
        m_yy, m_yz, m_zz, p_y, p_z, first, station, subtract(support[2], water_velocity), omega, omega_1[0],
        dl, fin.link_mass, fin.drag,
    )
    joint_accelerations(
        c, s, h_y, h_z, d_inverse, q_bias, g_y, g_z, first, second, third, station, q_acceleration,
        (a[1], a[2]), (a_slope[1], a_slope[2]), dl,
    )
    return a, a_slope


@kernel
def wrench_on_body(support: SupportMotion, force_0: Vector, moment_0: Vector) -> tuple[Vector, Vector]:
    """Return force and moment about the centre of mass, components in F_b, of a wrench about A in F_0, (33)."""
    rotation, position = support[0], support[1]
    force = rotate(rotation, force_0)
    return force, add(rotate(rotation, moment_0), cross(position, force))

"""The articulated inertia and bias wrench of one fin, its joints free, added mass included, for the left fin.

The accelerations of a fin's joints are linear in that of its support, b = (a, Omega_0-dot) at A in F_0. Eliminating
them from tip to root leaves what the support must exert, f = H b + p, with H symmetric. That is planar but for the
added mass: it pushes along the normals, which lean forward where the fin is twisted, and so ties the accelerations that
move links along x_0 to the planar ones. Letters as in `fin`, and

u = (a_x, y and z components of Omega_0-dot), what moves links along x_0; mu = added mass / (1 + slope^2);
f = M a + B u + p and f_u = B^T a + C u + r: force at a hinge and forces conjugate to u, of a link and all beyond it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from manta_sim_ros.dynamics.actuation import SupportMotion
from manta_sim_ros.dynamics.compilation import kernel
from manta_sim_ros.dynamics.fin import FinConstants, link_drag
from manta_sim_ros.dynamics.parameters import Vector


class ChainInertia(NamedTuple):
    """Working arrays of one fin, [chain]: M, B, C, p and r of each chain at its root."""

    m_yy: np.ndarray
    m_yz: np.ndarray
    m_zz: np.ndarray
    b_y1: np.ndarray
    b_y2: np.ndarray
    b_y3: np.ndarray
    b_z1: np.ndarray
    b_z2: np.ndarray
    b_z3: np.ndarray
    c_11: np.ndarray
    c_12: np.ndarray
    c_13: np.ndarray
    c_22: np.ndarray
    c_23: np.ndarray
    c_33: np.ndarray
    p_y: np.ndarray
    p_z: np.ndarray
    r_1: np.ndarray
    r_2: np.ndarray
    r_3: np.ndarray
    torque: np.ndarray  # of the root's joint


@kernel
def chain_inertia_arrays(row: int) -> ChainInertia:
    """Return new working arrays for rows of `row` chains; B is 0, as it stays without added mass."""
    return ChainInertia(
        np.zeros(row), np.zeros(row), np.zeros(row), np.zeros(row), np.zeros(row), np.zeros(row), np.zeros(row),
        np.zeros(row), np.zeros(row), np.zeros(row), np.zeros(row), np.zeros(row), np.zeros(row), np.zeros(row),
        np.zeros(row), np.zeros(row), np.zeros(row), np.zeros(row), np.zeros(row), np.zeros(row), np.zeros(row),
    )


@kernel
def _along_support(
    omega: Vector, station: float, y: float, z: float, y_rate: float, z_rate: float,
) -> float:
    """Return the acceleration along x_0 of a point of a link [m/s^2], without what u adds."""
    wx, wy, wz = omega
    return wx * (wy * y + wz * z) - (wy * wy + wz * wz) * station + 2.0 * (wy * z_rate - wz * y_rate)


@kernel
def eliminate_joints(
    c: np.ndarray, s: np.ndarray, w: np.ndarray, y: np.ndarray, z: np.ndarray, y_rate: np.ndarray,
    z_rate: np.ndarray, torque: np.ndarray, slope: np.ndarray, normal: np.ndarray, w_0: np.ndarray, w_y: np.ndarray,
    w_z: np.ndarray, d_inverse: np.ndarray, g_y: np.ndarray, g_z: np.ndarray, m_yy: np.ndarray, m_yz: np.ndarray,
    m_zz: np.ndarray, p_y: np.ndarray, p_z: np.ndarray, beyond: np.ndarray, station: np.ndarray,
    through_water: Vector, omega: Vector, dl: float, mass: float, added_mass: float, drag_factor: float,
) -> None:
    """From tip to root, with u = 0: drag (12), added mass, and M and p of each link with all beyond it, (18) to (26).

    A hinge must get tau = h.a + k.u + D w-dot + nu, so that w-dot = w_0 - w_y a_y - w_z a_z - k.u / D. It is that of
    the link's angle to inertial space: nothing here depends on the acceleration of the support. `normal` is the force
    along (slope, -s, c) that the link must get against drag and added mass.
    """
    links, row = c.shape
    wx, wy, wz = omega
    half = 0.5 * dl
    moment, inertia = half * mass, mass * dl * dl / 3.0
    for k in range(row):
        m_yy[k], m_yz[k], m_zz[k], p_y[k], p_z[k], beyond[k] = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(links - 1, -1, -1):
        for k in range(row):
            cj, sj, n_x = c[j, k], s[j, k], slope[j, k]
            mu = added_mass / (1.0 + n_x * n_x)
            spin = w[j, k] + wx
            spin2 = spin * spin
            gy = -spin2 * cj + wz * (wy * sj - wz * cj)
            gz = -spin2 * sj + wy * (wz * cj - wy * sj)
            turning = cj * gz - sj * gy
            ax = _along_support(omega, station[k], y[j, k], z[j, k], y_rate[j, k], z_rate[j, k])
            force = mu * (n_x * ax + half * turning) - link_drag(
                cj, sj, y[j, k], z[j, k], y_rate[j, k], z_rate[j, k], n_x, station[k],
                through_water, omega, drag_factor,
            )

            ey = p_y[k] + dl * (m_yy[k] * gy + m_yz[k] * gz)
            ez = p_z[k] + dl * (m_yz[k] * gy + m_zz[k] * gz)
            ny = dl * (m_yz[k] * cj - m_yy[k] * sj)
            nz = dl * (m_zz[k] * cj - m_yz[k] * sj)
            hy = ny - (moment + half * mu) * sj
            hz = nz + (moment + half * mu) * cj
            inverse = 1.0 / (inertia + half * half * mu + dl * (nz * cj - ny * sj))
            nu = inertia * turning + half * force + dl * (cj * ez - sj * ey) + beyond[k]
            alone = (torque[j, k] - nu) * inverse
            by, bz = hy * inverse, hz * inverse
            normal[j, k], w_0[j, k], w_y[j, k], w_z[j, k], d_inverse[j, k] = force, alone, by, bz, inverse
            g_y[j, k], g_z[j, k] = gy, gz

            m_yy[k] += mass + mu * sj * sj - hy * by
            m_yz[k] -= mu * sj * cj + hy * bz
            m_zz[k] += mass + mu * cj * cj - hz * bz
            p_y[k] = ey + moment * gy - force * sj + hy * alone
            p_z[k] = ez + moment * gz + force * cj + hz * alone
            beyond[k] = torque[j, k]


@kernel
def inertia_along_support(
    c: np.ndarray, s: np.ndarray, w: np.ndarray, y: np.ndarray, z: np.ndarray, y_rate: np.ndarray,
    z_rate: np.ndarray, slope: np.ndarray, normal: np.ndarray, c_11: np.ndarray, c_12: np.ndarray, c_13: np.ndarray,
    c_22: np.ndarray, c_23: np.ndarray, c_33: np.ndarray, r_1: np.ndarray, r_2: np.ndarray, r_3: np.ndarray,
    station: np.ndarray, omega: Vector, dl: float, mass: float,
) -> None:
    """Sum C and r of each chain's own mass and drag, after `eliminate_joints`: f_u = C u + r, (31)."""
    links, row = c.shape
    wx, wy, wz = omega
    central = mass * dl * dl / 12.0  # second moment of a link's mass about its midpoint
    for k in range(row):
        c_11[k], c_12[k], c_13[k], c_22[k], c_23[k], c_33[k] = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        r_1[k], r_2[k], r_3[k] = 0.0, 0.0, 0.0
    for j in range(links):
        for k in range(row):
            cj, sj, yj, zj = c[j, k], s[j, k], y[j, k], z[j, k]
            ax = _along_support(omega, station[k], yj, zj, y_rate[j, k], z_rate[j, k])
            gradient = central * (wx + 2.0 * w[j, k]) * (wy * cj + wz * sj)
            force = mass * ax + slope[j, k] * normal[j, k]
            r_1[k] += force
            r_2[k] += zj * force + sj * gradient
            r_3[k] -= yj * force + cj * gradient
            c_11[k] += mass
            c_12[k] += mass * zj
            c_13[k] -= mass * yj
            c_22[k] += mass * zj * zj + central * sj * sj
            c_23[k] -= mass * yj * zj + central * sj * cj
            c_33[k] += mass * yj * yj + central * cj * cj


@kernel
def add_oblique_mass(
    c: np.ndarray, s: np.ndarray, y: np.ndarray, z: np.ndarray, slope: np.ndarray, w_0: np.ndarray, w_y: np.ndarray,
    w_z: np.ndarray, d_inverse: np.ndarray, g_y: np.ndarray, g_z: np.ndarray, w_1: np.ndarray, w_2: np.ndarray,
    w_3: np.ndarray, b_y1: np.ndarray, b_y2: np.ndarray, b_y3: np.ndarray, b_z1: np.ndarray, b_z2: np.ndarray,
    b_z3: np.ndarray, c_11: np.ndarray, c_12: np.ndarray, c_13: np.ndarray, c_22: np.ndarray, c_23: np.ndarray,
    c_33: np.ndarray, r_1: np.ndarray, r_2: np.ndarray, r_3: np.ndarray, dl: float, added_mass: float,
) -> None:
    """From tip to root: B, w = k / D, and what added mass along leaning normals adds to C and r.

    After `eliminate_joints` and `inertia_along_support`.
    """
    links, row = c.shape
    half = 0.5 * dl
    for k in range(row):
        b_y1[k], b_y2[k], b_y3[k], b_z1[k], b_z2[k], b_z3[k] = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(links - 1, -1, -1):
        for k in range(row):
            cj, sj, yj, zj, n_x = c[j, k], s[j, k], y[j, k], z[j, k], slope[j, k]
            lean = added_mass * n_x / (1.0 + n_x * n_x)
            k1 = dl * (cj * b_z1[k] - sj * b_y1[k]) + half * lean
            k2 = dl * (cj * b_z2[k] - sj * b_y2[k]) + half * lean * zj
            k3 = dl * (cj * b_z3[k] - sj * b_y3[k]) - half * lean * yj
            w1, w2, w3 = k1 * d_inverse[j, k], k2 * d_inverse[j, k], k3 * d_inverse[j, k]
            w_1[j, k], w_2[j, k], w_3[j, k] = w1, w2, w3
            dy, dz, w0 = dl * g_y[j, k], dl * g_z[j, k], w_0[j, k]
            r_1[k] += b_y1[k] * dy + b_z1[k] * dz + k1 * w0
            r_2[k] += b_y2[k] * dy + b_z2[k] * dz + k2 * w0
            r_3[k] += b_y3[k] * dy + b_z3[k] * dz + k3 * w0
            m_x = lean * n_x
            c_11[k] += m_x - k1 * w1
            c_12[k] += m_x * zj - k1 * w2
            c_13[k] -= m_x * yj + k1 * w3
            c_22[k] += m_x * zj * zj - k2 * w2
            c_23[k] -= m_x * yj * zj + k2 * w3
            c_33[k] += m_x * yj * yj - k3 * w3
            by, bz = w_y[j, k], w_z[j, k]
            b_y1[k] -= lean * sj + by * k1
            b_y2[k] -= lean * sj * zj + by * k2
            b_y3[k] += lean * sj * yj - by * k3
            b_z1[k] += lean * cj - bz * k1
            b_z2[k] += lean * cj * zj - bz * k2
            b_z3[k] -= lean * cj * yj + bz * k3


@kernel
def support_inertia(
    fin: FinConstants, omega: Vector,
    m_yy: np.ndarray, m_yz: np.ndarray, m_zz: np.ndarray,
    b_y1: np.ndarray, b_y2: np.ndarray, b_y3: np.ndarray, b_z1: np.ndarray, b_z2: np.ndarray, b_z3: np.ndarray,
    c_11: np.ndarray, c_12: np.ndarray, c_13: np.ndarray, c_22: np.ndarray, c_23: np.ndarray, c_33: np.ndarray,
    p_y: np.ndarray, p_z: np.ndarray, r_1: np.ndarray, r_2: np.ndarray, r_3: np.ndarray, torque: np.ndarray,
    inertia: np.ndarray, bias: np.ndarray,
) -> None:
    """Sum the chains, (33): fill `inertia` H (6, 6) and `bias` p (6,) of f = H b + p, components in F_0 about A.

    After the functions above. A root's acceleration is a + Omega_0-dot x s + Omega_0 x (Omega_0 x s), s along x_0.
    """
    ds, station = fin.chain_spacing, fin.station
    y_known, z_known = omega[0] * omega[1], omega[0] * omega[2]
    xx, xy, xz, xb, xg, yy, yz, yb, yg = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    zz, zb, zg, bb, bg, gg = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    fx, fy, fz, mx, my, mz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(fin.chains):
        s = station[k]
        y_b, y_g = b_y2[k] - s * m_yz[k], b_y3[k] + s * m_yy[k]
        z_b, z_g = b_z2[k] - s * m_zz[k], b_z3[k] + s * m_yz[k]
        xx += c_11[k]
        xy += b_y1[k]
        xz += b_z1[k]
        xb += c_12[k] - s * b_z1[k]
        xg += c_13[k] + s * b_y1[k]
        yy += m_yy[k]
        yz += m_yz[k]
        yb += y_b
        yg += y_g
        zz += m_zz[k]
        zb += z_b
        zg += z_g
        bb += c_22[k] - s * b_z2[k] - s * z_b
        bg += c_23[k] - s * b_z3[k] + s * y_b
        gg += c_33[k] + s * b_y3[k] + s * y_g
        ay, az = s * y_known, s * z_known
        root_y = p_y[k] + m_yy[k] * ay + m_yz[k] * az
        root_z = p_z[k] + m_yz[k] * ay + m_zz[k] * az
        fx += r_1[k] + b_y1[k] * ay + b_z1[k] * az
        fy += root_y
        fz += root_z
        mx += torque[k]
        my += r_2[k] + b_y2[k] * ay + b_z2[k] * az - s * root_z
        mz += r_3[k] + b_y3[k] * ay + b_z3[k] * az + s * root_y
    rows = (
        (xx, xy, xz, 0.0, xb, xg), (xy, yy, yz, 0.0, yb, yg), (xz, yz, zz, 0.0, zb, zg),
        (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (xb, yb, zb, 0.0, bb, bg), (xg, yg, zg, 0.0, bg, gg),
    )
    wrench = (fx, fy, fz, mx, my, mz)
    for i in range(6):
        bias[i] = ds * wrench[i]
        for j in range(6):
            inertia[i, j] = ds * rows[i][j]


@kernel
def follow_support(
    c: np.ndarray, s: np.ndarray, w_0: np.ndarray, w_y: np.ndarray, w_z: np.ndarray, w_1: np.ndarray,
    w_2: np.ndarray, w_3: np.ndarray, g_y: np.ndarray, g_z: np.ndarray, a_y: np.ndarray, a_z: np.ndarray,
    w_dot: np.ndarray, station: np.ndarray, q_acceleration: np.ndarray, omega: Vector, a: Vector, omega_1: Vector,
    dl: float,
) -> None:
    """From root to tip: joint accelerations [rad/s^2], (27) to (29).

    `a` is the inertial acceleration of A and `omega_1` Omega_0-dot, components in F_0.
    """
    links, row = c.shape
    y_slope, z_slope = omega_1[2] + omega[0] * omega[1], omega[0] * omega[2] - omega_1[1]
    for k in range(row):
        a_y[k] = a[1] + y_slope * station[k]
        a_z[k] = a[2] + z_slope * station[k]
        w_dot[k] = omega_1[0]
    for j in range(links):
        for k in range(row):
            found = w_0[j, k] - w_y[j, k] * a_y[k] - w_z[j, k] * a_z[k]
            found -= w_1[j, k] * a[0] + w_2[j, k] * omega_1[1] + w_3[j, k] * omega_1[2]
            q_acceleration[j, k] = found - w_dot[k]
            w_dot[k] = found
            a_y[k] += dl * (g_y[j, k] - found * s[j, k])
            a_z[k] += dl * (g_z[j, k] + found * c[j, k])


@kernel
def inertia_about_body(support: SupportMotion, transform: np.ndarray, product: np.ndarray, inertia: np.ndarray) -> None:
    """Turn `inertia` (6, 6) in place from F_0, about A, to F_b, about the centre of mass; the others are scratch.

    `transform` (6, 6) is left holding the b that an acceleration of the body's twist makes, b = T eta_b-dot + ...
    """
    rotation, (x, y, z) = support[0], support[1]
    for i in range(3):
        row = (rotation[0][i], rotation[1][i], rotation[2][i])  # of R^T
        moved = (row[2] * y - row[1] * z, row[0] * z - row[2] * x, row[1] * x - row[0] * y)  # R^T (alpha x r)
        for j in range(3):
            transform[i, j] = transform[3 + i, 3 + j] = row[j]
            transform[i, 3 + j] = moved[j]
            transform[3 + i, j] = 0.0
    for i in range(6):
        for j in range(6):
            total = 0.0
            for k in range(6):
                total += inertia[i, k] * transform[k, j]
            product[i, j] = total
    for i in range(6):
        for j in range(i + 1):
            total = 0.0
            for k in range(6):
                total += transform[k, i] * product[k, j]
            inertia[i, j] = inertia[j, i] = total

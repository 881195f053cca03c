"""The inertia of a fin with free joints, as its support and the body feel it, for the left fin.

The accelerations of a fin's joints are linear in that of its support, b = (a, Omega_0-dot) at A in F_0. With them the
support must exert f = H b + p, with H symmetric. That is planar but for the added mass: it acts along the normals,
which lean forward where the fin is twisted, and so ties accelerations that move links along x_0 to the planar ones.

Letters as in `fin`, and e = (a_x, y and z components of Omega_0-dot), what moves links along x_0;
f = M a + B e + p and f_e = B^T a + C e + r: force at a hinge and forces conjugate to e, of a link and all beyond it.
"""

from __future__ import annotations

from manta_sim_ros.dynamics._kernels.actuation import SupportMotion
from manta_sim_ros.dynamics._kernels.compilation import kernel
from manta_sim_ros.dynamics._kernels.constants import FinConstants
from manta_sim_ros.dynamics._kernels.fin import acceleration_along_support
from manta_sim_ros.dynamics._kernels.geometry import Wrench
from manta_sim_ros.dynamics._kernels.layout import BodyArrays, Chains, Links
from manta_sim_ros.dynamics.quantity import FloatArray, Vector


@kernel
def fin_inertia(fin: FinConstants, omega: Vector, links: Links, chains: Chains, arrays: BodyArrays) -> None:
    """Fill H and p, `at_support` and `bias` of the arrays, after `articulated_inertia`; `omega` is Omega_0."""
    _inertia_along_support(fin, omega, links, chains)
    if fin.added_mass > 0.0:
        _add_oblique_mass(fin, links, chains)
    _sum_chains(fin, omega, chains, arrays.at_support, arrays.bias)


@kernel
def _inertia_along_support(fin: FinConstants, omega: Vector, links: Links, chains: Chains) -> None:
    """Sum C and r of each chain's own mass and loads, after `articulated_inertia`: f_e = C e + r, (31)."""
    count, row = links.c.shape
    dl, mass, station = fin.link_length, fin.link_mass, fin.station
    wx, wy, wz = omega
    half = 0.5 * dl
    central = mass * dl * dl / 12.0  # second moment of a link's mass about its midpoint
    for k in range(row):
        chains.c_11[k], chains.c_12[k], chains.c_13[k] = 0.0, 0.0, 0.0
        chains.c_22[k], chains.c_23[k], chains.c_33[k] = 0.0, 0.0, 0.0
        chains.r_1[k], chains.r_2[k], chains.r_3[k] = 0.0, 0.0, 0.0
    for j in range(count):
        for k in range(row):
            c, s, y, z = links.c[j, k], links.s[j, k], links.y[j, k], links.z[j, k]
            along = acceleration_along_support(omega, station[k], y, z, links.y_dot[j, k], links.z_dot[j, k])
            gradient = central * (wx + 2.0 * links.w[j, k]) * (wy * c + wz * s)
            normal = half * links.mu[j, k] * (c * links.g_z[j, k] - s * links.g_y[j, k]) - links.load[j, k]
            force = mass * along + links.slope[j, k] * normal
            chains.r_1[k] += force
            chains.r_2[k] += z * force + s * gradient
            chains.r_3[k] -= y * force + c * gradient
            chains.c_11[k] += mass
            chains.c_12[k] += mass * z
            chains.c_13[k] -= mass * y
            chains.c_22[k] += mass * z * z + central * s * s
            chains.c_23[k] -= mass * y * z + central * s * c
            chains.c_33[k] += mass * y * y + central * c * c


@kernel
def _add_oblique_mass(fin: FinConstants, links: Links, chains: Chains) -> None:
    """From tip to root: B, k, and what added mass along leaning normals adds to C and r.

    After `articulated_inertia` and `_inertia_along_support`.
    """
    count, row = links.c.shape
    dl = fin.link_length
    half = 0.5 * dl
    for k in range(row):
        chains.b_y1[k], chains.b_y2[k], chains.b_y3[k] = 0.0, 0.0, 0.0
        chains.b_z1[k], chains.b_z2[k], chains.b_z3[k] = 0.0, 0.0, 0.0
    for j in range(count - 1, -1, -1):
        for k in range(row):
            c, s, y, z, slope = links.c[j, k], links.s[j, k], links.y[j, k], links.z[j, k], links.slope[j, k]
            lean = links.mu[j, k] * slope
            k_1 = dl * (c * chains.b_z1[k] - s * chains.b_y1[k]) + half * lean
            k_2 = dl * (c * chains.b_z2[k] - s * chains.b_y2[k]) + half * lean * z
            k_3 = dl * (c * chains.b_z3[k] - s * chains.b_y3[k]) - half * lean * y
            links.k_1[j, k], links.k_2[j, k], links.k_3[j, k] = k_1, k_2, k_3
            inverse = links.d_inverse[j, k]
            w_1, w_2, w_3 = k_1 * inverse, k_2 * inverse, k_3 * inverse
            dy, dz, w_0 = dl * links.g_y[j, k], dl * links.g_z[j, k], links.u[j, k] * inverse
            chains.r_1[k] += chains.b_y1[k] * dy + chains.b_z1[k] * dz + k_1 * w_0
            chains.r_2[k] += chains.b_y2[k] * dy + chains.b_z2[k] * dz + k_2 * w_0
            chains.r_3[k] += chains.b_y3[k] * dy + chains.b_z3[k] * dz + k_3 * w_0
            m_x = lean * slope
            chains.c_11[k] += m_x - k_1 * w_1
            chains.c_12[k] += m_x * z - k_1 * w_2
            chains.c_13[k] -= m_x * y + k_1 * w_3
            chains.c_22[k] += m_x * z * z - k_2 * w_2
            chains.c_23[k] -= m_x * y * z + k_2 * w_3
            chains.c_33[k] += m_x * y * y - k_3 * w_3
            by, bz = links.h_y[j, k] * inverse, links.h_z[j, k] * inverse
            chains.b_y1[k] -= lean * s + by * k_1
            chains.b_y2[k] -= lean * s * z + by * k_2
            chains.b_y3[k] += lean * s * y - by * k_3
            chains.b_z1[k] += lean * c - bz * k_1
            chains.b_z2[k] += lean * c * z - bz * k_2
            chains.b_z3[k] -= lean * c * y + bz * k_3


@kernel
def take_off_oblique_torques(a: Vector, omega_dot: Vector, links: Links) -> None:
    """Take k.e off the torques of the joints, before `joint_accelerations`; `a` is the acceleration of A, in F_0."""
    count, row = links.c.shape
    for j in range(count):
        for k in range(row):
            links.u[j, k] -= links.k_1[j, k] * a[0] + links.k_2[j, k] * omega_dot[1] + links.k_3[j, k] * omega_dot[2]


@kernel
def _sum_chains(fin: FinConstants, omega: Vector, chains: Chains, inertia: FloatArray, bias: FloatArray) -> None:
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
        m_yy, m_yz, m_zz = chains.m_yy[k], chains.m_yz[k], chains.m_zz[k]
        b_y1, b_y2, b_y3 = chains.b_y1[k], chains.b_y2[k], chains.b_y3[k]
        b_z1, b_z2, b_z3 = chains.b_z1[k], chains.b_z2[k], chains.b_z3[k]
        y_b, y_g = b_y2 - s * m_yz, b_y3 + s * m_yy
        z_b, z_g = b_z2 - s * m_zz, b_z3 + s * m_yz
        xx += chains.c_11[k]
        xy += b_y1
        xz += b_z1
        xb += chains.c_12[k] - s * b_z1
        xg += chains.c_13[k] + s * b_y1
        yy += m_yy
        yz += m_yz
        yb += y_b
        yg += y_g
        zz += m_zz
        zb += z_b
        zg += z_g
        bb += chains.c_22[k] - s * b_z2 - s * z_b
        bg += chains.c_23[k] - s * b_z3 + s * y_b
        gg += chains.c_33[k] + s * b_y3 + s * y_g
        ay, az = s * y_known, s * z_known
        root_y = chains.p_y[k] + m_yy * ay + m_yz * az
        root_z = chains.p_z[k] + m_yz * ay + m_zz * az
        fx += chains.r_1[k] + b_y1 * ay + b_z1 * az
        fy += root_y
        fz += root_z
        mx += chains.torque[k]
        my += chains.r_2[k] + b_y2 * ay + b_z2 * az - s * root_z
        mz += chains.r_3[k] + b_y3 * ay + b_z3 * az + s * root_y
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
def wrench_at_support(a: Vector, omega_dot: Vector, arrays: BodyArrays) -> Wrench:
    """Return the wrench of a fin on its support, -(H b + p), about A in F_0, when that accelerates by b."""
    return Wrench(
        (-_effort(0, a, omega_dot, arrays), -_effort(1, a, omega_dot, arrays), -_effort(2, a, omega_dot, arrays)),
        (-_effort(3, a, omega_dot, arrays), -_effort(4, a, omega_dot, arrays), -_effort(5, a, omega_dot, arrays)),
    )


@kernel
def _effort(row: int, a: Vector, omega_dot: Vector, arrays: BodyArrays) -> float:
    """Return a component of H b + p."""
    total = arrays.bias[row]
    for j in range(3):
        total += arrays.at_support[row, j] * a[j]
    for j in range(3):
        total += arrays.at_support[row, 3 + j] * omega_dot[j]
    return total


@kernel
def inertia_in_body(support: SupportMotion, transform: FloatArray, arrays: BodyArrays) -> None:
    """Turn H in place from F_0, about A, to F_b, about the center of mass, of the left fin.

    `transform` T (6, 6) is filled with the b that an acceleration of the body's twist makes, b = T eta_b-dot + ...
    """
    rotation, (x, y, z) = support.rotation, support.position
    inertia, product = arrays.at_support, arrays.product
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

"""One flexible fin, (11) to (33), for the left fin: its links, the water on them, and the articulated-body algorithm.

All hinges of a chain are parallel to x_0, so in the components of F_0 the recursion is planar plus the motion of the
support, which the whole fin shares. Every chain quantity is per unit chord. The three passes of Featherstone's
articulated-body algorithm are `link_motion`, `articulated_inertia` and `joint_accelerations`; both couplings use them.

Letters of the kernels, after the paper and Featherstone: c, s = cosine and sine of a link's angle to y_0; w its rate;
(c, s) is its direction in the y-z plane of F_0 and (-s, c) the normal to it; y, z its midpoint; tau = joint torque;
M, h, D, p, nu = articulated-body inertia and bias of a link at its hinge; u = tau - nu.
"""

from __future__ import annotations

from math import factorial, sqrt
from typing import NamedTuple

from manta_sim_ros.dynamics._kernels.actuation import SupportMotion
from manta_sim_ros.dynamics._kernels.compilation import kernel
from manta_sim_ros.dynamics._kernels.constants import FinConstants
from manta_sim_ros.dynamics._kernels.geometry import Wrench, add, cross, rotate
from manta_sim_ros.dynamics._kernels.layout import Chains, Links
from manta_sim_ros.dynamics.quantity import Vector

# Taylor's coefficients: for |x| <= pi / 2 what is left out is below 2e-18.
S1, S3, S5, S7, S9, S11, S13, S15, S17, S19, S21 = ((-1) ** k / factorial(2 * k + 1) for k in range(11))
C0, C2, C4, C6, C8, C10, C12, C14, C16, C18, C20, C22 = ((-1) ** k / factorial(2 * k) for k in range(12))


class SupportAcceleration(NamedTuple):
    """The inertial acceleration of the points of the support, components in F_0."""

    at_a: Vector  # of A [m/s^2]
    slope: Vector  # its change along x_0 [1/s^2]


LANES = 1
"""Fins whose chains stand side by side in a row: chain k of a fin is `LANES` before its chain k + 1."""


@kernel
def at(value: float, k: int) -> float:
    """Return a value of chain k that all chains of a fin share. `packed` puts a row of values in its place."""
    return value


@kernel
def vector_of(vector: Vector, k: int) -> Vector:
    """Return a vector of chain k that all chains of a fin share, as `at`."""
    return vector


@kernel
def support_acceleration(support: SupportMotion) -> SupportAcceleration:
    """Return the inertial acceleration of the points of the support."""
    at_a = add(support.velocity_dot, cross(support.omega, support.velocity))
    return SupportAcceleration(at_a, acceleration_slope(support.omega, support.omega_dot))


@kernel
def acceleration_slope(omega: Vector, omega_dot: Vector) -> Vector:
    """Return how the inertial acceleration changes along x_0 [1/s^2], given Omega_0 and its derivative."""
    along = (1.0, 0.0, 0.0)
    return add(cross(omega_dot, along), cross(omega, cross(omega, along)))


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
def link_motion(fin: FinConstants, links: Links, chains: Chains) -> None:
    """From root to tip: pose (3) and velocity (16) of each link in F_0, and its joint torque, (13) to (15)."""
    count, row = links.q.shape
    for k in range(row):
        chains.tip_c[k], chains.tip_s[k], chains.tip_w[k] = 1.0, 0.0, 0.0
        chains.tip_y[k], chains.tip_z[k], chains.tip_y_dot[k], chains.tip_z_dot[k] = 0.0, 0.0, 0.0, 0.0
    for j in range(count):
        for k in range(row):
            dl, stiffness, damping = at(fin.link_length, k), at(fin.stiffness, k), at(fin.damping, k)
            half_s, half_c = sine_cosine(0.5 * links.q[j, k])
            half_c2 = half_c * half_c
            q_c, q_s = half_c2 - half_s * half_s, 2.0 * half_s * half_c
            links.torque[j, k] = -stiffness * half_s / (half_c2 * half_c) - damping * links.q_dot[j, k]
            c = chains.tip_c[k] * q_c - chains.tip_s[k] * q_s
            s = chains.tip_s[k] * q_c + chains.tip_c[k] * q_s
            w = chains.tip_w[k] + links.q_dot[j, k]
            along_y, along_z = 0.5 * dl * c, 0.5 * dl * s
            links.y[j, k] = chains.tip_y[k] + along_y
            links.z[j, k] = chains.tip_z[k] + along_z
            links.y_dot[j, k] = chains.tip_y_dot[k] - along_z * w
            links.z_dot[j, k] = chains.tip_z_dot[k] + along_y * w
            chains.tip_y[k] += 2.0 * along_y
            chains.tip_z[k] += 2.0 * along_z
            chains.tip_y_dot[k] -= 2.0 * along_z * w
            chains.tip_z_dot[k] += 2.0 * along_y * w
            links.c[j, k], links.s[j, k], links.w[j, k] = c, s, w
            chains.tip_c[k], chains.tip_s[k], chains.tip_w[k] = c, s, w


@kernel
def add_twist_torques(fin: FinConstants, links: Links, chains: Chains) -> None:
    """Add the torques of the twist of the fin along the chord to those of the joints; the paper leaves them out.

    The links of one row form a strip along x_0, which resists twist (Saint-Venant): the moment on a link is the second
    difference along the chord of stiffness times its angle to y_0 and damping times the rate of that; the two edges are
    free. A joint carries the moments of all links beyond it. After `link_motion`.
    """
    if at(fin.twist_stiffness, 0) == 0.0 and at(fin.twist_damping, 0) == 0.0:
        return
    count, row = links.q.shape
    last = (fin.chains - 1) * LANES
    for k in range(row):
        chains.angle[k], chains.twist[k] = 0.0, 0.0
    for j in range(count):
        for k in range(row):
            chains.angle[k] += links.q[j, k]
    for j in range(count - 1, -1, -1):
        for k in range(row):
            stiffness, damping = at(fin.twist_stiffness, k), at(fin.twist_damping, k)
            chains.moment[k] = stiffness * chains.angle[k] + damping * links.w[j, k]
            chains.angle[k] -= links.q[j, k]
        for k in range(LANES):
            chains.twist[k] += chains.moment[k + LANES] - chains.moment[k]
        for k in range(LANES, last):
            chains.twist[k] += chains.moment[k - LANES] - 2.0 * chains.moment[k] + chains.moment[k + LANES]
        for k in range(last, last + LANES):
            chains.twist[k] += chains.moment[k - LANES] - chains.moment[k]
        for k in range(last + LANES, row):
            chains.twist[k] = chains.twist[last]
        for k in range(row):
            links.torque[j, k] += chains.twist[k]


@kernel
def surface_slopes(fin: FinConstants, links: Links) -> None:
    """Chordwise slope of each link's normal, (11): n = t x u = (slope, -s, c), normalized where it is used.

    The sum of the tangents at root and tip of a link is twice the difference of its neighbors' midpoints.
    """
    c, s, y, z, slope = links.c, links.s, links.y, links.z, links.slope
    count, row = c.shape
    last = (fin.chains - 1) * LANES
    for j in range(count):
        for k in range(LANES):
            dy, dz = y[j, k] - y[j, k + LANES], z[j, k] - z[j, k + LANES]
            slope[j, k] = (dy * s[j, k] - dz * c[j, k]) / at(fin.chain_spacing, k)
        for k in range(LANES, last):
            dy, dz = y[j, k - LANES] - y[j, k + LANES], z[j, k - LANES] - z[j, k + LANES]
            slope[j, k] = (dy * s[j, k] - dz * c[j, k]) / (2.0 * at(fin.chain_spacing, k))
        for k in range(last, last + LANES):
            dy, dz = y[j, k - LANES] - y[j, k], z[j, k - LANES] - z[j, k]
            slope[j, k] = (dy * s[j, k] - dz * c[j, k]) / at(fin.chain_spacing, k)
        for k in range(last + LANES, row):
            slope[j, k] = slope[j, last]


@kernel
def water_loads(fin: FinConstants, relative_velocity: Vector, omega: Vector, links: Links) -> None:
    """Load of the water on each link along (slope, -s, c), which is not of unit length, per unit chord [N/m].

    Drag (12), and the added mass with the part of its load that does not depend on accelerations of the support and of
    the joints. `relative_velocity` is that of A to the water, `omega` is Omega_0, components in F_0.
    """
    count, row = links.c.shape
    station = fin.station
    for j in range(count):
        for k in range(row):
            vx, vy, vz = vector_of(relative_velocity, k)
            wx, wy, wz = vector_of(omega, k)
            y, z, slope = links.y[j, k], links.z[j, k], links.slope[j, k]
            normal_velocity = (
                slope * (vx + wy * z - wz * y)
                - links.s[j, k] * (vy + wz * station[k] - wx * z + links.y_dot[j, k])
                + links.c[j, k] * (vz + wx * y - wy * station[k] + links.z_dot[j, k])
            )
            n2 = 1.0 + slope * slope
            links.load[j, k] = -at(fin.drag, k) * abs(normal_velocity) * normal_velocity / (n2 * sqrt(n2))
    if at(fin.added_mass, 0) > 0.0:
        for j in range(count):
            for k in range(row):
                slope = links.slope[j, k]
                along = acceleration_along_support(
                    vector_of(omega, k), station[k], links.y[j, k], links.z[j, k], links.y_dot[j, k], links.z_dot[j, k])
                links.mu[j, k] = at(fin.added_mass, k) / (1.0 + slope * slope)
                links.load[j, k] -= links.mu[j, k] * slope * along


@kernel
def acceleration_along_support(
    omega: Vector, station: float, y: float, z: float, y_dot: float, z_dot: float,
) -> float:
    """Return the acceleration along x_0 of a point of a link [m/s^2] that does not depend on those of the support."""
    wx, wy, wz = omega
    return wx * (wy * y + wz * z) - (wy * wy + wz * wz) * station + 2.0 * (wy * z_dot - wz * y_dot)


@kernel
def articulated_inertia(
    fin: FinConstants, omega: Vector, roll_acceleration: float, links: Links, chains: Chains,
) -> None:
    """From tip to root: articulated-body inertia and bias of each link, with all links beyond it, (17) to (26).

    With a the acceleration of the link's hinge, f the force and tau the torque that it must get there:
    f = M a + h w-dot + p and tau = h.a + D w-dot + nu. Eliminating w-dot link by link solves (29) from the tip, without
    the matrix (30), at a cost linear in the number of links. Afterwards `chains` holds M and p of each root, with which
    f = M a + p.

    `omega` is Omega_0. `roll_acceleration` is the x component of its derivative as far as it is known, and w-dot is
    relative to a frame that accelerates so.
    """
    count, row = links.c.shape
    for k in range(row):
        chains.m_yy[k], chains.m_yz[k], chains.m_zz[k] = 0.0, 0.0, 0.0
        chains.p_y[k], chains.p_z[k], chains.torque[k] = 0.0, 0.0, 0.0
    for j in range(count - 1, -1, -1):
        for k in range(row):
            wx, wy, wz = vector_of(omega, k)
            dl, mass, roll = at(fin.link_length, k), at(fin.link_mass, k), at(roll_acceleration, k)
            half = 0.5 * dl
            moment, inertia = half * mass, mass * dl * dl / 3.0  # first and second, of the link's mass about its hinge
            c, s, load, mu = links.c[j, k], links.s[j, k], links.load[j, k], links.mu[j, k]
            m_yy, m_yz, m_zz, p_y, p_z = chains.m_yy[k], chains.m_yz[k], chains.m_zz[k], chains.p_y[k], chains.p_z[k]
            spin = links.w[j, k] + wx
            spin2 = spin * spin
            gy = -roll * s - spin2 * c + wz * (wy * s - wz * c)
            gz = roll * c - spin2 * s + wy * (wz * c - wy * s)
            turning = c * gz - s * gy
            ey = p_y + dl * (m_yy * gy + m_yz * gz)
            ez = p_z + dl * (m_yz * gy + m_zz * gz)
            ny = dl * (m_yz * c - m_yy * s)
            nz = dl * (m_zz * c - m_yz * s)

            hy = ny - (moment + half * mu) * s
            hz = nz + (moment + half * mu) * c
            hinge = inertia + half * half * mu
            inverse = 1.0 / (hinge + dl * (nz * c - ny * s))
            nu = hinge * turning - half * load + dl * (c * ez - s * ey) + chains.torque[k]
            u = links.torque[j, k] - nu
            links.h_y[j, k], links.h_z[j, k], links.d_inverse[j, k], links.u[j, k] = hy, hz, inverse, u
            links.g_y[j, k], links.g_z[j, k] = gy, gz

            by, bz = hy * inverse, hz * inverse
            normal = load - half * mu * turning
            chains.m_yy[k] = m_yy + (mass + mu * s * s - hy * by)
            chains.m_yz[k] = m_yz - (mu * s * c + hy * bz)
            chains.m_zz[k] = m_zz + (mass + mu * c * c - hz * bz)
            chains.p_y[k] = ey + moment * gy + normal * s + by * u
            chains.p_z[k] = ez + moment * gz - normal * c + bz * u
            chains.torque[k] = links.torque[j, k]


@kernel
def joint_accelerations(
    fin: FinConstants, acceleration: SupportAcceleration, roll_acceleration: float, links: Links, chains: Chains,
) -> None:
    """From root to tip: joint accelerations [rad/s^2], (27) to (29).

    `acceleration` is that of the support; `roll_acceleration` what `articulated_inertia` did not know of it.
    """
    count, row = links.c.shape
    station = fin.station
    for k in range(row):
        _, a_y, a_z = vector_of(acceleration.at_a, k)
        _, slope_y, slope_z = vector_of(acceleration.slope, k)
        chains.a_y[k] = a_y + slope_y * station[k]
        chains.a_z[k] = a_z + slope_z * station[k]
        chains.w_dot[k] = at(roll_acceleration, k)
    for j in range(count):
        for k in range(row):
            dl = at(fin.link_length, k)
            without = links.u[j, k] - links.h_y[j, k] * chains.a_y[k] - links.h_z[j, k] * chains.a_z[k]
            w_dot = without * links.d_inverse[j, k]
            links.q_ddot[j, k] = w_dot - chains.w_dot[k]
            chains.w_dot[k] = w_dot
            chains.a_y[k] += dl * (links.g_y[j, k] - w_dot * links.s[j, k])
            chains.a_z[k] += dl * (links.g_z[j, k] + w_dot * links.c[j, k])


@kernel
def support_wrench(
    fin: FinConstants, support: SupportMotion, acceleration: SupportAcceleration, links: Links, chains: Chains,
) -> Wrench:
    """Return force and moment of the fin on its support about A, components in F_0, (31) to (33).

    After `articulated_inertia`.
    """
    bending = acceleration_bending(support.omega, support.omega_dot)
    fx, fy, fz, mx, my, mz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(fin.chains):
        root_fy, root_fz = root_force(fin, acceleration, chains, k)
        fy -= root_fy
        fz -= root_fz
        mx -= links.torque[0, k]
        my += fin.station[k] * root_fz
        mz -= fin.station[k] * root_fy
    for j in range(links.c.shape[0]):
        for k in range(fin.chains):
            force, couple_y, couple_z = force_along_support(fin, support.omega, bending, acceleration, links, j, k)
            fx -= force
            my -= links.z[j, k] * force + couple_y
            mz += links.y[j, k] * force + couple_z
    ds = fin.chain_spacing
    return Wrench((ds * fx, ds * fy, ds * fz), (ds * mx, ds * my, ds * mz))


@kernel
def acceleration_bending(omega: Vector, omega_dot: Vector) -> tuple[float, float]:
    """Return how the x component of the acceleration of a point at rest in F_0 changes with its y and z [1/s^2]."""
    return omega[0] * omega[1] - omega_dot[2], omega[0] * omega[2] + omega_dot[1]


@kernel
def root_force(fin: FinConstants, acceleration: SupportAcceleration, chains: Chains, k: int) -> tuple[float, float]:
    """Return the y and z components of the force of the support on chain k, M a + p."""
    _, a_y, a_z = vector_of(acceleration.at_a, k)
    _, slope_y, slope_z = vector_of(acceleration.slope, k)
    ay, az = a_y + slope_y * fin.station[k], a_z + slope_z * fin.station[k]
    return (
        chains.m_yy[k] * ay + chains.m_yz[k] * az + chains.p_y[k],
        chains.m_yz[k] * ay + chains.m_zz[k] * az + chains.p_z[k],
    )


@kernel
def force_along_support(
    fin: FinConstants, omega: Vector, bending: tuple[float, float], acceleration: SupportAcceleration, links: Links,
    j: int, k: int,
) -> tuple[float, float, float]:
    """Return the force along x_0 that link j of chain k needs, and its couples about -y_0 and z_0."""
    dl, mass = at(fin.link_length, k), at(fin.link_mass, k)
    a_x, slope_x = vector_of(acceleration.at_a, k)[0], vector_of(acceleration.slope, k)[0]
    _, wy, wz = vector_of(omega, k)
    xy, xz = at(bending[0], k), at(bending[1], k)
    c, s, y, z = links.c[j, k], links.s[j, k], links.y[j, k], links.z[j, k]
    ax = a_x + slope_x * fin.station[k] + xy * y + xz * z
    ax += 2.0 * (wy * links.z_dot[j, k] - wz * links.y_dot[j, k])
    gx = xy * c + xz * s + 2.0 * links.w[j, k] * (wy * c + wz * s)
    force = mass * ax - links.load[j, k] * links.slope[j, k]
    return force, mass * dl * dl / 12.0 * s * gx, mass * dl * dl / 12.0 * c * gx


@kernel
def wrench_on_body(support: SupportMotion, at_support: Wrench) -> Wrench:
    """Return a wrench about A in F_0 as the one about the center of mass, components in F_b: Ad (2) in (33)."""
    force = rotate(support.rotation, at_support.force)
    return Wrench(force, add(rotate(support.rotation, at_support.moment), cross(support.position, force)))

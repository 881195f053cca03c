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
    dl, stiffness, damping = fin.link_length, fin.stiffness, fin.damping
    for k in range(row):
        chains.tip_c[k], chains.tip_s[k], chains.tip_w[k] = 1.0, 0.0, 0.0
        chains.tip_y[k], chains.tip_z[k], chains.tip_y_dot[k], chains.tip_z_dot[k] = 0.0, 0.0, 0.0, 0.0
    for j in range(count):
        for k in range(row):
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
    if fin.twist_stiffness == 0.0 and fin.twist_damping == 0.0:
        return
    count, row = links.q.shape
    last, stiffness, damping = fin.chains - 1, fin.twist_stiffness, fin.twist_damping
    for k in range(row):
        chains.angle[k], chains.twist[k] = 0.0, 0.0
    for j in range(count):
        for k in range(row):
            chains.angle[k] += links.q[j, k]
    for j in range(count - 1, -1, -1):
        for k in range(row):
            chains.moment[k] = stiffness * chains.angle[k] + damping * links.w[j, k]
            chains.angle[k] -= links.q[j, k]
        chains.twist[0] += chains.moment[1] - chains.moment[0]
        for k in range(1, last):
            chains.twist[k] += chains.moment[k - 1] - 2.0 * chains.moment[k] + chains.moment[k + 1]
        chains.twist[last] += chains.moment[last - 1] - chains.moment[last]
        for k in range(fin.chains, row):
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
    last, ds = fin.chains - 1, fin.chain_spacing
    for j in range(count):
        slope[j, 0] = ((y[j, 0] - y[j, 1]) * s[j, 0] - (z[j, 0] - z[j, 1]) * c[j, 0]) / ds
        for k in range(1, last):
            slope[j, k] = ((y[j, k - 1] - y[j, k + 1]) * s[j, k] - (z[j, k - 1] - z[j, k + 1]) * c[j, k]) / (2.0 * ds)
        slope[j, last] = (
            (y[j, last - 1] - y[j, last]) * s[j, last] - (z[j, last - 1] - z[j, last]) * c[j, last]
        ) / ds
        for k in range(fin.chains, row):
            slope[j, k] = slope[j, last]


@kernel
def water_loads(fin: FinConstants, relative_velocity: Vector, omega: Vector, links: Links) -> None:
    """Load of the water on each link along (slope, -s, c), which is not of unit length, per unit chord [N/m].

    Drag (12), and the added mass with the part of its load that does not depend on accelerations of the support and of
    the joints. `relative_velocity` is that of A to the water, `omega` is Omega_0, components in F_0.
    """
    count, row = links.c.shape
    vx, vy, vz = relative_velocity
    wx, wy, wz = omega
    station, factor = fin.station, fin.drag
    for j in range(count):
        for k in range(row):
            y, z, slope = links.y[j, k], links.z[j, k], links.slope[j, k]
            normal_velocity = (
                slope * (vx + wy * z - wz * y)
                - links.s[j, k] * (vy + wz * station[k] - wx * z + links.y_dot[j, k])
                + links.c[j, k] * (vz + wx * y - wy * station[k] + links.z_dot[j, k])
            )
            n2 = 1.0 + slope * slope
            links.load[j, k] = -factor * abs(normal_velocity) * normal_velocity / (n2 * sqrt(n2))
    if fin.added_mass > 0.0:
        for j in range(count):
            for k in range(row):
                slope = links.slope[j, k]
                along = acceleration_along_support(
                    omega, station[k], links.y[j, k], links.z[j, k], links.y_dot[j, k], links.z_dot[j, k])
                links.mu[j, k] = fin.added_mass / (1.0 + slope * slope)
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
    wx, wy, wz = omega
    dl, mass = fin.link_length, fin.link_mass
    half = 0.5 * dl
    moment, inertia = half * mass, mass * dl * dl / 3.0  # first and second, of the link's mass about its hinge
    for k in range(row):
        chains.m_yy[k], chains.m_yz[k], chains.m_zz[k] = 0.0, 0.0, 0.0
        chains.p_y[k], chains.p_z[k], chains.torque[k] = 0.0, 0.0, 0.0
    for j in range(count - 1, -1, -1):
        for k in range(row):
            c, s, load, mu = links.c[j, k], links.s[j, k], links.load[j, k], links.mu[j, k]
            m_yy, m_yz, m_zz, p_y, p_z = chains.m_yy[k], chains.m_yz[k], chains.m_zz[k], chains.p_y[k], chains.p_z[k]
            spin = links.w[j, k] + wx
            spin2 = spin * spin
            gy = -roll_acceleration * s - spin2 * c + wz * (wy * s - wz * c)
            gz = roll_acceleration * c - spin2 * s + wy * (wz * c - wy * s)
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
    dl, station = fin.link_length, fin.station
    for k in range(row):
        chains.a_y[k] = acceleration.at_a[1] + acceleration.slope[1] * station[k]
        chains.a_z[k] = acceleration.at_a[2] + acceleration.slope[2] * station[k]
        chains.w_dot[k] = roll_acceleration
    for j in range(count):
        for k in range(row):
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
    dl, mass, station = fin.link_length, fin.link_mass, fin.station
    wx, wy, wz = support.omega
    a, a_slope = acceleration.at_a, acceleration.slope
    # how the x component of the acceleration of a point at rest in F_0 changes with its y and z
    xy, xz = wx * wy - support.omega_dot[2], wx * wz + support.omega_dot[1]
    fx, fy, fz, mx, my, mz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(fin.chains):
        ay, az = a[1] + a_slope[1] * station[k], a[2] + a_slope[2] * station[k]
        root_fy = chains.m_yy[k] * ay + chains.m_yz[k] * az + chains.p_y[k]
        root_fz = chains.m_yz[k] * ay + chains.m_zz[k] * az + chains.p_z[k]
        fy -= root_fy
        fz -= root_fz
        mx -= links.torque[0, k]
        my += station[k] * root_fz
        mz -= station[k] * root_fy
    for j in range(links.c.shape[0]):
        for k in range(fin.chains):
            c, s, y, z = links.c[j, k], links.s[j, k], links.y[j, k], links.z[j, k]
            ax = a[0] + a_slope[0] * station[k] + xy * y + xz * z
            ax += 2.0 * (wy * links.z_dot[j, k] - wz * links.y_dot[j, k])
            gx = xy * c + xz * s + 2.0 * links.w[j, k] * (wy * c + wz * s)
            force = mass * ax - links.load[j, k] * links.slope[j, k]
            fx -= force
            my -= z * force + mass * dl * dl / 12.0 * s * gx
            mz += y * force + mass * dl * dl / 12.0 * c * gx
    ds = fin.chain_spacing
    return Wrench((ds * fx, ds * fy, ds * fz), (ds * mx, ds * my, ds * mz))


@kernel
def wrench_on_body(support: SupportMotion, at_support: Wrench) -> Wrench:
    """Return a wrench about A in F_0 as the one about the center of mass, components in F_b: Ad (2) in (33)."""
    force = rotate(support.rotation, at_support.force)
    return Wrench(force, add(rotate(support.rotation, at_support.moment), cross(support.position, force)))

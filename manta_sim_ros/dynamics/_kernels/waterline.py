"""The surface of the water, beyond the paper: what is above it has weight, but no drag, added mass and buoyancy.

The body is a slab about its center of buoyancy, and a link is as thick as the fin at its midpoint. The immersed share
of each falls linearly from 1 to 0 while it crosses the surface. Water that begins to move takes the momentum of its
added mass from the robot, and keeps it when the robot leaves it. So the surface never adds energy.
"""

from __future__ import annotations

from math import ceil, cos, sin, sqrt
from typing import NamedTuple

from manta_sim_ros.dynamics._kernels.actuation import BodyMotion, SupportMotion, support_motion
from manta_sim_ros.dynamics._kernels.compilation import kernel, rare_kernel
from manta_sim_ros.dynamics._kernels.constants import BodyConstants, Constants, FinConstants
from manta_sim_ros.dynamics._kernels.gait import Rod
from manta_sim_ros.dynamics._kernels.geometry import (
    Rotation,
    Wrench,
    add,
    cross,
    dot,
    mirror_polar,
    rotate_back,
    subtract,
)
from manta_sim_ros.dynamics._kernels.layout import Chains, Links, Workspace, links_of
from manta_sim_ros.dynamics.quantity import FloatArray, SixVector, Vector

MOST_PARTS = 1000
"""Largest number of parts of a step near the surface."""


class Surface(NamedTuple):
    """The surface of the water as the body or the support of a fin sees it."""

    is_near: bool  # whether a part of the robot may be above it
    up: Vector  # the unit vector upward, components in F_b or F_0
    height: float  # of the center of mass or of A above the surface [m]


@kernel
def deep() -> Surface:
    """Return a surface that is out of reach."""
    return Surface(False, (0.0, 0.0, 0.0), 0.0)


@kernel
def surface_at_body(constants: Constants, height: float, rotation: Rotation) -> Surface:
    """Return the surface as the body sees it at a height in the world [m]; `rotation` is R_b."""
    above = height - constants.surface_height
    return Surface(above > -constants.reach, rotate_back(rotation, (0.0, 0.0, 1.0)), above)


@kernel
def surface_at_support(surface: Surface, side: int, support: SupportMotion) -> Surface:
    """Return the surface as a support sees it; `surface` is as the body sees it."""
    up = mirror_polar(surface.up, side)
    return Surface(surface.is_near, rotate_back(support.rotation, up), surface.height + dot(up, support.position))


@kernel
def _immersed_share(height: float, thickness: float) -> float:
    """Return the share below the surface of what is `thickness` [m] thick about a point `height` [m] above it."""
    return min(1.0, max(0.0, 0.5 - height / thickness))


@rare_kernel
def body_at_surface(body: BodyConstants, surface: Surface, velocity: Vector, omega: Vector) -> BodyConstants:
    """Return the constants of the body that hold for its immersed share; `velocity` and `omega` are its twist."""
    share = _immersed_share(surface.height + dot(surface.up, body.buoyancy_center), body.height)
    if share == 1.0:
        return body
    rising = dot(surface.up, add(velocity, cross(omega, body.buoyancy_center)))
    entering = max(0.0, -rising / body.height) if share > 0.0 else 0.0  # rate of the immersed share [1/s]
    drag, damping = body.drag, body.angular_damping
    return BodyConstants(
        body.mass, body.inertia, (share * drag[0], share * drag[1], share * drag[2]),
        (share * damping[0], share * damping[1], share * damping[2]), body.buoyancy_center, share * body.buoyancy,
        True, _scaled(share, body.added_mass, 0.0, body.added_mass),
        _scaled(share, body.linear_damping, entering, body.added_mass),
        _scaled(share, body.quadratic_damping, 0.0, body.added_mass),
        share * body.net_buoyancy, body.unsupported_weight + (1.0 - share) * body.buoyancy, body.height,
    )


@kernel
def _scaled(share: float, a: SixVector, other: float, b: SixVector) -> SixVector:
    """Return share a + other b."""
    return (
        share * a[0] + other * b[0], share * a[1] + other * b[1], share * a[2] + other * b[2],
        share * a[3] + other * b[3], share * a[4] + other * b[4], share * a[5] + other * b[5],
    )


@rare_kernel
def dry_links(fin: FinConstants, surface: Surface, support: SupportMotion, current: Vector, links: Links) -> bool:
    """Reduce the loads and the added mass of links to their immersed shares; return whether any is not immersed.

    After `water_loads`. Fills the weight of each link that no water carries. `current` is in F_0.
    """
    count, row = links.c.shape
    up, velocity, omega = surface.up, support.velocity, support.omega
    any_dry = False
    for j in range(count):
        for k in range(row):
            arm = (fin.station[k], links.y[j, k], links.z[j, k])
            share = _immersed_share(surface.height + dot(up, arm), fin.thickness)
            links.weight[j, k] = (1.0 - share) * fin.link_weight
            if share < 1.0:
                any_dry = True
                moving = add(add(velocity, cross(omega, arm)), (0.0, links.y_dot[j, k], links.z_dot[j, k]))
                entering = max(0.0, -dot(up, moving) / fin.thickness) if share > 0.0 else 0.0
                slope = links.slope[j, k]
                normal = (slope, -links.s[j, k], links.c[j, k])
                added = fin.added_mass / (1.0 + slope * slope)
                links.load[j, k] = share * links.load[j, k] - entering * added * dot(normal, subtract(moving, current))
                links.mu[j, k] *= share
    return any_dry


@rare_kernel
def add_weight(fin: FinConstants, surface: Surface, links: Links, chains: Chains) -> None:
    """From tip to root: add the weight that no water carries to the biases of `articulated_inertia`, after it."""
    count, row = links.c.shape
    dl = fin.link_length
    half = 0.5 * dl
    _, up_y, up_z = surface.up
    for k in range(row):
        p_y, p_z = 0.0, 0.0
        for j in range(count - 1, -1, -1):
            c, s = links.c[j, k], links.s[j, k]
            f_y, f_z = -links.weight[j, k] * up_y, -links.weight[j, k] * up_z
            u = half * (c * f_z - s * f_y) - dl * (c * p_z - s * p_y)
            links.u[j, k] += u
            p_y += links.h_y[j, k] * links.d_inverse[j, k] * u - f_y
            p_z += links.h_z[j, k] * links.d_inverse[j, k] * u - f_z
        chains.p_y[k] += p_y
        chains.p_z[k] += p_z


@rare_kernel
def weight_along_support(fin: FinConstants, surface: Surface, links: Links) -> Wrench:
    """Return what the weight that no water carries does along x_0: a wrench on the support about A, in F_0."""
    force, moment_y, moment_z = 0.0, 0.0, 0.0
    for j in range(links.c.shape[0]):
        for k in range(fin.chains):
            along = -links.weight[j, k] * surface.up[0]
            force += along
            moment_y += links.z[j, k] * along
            moment_z -= links.y[j, k] * along
    ds = fin.chain_spacing
    return Wrench((ds * force, 0.0, 0.0), (0.0, ds * moment_y, ds * moment_z))


@rare_kernel
def highest_part(
    constants: Constants, surface: Surface, rod_angles: FloatArray, left: Links, right: Links,
) -> float:
    """Return how high the highest part of the robot is above the surface [m]; `surface` is as the body sees it.

    `rod_angles` (2, 2) are those of `State`.
    """
    none = (0.0, 0.0, 0.0)
    fin, body = constants.fin, constants.body
    highest = surface.height + dot(surface.up, body.buoyancy_center) + 0.5 * body.height
    for side in range(2):
        front, rear = Rod(rod_angles[side, 0], 0.0, 0.0), Rod(rod_angles[side, 1], 0.0, 0.0)
        support = support_motion(constants.rods, front, rear, BodyMotion(none, none, none, none))
        at_a = surface_at_support(surface, side, support)
        for k in range(fin.chains):
            angle, height = 0.0, at_a.height + at_a.up[0] * fin.station[k] + 0.5 * fin.thickness
            for j in range(left.q.shape[0]):
                angle += left.q[j, k] if side == 0 else right.q[j, k]
                half = 0.5 * fin.link_length * (at_a.up[1] * cos(angle) + at_a.up[2] * sin(angle))
                highest = max(highest, height + half)
                height += 2.0 * half
    return highest


@kernel
def parts_of_step(
    constants: Constants, surface: Surface, twist: FloatArray, rod_angles: FloatArray, work: Workspace,
) -> int:
    """Return the number of equal parts that a step must be taken in: 1 unless the robot is at the surface.

    `surface` is as the body sees it, and `twist` (6,) is that of the body.
    """
    if surface.is_near:
        return _parts_near_surface(constants, surface, twist, rod_angles, links_of(work, 0), links_of(work, 1))
    return 1


@rare_kernel
def _parts_near_surface(
    constants: Constants, surface: Surface, twist: FloatArray, rod_angles: FloatArray, left: Links, right: Links,
) -> int:
    """Return the number of parts near the surface.

    What falls into the water is faster than what swims in it, so that drag and the bend of the fins are stiffer.
    """
    fin, body = constants.fin, constants.body
    rate, bend = 0.0, 0.0
    for j in range(left.q.shape[0]):
        for k in range(fin.chains):
            rate = max(rate, max(abs(left.q_dot[j, k]), abs(right.q_dot[j, k])))
            bend = max(bend, max(abs(left.q[j, k]), abs(right.q[j, k])))
    speed = fin.span * rate + sqrt(twist[0] ** 2 + twist[1] ** 2 + twist[2] ** 2)
    speed += constants.reach * sqrt(twist[3] ** 2 + twist[4] ** 2 + twist[5] ** 2)
    way = constants.time_step * speed
    if surface.height > constants.reach + way or highest_part(constants, surface, rod_angles, left, right) < -way:
        return 1  # all of it is in the air or in the water
    per_length = max(2.0 * fin.drag / fin.link_mass, fin.added_mass / (fin.link_mass * fin.thickness))
    for axis in range(6):
        own = body.mass if axis < 3 else body.inertia[axis - 3]
        per_length = max(per_length, body.added_mass[axis] / (own * body.height))
    half_tangent = min(bend / 2.0, 1.5)
    half_tangent = half_tangent + half_tangent**3 / 3.0
    steeper = (1.0 + half_tangent**2) * (1.0 + 3.0 * half_tangent**2)
    bending = sqrt(15.0 * fin.stiffness * steeper / (fin.link_mass * fin.link_length**2))  # of the last links [1/s]
    parts = ceil(constants.time_step * max(speed * per_length, 0.5 * bending))
    return min(max(parts, 1), MOST_PARTS)


@kernel
def with_parts(constants: Constants, parts: int) -> Constants:
    """Return the constants with a step divided into equal parts."""
    return Constants(
        constants.fin, constants.rods, constants.body, constants.time_step / parts, constants.fixed_base,
        constants.surface_height, constants.reach)

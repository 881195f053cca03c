"""The state of a simulation as the kernels take and change it, and how their calls end."""

from __future__ import annotations

from math import pi
from typing import NamedTuple

import numpy as np

from manta_sim_ros.dynamics._kernels.actuation import rod_torques
from manta_sim_ros.dynamics._kernels.compilation import kernel, rare_kernel
from manta_sim_ros.dynamics._kernels.constants import RodConstants
from manta_sim_ros.dynamics._kernels.gait import Gait, rod_motion
from manta_sim_ros.dynamics._kernels.geometry import Wrench, mirror_axial, mirror_polar, vector_at
from manta_sim_ros.dynamics._kernels.layout import Links, Workspace, from_rows, links_of, to_rows
from manta_sim_ros.dynamics.quantity import FloatArray

FIN_DIVERGED, BODY_DIVERGED, NO_SOLUTION = 1, 2, 3
"""How a step failed: a joint, the body, or the six equations for the body's acceleration."""

FASTEST = 1e3
"""Velocity [m/s] and angular velocity [rad/s] of the body that no motion of the robot comes near: it has diverged."""


class Motion(NamedTuple):
    """The state of a simulation; fields as in `State`, in the order in which `motion_of` finds them."""

    position: FloatArray  # (3,)
    orientation: FloatArray  # (4,), x, y, z, w
    twist: FloatArray  # (6,)
    acceleration: FloatArray  # (6,)
    gait: FloatArray  # (2, 5)
    gait_rates: FloatArray  # (2, 5)
    gait_commands: FloatArray  # (2, 5)
    cycle_angles: FloatArray  # (2,)
    rod_angles: FloatArray  # (2, 2)
    fin_wrenches: FloatArray  # (2, 6)
    rod_rates: FloatArray  # (2, 2)
    rod_torques: FloatArray  # (2, 2)
    joint_angles: FloatArray  # (2, n, m)
    joint_rates: FloatArray  # (2, n, m)


class FinState(NamedTuple):
    """What the accelerations of one fin depend on, and where they go; as in `fin_dynamics`."""

    rods: FloatArray  # (2, 3) front, rear; angle and its derivatives
    joint_angles: FloatArray  # (n, m)
    joint_rates: FloatArray  # (n, m)
    body_twist: FloatArray  # (6,)
    body_acceleration: FloatArray  # (6,)
    joint_accelerations: FloatArray  # (n, m), filled


class Outcome(NamedTuple):
    """How a call of many steps ended; the kernels return its fields as a plain tuple."""

    steps: int  # that were taken
    failure: int  # 0, or one of the constants above
    side: int  # of the joint that failed
    chain: int  # of the joint that failed


FIXED_SIZE = 75
"""Sum of the sizes of the arrays of `Motion` but for the joints."""


def motion_size(chains: int, links: int) -> int:
    """Return the sum of the sizes of all arrays of `Motion`."""
    return FIXED_SIZE + 4 * chains * links


@kernel
def motion_of(values: FloatArray, chains: int, links: int) -> Motion:
    """Return the motion that lies in one array (motion_size,), in the same memory."""
    a, first, second = values, FIXED_SIZE, FIXED_SIZE + 2 * chains * links
    return Motion(
        a[0:3], a[3:7], a[7:13], a[13:19], a[19:29].reshape((2, 5)), a[29:39].reshape((2, 5)),
        a[39:49].reshape((2, 5)), a[49:51], a[51:55].reshape((2, 2)), a[55:67].reshape((2, 6)),
        a[67:71].reshape((2, 2)), a[71:75].reshape((2, 2)), a[first:second].reshape((2, chains, links)),
        a[second:].reshape((2, chains, links)),
    )


@kernel
def gait_of(motion: Motion, side: int) -> Gait:
    """Return the gait of one fin."""
    return Gait(motion.gait[side], motion.gait_rates[side], motion.gait_commands[side], motion.cycle_angles[side])


@kernel
def load_joints(motion: Motion, work: Workspace) -> None:
    """Lay the joints of both fins out as [link, chain]."""
    for side in range(2):
        links = links_of(work, side)
        to_rows(motion.joint_angles[side], links.q)
        to_rows(motion.joint_rates[side], links.q_dot)


@kernel
def store_joints(work: Workspace, motion: Motion) -> None:
    """Lay the joints of both fins out as (n, m)."""
    for side in range(2):
        links = links_of(work, side)
        from_rows(links.q, motion.joint_angles[side])
        from_rows(links.q_dot, motion.joint_rates[side])


@kernel
def store_wrench(wrench: Wrench, side: int, wrenches: FloatArray) -> None:
    """Put the wrench of one fin, in the left fin's coordinates, into its row of an array (2, 6) in F_b."""
    force, moment = mirror_polar(wrench.force, side), mirror_axial(wrench.moment, side)
    for axis in range(3):
        wrenches[side, axis], wrenches[side, 3 + axis] = force[axis], moment[axis]


@rare_kernel
def store_rods(rods: RodConstants, motion: Motion) -> None:
    """Fill rates and torques of the rods, of the present gait and the wrenches of the fins."""
    for side in range(2):
        front, rear = rod_motion(rods, gait_of(motion, side), 0.0)
        wrench = motion.fin_wrenches[side]
        on_body = Wrench(mirror_polar(vector_at(wrench, 0), side), mirror_axial(vector_at(wrench, 3), side))
        motion.rod_rates[side, 0], motion.rod_rates[side, 1] = front.angle_dot, rear.angle_dot
        motion.rod_torques[side, 0], motion.rod_torques[side, 1] = rod_torques(rods, front, rear, on_body)


@kernel
def diverged_chain(links: Links, chains: int) -> int:
    """Return the first chain with a joint at or past +-pi or not finite, or -1."""
    q, q_dot = links.q, links.q_dot
    diverged = 0
    for j in range(q.shape[0]):
        for k in range(chains):
            diverged += 0 if abs(q[j, k]) < pi and abs(q_dot[j, k]) < np.inf else 1
    if diverged:
        for k in range(chains):
            for j in range(q.shape[0]):
                if not (abs(q[j, k]) < pi and abs(q_dot[j, k]) < np.inf):
                    return k
    return -1

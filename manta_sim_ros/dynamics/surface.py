"""Where the fins are: the nodes of their chains, from the angles of rods and joints, (7) to (9)."""

from __future__ import annotations

import numpy as np

from manta_sim_ros.dynamics.fin import stations
from manta_sim_ros.dynamics.parameters import Parameters


def fin_surfaces(parameters: Parameters, rod_angles: np.ndarray, joint_angles: np.ndarray) -> np.ndarray:
    """Return the nodes of both fins, in F_b.

    Parameters
    ----------
    parameters
        Sizes of rods and fins.
    rod_angles
        (..., 2, 2) [fin, front or rear] [rad], as of a State, or of many along leading axes.
    joint_angles
        (..., 2, n, m) [fin, chain, link] [rad].

    Returns
    -------
    numpy.ndarray
        (..., 2, n, m + 1, 3) [fin, chain, node, x y z] [m]: node 0 is the root on the support, node m the tip.

    """
    rods, fin = parameters.rods, parameters.fin
    front, rear = rod_angles[..., 0, None, None], rod_angles[..., 1, None, None]  # (..., 2, 1, 1): then chain, node
    length = rods.support_length
    dy = rods.front_radius * np.cos(front) - rods.rear_radius * np.cos(rear)
    dz = rods.front_radius * np.sin(front) - rods.rear_radius * np.sin(rear)
    sin_beta = -dz / length
    cos_beta = np.sqrt(1.0 - sin_beta**2)
    sin_theta = dy / (length * cos_beta)
    cos_theta = np.sqrt(1.0 - sin_theta**2)

    # Components along x_0, y_0, z_0 from A: the links of a chain turn about x_0
    directions = np.cumsum(joint_angles, axis=-1)
    link = fin.span / fin.links
    nodes = [np.cumsum(link * part(directions), axis=-1) for part in (np.cos, np.sin)]
    out, up = (np.concatenate([np.zeros_like(part[..., :1]), part], axis=-1) for part in nodes)
    along = stations(fin.chains, length)[:fin.chains, None]

    motor_x, motor_y, motor_z = rods.rear_motor_position
    x = motor_x + cos_theta * cos_beta * along - sin_theta * out + cos_theta * sin_beta * up
    y = (motor_y + rods.rear_radius * np.cos(rear)
         + sin_theta * cos_beta * along + cos_theta * out + sin_theta * sin_beta * up)
    z = motor_z + rods.rear_radius * np.sin(rear) - sin_beta * along + cos_beta * up
    sides = np.array([1.0, -1.0])[:, None, None]  # the right fin is the left one in a mirror
    return np.stack(np.broadcast_arrays(x, sides * y, z), axis=-1)

"""Kinematics of rods, supports and fins, from the angles of the rods and the joints, (7) to (9) and (38)."""

from __future__ import annotations

import numpy as np

from manta_sim_ros.dynamics._kernels.layout import stations
from manta_sim_ros.dynamics.parameters import Parameters, Rods
from manta_sim_ros.dynamics.quantity import FloatArray
from manta_sim_ros.dynamics.state import State

STEP = 1e-20
"""Imaginary time step h [s]: f(t + i h) = f + i h f-dot is exact to rounding, as h^2 is negligible against 1."""


def support_angles(parameters: Parameters, rod_angles: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return theta and beta (..., 2) of each fin [rad]: F_0 is F_b rotated by theta about z, then by beta about y, (9).

    `rod_angles` (..., 2, 2) are those of `fin_surfaces`. On the right, the angles are those of the mirrored fin.
    """
    sin_theta, sin_beta = _support_sines(parameters, rod_angles)
    return np.arcsin(sin_theta), np.arcsin(sin_beta)


def _support_sines(parameters: Parameters, rod_angles: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return sin(theta) and sin(beta) (..., 2), from |AB| = L, (8)."""
    rods, front, rear = parameters.rods, rod_angles[..., 0], rod_angles[..., 1]
    dy = rods.front_radius * np.cos(front) - rods.rear_radius * np.cos(rear)
    dz = rods.front_radius * np.sin(front) - rods.rear_radius * np.sin(rear)
    sin_beta = -dz / rods.support_length
    return dy / (rods.support_length * np.sqrt(1.0 - sin_beta**2)), sin_beta


def rod_rates(rods: Rods, state: State) -> FloatArray:
    """Return the rates of the rods (2, 2) by fin and rod (front, rear) [rad/s], from (38) with the smoothed gait."""
    amplitude, frequency, phase, front_bias, rear_bias = (state.gait + 1j * STEP * state.gait_rates).T
    psi = state.cycle_angles + 2j * np.pi * STEP * frequency.real
    front = np.arcsin(rods.rear_radius / rods.front_radius * np.sin(amplitude))
    angles = front * np.sin(psi + phase) + front_bias, amplitude * np.sin(psi) + rear_bias
    return np.stack(angles, axis=-1).imag / STEP


def support_rates(parameters: Parameters, rod_angles: FloatArray, rates: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the time derivatives of `support_angles` (..., 2) [rad/s]; those of the rods are (..., 2, 2)."""
    theta, beta = support_angles(parameters, rod_angles + 1j * STEP * rates)
    return theta.imag / STEP, beta.imag / STEP


def fin_surfaces(parameters: Parameters, rod_angles: FloatArray, joint_angles: FloatArray) -> FloatArray:
    """Return the positions of the nodes of both fins, in F_b.

    Parameters
    ----------
    parameters
        Sizes of rods and fins.
    rod_angles
        (..., 2, 2) by fin and rod (front, rear) [rad], as in `State`; leading axes are for many states.
    joint_angles
        (..., 2, n, m) by fin, chain and link [rad].

    Returns
    -------
    numpy.ndarray
        (..., 2, n, m + 1, 3) by fin, chain, node and coordinate [m]: node 0 is the root on the support, node m the tip.

    """
    rods, fin = parameters.rods, parameters.fin
    sin_theta, sin_beta = (sine[..., None, None] for sine in _support_sines(parameters, rod_angles))  # chain, node
    cos_theta, cos_beta = np.sqrt(1.0 - sin_theta**2), np.sqrt(1.0 - sin_beta**2)
    rear = rod_angles[..., 1, None, None]

    # Components along x_0, y_0, z_0 from A: the links of a chain rotate about x_0
    link_angles = np.cumsum(joint_angles, axis=-1)
    link = fin.span / fin.links
    nodes = [np.cumsum(link * part(link_angles), axis=-1) for part in (np.cos, np.sin)]
    out, up = (np.concatenate([np.zeros_like(part[..., :1]), part], axis=-1) for part in nodes)
    along = stations(fin.chains, rods.support_length)[:fin.chains, None]

    motor_x, motor_y, motor_z = rods.rear_motor_position
    x = motor_x + cos_theta * cos_beta * along - sin_theta * out + cos_theta * sin_beta * up
    y = (motor_y + rods.rear_radius * np.cos(rear)
         + sin_theta * cos_beta * along + cos_theta * out + sin_theta * sin_beta * up)
    z = motor_z + rods.rear_radius * np.sin(rear) - sin_beta * along + cos_beta * up
    sides = np.array([1.0, -1.0])[:, None, None]  # the right fin is the left one in a mirror
    return np.stack(np.broadcast_arrays(x, sides * y, z), axis=-1)

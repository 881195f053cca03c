"""The load of the water on the fins: the drag (12) of each link as a pressure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from manta_sim_ros.dynamics._kernels.constants import slab_height
from manta_sim_ros.dynamics._kernels.geometry import rotation_of
from manta_sim_ros.dynamics.parameters import Parameters
from manta_sim_ros.dynamics.quantity import FloatArray
from manta_sim_ros.dynamics.state import State, check_shape, finite_array
from manta_sim_ros.dynamics.surface import STEP, fin_surfaces, rod_rates


def immersed_shares(parameters: Parameters, state: State) -> tuple[float, FloatArray]:
    """Return the share of the body and the shares (2, n, m) of the links that are below the surface of the water.

    The body is a slab about its center of buoyancy, and a link is as thick as the fin at its midpoint.

    Raises
    ------
    ValueError
        `state` does not fit `parameters`.

    """
    check_shape(parameters, state)
    nodes = fin_surfaces(parameters, state.rod_angles, state.joint_angles)
    up = state.up
    above = float(state.position[2]) - parameters.water.surface_height
    body = 0.5 - (above + up @ np.array(parameters.body.buoyancy_center)) / slab_height(parameters)
    links = 0.5 - (above + 0.5 * (nodes[..., 1:, :] + nodes[..., :-1, :]) @ up) / parameters.fin.thickness
    return float(np.clip(body, 0.0, 1.0)), np.clip(links, 0.0, 1.0)


def fin_loads(
    parameters: Parameters, state: State, current: Sequence[float] | FloatArray | None = None,
) -> FloatArray:
    """Return the normal load of the water on each link of both fins, per unit area, (12).

    The force on a link is load n dl ds: n is the unit normal (11), which points up on both sides when the fin is level,
    dl is the length of the link, and ds is the distance of the chains. This is the whole drag, of the immersed share of
    each link; the load of the added mass is not included. The function is written in NumPy, as a kernel would have to
    be compiled first.

    Parameters
    ----------
    parameters
        All values of the model.
    state
        A state with as many chains and links. The motion of the rods is that of its gait.
    current
        (3,) mean velocity of the water, world frame [m/s], as in `Simulator.advance`; by default `water.current`. The
        deviation of the current in the state is added to it.

    Returns
    -------
    numpy.ndarray
        (2, n, m) by fin, chain and link [Pa], positive where the water pushes the link along n, that is, up.

    Raises
    ------
    ValueError
        `current` has a wrong shape or is not finite, or `state` does not fit `parameters`.

    """
    check_shape(parameters, state)
    mean = finite_array('current', parameters.water.current if current is None else current, (3,))
    water = mean + state.current_deviation
    nodes = fin_surfaces(
        parameters, state.rod_angles + 1j * STEP * rod_rates(parameters.rods, state),
        state.joint_angles + 1j * STEP * state.joint_rates)
    middles = 0.5 * (nodes[..., 1:, :] + nodes[..., :-1, :])

    spanwise = np.diff(nodes.real, axis=-2)
    chordwise = -np.gradient(middles.real, axis=1)  # toward the leading edge; one-sided at the edges
    normals = np.cross(chordwise, spanwise)
    normals[1] *= -1.0  # the mirror changes the sign of a vector product
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)

    velocities = middles.imag / STEP + np.cross(state.twist[3:], middles.real)
    velocities += state.twist[:3] - water @ np.array(rotation_of.py_func(state.orientation))  # R^T
    normal_velocities = np.sum(velocities * normals, axis=-1)
    factor = 0.5 * parameters.water.density * parameters.fin.drag_coefficient
    return -factor * np.abs(normal_velocities) * normal_velocities * immersed_shares(parameters, state)[1]


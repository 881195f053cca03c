"""The robot in space at some times of a swim: points in the body frame, and the triangles between them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from manta_sim_ros.body_shape import SECTIONS, body_surface
from manta_sim_ros.dynamics import FloatArray, Parameters, fin_surfaces
from manta_sim_ros.studies.recorded_swim import Swim

IntArray = npt.NDArray[np.int64]

BODY_POINTS = 25
"""Points around each cross section of the body; the last one is the first one."""


class Part(NamedTuple):
    """A part of the robot as triangles between V points, at K times or always the same."""

    points: FloatArray
    """(K or 1, V, 3) body frame [m]."""
    triangles: IntArray
    """(F, 3) whole numbers: the points of each triangle."""
    angles: FloatArray | None = None
    """(K, V) angle of the link at each point against the support [deg], to color the fins."""


def body() -> Part:
    """Return the body."""
    points = body_surface(SECTIONS, BODY_POINTS)
    return Part(points.reshape(1, -1, 3), grid_triangles(len(SECTIONS), BODY_POINTS))


def fins(swim: Swim, times: FloatArray) -> list[Part]:
    """Return what the bag has of both fins at some times [s]: with the joints of the chains, else as markers, or stiff.

    Between two states in the bag, the angles are interpolated; markers stay until the next ones.
    """
    joints, markers = swim.joints, swim.markers
    if joints is not None and (joints.joint_angles is not None or markers is None):
        fin = swim.settings.model.fin
        angles = joints.joint_angles
        flat = np.zeros((len(joints.time), 2, fin.chains, fin.links)) if angles is None else angles
        bent = _bent(swim.settings.model, _at(times, joints.time, joints.rod_angles), _at(times, joints.time, flat))
        return bent if angles is not None else [part._replace(angles=None) for part in bent]
    if markers is not None:
        index = np.clip(np.searchsorted(markers.time, times, side='right') - 1, 0, None)
        corners = markers.corners[index]
        return [Part(corners[:, side], np.arange(corners.shape[2]).reshape(-1, 3)) for side in range(2)]
    return []


def _bent(model: Parameters, rod_angles: FloatArray, joint_angles: FloatArray) -> list[Part]:
    """Return both fins with the panels between motors and supports."""
    nodes = fin_surfaces(model, rod_angles, joint_angles)
    motors = nodes[..., :1, :].copy()
    _, y, z = model.rods.rear_motor_position
    motors[..., 1:] = np.array([(y, z), (-y, z)])[:, None, None]
    points = np.concatenate([motors, nodes], axis=-2)  # by time, fin, chain and point
    links = np.degrees(np.cumsum(joint_angles, axis=-1))
    zeros = np.zeros_like(links[..., :1])
    angles = np.concatenate([zeros, zeros, links], axis=-1)
    triangles = grid_triangles(*points.shape[2:4])
    count = len(points)
    return [Part(points[:, side].reshape(count, -1, 3), triangles, angles[:, side].reshape(count, -1))
            for side in range(2)]


def _at(times: FloatArray, known: FloatArray, values: FloatArray) -> FloatArray:
    """Return values (T, ...) that are interpolated linearly."""
    flat = values.reshape(len(known), -1)
    return np.stack([np.interp(times, known, column) for column in flat.T], axis=-1).reshape(-1, *values.shape[1:])


def grid_triangles(rows: int, columns: int) -> IntArray:
    """Return two triangles (F, 3) for each quadrilateral of a grid of points, as indices into its points row by row."""
    corner = (columns * np.arange(rows - 1)[:, None] + np.arange(columns - 1)).reshape(-1, 1)
    return np.concatenate([corner + (0, columns, columns + 1), corner + (0, columns + 1, 1)])

"""The robot as colored faces in space: body, rods, supports and fins at every time of a record."""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation

from manta_sim_ros.body_shape import SECTIONS, body_surface
from manta_sim_ros.dynamics import FloatArray, Parameters, fin_surfaces
from manta_sim_ros.figures.record import Record

PANEL = np.array([0.0, 0.33, 0.66, 0.95])
"""Divisions of the panel between the motors (0) and the support (1); the last part is drawn as the support."""
BACK_COLOR, BELLY_COLOR = (0.28, 0.36, 0.45), (0.80, 0.83, 0.86)
EDGE_COLOR, PANEL_COLOR = (0.12, 0.14, 0.17), (0.66, 0.71, 0.76)
COLOR_MAP, HUES = 'viridis', 20
SHADES = np.linspace(0.6, 1.05, 8)
"""Brightness of a face, from one parallel to the light to one normal to it."""
LIGHT = np.array([0.33, 0.24, 0.91])
"""Unit vector toward the light, world frame."""


def in_world(record: Record, points: FloatArray) -> FloatArray:
    """Return points (T, ..., 3) [m] in the world frame, given those in F_b at each time of a record."""
    flat = points.reshape(len(points), -1, 3)
    rotated = flat @ Rotation.from_quat(record.orientation).as_matrix().transpose(0, 2, 1)
    return np.asarray((rotated + record.position[:, None]).reshape(points.shape))


def faces_of(grid: FloatArray) -> FloatArray:
    """Return the quadrilaterals (..., a - 1, b - 1, 4, 3) between neighbors of a grid of points (..., a, b, 3)."""
    return np.stack(
        [grid[..., :-1, :-1, :], grid[..., 1:, :-1, :], grid[..., 1:, 1:, :], grid[..., :-1, 1:, :]], axis=-2)


def body() -> FloatArray:
    """Return the faces (27, 28, 4, 3) [m] of the body, in F_b."""
    smooth = PchipInterpolator(np.arange(len(SECTIONS)), SECTIONS)(np.linspace(0.0, len(SECTIONS) - 1.0, 28))
    return faces_of(body_surface(smooth, 29))


def fins(parameters: Parameters, nodes: FloatArray) -> FloatArray:
    """Return the faces (T, 2, n + 1, 4 + m, 4, 3) [m] of both fins with the panels that the rods sweep, in F_b.

    `nodes` (T, 2, n, m + 1, 3) [m] are in F_b. From front to rear, the first and the last faces are the edges, which
    are half a chain's distance wide. Outward, the first three faces are the panel's; the support and the links follow.
    """
    half = 0.5 * (nodes[:, :, :1, :1] - nodes[:, :, -1:, :1]) / (nodes.shape[2] - 1)
    chains = np.concatenate([nodes[:, :, :1] + half, nodes, nodes[:, :, -1:] - half], axis=2)
    roots = chains[..., :1, :]
    _, y, z = parameters.rods.rear_motor_position
    motors = roots.copy()
    motors[..., 1:] = np.array([(y, z), (-y, z)])[:, None, None]
    return faces_of(np.concatenate([motors + PANEL[:, None] * (roots - motors), chains], axis=-2))


def lit(faces: FloatArray, colors: FloatArray) -> FloatArray:
    """Return the colors (..., 3) of faces (..., 4, 3) [m] in the world frame, with both their sides lit."""
    normals = np.cross(faces[..., 2, :] - faces[..., 0, :], faces[..., 3, :] - faces[..., 1, :])
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    shades = SHADES[np.round(np.abs(normals @ LIGHT) * (len(SHADES) - 1)).astype(int)]
    return np.asarray(np.clip(colors * shades[..., None], 0.0, 1.0))


@dataclasses.dataclass(frozen=True)
class Scene:
    """The robot at every time of a record."""

    record: Record
    faces: FloatArray
    """(T, F, 4, 3) of F faces in the world frame [m]."""
    colors: FloatArray
    """(T, F, 3) red, green, blue."""
    height: float
    """Largest height of a fin in F_b [m], which is the end of the color scale."""

    @classmethod
    def of(cls, record: Record) -> Scene:
        """Build the robot from its body, fins and panels."""
        import matplotlib as mpl

        nodes = fin_surfaces(record.parameters, record.rod_angles, record.joint_angles)
        height = float(np.abs(nodes[..., 2]).max())
        of_fins, of_body = fins(record.parameters, nodes), np.broadcast_to(body(), (len(nodes), *body().shape))
        fin_colors = mpl.colormaps[COLOR_MAP].resampled(HUES)(0.5 + 0.5 * of_fins[..., 2].mean(axis=-1) / height)
        fin_colors[..., :len(PANEL) - 1, :3] = PANEL_COLOR
        fin_colors[..., len(PANEL) - 1, :3] = fin_colors[:, :, [0, -1], :, :3] = EDGE_COLOR
        body_colors = np.where(of_body[..., 2].mean(axis=-1, keepdims=True) > 0.0, BACK_COLOR, BELLY_COLOR)
        faces = in_world(record, np.concatenate([part.reshape(len(nodes), -1, 4, 3) for part in (of_body, of_fins)], 1))
        colors = [part.reshape(len(nodes), -1, 3) for part in (body_colors, fin_colors[..., :3])]
        return cls(record, faces, lit(faces, np.concatenate(colors, axis=1)), height)

"""The robot as markers for RViz: body, fins colored by their load, wrenches of the fins, and path."""

from __future__ import annotations

import functools
import math
from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Point, Vector3
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from manta_sim_ros.body_shape import SECTIONS, body_surface
from manta_sim_ros.dynamics import SIDES, FloatArray, Parameters, State, fin_loads, fin_surfaces

LIFETIME = 2
"""Time after which a marker disappears if no message follows [s], on the clock of the viewer."""

FULL_LOAD = 300.0
"""Load at the ends of the color scale [Pa]: in the gait 0.7 rad, 0.6 Hz, 0.7 rad, 2 % of the links exceed it."""
LOAD_COLORS = (
    '364B9A', '4A7BB7', '6EA6CD', '98CAE1', 'C2E4EF', 'EAECCC', 'FEDA8B', 'FDB366', 'F67E4B', 'DD3D2D', 'A50026',
)
"""From a load downward (blue) to a load upward (red): the diverging scheme 'sunset', which is for all kinds of color
vision and can be interpolated. P. Tol, Colour Schemes, SRON/EPS/TN/09-002."""
LEVELS = 101
"""Number of colors of the scale, odd so that one of them is for no load."""

BODY_COLOR, PANEL_COLOR, PATH_COLOR = '475C73', 'A8B5C2', 'BBBBBB'
FORCE_COLOR, MOMENT_COLOR = '009988', 'EE3377'

FORCE_SCALE = 0.03
"""Length of an arrow per force [m/N]."""
MOMENT_SCALE = 0.04
"""Length of an arrow per moment [m/(N m)]."""
ARROW_SIZE = 0.015, 0.04, 0.06
"""Diameter of the shaft, diameter and length of the head [m]."""
SHORTEST_ARROW = 0.001
"""An arrow below this length [m] is not drawn, as its direction would not be visible."""

PATH_WIDTH = 0.01
"""Width of the line [m]."""
PATH_SPACING = 0.05
"""Least distance of two points of the path [m]."""

BODY_POINTS = 13
"""Points around each cross section of the body; the last one is the first one."""


class Markers:
    """Makes the markers of one robot, and keeps its path.

    Namespaces and ids are the same in every message, so that each marker replaces the last one: `body`; `left_fin` and
    `right_fin`, with the links (0) and the panel from the motors to the support (1); `force` and `moment`, of the left
    fin (0) and the right one (1); and `path`. An arrow or a path without length is deleted. All markers are locked to
    their frames: they follow the transform until the next message.

    Parameters
    ----------
    path_length
        Length of the path that is kept [m]: its last part.

    """

    def __init__(self, path_length: float) -> None:
        self._path_length = path_length
        self._path: deque[tuple[float, Point]] = deque()  # distance along the path [m], and position

    def forget(self) -> None:
        """Begin a new path, as the robot was put at another place."""
        self._path.clear()

    def message(
        self, state: State, model: Parameters, base: Header, odom: Header,
        current: Sequence[float] | FloatArray | None = None,
    ) -> MarkerArray:
        """Return all markers of a state, and add its position to the path.

        The arrows show the published wrenches, with the moment about the center of mass; they begin in the middle of
        the support of each fin.

        Parameters
        ----------
        state
            The state to draw.
        model
            The parameters of the model.
        base, odom
            Headers in the body frame and in the world frame.
        current
            (3,) mean velocity of the water, world frame [m/s]; by default `water.current`.

        """
        nodes = fin_surfaces(model, state.rod_angles, state.joint_angles)
        loads = fin_loads(model, state, current)
        markers = [_triangles('body', 0, base, BODY_COLOR, _body())]
        for side, name in enumerate(f'{side}_fin' for side in SIDES):
            middle, wrench = nodes[side, :, 0].mean(axis=0), state.fin_wrenches[side]
            markers += [
                _fin(name, base, side, nodes[side], loads[side]),
                _triangles(name, 1, base, PANEL_COLOR, _panel(model, side, nodes[side])),
                _arrow('force', side, base, FORCE_COLOR, middle, FORCE_SCALE * wrench[:3]),
                _arrow('moment', side, base, MOMENT_COLOR, middle, MOMENT_SCALE * wrench[3:]),
            ]
        markers.append(_line('path', odom, PATH_COLOR, self._extended_path(_points(state.position)[0])))
        return MarkerArray(markers=markers)

    def _extended_path(self, here: Point) -> list[Point]:
        """Return the points of the path up to the position `here`, which is kept if it is far enough from the last."""
        before, last = self._path[-1] if self._path else (0.0, here)
        distance = before + math.dist((here.x, here.y, here.z), (last.x, last.y, last.z))
        if not self._path or distance - before >= PATH_SPACING:
            self._path.append((distance, here))
        while self._path and distance - self._path[0][0] > self._path_length:
            self._path.popleft()
        points = [point for _, point in self._path]
        return points if self._path and self._path[-1][0] == distance else [*points, here]


def _marker(
    ns: str, number: int, header: Header, kind: int, color: str, scale: Sequence[float], **shape: Any,
) -> Marker:
    """Return a marker; `color` is red, green and blue with two hexadecimal digits each."""
    x, y, z = scale
    return Marker(
        header=header, ns=ns, id=number, type=kind, action=Marker.ADD, frame_locked=True,
        lifetime=Duration(sec=LIFETIME), color=_color(color), scale=Vector3(x=x, y=y, z=z), **shape)


def _deletion(ns: str, number: int, header: Header) -> Marker:
    return Marker(header=header, ns=ns, id=number, action=Marker.DELETE)


def _triangles(ns: str, number: int, header: Header, color: str, corners: list[Point], **shape: Any) -> Marker:
    return _marker(ns, number, header, Marker.TRIANGLE_LIST, color, (1.0, 1.0, 1.0), points=corners, **shape)


def _fin(ns: str, header: Header, side: int, nodes: FloatArray, loads: FloatArray) -> Marker:
    """Return the surface of one fin between its chains, in the colors of the loads.

    `nodes` (n, m + 1, 3) [m], `loads` (n, m) [Pa]. Along a chain the color changes at the joints; from chain to chain
    it is interpolated.
    """
    corners, of_links = _corners(*nodes.shape[:2], flipped=side == 0)
    points = _points(nodes)
    levels = np.rint((0.5 + 0.5 * np.clip(loads / FULL_LOAD, -1.0, 1.0)) * (LEVELS - 1)).astype(int).ravel().tolist()
    scale = _load_scale()
    colors = [scale[level] for level in levels]
    return _triangles(
        ns, 0, header, PANEL_COLOR, [points[corner] for corner in corners], colors=[colors[link] for link in of_links])


def _panel(model: Parameters, side: int, nodes: FloatArray) -> list[Point]:
    """Return the two triangles between the motors and the support of one fin, from the first root to the last."""
    roots = nodes[[0, -1], 0]
    _, y, z = model.rods.rear_motor_position
    motors = np.column_stack([roots[:, 0], np.full(2, -y if side == 1 else y), np.full(2, z)])
    points = _points(np.stack([motors, roots], axis=1))
    return [points[corner] for corner in _corners(2, 2, flipped=side == 0)[0]]


def _arrow(ns: str, side: int, header: Header, color: str, start: FloatArray, vector: FloatArray) -> Marker:
    if not np.linalg.norm(vector) >= SHORTEST_ARROW:
        return _deletion(ns, side, header)
    return _marker(ns, side, header, Marker.ARROW, color, ARROW_SIZE, points=_points(np.stack([start, start + vector])))


def _line(ns: str, header: Header, color: str, points: list[Point]) -> Marker:
    if len(points) < 2:
        return _deletion(ns, 0, header)
    return _marker(ns, 0, header, Marker.LINE_STRIP, color, (PATH_WIDTH, 0.0, 0.0), points=points)


def _points(array: FloatArray) -> list[Point]:
    return [Point(x=x, y=y, z=z) for x, y, z in array.reshape(-1, 3).tolist()]


def _color(digits: str) -> ColorRGBA:
    red, green, blue = (int(digits[at:at + 2], 16) / 255.0 for at in (0, 2, 4))
    return ColorRGBA(r=red, g=green, b=blue, a=1.0)


@functools.cache
def _load_scale() -> list[ColorRGBA]:
    """Return the colors of loads from -FULL_LOAD to FULL_LOAD in equal steps; many vertices share each of them."""
    given = [_color(digits) for digits in LOAD_COLORS]
    at = np.linspace(0.0, len(given) - 1.0, LEVELS)
    red, green, blue = (
        np.interp(at, np.arange(len(given)), [getattr(color, name) for color in given]).tolist() for name in 'rgb')
    return [ColorRGBA(r=r, g=g, b=b, a=1.0) for r, g, b in zip(red, green, blue, strict=True)]


@functools.cache
def _body() -> list[Point]:
    """Return the triangles of the body."""
    points = body_surface(SECTIONS, BODY_POINTS).reshape(-1, 3)
    faces = points[_corners(len(SECTIONS), BODY_POINTS, flipped=False)[0]].reshape(-1, 3, 3)
    areas = np.linalg.norm(np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0]), axis=-1)
    return _points(faces[areas > 0.0])  # nose and tail are points


@functools.lru_cache
def _corners(rows: int, columns: int, flipped: bool) -> tuple[list[int], list[int]]:
    """Return the corners of two triangles for each quadrilateral of a grid, as indices into its points, row by row.

    The second list has, for each corner, the index of its link in an array (rows, columns - 1). RViz lights the side to
    which the normal of a triangle points: the direction rows x columns, or the opposite one when `flipped`.
    """
    row, column = np.mgrid[:rows - 1, :columns - 1][..., None]
    of_row = np.concatenate([row, row + 1, row + 1, row, row + 1, row], axis=-1)
    of_column = np.concatenate([column, column, column + 1, column, column + 1, column + 1], axis=-1)
    corners, between = (of_row * columns + of_column).ravel(), (of_row * (columns - 1) + column).ravel()
    order = -1 if flipped else 1
    return corners[::order].tolist(), between[::order].tolist()

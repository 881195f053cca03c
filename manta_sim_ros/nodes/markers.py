"""The robot as markers for RViz: body, fins colored by their load, wrenches of the fins, and path."""

from __future__ import annotations

import functools
import math
from collections import deque
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import Point, Vector3
from numpy.typing import NDArray
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from manta_sim_ros.body_shape import SECTIONS, body_surface
from manta_sim_ros.dynamics import SIDES, FloatArray, Parameters, State, fin_loads, fin_surfaces
from manta_sim_ros.nodes.serialization import Template

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
PATH_BLOCK = 32
"""The path has a multiple of this number of points, the last one repeated: each other number of points would need
another template."""

BODY_POINTS = 13
"""Points around each cross section of the body; the last one is the first one."""


class Markers:
    """Writes the markers of one robot, and keeps its path.

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
        self._path: deque[tuple[float, list[float]]] = deque()  # distance along the path [m], and position
        self._layout: list[tuple[str, int]] = []  # frames and numbers of points that the template is for
        self._template: Template

    def forget(self) -> None:
        """Begin a new path, as the robot was put at another place."""
        self._path.clear()

    def write(
        self, state: State, model: Parameters, stamp: Time, base_frame: str, odom_frame: str,
        current: Sequence[float] | FloatArray | None = None,
    ) -> Any:
        """Return a MarkerArray with all markers of a state as `Template.write`, and add its position to the path.

        The arrows show the published wrenches, with the moment about the center of mass; they begin in the middle of
        the support of each fin.

        Parameters
        ----------
        state
            The state to draw.
        model
            The parameters of the model.
        stamp
            The stamp of all markers.
        base_frame, odom_frame
            The names of the body frame and of the world frame.
        current
            (3,) mean velocity of the water, world frame [m/s]; by default `water.current`.

        """
        nodes = fin_surfaces(model, state.rod_angles, state.joint_angles)
        loads = fin_loads(model, state, current)
        shapes = [_triangles('body', 0, base_frame, BODY_COLOR, _body())]
        for side, name in enumerate(f'{side}_fin' for side in SIDES):
            middle, wrench = nodes[side, :, 0].mean(axis=0), state.fin_wrenches[side]
            shapes += [
                _fin(name, base_frame, side, nodes[side], loads[side]),
                _triangles(name, 1, base_frame, PANEL_COLOR, _panel(model, side, nodes[side])),
                _arrow('force', side, base_frame, FORCE_COLOR, middle, FORCE_SCALE * wrench[:3]),
                _arrow('moment', side, base_frame, MOMENT_COLOR, middle, MOMENT_SCALE * wrench[3:]),
            ]
        shapes.append(_line('path', odom_frame, PATH_COLOR, self._extended_path(state.position.tolist())))
        layout = [(shape.frame, len(shape.points)) for shape in shapes]
        if layout != self._layout:
            self._layout, self._template = layout, _template(shapes)
        return self._template.write(stamp, shapes)

    def _extended_path(self, here: list[float]) -> FloatArray:
        """Return the points (k, 3) of the path up to the position `here`, kept if it is far enough from the last."""
        before, last = self._path[-1] if self._path else (0.0, here)
        distance = before + math.dist(here, last)
        if not self._path or distance - before >= PATH_SPACING:
            self._path.append((distance, here))
        while self._path and distance - self._path[0][0] > self._path_length:
            self._path.popleft()
        points = [point for _, point in self._path]
        return np.array(points if self._path and self._path[-1][0] == distance else [*points, here])


class _Shape(NamedTuple):
    """What a marker shows; without a point, the marker is deleted."""

    ns: str
    number: int
    frame: str
    kind: int
    color: str
    """Red, green and blue with two hexadecimal digits each."""
    scale: tuple[float, float, float]
    points: FloatArray
    """(k, 3)"""
    colors: FloatArray = np.empty((0, 4))
    """(k, 4) red, green, blue and opacity of each point, or (0, 4) if all have `color`."""


def _template(shapes: Sequence[_Shape]) -> Template:
    """Return the template of a message with these shapes; their points and colors change."""
    drawn = [(index, shape) for index, shape in enumerate(shapes) if len(shape.points)]
    fields = [f'markers.{index}.points' for index, _ in drawn]
    fields += [f'markers.{index}.colors' for index, shape in drawn if len(shape.colors)]

    def numbers_of(shapes: Sequence[_Shape]) -> list[FloatArray]:
        parts = [shape.points for shape in shapes] + [shape.colors for shape in shapes]
        return [part.ravel() for part in parts if len(part)]

    return Template(
        MarkerArray(markers=[_marker(shape) for shape in shapes]),
        [f'markers.{index}.header.stamp' for index in range(len(shapes))], fields, numbers_of)


def _marker(shape: _Shape) -> Marker:
    """Return the marker of a shape; its points and colors have no values yet."""
    marker = Marker(header=Header(frame_id=shape.frame), ns=shape.ns, id=shape.number, action=Marker.DELETE)
    if len(shape.points):
        x, y, z = shape.scale
        red, green, blue, opacity = _rgba(shape.color)
        marker.action, marker.type, marker.frame_locked = Marker.ADD, shape.kind, True
        marker.lifetime, marker.scale = Duration(sec=LIFETIME), Vector3(x=x, y=y, z=z)
        marker.color = ColorRGBA(r=red, g=green, b=blue, a=opacity)
        marker.points, marker.colors = [Point() for _ in shape.points], [ColorRGBA() for _ in shape.colors]
    return marker


def _triangles(ns: str, number: int, frame: str, color: str, corners: FloatArray, **shape: Any) -> _Shape:
    return _Shape(ns, number, frame, Marker.TRIANGLE_LIST, color, (1.0, 1.0, 1.0), corners, **shape)


def _fin(ns: str, frame: str, side: int, nodes: FloatArray, loads: FloatArray) -> _Shape:
    """Return the surface of one fin between its chains, in the colors of the loads.

    `nodes` (n, m + 1, 3) [m], `loads` (n, m) [Pa]. Along a chain the color changes at the joints; from chain to chain
    it is interpolated.
    """
    corners, of_links = _corners(*nodes.shape[:2], flipped=side == 0)
    levels = np.rint((0.5 + 0.5 * np.clip(loads / FULL_LOAD, -1.0, 1.0)) * (LEVELS - 1)).astype(int).ravel()
    return _triangles(
        ns, 0, frame, PANEL_COLOR, nodes.reshape(-1, 3)[corners], colors=_load_scale()[levels[of_links]])


def _panel(model: Parameters, side: int, nodes: FloatArray) -> FloatArray:
    """Return the two triangles between the motors and the support of one fin, from the first root to the last."""
    roots = nodes[[0, -1], 0]
    _, y, z = model.rods.rear_motor_position
    motors = np.column_stack([roots[:, 0], np.full(2, -y if side == 1 else y), np.full(2, z)])
    return np.stack([motors, roots], axis=1).reshape(-1, 3)[_corners(2, 2, flipped=side == 0)[0]]


def _arrow(ns: str, side: int, frame: str, color: str, start: FloatArray, vector: FloatArray) -> _Shape:
    ends = np.stack([start, start + vector]) if np.linalg.norm(vector) >= SHORTEST_ARROW else np.empty((0, 3))
    return _Shape(ns, side, frame, Marker.ARROW, color, ARROW_SIZE, ends)


def _line(ns: str, frame: str, color: str, points: FloatArray) -> _Shape:
    """Return a line through points (k, 3), in blocks of `PATH_BLOCK`; through one point there is none."""
    missing = -len(points) % PATH_BLOCK
    padded = np.concatenate([points, np.repeat(points[-1:], missing, axis=0)]) if len(points) > 1 else points[:0]
    return _Shape(ns, 0, frame, Marker.LINE_STRIP, color, (PATH_WIDTH, 0.0, 0.0), padded)


def _rgba(digits: str) -> tuple[float, float, float, float]:
    red, green, blue = (int(digits[at:at + 2], 16) / 255.0 for at in (0, 2, 4))
    return red, green, blue, 1.0


@functools.cache
def _load_scale() -> FloatArray:
    """Return the colors (LEVELS, 4) of loads from -FULL_LOAD to FULL_LOAD in equal steps."""
    given = np.array([_rgba(digits) for digits in LOAD_COLORS])
    at = np.linspace(0.0, len(given) - 1.0, LEVELS)
    return np.stack([np.interp(at, np.arange(len(given)), part) for part in given.T], axis=-1)


@functools.cache
def _body() -> FloatArray:
    """Return the triangles (k, 3) of the body."""
    points = body_surface(SECTIONS, BODY_POINTS).reshape(-1, 3)
    faces = points[_corners(len(SECTIONS), BODY_POINTS, flipped=False)[0]].reshape(-1, 3, 3)
    areas = np.linalg.norm(np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0]), axis=-1)
    return faces[areas > 0.0].reshape(-1, 3)  # nose and tail are points


@functools.lru_cache
def _corners(rows: int, columns: int, flipped: bool) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the corners of two triangles for each quadrilateral of a grid, as indices into its points, row by row.

    The second list has, for each corner, the index of its link in an array (rows, columns - 1). RViz lights the side to
    which the normal of a triangle points: the direction rows x columns, or the opposite one when `flipped`.
    """
    row, column = np.mgrid[:rows - 1, :columns - 1][..., None]
    of_row = np.concatenate([row, row + 1, row + 1, row, row + 1, row], axis=-1)
    of_column = np.concatenate([column, column, column + 1, column, column + 1, column + 1], axis=-1)
    corners, between = (of_row * columns + of_column).ravel(), (of_row * (columns - 1) + column).ravel()
    order = -1 if flipped else 1
    return corners[::order], between[::order]

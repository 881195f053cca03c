"""A path in space: straight legs between waypoints, measured along the horizontal plane."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from manta_sim_ros.dynamics import FloatArray, shown

SHORTEST_LEG = 0.01
"""Least horizontal length of a leg [m]."""

STEEPEST = 0.2
"""Largest slope of a leg: the robot climbs with a fifth of its speed."""

FARTHEST = 1e5
"""Bound of the coordinates of a waypoint [m]."""

MOST_WAYPOINTS = 100_000


class Polyline:
    """A path of straight legs.

    Parameters
    ----------
    waypoints
        (n, 3) positions [m], world frame, n at least 2.

    Raises
    ------
    ValueError
        There are less than two or too many waypoints, a coordinate is not finite or out of its bounds, or a leg is too
        short or too steep; names the waypoint, the value and the bound.

    """

    def __init__(self, waypoints: Sequence[Sequence[float]] | FloatArray) -> None:
        if not 2 <= len(waypoints) <= MOST_WAYPOINTS:
            raise ValueError(f'the path has {len(waypoints)} waypoints, but must have from 2 to {MOST_WAYPOINTS}')
        for index, waypoint in enumerate(waypoints):
            try:
                fits = len(waypoint) == 3 and all(abs(value) <= FARTHEST for value in waypoint)
            except TypeError:  # of no length, or not numbers
                fits = False
            if not fits:
                raise ValueError(
                    f'waypoint {index} is {shown(waypoint)}, but must be three numbers from {-FARTHEST:g} to '
                    f'{FARTHEST:g} m')
        self.waypoints = np.array(waypoints, dtype=float)
        legs = np.diff(self.waypoints, axis=0)
        lengths = np.hypot(legs[:, 0], legs[:, 1])
        for index, (length, climb) in enumerate(zip(lengths, legs[:, 2], strict=True)):
            if not length >= SHORTEST_LEG:
                raise ValueError(
                    f'waypoint {index + 1} is {length:g} m from the one before in the horizontal plane, but must be at '
                    f'least {SHORTEST_LEG:g} m')
            if not abs(climb) <= STEEPEST * length:
                raise ValueError(
                    f'the leg to waypoint {index + 1} has a slope of {climb / length:g}, but must be within '
                    f'+-{STEEPEST:g}')
        self._lengths = lengths
        self._directions = legs / lengths[:, np.newaxis]
        self._stations = np.concatenate([[0.0], np.cumsum(lengths)])

    @property
    def length(self) -> float:
        """Horizontal length of the path [m]."""
        return float(self._stations[-1])

    def point(self, station: float) -> FloatArray:
        """Return the point (3,) at a station: at this horizontal length from the beginning [m]."""
        return np.array([np.interp(station, self._stations, axis) for axis in self.waypoints.T])

    def course(self, station: float, length: float) -> float:
        """Return the course of the path about a station: of the chord of this length whose middle is there [rad].

        It is 0 along x and positive to the left. So a corner is rounded, and a circle has the course of its tangent.
        Before its beginning and behind its end the path goes on straight.
        """
        x, y, _ = self._extended(station + 0.5 * length) - self._extended(station - 0.5 * length)
        return math.atan2(y, x)

    def curvature(self, station: float, length: float) -> float:
        """Return the change of the course per length about a station [rad/m], positive to the left."""
        ahead, behind = (self.course(station + offset, length) for offset in (0.25 * length, -0.25 * length))
        return math.remainder(ahead - behind, 2.0 * math.pi) / (0.5 * length)

    def _extended(self, station: float) -> FloatArray:
        """Return the point (3,) at a station, also before the beginning and behind the end."""
        beyond = station - min(max(station, 0.0), self.length)
        leg = 0 if beyond < 0.0 else -1
        return self.point(station) + beyond * self._directions[leg]

    def leg_at(self, station: float) -> FloatArray:
        """Return the point (3,), and the horizontal direction (2,) and the slope of its leg, at a station [m].

        Behind its end the path goes on straight.
        """
        leg = max(int(np.searchsorted(self._stations[:-1], station, side='right')) - 1, 0)
        direction = self._directions[leg]
        return np.concatenate([self.waypoints[leg] + (station - self._stations[leg]) * direction, direction])

    def points_near(self, positions: FloatArray, station: float, steps: tuple[float, float]) -> FloatArray:
        """Return what `leg_at` says (n, 6) of the points nearest to positions (n, 3) [m], the first one at `station`.

        Each of the others is ahead of the one before by a length between the least and the largest of `steps` [m], so
        that the points go round a corner also when the positions do not.
        """
        points = [self.leg_at(station)]
        least, largest = steps
        for position in positions[1:]:
            station = self.project(position, station + least, station + largest).station
            beyond = 0.0
            if station >= self.length:
                beyond = max(float(self._directions[-1, :2] @ (position - self.waypoints[-1])[:2]), 0.0)
            points.append(self.leg_at(station + beyond))
        return np.array(points)

    def project(self, position: Sequence[float] | FloatArray, begin: float, end: float) -> Projection:
        """Return the point of the path nearest to a position (3,) [m] in the horizontal plane, between two stations."""
        end = min(end, self.length)
        first = max(0, int(np.searchsorted(self._stations, begin, side='right')) - 1)
        last = int(np.searchsorted(self._stations, end, side='left'))
        legs = slice(min(first, len(self._lengths) - 1), max(last, first + 1))
        starts, lengths = self._stations[:-1][legs], self._lengths[legs]
        directions = self._directions[legs, :2]
        offsets = np.asarray(position)[:2] - self.waypoints[:-1][legs, :2]
        along = np.sum(offsets * directions, axis=1)
        held = np.clip(along, np.maximum(begin - starts, 0.0), np.minimum(end - starts, lengths))
        distances = np.linalg.norm(offsets - held[:, np.newaxis] * directions, axis=1)
        nearest = int(np.argmin(distances))
        station = float(starts[nearest] + held[nearest])
        x, y = directions[nearest]
        left = math.copysign(distances[nearest], x * offsets[nearest, 1] - y * offsets[nearest, 0])
        return Projection(station, left, float(np.asarray(position)[2] - self.point(station)[2]))


class Projection(NamedTuple):
    """Where a position is relative to the path."""

    station: float
    """Of the nearest point [m]."""
    cross_track: float
    """Horizontal distance [m], positive on the left of the path."""
    height: float
    """Above the path [m]."""

"""The points of a path that a plan is held against."""

from __future__ import annotations

import numpy as np

from manta_sim_ros.control.polyline import Polyline
from manta_sim_ros.dynamics import FloatArray


class PathPoints:
    """The points of a path, with the direction of their leg; behind its end the path goes on straight.

    Parameters
    ----------
    path
        The path.

    """

    def __init__(self, path: Polyline) -> None:
        self.path = path
        legs = np.diff(path.waypoints, axis=0)
        lengths = np.hypot(legs[:, 0], legs[:, 1])
        self._begins = np.concatenate([[0.0], np.cumsum(lengths[:-1])])
        self._directions = legs / lengths[:, np.newaxis]

    def at(self, station: float) -> FloatArray:
        """Return the position, the horizontal direction and the slope (6,) of the leg at a station [m]."""
        leg = max(int(np.searchsorted(self._begins, station, side='right')) - 1, 0)
        direction = self._directions[leg]
        return np.concatenate([self.path.waypoints[leg] + (station - self._begins[leg]) * direction, direction])

    def near(self, positions: FloatArray, station: float, steps: tuple[float, float]) -> FloatArray:
        """Return the nearest points (n, 6) of positions (n, 3) [m], the first one at `station` [m].

        Each of the others is ahead of the one before by a length between the least and the largest of `steps` [m], so
        that the points go round a corner also when the positions do not.
        """
        points = [self.at(station)]
        least, largest = steps
        for position in positions[1:]:
            station = self.path.project(position, station + least, station + largest).station
            beyond = 0.0
            if station >= self.path.length:
                beyond = max(float(self._directions[-1, :2] @ (position - self.path.waypoints[-1])[:2]), 0.0)
            points.append(self.at(station + beyond))
        return np.array(points)

"""A step of the path to the side, and how the robot settles after it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from evidence.control_report.conditions import CONDITIONS
from evidence.control_report.robots import CONTROLLERS, ROBOTS
from evidence.control_report.swims import LONGEST, Row
from manta_sim_ros.control.closed_loop import Follower, fly
from manta_sim_ros.control.polyline import Polyline
from manta_sim_ros.dynamics import FinCommand, FloatArray
from manta_sim_ros.figures.jobs import Done

CRUISE, WIDTH, REST = 6.0, 0.5, 10.0
"""The step: length that is followed before it, its width to the left, and length after it [m]."""

SETTLED = 0.1
"""Largest cross-track error of a robot that has settled after the step [m]: a fifth of it."""


class Settling(NamedTuple):
    """What is measured after the step; NaN of a robot that does not settle."""

    length: float
    """Way along the path until the error remains within SETTLED [m]."""
    time: float
    """Time until then [s]."""
    overshoot: float
    """Largest error on the other side of the path [m]."""


class Step(NamedTuple):
    """A step to the side: what is measured, and where the robot went."""

    result: Settling
    position: FloatArray
    """(n, 3) after the step, relative to where it came on the path [m]."""


def step(row: Row, seed: int, done: Done) -> Step:
    """Let a robot cruise along x, then move the path to the left; call `done` at the end."""
    robot, condition = ROBOTS[row.robot], CONDITIONS[row.condition]
    before = Polyline([[0.0, 0.0, 0.0], [CRUISE + REST, 0.0, 0.0]])
    after = Polyline([[CRUISE, WIDTH, 0.0], [CRUISE + REST, WIDTH, 0.0]])
    stepping = _Stepping(CONTROLLERS[row.controller](robot, before), after)
    flight = fly(condition.parameters(robot, seed), stepping, before, LONGEST, condition.noise(seed))
    time, position = flight.time, flight.position
    first = int(np.argmax(time >= stepping.time))
    moved = position[first:] - [position[first, 0], WIDTH, 0.0]
    done()
    return Step(settling(time[first:] - time[first], moved), moved)


def settling(time: FloatArray, position: FloatArray) -> Settling:
    """Return what is measured from times (n,) [s] and positions (n, 3) [m] relative to a path along x, from its right.

    The times and the positions along x begin at 0.
    """
    outside = np.flatnonzero(abs(position[:, 1]) > SETTLED)
    last = int(outside[-1]) + 1 if outside.size else 0
    at = (float(position[last, 0]), float(time[last])) if last < len(time) else (np.nan, np.nan)
    return Settling(*at, max(0.0, float(np.max(position[:, 1]))))


class _Stepping:
    """A controller that follows a path, and another one from where its waypoints begin along x."""

    def __init__(self, follower: Follower, after: Polyline) -> None:
        self._follower, self._after = follower, after
        self.time = np.inf
        """When the other path was given [s]."""

    @property
    def finished(self) -> bool:
        """Whether the end of the other path was reached."""
        return self._follower.finished

    def follow(self, path: Polyline) -> None:
        """Follow another path."""
        self._follower.follow(path)

    def observe(self, time: float, position: FloatArray, orientation: FloatArray, twist: FloatArray) -> None:
        """Take a sample, and take the other path where it begins."""
        if self.time == np.inf and position[0] >= self._after.waypoints[0, 0]:
            self.time = time
            self._follower.follow(self._after)
        self._follower.observe(time, position, orientation, twist)

    def command(self, time: float) -> tuple[FinCommand, FinCommand]:
        """Return the gaits of both fins."""
        return self._follower.command(time)


def largest(results: Sequence[Settling]) -> Settling:
    """Return the largest values of draws; NaN if one robot did not settle."""
    return Settling(*np.max(results, axis=0).tolist())

"""The paths that are followed, where the errors count on them, and the bounds of the errors."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray

from evidence.control_report.robots import CONFIG
from manta_sim_ros.control.mission import StationKeeping, read_mission
from manta_sim_ros.control.polyline import Polyline
from manta_sim_ros.dynamics import FloatArray

START, AFTER_CORNER, BEFORE_CORNER = 2.0, 2.0, 1.0
"""Lengths that do not count: after the start from rest, and after and before a corner, where the robot turns [m]."""

ON_LEGS, ON_LEGS_IN_CURRENT, ON_CURVES, OF_HEIGHT = 0.15, 0.35, 0.30, 0.10
"""Bounds of the 95th percentiles of the cross-track error and of the height error [m]."""

MISSIONS = CONFIG / 'missions'


class Kept(NamedTuple):
    """A point that the robot stays near."""

    center: tuple[float, float]
    """Horizontal position [m]."""
    radius: float
    """Largest horizontal distance from it [m]."""


class Course(NamedTuple):
    """A path; the robot starts at rest at the origin, along x."""

    path: Polyline
    curved: bool
    """Whether it has no straight legs."""
    kept: Kept | None = None
    """The point that the path goes around, if the distance from it is what matters."""

    def counts(self, station: FloatArray) -> NDArray[np.bool_]:
        """Return which of the stations (n,) [m] count: not the start, the corners, and what is beyond the end."""
        if self.curved:
            return (station > START) & (station < self.path.length)
        ends = np.cumsum(np.hypot(*np.diff(self.path.waypoints[:, :2], axis=0).T))
        begins, last = np.array([0.0, *ends[:-1]]), self.path.length
        lows = begins + np.where(begins > 0.0, AFTER_CORNER, START)
        highs = np.where(ends < last, ends - BEFORE_CORNER, last)
        return np.any((station[:, np.newaxis] > lows) & (station[:, np.newaxis] < highs), axis=1)

    def errors(self, position: FloatArray, cross_track: FloatArray) -> FloatArray:
        """Return the errors (n,) [m] at positions (n, 3) with these cross-track errors (n,) [m]."""
        if self.kept is None:
            return cross_track
        return np.asarray(np.linalg.norm(position[:, :2] - self.kept.center, axis=1))

    def bound(self, in_current: bool, widening: float) -> float:
        """Return the bound of the errors [m], for a robot whose bounds are wider by a factor."""
        if self.kept is not None:
            return self.kept.radius
        return widening * (ON_CURVES if self.curved else ON_LEGS_IN_CURRENT if in_current else ON_LEGS)


def _kept(mission: Path) -> Kept:
    values = StationKeeping(**yaml.safe_load(mission.read_text(encoding='utf-8'))[mission.stem])
    return Kept(values.center[:2], values.radius)


def _course(name: str, curved: bool) -> Course:
    mission = MISSIONS / f'{name}.yaml'
    return Course(read_mission(mission), curved, _kept(mission) if name == 'station_keeping' else None)


COURSES = {name: _course(name, curved) for name, curved in {
    'straight': False, 'lawnmower': False, 'circle': True, 'helix': True, 'waypoints': False, 'station_keeping': True,
}.items()}
"""The missions of config/missions/, by name."""

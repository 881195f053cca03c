"""Measure how well the path follower stays near paths: `make path` prints a table."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from evidence.report import table
from manta_sim_ros.control.closed_loop import Flight, fly
from manta_sim_ros.control.polyline import Polyline
from manta_sim_ros.control.settings import FollowerSettings
from manta_sim_ros.dynamics import Parameters, read_sections, values_for

CONFIG = Path(__file__).parents[1] / 'config'
FOR_PAPER = values_for('/manta_path_follower', read_sections(CONFIG / 'path_follower_manta.yaml'))
ROBOTS = {
    'freshwater': (Parameters.from_yaml(CONFIG / 'freshwater.yaml'), FollowerSettings()),
    'manta': (Parameters.from_yaml(CONFIG / 'manta.yaml'), FollowerSettings(**FOR_PAPER)),
}
"""Parameters and settings of each configuration."""

PATHS = {
    'straight': [[0.0, 0.5, 0.0], [10.0, 0.5, 0.0]],
    'lawnmower': [[0.0, 0.0, 0.0], [7.0, 0.0, 0.0], [7.0, 2.0, 0.0], [0.0, 2.0, 0.0]],
    'helix': [[2.0 * math.sin(a), 2.0 - 2.0 * math.cos(a), 0.2 * a] for a in np.linspace(0.0, 2.0 * math.pi, 100)],
    'climb': [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [6.0, 0.0, 0.3], [9.0, 0.0, 0.3]],
}
"""Waypoints [m]; the robot starts at rest at the origin, along x."""

AFTER = {'straight': 5.0, 'lawnmower': 2.0, 'helix': 2.0, 'climb': 0.0}
"""Length behind the beginning of a leg from which the errors count [m]; the straight path begins 0.5 m beside it."""

BEFORE = 1.0
"""Length before the end of a leg up to which they count [m]: then the robot begins to turn."""

LONGEST = 250.0
"""Longest duration [s]."""

LARGEST_HEIGHT_ERROR = 0.1
"""Bound of the error of the height [m]."""


class Case(NamedTuple):
    """A path that a robot follows."""

    robot: str
    path: str
    current: float
    """Along y [m/s]."""
    bound: float
    """Of the cross-track error [m]."""

    def fly(self) -> Flight:
        """Let the robot follow the path."""
        parameters, settings = ROBOTS[self.robot]
        return fly(parameters.replace(water={'current': (0.0, self.current, 0.0)}), Polyline(PATHS[self.path]),
                   settings, LONGEST)

    def errors(self, flight: Flight) -> tuple[float, float]:
        """Return the 95th percentiles of the cross-track error and of that of the height [m], on the legs."""
        lengths = np.linalg.norm(np.diff(np.array(PATHS[self.path])[:, :2], axis=0), axis=1)
        ends = np.cumsum(lengths)
        begins, station = ends - lengths, flight.station[:, np.newaxis]
        on_leg = np.any((station > begins + AFTER[self.path]) & (station < ends - BEFORE), axis=1)
        if not on_leg.any():  # a helix has short legs
            on_leg = flight.station > AFTER[self.path]
        cross_track, height = (
            float(np.percentile(abs(error[on_leg]), 95.0)) for error in (flight.cross_track, flight.height))
        return cross_track, height


CASES = [
    Case('freshwater', 'straight', 0.0, 0.15), Case('freshwater', 'straight', 0.1, 0.35),
    Case('freshwater', 'lawnmower', 0.0, 0.15), Case('freshwater', 'lawnmower', 0.1, 0.35),
    Case('freshwater', 'helix', 0.0, 0.3), Case('freshwater', 'helix', 0.1, 0.7),
    Case('freshwater', 'climb', 0.0, 0.01),
    Case('manta', 'straight', 0.0, 0.3), Case('manta', 'lawnmower', 0.0, 0.3), Case('manta', 'helix', 0.0, 0.3),
    Case('manta', 'climb', 0.0, 0.01),
]


def main() -> None:
    """Print the errors of all cases."""
    rows = []
    for case in CASES:
        flight = case.fly()
        cross_track, height = case.errors(flight)
        rows.append((case.robot, case.path, f'{case.current:g}', f'{cross_track:.2f}', f'{height:.2f}',
                     f'{flight.time[-1]:.0f}'))
    print(table(('configuration', 'path', 'current [m/s]', 'cross-track error [m]', 'height error [m]', 'time [s]'),
                rows))


if __name__ == '__main__':
    main()

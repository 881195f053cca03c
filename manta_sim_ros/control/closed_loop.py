"""The closed loop of the simulator and the path follower, without ROS."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from manta_sim_ros.control.follower import PathFollower
from manta_sim_ros.control.polyline import Polyline
from manta_sim_ros.control.settings import FollowerSettings
from manta_sim_ros.dynamics import FloatArray, Parameters, Simulator

CONTROL_PERIOD = 0.1
"""Time between two commands [s]."""

SAMPLES = 5
"""Samples of the motion for each command."""


class Flight(NamedTuple):
    """A swim along a path: one row for each command."""

    time: FloatArray
    """(n,) [s]."""
    position: FloatArray
    """(n, 3) [m]."""
    station: FloatArray
    """(n,) of the nearest point of the path [m]."""
    cross_track: FloatArray
    """(n,) horizontal distance to the path [m], positive on the left."""
    height: FloatArray
    """(n,) above the path [m]."""
    commands: FloatArray
    """(n, 2, 5) the gait of each fin, as `FinCommand.as_array`."""
    finished: bool
    """Whether the end of the path was reached."""


def fly(
    parameters: Parameters, path: Polyline, settings: FollowerSettings, duration: float,
) -> Flight:
    """Let the robot follow a path from rest at the origin, until its end or for a duration [s].

    Raises
    ------
    ValueError
        As of `PathFollower` and `Simulator`.
    DivergenceError
        The motion diverged.

    """
    follower, simulator = PathFollower(path, settings, parameters), Simulator(parameters)
    state, station, rows, commands = simulator.state, 0.0, [], []
    while state.time < duration and not follower.finished:
        follower.observe(state.time, state.position, state.orientation, state.twist)
        left, right = follower.command(state.time)
        simulator.command(left=left, right=right)
        where = path.project(state.position, station, station + settings.lookahead)
        station = where.station
        rows.append([state.time, *state.position, *where])
        commands.append([left.as_array(), right.as_array()])
        for sample in range(SAMPLES):
            state = simulator.advance(CONTROL_PERIOD / SAMPLES)
            if sample < SAMPLES - 1:
                follower.observe(state.time, state.position, state.orientation, state.twist)
    table = np.array(rows)
    time, station, cross_track, height = table[:, [0, 4, 5, 6]].T
    return Flight(time, table[:, 1:4], station, cross_track, height, np.array(commands), follower.finished)

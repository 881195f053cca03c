"""The closed loop of the simulator and a controller that follows a path, without ROS."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from manta_sim_ros.control.polyline import Polyline
from manta_sim_ros.dynamics import FinCommand, FloatArray, Parameters, Simulator
from manta_sim_ros.sensors import OdometryNoise, read_odometry

CONTROL_PERIOD = 0.1
"""Time between two commands [s]."""

SAMPLES = 5
"""Samples of the motion for each command."""

SEARCHED = 3.0
"""Length of the path behind the last nearest point in which the next one is searched [m]."""


class Follower(Protocol):
    """A controller that follows a path, such as `PathFollower`."""

    @property
    def finished(self) -> bool:
        """Whether the end of the path was reached."""

    def follow(self, path: Polyline) -> None:
        """Follow another path from now on, from its beginning."""

    def observe(self, time: float, position: FloatArray, orientation: FloatArray, twist: FloatArray) -> None:
        """Take a sample: time [s], position (3,) [m], orientation (x, y, z, w), twist (6,) in the body frame."""

    def command(self, time: float) -> tuple[FinCommand, FinCommand]:
        """Return the gaits of the left and of the right fin at a time [s]."""


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
    power: FloatArray
    """(n,) mean power of the motors into the fins until the next command [W]."""
    finished: bool
    """Whether the end of the path was reached."""


def fly(
    parameters: Parameters, follower: Follower, path: Polyline, duration: float,
    noise: OdometryNoise | None = None,
) -> Flight:
    """Let a controller follow a path from rest at the origin, until its end or for a duration [s].

    Parameters
    ----------
    parameters
        Of the robot that swims; those that the controller was designed for may differ.
    follower
        The controller, which follows `path` already.
    path
        The path from which the errors are measured.
    duration
        [s].
    noise
        Of the odometry that the controller observes; by default it is the ground truth.

    Raises
    ------
    ValueError
        As of `Simulator`.
    DivergenceError
        The motion diverged.

    """
    noise = OdometryNoise() if noise is None else noise
    simulator = Simulator(parameters)
    state, station, rows, commands = simulator.state, 0.0, [], []
    while state.time < duration and not follower.finished:
        follower.observe(state.time, *read_odometry(noise, state))
        left, right = follower.command(state.time)
        simulator.command(left=left, right=right)
        where = path.project(state.position, station, station + SEARCHED)
        station = where.station
        row = [state.time, *state.position, *where]
        commands.append([left.as_array(), right.as_array()])
        power = 0.0
        for sample in range(SAMPLES):
            state = simulator.advance(CONTROL_PERIOD / SAMPLES)
            power += state.rod_power / SAMPLES
            if sample < SAMPLES - 1:
                follower.observe(state.time, *read_odometry(noise, state))
        rows.append([*row, power])
    table = np.array(rows)
    time, station, cross_track, height, powers = table[:, [0, 4, 5, 6, 7]].T
    return Flight(
        time, table[:, 1:4], station, cross_track, height, np.array(commands), powers, follower.finished)

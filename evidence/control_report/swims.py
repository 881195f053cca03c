"""A swim on a path, and what is measured on it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from evidence.control_report.conditions import CONDITIONS
from evidence.control_report.courses import COURSES, OF_HEIGHT
from evidence.control_report.robots import CONTROLLERS, ROBOTS
from manta_sim_ros.control.closed_loop import CONTROL_PERIOD, Flight, fly
from manta_sim_ros.dynamics import FloatArray
from manta_sim_ros.figures.jobs import Done
from manta_sim_ros.nodes.transport import cost_of_transport

LONGEST = 400.0
"""Longest duration of a swim [s]."""

class Row(NamedTuple):
    """A row of the tables: a controller with a robot on a course under a condition, by name."""

    robot: str
    course: str
    condition: str
    controller: str


class Result(NamedTuple):
    """What is measured on a course: errors where they count, the others on the whole swim."""

    mean: float
    """Mean absolute error: cross-track, or the distance from the point that is kept [m]."""
    most: float
    """Its 95th percentile [m]."""
    largest: float
    """Its maximum [m]."""
    height: float
    """95th percentile of the height error [m]."""
    largest_height: float
    """Its maximum [m]."""
    effort: float
    """Mean absolute rate of amplitude, phase and biases of both fins [rad/s]."""
    power: float
    """Mean power of the motors into the fins [W]."""
    cost: float
    """Cost of transport: this power over weight in air and mean speed along the path."""
    time: float
    """Duration [s]."""
    finished: bool
    """Whether the end of the path was reached."""


class Swim(NamedTuple):
    """A swim on a course, and what is measured on it."""

    result: Result
    flight: Flight
    error: FloatArray
    """(n,) cross-track error, positive on the left, or distance from the point that is kept [m]."""


def swim(row: Row, seed: int, done: Done) -> Swim:
    """Let a robot swim on a course; call `done` at the end."""
    robot, course, condition = ROBOTS[row.robot], COURSES[row.course], CONDITIONS[row.condition]
    parameters = condition.parameters(robot, seed)
    flight = fly(parameters, CONTROLLERS[row.controller](robot, course.path), course.path, LONGEST,
                 condition.noise(seed))
    counts = course.counts(flight.station)
    if not counts.any():  # swept away from the start
        counts[:] = True
    all_errors = course.errors(flight.position, flight.cross_track)
    error, height = abs(all_errors[counts]), abs(flight.height[counts])
    power, weight = float(np.mean(flight.power)), parameters.body.mass * parameters.body.gravity
    duration = float(flight.time[-1])
    done()
    result = Result(
        float(np.mean(error)), float(np.percentile(error, 95.0)), float(np.max(error)),
        float(np.percentile(height, 95.0)), float(np.max(height)), effort(flight), power,
        cost_of_transport(power, float(flight.station[-1]) / duration, weight), duration, flight.finished)
    return Swim(result, flight, all_errors)


def effort(flight: Flight) -> float:
    """Return the mean absolute rate of amplitude, phase and biases of both fins [rad/s]."""
    return float(np.mean(abs(np.diff(flight.commands[:, :, [0, 2, 3, 4]], axis=0))) / CONTROL_PERIOD)


def of_draws(results: Sequence[Result]) -> Result:
    """Return the largest errors and the means of the rest over the draws of a condition."""
    values = np.array([result[:-1] for result in results])
    errors = len(Result._fields[:Result._fields.index('effort')])
    combined = [*values[:, :errors].max(axis=0).tolist(), *values[:, errors:].mean(axis=0).tolist()]
    return Result(*combined, all(result.finished for result in results))


class Verdict(NamedTuple):
    """Bounds of the errors, and whether they are met."""

    bound: float
    """Of the 95th percentile of the cross-track error, or of the largest distance from the point that is kept [m]."""
    met: bool
    height_bound: float
    """Of the 95th percentile of the height error [m]."""
    height_met: bool


def verdict(row: Row, result: Result) -> Verdict:
    """Return the bounds of a row, and whether the errors as printed are within them; not if the end is not reached."""
    widening, course = ROBOTS[row.robot].widening, COURSES[row.course]
    bound = course.bound(CONDITIONS[row.condition].current > 0.0, widening)
    error = result.most if course.kept is None else result.largest
    height_bound = widening * OF_HEIGHT
    return Verdict(bound, result.finished and round(error, 2) <= bound + 1e-9,
                   height_bound, result.finished and round(result.height, 2) <= height_bound + 1e-9)

"""The path follower: line-of-sight guidance, and regulators of heading, height and speed."""

from __future__ import annotations

import itertools
import math

import numpy as np

from manta_sim_ros.control.averaging import PeriodAverage
from manta_sim_ros.control.current_observer import CurrentObserver
from manta_sim_ros.control.polyline import Polyline, Projection
from manta_sim_ros.control.settings import FollowerSettings
from manta_sim_ros.dynamics import FinCommand, FloatArray, Parameters, Simulator

SEARCHED = 2.0
"""Length of the path in which the nearest point is searched, in lookahead distances."""

ARRIVED = 0.02
"""Distance from the end of the path at which it counts as followed [m]."""


import os
TRIM_TIME = float(os.environ.get('TRIM', 3.0))
SMITH = float(os.environ.get('SMITH', 1.0))
SCHED = float(os.environ.get('SCHED', 1.0))
LEAD = float(os.environ.get('LEAD', 1.0))
SLOWEST = 0.5
"""Least speed through the water with which guidance reckons, over that of the cruise: the robot starts at rest."""

LARGEST_CRAB = 0.8
"""Largest part of the speed that is spent against a current across the path."""


class Loop:
    """A control with an integral, a limit and a limited rate.

    The integral stands still while the control is at its limit and the error drives it further.

    Parameters
    ----------
    gains
        Of the states, the last one of the integral.
    low, high
        Limits of the control.
    rate
        Fastest change of the control, per second.

    """

    def __init__(self, gains: tuple[float, ...], low: float, high: float, rate: float) -> None:
        self.gains = np.array(gains)
        self.integral = self.control = 0.0
        self._low, self._high, self._rate = low, high, rate

    def update(self, elapsed: float, wanted: float, error: float) -> float:
        """Return the control after `elapsed` [s] on its way to the one that is wanted, and integrate the error."""
        held = min(max(wanted, self._low), self._high)
        if -self.gains[-1] * error * (wanted - held) <= 0.0:
            self.integral += elapsed * error
        step = self._rate * elapsed
        self.control += min(max(held - self.control, -step), step)
        return self.control

    def regulate(self, elapsed: float, states: list[float]) -> float:
        """Return the control that drives these states, of which the last one is integrated, to zero."""
        return self.update(elapsed, -float(self.gains @ [*states, self.integral]), states[-1])


class PathFollower:
    """Follows a path in space with the gaits of both fins.

    Parameters
    ----------
    path
        The path.
    settings
        Limits, cruise and gains.
    parameters
        All values of the model, whose mechanism limits the gaits.

    Raises
    ------
    ValueError
        The rods cannot follow a gait within the limits; names the value and the bound.

    """

    def __init__(
        self, path: Polyline, settings: FollowerSettings | None = None, parameters: Parameters | None = None,
    ) -> None:
        self.path = path
        self.settings = settings = FollowerSettings() if settings is None else settings
        check_limits(settings, Parameters() if parameters is None else parameters)
        self._average = PeriodAverage(settings.period)
        rate = settings.rate_limit
        self._steering = Loop(settings.steering_gains, -settings.largest_steering, settings.largest_steering, rate)
        self._bias = Loop(settings.depth_gains, -settings.largest_bias, settings.largest_bias, rate)
        self._amplitude = Loop(settings.speed_gains, 0.0, settings.largest_amplitude, rate)
        self._station = 0.0
        self._time = math.nan
        self._x = 0.0
        self._sf = 0.0
        self._t0 = math.nan
        self._observer = CurrentObserver(
            settings.speed, settings.amplitude, settings.speed_model, settings.sideslip)

    def follow(self, path: Polyline) -> None:
        """Follow another path from now on, from its beginning; what is known of the current is kept."""
        self.path, self._station = path, 0.0

    @property
    def current(self) -> FloatArray:
        """(2,) estimate of the velocity of the water [m/s], world frame."""
        return self._observer.current

    @property
    def finished(self) -> bool:
        """Whether the end of the path was reached."""
        return self._station >= self.path.length - ARRIVED

    def observe(self, time: float, position: FloatArray, orientation: FloatArray, twist: FloatArray) -> None:
        """Take a sample: time [s], position (3,) [m], orientation (x, y, z, w), twist (6,) in the body frame."""
        self._average.add(time, position, orientation, twist)

    def command(self, time: float) -> tuple[FinCommand, FinCommand]:
        """Return the gaits of both fins at a time [s], after one sample or more; at rest at the end of the path."""
        elapsed = time - self._time if time > self._time else 0.0  # also at the first time, and when it goes back
        self._time = time
        motion = self._average.mean
        lookahead = self.settings.lookahead
        lag = 0.5 * self.settings.period * LEAD
        u, v, w, p, q, r = motion.twist.tolist()
        roll, pitch, heading = motion.attitude.tolist()
        cos, sin = math.cos(heading), math.sin(heading)
        position = motion.position + lag * np.array([cos * u - sin * v, sin * u + cos * v, 0.0])
        where = self.path.project(position, self._station, self._station + SEARCHED * lookahead)
        self._station = where.station
        if self.finished:
            return self.glide()
        b = self.settings.turn_response * (SCHED * (self._amplitude.control / self.settings.amplitude) ** 2 + 1 - SCHED)
        self._b = max(b, 0.3 * self.settings.turn_response)
        self._sf += min(elapsed / lag, 1.0) * (self._steering.control + self._trim() - self._sf)
        rate = r + SMITH * self._b * lag * self._sf
        heading_now = heading + lag * 0.5 * (r + rate)
        self._observer.update(elapsed, self._amplitude.control, heading, u, v, r)
        forward, left = self._observer.along(heading)
        steering = self._steer(elapsed, u - forward, [v - left, p, rate, roll], heading_now, where, r)
        bias = self._bias.regulate(elapsed, [w, q, pitch, where.height])
        amplitude = self._amplitude.regulate(elapsed, [u - forward - self.settings.speed])
        return self._gait(amplitude, -steering, bias), self._gait(amplitude, steering, bias)

    def glide(self) -> tuple[FinCommand, FinCommand]:
        """Return the gaits with which the robot glides to rest, and forget how it moved."""
        self._time = math.nan
        self._average.clear()
        for loop in (self._steering, self._bias, self._amplitude):
            loop.control = 0.0
        return self._gait(0.0, 0.0, 0.0), self._gait(0.0, 0.0, 0.0)

    def _gait(self, amplitude: float, steering: float, bias: float) -> FinCommand:
        return FinCommand(amplitude, self.settings.frequency, self.settings.phase + steering, bias, -bias)

    _inv = 0.0

    def _trim(self) -> float:
        limit = self.settings.largest_steering
        return min(max(self._inv - self._x, -limit), limit)

    def _steer(self, elapsed: float, speed: float, states: list[float], heading: float, where: Projection, r: float) -> float:
        """Return the steering: the regulator about the motion along the path, and far from it a limited angle to it."""
        loop, path, lookahead = self._steering, self.path, self.settings.lookahead
        of_heading, of_error = loop.gains[-2:]
        course = path.course(where.station, lookahead) - math.atan(of_error * where.cross_track / of_heading)
        speed = max(speed, SLOWEST * self.settings.speed)
        along, left = self._observer.along(course)
        crab = math.asin(min(max(left / speed, -LARGEST_CRAB), LARGEST_CRAB))
        through_water = speed * math.cos(crab)
        over_ground = max(through_water + along, 0.0)
        rate = path.curvature(where.station, lookahead) * over_ground ** 2 / through_water
        sideslip = self.settings.sideslip * rate
        turn = math.remainder(heading - course + crab + math.atan2(sideslip, speed), 2.0 * math.pi)
        deviation = np.array([*states, turn]) - [sideslip, 0.0, rate, 0.0, 0.0]
        if math.isnan(self._t0):
            self._t0 = self._time
        started = self._time - self._t0 > self.settings.period
        self._inv = r / (self._b * TRIM_TIME)
        self._x += min(elapsed / TRIM_TIME, 1.0) * (loop.control + self._inv - self._x)
        if not started:
            self._x = self._inv
            return loop.update(elapsed, 0.0, 0.0)
        trim = self._trim()
        scale = self.settings.turn_response / self._b
        self.debug = [turn, rate, states[2], trim, speed, over_ground]
        return loop.update(elapsed, -scale * float(loop.gains[:-1] @ deviation) - trim, 0.0)


def check_limits(settings: FollowerSettings, parameters: Parameters) -> None:
    """Refuse settings whose gaits, up to the limits, the rods cannot follow.

    Raises
    ------
    ValueError
        Names the value and the bound.

    """
    simulator = Simulator(parameters)
    for steering, bias in itertools.product(
            (-settings.largest_steering, settings.largest_steering), (-settings.largest_bias, settings.largest_bias)):
        fin = FinCommand(settings.largest_amplitude, settings.frequency, settings.phase + steering, bias, -bias)
        try:
            simulator.command(left=fin, right=fin)
        except ValueError as error:
            raise ValueError(f'at the limits of the path follower: {error}') from error

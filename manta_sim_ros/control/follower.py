"""The path follower: line-of-sight guidance, and regulators of heading, height and speed."""

from __future__ import annotations

import math

import numpy as np

from manta_sim_ros.control.averaging import Motion, PeriodAverage
from manta_sim_ros.control.current_observer import CurrentObserver
from manta_sim_ros.control.gaits import Gaits, gaits
from manta_sim_ros.control.polyline import Polyline, Projection
from manta_sim_ros.control.settings import FollowerSettings
from manta_sim_ros.control.turn_observer import TurnObserver
from manta_sim_ros.dynamics import FloatArray, Parameters

SEARCHED = 2.0
"""Length of the path in which the nearest point is searched, in lookahead distances."""

ARRIVED = 0.02
"""Distance from the end of the path at which it counts as followed [m]."""

SLOWEST = 0.5
"""Least speed through the water that guidance assumes, over that of the cruise: the robot starts at rest."""

LARGEST_CRAB = 0.8
"""Largest part of the speed that is spent against a current across the path."""


class Loop:
    """A control with an integral, a limit and a limited rate.

    The integral stands still while the control is at its limit and the error drives it further.

    Parameters
    ----------
    gains
        Of the states, and the last one of the integral where it is used.
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
        settings.check_limits(Parameters() if parameters is None else parameters)
        self._average = PeriodAverage(settings.period)
        rate = settings.rate_limit
        self._steering = Loop(settings.steering_gains, -settings.largest_steering, settings.largest_steering, rate)
        self._bias = Loop(settings.depth_gains, -settings.largest_bias, settings.largest_bias, rate)
        self._amplitude = Loop(settings.speed_gains, 0.0, settings.largest_amplitude, rate)
        self._water = CurrentObserver(settings.speed, settings.amplitude, settings.speed_model, settings.sideslip)
        self._turn = TurnObserver(settings.turn_response, 0.5 * settings.period, settings.largest_steering)
        self._station = 0.0
        self._time = math.nan

    def follow(self, path: Polyline) -> None:
        """Follow another path from now on, from its beginning; what is known of the current is kept."""
        self.path, self._station = path, 0.0

    @property
    def current(self) -> FloatArray:
        """(2,) estimate of the velocity of the water [m/s], world frame."""
        return self._water.current

    @property
    def finished(self) -> bool:
        """Whether the end of the path was reached."""
        return self._station >= self.path.length - ARRIVED

    def observe(self, time: float, position: FloatArray, orientation: FloatArray, twist: FloatArray) -> None:
        """Take a sample: time [s], position (3,) [m], orientation (x, y, z, w), twist (6,) in the body frame."""
        self._average.add(time, position, orientation, twist)

    def command(self, time: float) -> Gaits:
        """Return the gaits of both fins at a time [s], after one sample or more; at rest at the end of the path."""
        elapsed = time - self._time if time > self._time else 0.0  # also at the first time, and when it goes back
        self._time = time
        motion = self._average.mean
        where = self.path.project(
            self._position_now(motion), self._station, self._station + SEARCHED * self.settings.lookahead)
        self._station = where.station
        u, v, w, p, q, r = motion.twist.tolist()
        roll, pitch, heading = motion.attitude.tolist()
        self._water.update(elapsed, self._amplitude.control, heading, u, v, r)
        if self.finished:
            return self._rest()
        forward, left = self._water.along(heading)
        if self._average.whole:  # before that, the means have the stroke in them
            self._turn.update(elapsed, self._steering.control, r)
            heading += 0.25 * self.settings.period * (r + self._turn.rate)
            wanted = self._guide(u - forward, [v - left, p, self._turn.rate, roll], heading, where)
        else:
            wanted = 0.0
        steering = self._steering.update(elapsed, wanted, 0.0)
        bias = self._bias.regulate(elapsed, [w, q, pitch, where.height])
        amplitude = self._amplitude.regulate(elapsed, [u - forward - self.settings.speed])
        return self._gaits(amplitude, steering, bias)

    def _position_now(self, motion: Motion) -> FloatArray:
        """Return the position (3,) [m] to which the mean velocity has brought the robot since the middle of the means.

        The height is that of the mean.
        """
        u, v = motion.twist[:2]
        cos, sin = math.cos(motion.attitude[2]), math.sin(motion.attitude[2])
        velocity = np.array([cos * u - sin * v, sin * u + cos * v, 0.0])
        return motion.position + 0.5 * self.settings.period * velocity

    def glide(self) -> Gaits:
        """Return the gaits with which the robot glides to rest, and forget how it moved."""
        self._time = math.nan
        self._average.clear()
        self._water.stop()
        return self._rest()

    def _rest(self) -> Gaits:
        self._turn.reset()
        for loop in (self._steering, self._bias, self._amplitude):
            loop.control = 0.0
        return self._gaits(0.0, 0.0, 0.0)

    def _gaits(self, amplitude: float, steering: float, bias: float) -> Gaits:
        return gaits(self.settings.frequency, self.settings.phase, amplitude, steering, bias)

    def _guide(self, speed: float, states: list[float], heading: float, where: Projection) -> float:
        """Return the steering that is wanted: the regulator acts on deviations from the motion along the path.

        Far from the path, that is a motion at a limited angle to it. `speed` is that through the water [m/s], and
        `states` are v through the water, p, r and roll.
        """
        gains, lookahead = self._steering.gains, self.settings.lookahead
        of_heading, of_error = gains[-2:]
        course = self.path.course(where.station, lookahead) - math.atan(of_error * where.cross_track / of_heading)
        speed = max(speed, SLOWEST * self.settings.speed)
        along, left = self._water.along(course)
        crab = math.asin(min(max(left / speed, -LARGEST_CRAB), LARGEST_CRAB))
        through_water = speed * math.cos(crab)  # its part along the course
        over_ground = max(through_water + along, 0.0)
        # The heading is the course minus the crab angle, which changes with the course.
        rate = self.path.curvature(where.station, lookahead) * over_ground ** 2 / through_water
        sideslip = self.settings.sideslip * rate
        turn = math.remainder(heading - course + crab + math.atan2(sideslip, speed), 2.0 * math.pi)
        deviation = np.array([*states, turn]) - [sideslip, 0.0, rate, 0.0, 0.0]
        return -float(gains[:-1] @ deviation) - self._turn.disturbance

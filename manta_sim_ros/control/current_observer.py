"""An observer of the current: a constant velocity of the water in the world frame."""

from __future__ import annotations

import math

import numpy as np

from manta_sim_ros.dynamics import FloatArray

CURRENT_TIME = 3.5
"""Time constant with which the estimate of the current follows [s], two flapping periods."""

BIAS_TIME = 15.0
"""Time constant with which an error of the model of the speed is found [s]: slower, as it takes a turn to tell the two
apart."""


class CurrentObserver:
    """Estimates the current as the velocity over ground minus the velocity through the water of a model.

    In the model, the forward speed through the water follows the amplitude with first order, and the lateral velocity
    is proportional to the yaw rate. A constant error of the speed is estimated too: on a straight line it cannot be
    told from a current along the line, but a turn tells them apart.

    Parameters
    ----------
    speed
        Forward speed of the cruise [m/s].
    amplitude
        Amplitude of the cruise [rad].
    speed_model
        Change of the speed per change of the amplitude [m/s/rad], and its time constant [s].
    sideslip
        Lateral velocity per yaw rate [m].

    """

    def __init__(self, speed: float, amplitude: float, speed_model: tuple[float, ...], sideslip: float) -> None:
        self._speed, self._amplitude = speed, amplitude
        self._response, self._speed_time = speed_model
        self._sideslip = sideslip
        self._modeled = 0.0  # speed [m/s]; the robot starts at rest
        self._bias = 0.0  # of the speed [m/s]
        self.current: FloatArray = np.zeros(2)
        """(2,) estimate of the velocity of the water [m/s], world frame."""

    def update(self, elapsed: float, amplitude: float, heading: float, u: float, v: float, r: float) -> None:
        """Take means over a period after a time `elapsed` [s], in which the amplitude was this [rad].

        `heading` [rad], `u` and `v` [m/s] are the forward and the lateral velocity over ground, `r` is the yaw rate
        [rad/s].
        """
        target = max(self._speed + self._response * (amplitude - self._amplitude), 0.0)
        self._modeled += min(elapsed / self._speed_time, 1.0) * (target - self._modeled)
        forward, left = self.along(heading)
        error_u = u - (self._modeled + self._bias) - forward
        error_v = v - self._sideslip * r - left
        cos, sin = math.cos(heading), math.sin(heading)
        error = np.array([cos * error_u - sin * error_v, sin * error_u + cos * error_v])
        self.current += min(elapsed / CURRENT_TIME, 1.0) * error
        self._bias += min(elapsed / BIAS_TIME, 1.0) * error_u

    def stop(self) -> None:
        """Take the robot for one that has come to rest in the water."""
        self._modeled = 0.0

    def along(self, heading: float) -> tuple[float, float]:
        """Return the current along a heading [rad] and to its left [m/s]."""
        cos, sin = math.cos(heading), math.sin(heading)
        x, y = self.current.tolist()
        return cos * x + sin * y, cos * y - sin * x

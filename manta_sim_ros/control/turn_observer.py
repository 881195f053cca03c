"""An observer of the turn: the yaw rate now, and the steering that a disturbance of the yaw takes."""

from __future__ import annotations

TRIM_TIME = 6.0
"""Time constant with which a disturbance is found [s]: a shorter one lets the steering swing after a corner."""


class TurnObserver:
    """Predicts the yaw rate from its mean over the last period, and finds out what disturbs it.

    A steering accelerates the yaw. What accelerates it beside the steering, such as the drag in a turn, is a
    disturbance, and is given as the steering that would do the same. The mean over a period is that of half a period
    ago; since then, steering and disturbance have acted.

    Parameters
    ----------
    response
        Yaw acceleration per steering [rad/s^2/rad].
    lag
        Age of the mean [s].
    limit
        Largest disturbance, as a steering [rad].

    """

    def __init__(self, response: float, lag: float, limit: float) -> None:
        self._response, self._lag, self._limit = response, lag, limit
        self.reset()

    def reset(self) -> None:
        """Forget what was observed."""
        self._mean_rate = self._low_pass = self._acting = 0.0

    @property
    def disturbance(self) -> float:
        """What disturbs the yaw, as a steering [rad]."""
        found = self._mean_rate / (self._response * TRIM_TIME) - self._low_pass
        return min(max(found, -self._limit), self._limit)

    @property
    def rate(self) -> float:
        """Yaw rate now [rad/s]."""
        return self._mean_rate + self._response * self._lag * self._acting

    def update(self, elapsed: float, steering: float, mean_rate: float) -> None:
        """Take the mean of the yaw rate [rad/s] after a time [s] in which this steering [rad] acted."""
        self._mean_rate = mean_rate
        self._acting += min(elapsed / self._lag, 1.0) * (steering + self.disturbance - self._acting)
        passed = steering + mean_rate / (self._response * TRIM_TIME)
        self._low_pass += min(elapsed / TRIM_TIME, 1.0) * (passed - self._low_pass)

"""Means over the last flapping period: feedback without the stroke of the fins."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from manta_sim_ros.dynamics import FloatArray


class Motion(NamedTuple):
    """How the robot moves: a sample, or the mean over a period."""

    position: FloatArray
    """(3,) [m], world frame."""
    twist: FloatArray
    """(6,) [m/s, rad/s], body frame."""
    attitude: FloatArray
    """(3,) roll, pitch and heading [rad]; the heading of means does not jump."""


class PeriodAverage:
    """The mean of all samples of the last period.

    Parameters
    ----------
    period
        [s].

    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._samples: deque[tuple[float, FloatArray]] = deque()
        self._began = 0.0

    def add(self, time: float, position: FloatArray, orientation: FloatArray, twist: FloatArray) -> None:
        """Take a sample: time [s], position (3,), orientation (x, y, z, w), twist (6,) in the body frame.

        When the time goes back, what came before is forgotten.
        """
        heading, pitch, roll = Rotation.from_quat(orientation).as_euler('ZYX')
        if self._samples and time <= self._samples[-1][0]:
            self.clear()
        if self._samples:
            before = self._samples[-1][1][-1]
            heading = before + np.remainder(heading - before + np.pi, 2.0 * np.pi) - np.pi
        else:
            self._began = time
        self._samples.append((time, np.array([*position, *twist, roll, pitch, heading])))
        while self._samples[0][0] <= time - self._period + 1e-9:
            self._samples.popleft()

    def clear(self) -> None:
        """Forget all samples."""
        self._samples.clear()

    @property
    def whole(self) -> bool:
        """Whether the samples are those of a whole period."""
        return bool(self._samples) and self._samples[-1][0] - self._began > self._period - 1e-9

    @property
    def mean(self) -> Motion:
        """The mean; there must be a sample."""
        values = np.mean([values for _, values in self._samples], axis=0)
        return Motion(values[:3], values[3:9], values[9:])

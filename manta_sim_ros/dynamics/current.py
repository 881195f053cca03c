"""The deviation of the current from its mean: a first-order Gauss-Markov process, in intervals of simulated time."""

from __future__ import annotations

import math

import numpy as np

from manta_sim_ros.dynamics.noise import gaussian_noise
from manta_sim_ros.dynamics.parameters import Water
from manta_sim_ros.dynamics.quantity import FloatArray

INTERVAL = 0.01
"""Time for which a deviation is constant [s]: the shortest correlation time that is allowed."""

STREAM = 0
"""Stream of the noise of the current."""

ROUNDING = 1e-6
"""Largest difference of a time from the end of an interval to count as the end, in intervals: decimal rounding."""


def deviation_at(water: Water, deviation: FloatArray, began: float, time: float) -> FloatArray:
    """Return the deviation (3,) of the current [m/s], world frame, at `time` [s], given the one when it `began` [s].

    The process is exact for any interval: in the stationary state its standard deviation is `water.current_deviation`,
    and its autocorrelation decays as exp(-t / `water.current_correlation_time`). The noise of an interval depends only
    on the seed and on the number of the interval, so that simulations which start with the same deviation at the same
    time have the same current.
    """
    kept = math.exp(-INTERVAL / water.current_correlation_time)
    new = math.sqrt(1.0 - kept * kept) * np.array(water.current_deviation)
    for interval in range(_interval(began) + 1, _interval(time) + 1):
        deviation = kept * deviation + new * gaussian_noise(water.current_seed, STREAM, interval, 3)
    return deviation


def steps_left(time: float, time_step: float) -> int:
    """Return the number of time steps [s] until the next interval has begun, at least one."""
    return max(1, math.ceil(((_interval(time) + 1) * INTERVAL - time) / time_step - ROUNDING))


def _interval(time: float) -> int:
    """Return the number of the interval that contains a time [s]; the end of an interval belongs to the next one."""
    return math.floor(time / INTERVAL + ROUNDING)

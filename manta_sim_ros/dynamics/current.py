"""The current's deviation from its mean: a first-order Gauss-Markov process, in intervals of simulated time."""

from __future__ import annotations

import math

import numpy as np

from manta_sim_ros.dynamics.parameters import Water

INTERVAL = 0.01
"""How long a deviation holds [s]: the shortest correlation time that is allowed."""

ROUNDING = 1e-6
"""How far a time may be from the end of an interval, in intervals, to be at it: the rounding of decimal fractions."""


def deviation_at(water: Water, deviation: np.ndarray, began: float, time: float) -> np.ndarray:
    """Return the deviation (3,) of the current [m/s], world frame, at a time, from that at an earlier one [s].

    Exact at any interval: the stationary process has the standard deviation `water.current_deviation`, and its
    autocorrelation falls as exp(-t / `water.current_correlation_time`). The noise of an interval depends on the seed
    and the interval's number only, so that who starts with the same deviation at the same time gets the same current.
    """
    kept = math.exp(-INTERVAL / water.current_correlation_time)
    new = math.sqrt(1.0 - kept * kept) * np.array(water.current_deviation)
    for interval in range(_interval(began) + 1, _interval(time) + 1):
        noise = np.random.Generator(np.random.Philox(key=water.current_seed, counter=[0, 0, 0, interval % 2**64]))
        deviation = kept * deviation + new * noise.standard_normal(3)
    return deviation


def steps_left(time: float, time_step: float) -> int:
    """Return after how many time steps [s] the next interval has begun, at least one."""
    return max(1, math.ceil(((_interval(time) + 1) * INTERVAL - time) / time_step - ROUNDING))


def _interval(time: float) -> int:
    """Return the number of the interval that a time [s] is in; the end of one is in the next."""
    return math.floor(time / INTERVAL + ROUNDING)

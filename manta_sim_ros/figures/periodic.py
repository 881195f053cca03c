"""Periods, means and lags of recorded curves, and the ends of their transients."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from scipy.ndimage import uniform_filter1d

from manta_sim_ros.dynamics import FloatArray
from manta_sim_ros.figures.record import Record

RECURRENCE = 1e-3
"""A curve recurs when it differs from that of the previous period by at most this share of its range."""

MOST_PERIODS = 50
"""Number of periods within which every transient of a held fin must end."""

LAST_PART = 4
"""The end of a run is the last quarter of its periods, and a run must settle before that."""


def recurring(
    periods: Iterator[Record], curve: Callable[[Record], FloatArray], tolerance: float = RECURRENCE,
) -> tuple[int, Record]:
    """Return the number of periods before `curve` recurs, and the first period after them.

    `curve` returns an array (samples,) or (samples, k) for a period; each of its columns must recur.

    Raises
    ------
    ValueError
        The curve does not recur within MOST_PERIODS.

    """
    before: Record | None = None
    for index in range(MOST_PERIODS):
        now = next(periods)
        if before is not None:
            change = np.abs(curve(now) - curve(before)).max(axis=0)
            if np.all(change <= tolerance * np.ptp(curve(now), axis=0)):
                return index - 1, before
        before = now
    raise ValueError(f'the motion is not periodic to {tolerance:g} of its range within {MOST_PERIODS} periods')


def settled(means: FloatArray, tolerance: float) -> int | None:
    """Return the period from which means (periods,) stay within `tolerance` of the mean of their last quarter.

    The result is None if they do not stay before this quarter begins. `tolerance` is a share of that mean.
    """
    final = end_mean(means)
    unsettled = np.flatnonzero(np.abs(means - final) > tolerance * abs(final))
    begin = int(unsettled[-1]) + 1 if unsettled.size else 0
    return begin if begin <= len(means) - _end(means) else None


def end_mean(means: FloatArray) -> float:
    """Return the mean of the last quarter of means (periods,)."""
    return float(means[-_end(means):].mean())


def _end(means: FloatArray) -> int:
    return max(1, len(means) // LAST_PART)


def period_average(values: FloatArray, samples: int) -> FloatArray:
    """Return the average of values (T, ...) over the period around each sample; NaN where it is not complete."""
    average = uniform_filter1d(values, samples, axis=0)
    average[:samples // 2] = np.nan
    average[len(values) - (samples - samples // 2 - 1):] = np.nan
    return average


def fundamental(values: FloatArray) -> FloatArray:
    """Return the complex amplitude c of the fundamental of one period (samples, ...): Re(c exp(i 2 pi t / T))."""
    return np.asarray(2.0 * np.fft.rfft(values, axis=0)[1] / len(values))


def lag(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return how far the second of two fundamentals lags behind the first [degrees], within +-180."""
    return np.degrees(np.angle(first * np.conj(second)))

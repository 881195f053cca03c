"""Periods, means and lags of recorded curves, and where their transients end."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from scipy.ndimage import uniform_filter1d

from manta_sim_ros.figures.record import Record

RECURRENCE = 1e-3
"""A curve recurs when it differs from that of the period before by less than this part of its swing."""

MOST_PERIODS = 50
"""Longer than this no transient of a held fin lasts."""

LAST_PART = 4
"""The end of a run is the last quarter of its periods; it has settled when it did so before that."""


def recurring(
    periods: Iterator[Record], curve: Callable[[Record], np.ndarray], tolerance: float = RECURRENCE,
) -> tuple[int, Record]:
    """Take periods until `curve` recurs; return how many periods the transient lasted, and the first after it.

    `curve` gives (samples,) or (samples, k) of a period; each column must recur.

    Raises
    ------
    ValueError
        It does not within MOST_PERIODS.

    """
    before: Record | None = None
    for index in range(MOST_PERIODS):
        now = next(periods)
        if before is not None:
            change = np.abs(curve(now) - curve(before)).max(axis=0)
            if np.all(change <= tolerance * np.ptp(curve(now), axis=0)):
                return index - 1, before
        before = now
    raise ValueError(f'the motion is not periodic to {tolerance:g} of its swing within {MOST_PERIODS} periods')


def settled(means: np.ndarray, tolerance: float) -> int | None:
    """Return from which period on means (periods,) stay within `tolerance` of their last quarter's mean.

    None when they do not before that quarter begins. `tolerance` is a part of that mean.
    """
    final = end_mean(means)
    outside = np.flatnonzero(np.abs(means - final) > tolerance * abs(final))
    begin = int(outside[-1]) + 1 if outside.size else 0
    return begin if begin <= len(means) - _end(means) else None


def end_mean(means: np.ndarray) -> float:
    """Return the mean of the last quarter of means (periods,)."""
    return float(means[-_end(means):].mean())


def _end(means: np.ndarray) -> int:
    return max(1, len(means) // LAST_PART)


def period_average(values: np.ndarray, samples: int) -> np.ndarray:
    """Return the average of values (T, ...) over the period around each sample; NaN where that is not whole."""
    average = uniform_filter1d(values, samples, axis=0)
    average[:samples // 2] = np.nan
    average[len(values) - (samples - samples // 2 - 1):] = np.nan
    return average


def fundamental(values: np.ndarray) -> np.ndarray:
    """Return the complex amplitude c of the fundamental of one period (samples, ...): Re(c exp(i 2 pi t / T))."""
    return np.asarray(2.0 * np.fft.rfft(values, axis=0)[1] / len(values))


def lag(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return how far the second of two fundamentals lags behind the first [degrees], within +-180."""
    return np.degrees(np.angle(first * np.conj(second)))

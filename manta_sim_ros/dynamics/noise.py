"""Random numbers that depend only on a seed and on the moment that they are for, not on those drawn before."""

from __future__ import annotations

import numpy as np

from manta_sim_ros.dynamics.quantity import FloatArray

_PHILOX = np.random.Philox(key=0)  # set to each seed and moment: to make a new one takes ten times as long
_RANDOM = np.random.Generator(_PHILOX)
_START = _PHILOX.state


def gaussian_noise(seed: int, stream: int, moment: int, count: int) -> FloatArray:
    """Return `count` independent random numbers of zero mean and standard deviation 1.

    Parameters
    ----------
    seed
        The seed, from 0 to LARGEST_SEED.
    stream
        A number for each use of the noise: those of different streams are independent, also with the same seed.
    moment
        A whole number for the time.
    count
        How many numbers.

    """
    counter, key = np.array((0, 0, stream, moment % 2**64), np.uint64), np.array((seed, 0), np.uint64)
    with _PHILOX.lock:  # threads share the generator
        _PHILOX.state = {**_START, 'state': {'counter': counter, 'key': key}}
        return _RANDOM.standard_normal(count)

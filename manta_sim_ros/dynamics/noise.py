"""Random numbers that depend only on a seed and on the moment that they are for, not on those drawn before."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from manta_sim_ros.dynamics.quantity import FloatArray

WALK_STEP = 2.0**-6
"""Time between the points of a random walk, which is straight in between [s]."""

LONGEST_WALK = 2.0**32
"""Time at which a random walk ends [s]: 136 years."""

_PHILOX = np.random.Philox(key=0)  # set to each seed and moment: to make a new one takes ten times as long
_RANDOM = np.random.Generator(_PHILOX)


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
    state: Any = {  # numbers of Python, which NumPy reads in half the time of its own
        'bit_generator': 'Philox', 'state': {'counter': (0, 0, stream, moment % 2**64), 'key': (seed, 0)},
        'buffer': (0, 0, 0, 0), 'buffer_pos': 4, 'has_uint32': 0, 'uinteger': 0}
    with _PHILOX.lock:  # threads share the generator
        _PHILOX.state = state
        return _RANDOM.standard_normal(count)


def random_walk(seed: int, stream: int, time: float, count: int) -> FloatArray:
    """Return the values of `count` independent random walks at a time [s]: Wiener processes, zero up to time 0.

    The variance of the change in a time is that time in seconds. As `gaussian_noise`, a value depends on nothing drawn
    before: after Levy, a value between two known ones is normal about their mean. That takes some dozens of numbers.
    """
    time = min(max(time, 0.0), LONGEST_WALK)

    def noise(at: float) -> FloatArray:
        return gaussian_noise(seed, stream, round(at / WALK_STEP), count)

    begin, end = 0.0, WALK_STEP
    at_begin, at_end = np.zeros(count), math.sqrt(WALK_STEP) * noise(WALK_STEP)
    while end < time:
        begin, end = end, 2.0 * end
        at_begin, at_end = at_end, at_end + math.sqrt(begin) * noise(end)
    while end - begin > WALK_STEP:
        middle = 0.5 * (begin + end)
        at_middle = 0.5 * (at_begin + at_end) + 0.5 * math.sqrt(end - begin) * noise(middle)
        if time < middle:
            end, at_end = middle, at_middle
        else:
            begin, at_begin = middle, at_middle
    return at_begin + (time - begin) / (end - begin) * (at_end - at_begin)

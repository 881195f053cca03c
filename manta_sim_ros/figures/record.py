"""Simulations as arrays: the states of a gait, with a fixed number of samples per flapping period."""

from __future__ import annotations

import dataclasses
import itertools
import math
import warnings
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from manta_sim_ros.dynamics import FinCommand, FloatArray, ModelWarning, Parameters, Simulator, State

SAMPLES = 100
"""Samples per flapping period."""


@dataclasses.dataclass(frozen=True)
class Record:
    """States at equal intervals; the first axis of every array is time, with T samples.

    Sample i is (i + 1) / `samples` periods after the beginning, so every period has all of its samples. Frames and
    units are those of State.
    """

    parameters: Parameters
    """Parameters of the robot, with the time step that was used."""
    period: float
    """Flapping period [s]."""
    samples: int
    """Samples per period."""
    time: FloatArray
    """(T,) time [s]."""
    position: FloatArray
    """(T, 3) in the world frame [m]."""
    orientation: FloatArray
    """(T, 4) quaternions x, y, z, w."""
    twist: FloatArray
    """(T, 6) in F_b [m/s, rad/s]."""
    fin_wrenches: FloatArray
    """(T, 2, 6) [fin] in F_b, about the center of mass [N, N m]."""
    rod_angles: FloatArray
    """(T, 2, 2) [fin, front or rear] [rad]."""
    joint_angles: FloatArray
    """(T, 2, n, m) [fin, chain, link] [rad]."""
    rod_power: FloatArray
    """(T,) power of the motors of all rods into the fins [W]."""

    @property
    def wrench(self) -> FloatArray:
        """(T, 6) wrench of both fins on the body in F_b, about the center of mass [N, N m]."""
        return self.fin_wrenches[:, 0] + self.fin_wrenches[:, 1]

    @property
    def periods(self) -> int:
        """Number of complete periods."""
        return len(self.time) // self.samples

    def by_period(self, values: FloatArray) -> FloatArray:
        """Return values (T, ...) of all samples as (periods, samples, ...)."""
        return values.reshape(self.periods, self.samples, *values.shape[1:])


ARRAYS = tuple(field.name for field in dataclasses.fields(Record) if field.type == 'FloatArray')


def flap(parameters: Parameters, left: FinCommand, right: FinCommand, samples: int = SAMPLES) -> Iterator[Record]:
    """Yield a Record of each flapping period from rest, without end.

    The time step is the largest that is no larger than `solver.time_step` and divides the time between two samples.

    Raises
    ------
    ValueError
        The fins flap at different frequencies or not at all, or a gait is impossible.

    """
    if not left.frequency == right.frequency > 0.0:
        raise ValueError(
            f'the frequencies are {left.frequency:g} Hz left and {right.frequency:g} Hz right, but must be the same '
            'and greater than 0 Hz to have a period')
    period = 1.0 / left.frequency
    steps = math.ceil(period / (samples * parameters.solver.time_step) - 1e-9)
    time_step = period / (samples * steps)
    parameters = parameters.replace(solver={'time_step': time_step})
    simulator = Simulator(parameters)
    simulator.command(left=left, right=right)
    while True:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore', ModelWarning)  # figures show the chordwise instability
            states = [simulator.advance(steps * time_step) for _ in range(samples)]
        yield Record(parameters, period, samples, **{name: stacked(states, name) for name in ARRAYS})


def record(
    parameters: Parameters, left: FinCommand, right: FinCommand, periods: int, samples: int = SAMPLES,
) -> Record:
    """Return the first `periods` periods of `flap` as one Record."""
    return joined(itertools.islice(flap(parameters, left, right, samples), periods))


def joined(records: Iterable[Record]) -> Record:
    """Return consecutive records as one."""
    parts = list(records)
    arrays: dict[str, Any] = {name: np.concatenate([getattr(part, name) for part in parts]) for name in ARRAYS}
    return dataclasses.replace(parts[0], **arrays)


def stacked(states: list[State], name: str) -> FloatArray:
    """Return one field of states as an array with time as its first axis."""
    return np.array([getattr(state, name) for state in states])

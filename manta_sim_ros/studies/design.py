"""Design of experiments: gaits that make parameters identifiable. Free of ROS."""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from manta_sim_ros.dynamics import DivergenceError, FloatArray, Parameters, Simulator
from manta_sim_ros.studies.gaits import gaits_from
from manta_sim_ros.studies.identification import Problem, check_free, directions_of
from manta_sim_ros.studies.measured import CHANNELS, ORIENTATIONS, Run, Series
from manta_sim_ros.studies.replay import predicted

AMPLITUDES, FREQUENCIES, PHASES = (20.0, 35.0), (0.4, 0.7), (20.0, 40.0)
"""Values of the candidate gaits [degrees, Hz, degrees]."""

MANEUVERS = ('straight', 'turn by amplitude', 'turn by phase', 'pitch')

NOISE = {'position': 0.01, 'orientation': 0.01, 'twist': 0.01}
"""Standard deviations of what is assumed to be measured if there are no data [m, rad, m/s and rad/s]."""

SAMPLE_INTERVAL = 0.1
"""Interval of the assumed samples [s]."""

PRIOR = 1e-9
"""Information about each parameter before the first run, for a change by its scale: none, but for the logarithm."""


class Design(NamedTuple):
    """Proposed gaits, and what they will tell about p parameters together with the data that are there."""

    gaits: list[tuple[float, ...]]
    """Gaits of both fins, as six or ten values in the order of `gaits.ORDER` [degrees, Hz], the best one first."""
    values: FloatArray
    """(p,) present values of the parameters."""
    errors: FloatArray
    """(p,) expected standard errors."""


def candidates() -> list[tuple[float, ...]]:
    """Return the gaits among which `design` chooses, as values in the order of `gaits.ORDER` [degrees, Hz]."""
    found = []
    for amplitude, frequency, phase, maneuver in itertools.product(AMPLITUDES, FREQUENCIES, PHASES, MANEUVERS):
        right_amplitude = 0.5 * amplitude if maneuver == 'turn by amplitude' else amplitude
        right_phase = 0.0 if maneuver == 'turn by phase' else phase
        biases = (10.0, 10.0, -10.0, -10.0) if maneuver == 'pitch' else ()
        found.append((amplitude, right_amplitude, frequency, frequency, phase, right_phase, *biases))
    return found


def design(
    free: Sequence[str], parameters: Parameters, count: int, *, duration: float = 10.0, runs: Sequence[Run] = (),
) -> Design:
    """Choose the gaits from rest, each for `duration`, that tell most about parameters: a greedy D-optimal design.

    Each choice maximizes the determinant of the information matrix for the present values of the parameters, of which
    the starts of the runs have taken their part.

    Parameters
    ----------
    free
        Names of the parameters, as of `identify`.
    parameters
        All values of the model.
    count
        Number of gaits.
    duration
        Of each run [s].
    runs
        Data that are there already: they count, and the same channels are measured again, with the same noise. By
        default what NOISE has.

    Raises
    ------
    ValueError
        No parameter is free, a name is not that of a number of the model, or `count` or `duration` is too small.
    NotIdentifiableError
        These gaits, with the data, cannot say what the values are.

    """
    check_free(free)
    if not count >= 1:
        raise ValueError(f'count is {count}, but must be at least 1')
    if not SAMPLE_INTERVAL <= duration < math.inf:
        raise ValueError(f'duration is {duration:g} s, but must be a finite number of at least {SAMPLE_INTERVAL:g} s')
    measured = Problem(runs, free, parameters).noise() if runs else {
        name: np.full(3 if name in ORIENTATIONS else len(CHANNELS[name]), deviation)
        for name, deviation in NOISE.items()}
    gaits = [gait for gait in candidates() if _possible(gait, parameters)]
    planned = [_planned(gait, duration, measured) for gait in gaits]
    good = [(gait, run) for gait, run in zip(gaits, predicted(planned, parameters), strict=True)
            if not isinstance(run, DivergenceError)]
    problem = Problem([*runs, *(run for _, run in good)], free, parameters)
    parts = problem.sensitivities(problem.start)
    total = sum((part.T @ part for part in parts[:len(runs)]), PRIOR * np.eye(len(free)))
    others, chosen = dict(enumerate(parts[len(runs):])), list(range(len(runs)))
    for _ in range(min(count, len(others))):
        gains = {each: np.linalg.slogdet(total + part.T @ part)[1] for each, part in others.items()}
        best = max(gains, key=gains.__getitem__)
        part = others.pop(best)
        chosen.append(best + len(runs))
        total = total + part.T @ part
    directions_of(free, np.concatenate([parts[each] for each in chosen]))
    gaits = [good[each - len(runs)][0] for each in chosen[len(runs):]]
    errors = np.sqrt(np.diag(np.linalg.inv(total)))
    return Design(gaits, problem.start[:len(free)] * problem.scales, errors * problem.scales)


def _possible(gait: Sequence[float], parameters: Parameters) -> bool:
    left, right = gaits_from(gait)
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')
        try:
            Simulator(parameters).command(left=left, right=right)
        except ValueError:
            return False
    return True


def _planned(gait: Sequence[float], duration: float, noise: Mapping[str, FloatArray]) -> Run:
    """Return a run with one gait whose samples are all at rest at the origin."""
    time = np.linspace(0.0, duration, max(2, round(duration / SAMPLE_INTERVAL) + 1))
    channels = {}
    for name, deviations in noise.items():
        values = np.zeros((len(time), len(CHANNELS[name])))
        if name in ORIENTATIONS:
            values[:, 3] = 1.0
        channels[name] = Series(time, values, np.tile(deviations, (len(time), 1)))
    return Run(str(gait), ((0.0, gaits_from(gait)),), channels)

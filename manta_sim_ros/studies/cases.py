"""The simulation of cases of a study, many at once, on this machine or on a worker of a cluster."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from manta_sim_ros.dynamics import (
    DivergenceError,
    ModelWarning,
    Parameters,
    Simulator,
    StabilityWarning,
    State,
    body_warning,
    simulate_batch,
    step_warning,
    turn_warning,
)
from manta_sim_ros.studies.gaits import Gaits
from manta_sim_ros.studies.study import Study, check_duration
from manta_sim_ros.studies.swim import Swim, swim

SAMPLES = 40
"""Least number of samples of a period, as far as there are so many time steps."""

NUMBERS_AT_ONCE = 30_000_000
"""Largest memory of the states of cases that are simulated at once, in numbers of 8 bytes: a quarter of a gigabyte."""

NUMBERS_OF_STATE = 600
"""The memory of a state besides its joints, in numbers of 8 bytes."""

RESULTS = (*Swim._fields, 'step_stable', 'warning', 'error')
"""What each case has besides its inputs: means over the last period (`Swim`), whether `solver.time_step` is stable for
its gaits, what the model does not do as a robot does, and why there is no result."""


def simulate_cases(study: Study) -> list[dict[str, Any]]:
    """Simulate all cases of a study at once, from rest, and return a row of each: number, inputs and RESULTS.

    A case that is impossible or diverges has the text of its error, and None for what is not known.
    """
    rows = {case: {'case': case, **study.inputs(case), **dict.fromkeys(RESULTS)} for case in study.cases}
    groups: dict[tuple[float, float, float], list[_Case]] = {}
    with warnings.catch_warnings():
        for category in (StabilityWarning, ModelWarning):  # each row has its own
            warnings.simplefilter('ignore', category)
        for number in study.cases:
            try:
                case = _Case(study, number)
            except ValueError as error:
                rows[number]['error'] = str(error)
                continue
            rows[number]['step_stable'] = step_warning(case.parameters, *case.gaits) is None
            groups.setdefault(case.sampling, []).append(case)
        for sampling, group in groups.items():
            for case, row in zip(group, _simulate(group, study.duration, *sampling), strict=True):
                rows[case.number] |= row
    return list(rows.values())


class _Case:
    """A case that is possible."""

    def __init__(self, study: Study, number: int) -> None:
        self.number = number
        self.parameters: Parameters = study.parameters_of(number)
        self.gaits: Gaits = study.gaits_of(number)
        moving = [gait for gait in self.gaits if gait.frequency > 0.0]
        flapping = [gait.frequency for gait in moving if gait.amplitude > 0.0] or [gait.frequency for gait in moving]
        self.frequency = min(flapping, default=0.0)
        if not self.frequency * study.duration >= 2.0:
            raise ValueError(
                f'the lowest frequency of a fin that flaps is {self.frequency:g} Hz, but must be at least '
                f'{2.0 / study.duration:g} Hz, for two periods in {study.duration:g} s')
        check_duration(study.duration, self.parameters)
        simulator = Simulator(self.parameters)
        simulator.command(left=self.gaits[0], right=self.gaits[1])
        self.state: State = simulator.state
        self.period = common_period(flapping, study.duration / 4.0)
        self.sampling = (
            self.parameters.solver.time_step, 2.0 ** math.floor(-math.log2(self.period)),
            2.0 ** math.ceil(math.log2(max(flapping))))
        """Time step [s], and powers of 2 below the frequency of the period and above the highest one [Hz]. Cases that
        agree in them are sampled together: the results of a case do not depend on those beside it."""


def common_period(frequencies: Sequence[float], longest: float) -> float:
    """Return the time [s] after which fins with these frequencies [Hz] repeat their motion.

    If that is above `longest` [s], it is the time of whole strokes of the slower fin up to `longest`, at least of one,
    after which the other one is nearest to a whole number of its own.
    """
    slower, faster = min(frequencies), max(frequencies)
    strokes = Fraction(faster / slower).limit_denominator(max(1, int(longest * slower))).denominator
    return strokes / slower


def _simulate(
    group: Sequence[_Case], duration: float, time_step: float, lowest: float, highest: float,
) -> list[dict[str, Any]]:
    """Simulate cases of the same `sampling`, and return what is known of each.

    No more are simulated at once than their states fit into NUMBERS_AT_ONCE: they are many where one fin flaps much
    faster than the other.
    """
    every = max(1, math.floor(1.0 / (highest * SAMPLES * time_step)))
    steps = round(duration / time_step)
    sampled = min(steps // every, math.ceil(2.0 / (lowest * every * time_step)) + 1)
    numbers = (sampled + 1) * max(2 * case.state.joint_angles.size + NUMBERS_OF_STATE for case in group)
    at_once = max(1, NUMBERS_AT_ONCE // numbers)
    if len(group) > at_once:
        return [row for first in range(0, len(group), at_once)
                for row in _simulate(group[first:first + at_once], duration, time_step, lowest, highest)]
    parameters = [case.parameters for case in group]
    begun = simulate_batch(
        parameters, [case.state for case in group], None, (steps - sampled * every) * time_step)
    swimming = [index for index, state in enumerate(begun) if isinstance(state, State)]
    records = simulate_batch(
        [parameters[index] for index in swimming], [state for state in begun if isinstance(state, State)], None,
        sampled * every * time_step, every=every * time_step)
    ends: list[Any] = list(begun)
    for index, record in zip(swimming, records, strict=True):
        ends[index] = record if isinstance(record, DivergenceError) else [begun[index], *record]
    return [
        {'error': str(end)} if isinstance(end, DivergenceError) else {
            **swim(case.parameters, end, case.frequency, case.period)._asdict(),
            'warning': body_warning(case.parameters) or turn_warning(case.parameters, end[-1])}
        for case, end in zip(group, ends, strict=True)]

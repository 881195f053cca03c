"""Measured runs, simulated again: all of them with many sets of parameters at once. Free of ROS."""

from __future__ import annotations

import dataclasses
import difflib
import itertools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from manta_sim_ros.dynamics import DivergenceError, FloatArray, Parameters, State, shown_name, simulate_batch
from manta_sim_ros.sensors import Imu
from manta_sim_ros.studies.gaits import Gaits
from manta_sim_ros.studies.measured import ORIENTATIONS, Run, Series

COARSEST = 0.01
"""Largest interval of the simulated states [s] where the samples have no common one: between states, the simulation is
interpolated, and commands are rounded to them."""

ROUNDING = 1e-3
"""Largest difference of a time from a whole number of time steps, in steps."""

STARTS = {'position': range(3), 'orientation': range(3, 6), 'twist': range(6, 12)}
"""Coordinates of the start of a segment that a channel measures: position [m], rotation vector [rad], twist."""

ALL = tuple(itertools.chain.from_iterable(STARTS.values()))
"""All coordinates of a start."""

DYNAMIC = ('acceleration', 'fin_wrenches', 'rod_torques')
"""What a state has from the step before it."""

DYNAMIC_STEPS = 4
"""Time steps after which these are those of the motion with the staggered coupling, too: within a percent."""

Values = dict[str, FloatArray]
"""The values (T, k) of each channel at the times of its samples."""


def value_of(parameters: Parameters, name: str) -> float:
    """Return a number of the model by its name, such as `fin.span` or `body.inertia[0]`.

    Raises
    ------
    ValueError
        It is no parameter of the robot or the water, no real number, or lacks an index.

    """
    full_name, bracket, index = name.partition('[')
    known = {each: about for each, about in Parameters.quantities().items()
             if about.kind in (float, tuple) and not each.startswith('solver.')}
    if full_name not in known:
        near = difflib.get_close_matches(full_name, known, n=1)
        raise ValueError(f'{shown_name(name)} is no real number of the model{f"; is {near[0]} meant?" if near else ""}')
    size = known[full_name].size
    if bool(bracket) != (size > 1) or bracket and index not in {f'{i}]' for i in range(size)}:
        wanted = f'one of {full_name}[0] to {full_name}[{size - 1}]' if size > 1 else full_name
        raise ValueError(f'{shown_name(name)} is no single number, but must be {wanted}')
    group, _, field = full_name.partition('.')
    value = getattr(getattr(parameters, group), field)
    return float(value[int(index[:-1])] if bracket else value)


class Start(NamedTuple):
    """The start of a segment."""

    interval: int
    """Number of the interval of the simulation that it begins."""
    body: dict[str, FloatArray]
    """Position [m], orientation (quaternion) and twist of the body, as far as they are known; others are those of the
    simulation until there: rest at the origin at the beginning of a run."""
    free: tuple[int, ...]
    """Its coordinates that are free."""


class Plan(NamedTuple):
    """How a run is simulated, and where its samples are among the simulated states."""

    run: Run
    starts: list[Start]
    intervals: int
    commands: dict[int, Gaits]
    """Gaits by the number of the interval from which they act."""
    samples: dict[str, tuple[np.ndarray, FloatArray]]
    """Index (T,) of the simulated state before each sample of a channel, and share (T,) of the interval until it."""
    segments: dict[str, np.ndarray]
    """Segment (T,) of each sample."""


def interval_of(runs: Sequence[Run], time_step: float) -> float:
    """Return the interval of the simulated states [s]: that of all samples and commands, if there is such a one."""
    times = np.concatenate([[time for run in runs for time, _ in run.commands],
                            *(series.time for run in runs for series in run.channels.values())]) / time_step
    steps, coarsest = np.rint(times).astype(int), max(1, math.floor(COARSEST / time_step + ROUNDING))
    common = int(np.gcd.reduce(steps)) if np.abs(times - steps).max() < ROUNDING else 0
    return time_step * (common if common >= coarsest / 4 else coarsest)


def plan_of(run: Run, parameters: Parameters, every: float, segment: float | None) -> Plan:
    """Return how a run is simulated.

    Parameters
    ----------
    run, parameters
        The run, and all values of the model.
    every
        Interval of the simulated states [s].
    segment
        Duration of a segment [s]; None for the whole run.

    Raises
    ------
    ValueError
        A segment is too short, or has no sample of a channel that says where it starts.

    """
    last = max(float(series.time[-1]) for series in run.channels.values())
    intervals = max(1, math.ceil(last / every - ROUNDING))
    if segment is not None and not (math.isfinite(segment) and round(segment / every) >= 2):
        raise ValueError(f'segment is {segment:g} s, but must be a finite number of at least {2 * every:g} s')
    length = intervals if segment is None else round(segment / every)
    begins = list(range(0, max(1, intervals - length // 2), length))  # a short rest belongs to the last one
    measured = [] if parameters.solver.fixed_base else [name for name in STARTS if name in run.channels]
    starts = []
    for begin, end in itertools.pairwise([*begins, intervals + 1]):
        first = {}
        for name in measured:
            series = run.channels[name]
            index = int(np.searchsorted(series.time, (begin - ROUNDING) * every))
            if index == len(series.time) or series.time[index] > end * every:
                raise ValueError(f'{run.name}: has no {name} from {begin * every:g} to {end * every:g} s, where a '
                                 'segment starts')
            first[name] = series.values[index]
        free = ALL if begin and not parameters.solver.fixed_base else tuple(
            coordinate for name in measured for coordinate in STARTS[name])
        starts.append(Start(begin, first, free))
    samples, segments = {}, {}
    for name, series in run.channels.items():
        at = series.time / every
        before = np.clip(np.floor(at + ROUNDING).astype(int), 0, intervals - 1)
        segments[name] = np.searchsorted(begins, before, side='right') - 1
        samples[name] = (before + segments[name], np.clip(at - before, 0.0, 1.0))  # each segment has one state more
    commands = {round(time / every): gaits for time, gaits in run.commands}
    return Plan(run, starts, intervals, commands, samples, segments)


def with_whole_starts(plans: Sequence[Plan], parameters: Parameters, every: float) -> list[Plan]:
    """Return plans whose later segments start with what is not measured as a simulation of the whole run has it.

    Raises
    ------
    DivergenceError
        A motion diverges.

    """
    if all(len(start.body) == len(STARTS) for plan in plans for start in plan.starts if start.interval):
        return list(plans)
    found = _simulate([(parameters, plan, np.zeros((len(plan.starts), 12))) for plan in plans], every)
    whole = []
    for plan, states in zip(plans, found, strict=True):
        if isinstance(states, DivergenceError):
            raise states
        bodies = [states[start.interval + number] for number, start in enumerate(plan.starts)]
        whole.append(plan._replace(starts=[
            start._replace(body={name: getattr(body, name) for name in STARTS}) if start.interval else start
            for start, body in zip(plan.starts, bodies, strict=True)]))
    return whole


def simulate_runs(
    cases: Sequence[tuple[Parameters, Plan, FloatArray]], every: float,
) -> list[Values | DivergenceError]:
    """Return the simulated values of the channels of many runs, all robots at once; an error for one that diverged.

    Parameters
    ----------
    cases
        For each robot all values of the model, the plan of its run, and the changes (S, 12) of its S starts: position
        [m], rotation vector in the world frame [rad], whose third component turns the heading alone, and twist [m/s,
        rad/s].
    every
        Interval of the simulated states [s].

    """
    return [found if isinstance(found, DivergenceError) else _sampled(plan, _Record(found, parameters, plan.run.imu))
            for found, (parameters, plan, _) in zip(_simulate(cases, every), cases, strict=True)]


def _simulate(
    cases: Sequence[tuple[Parameters, Plan, FloatArray]], every: float,
) -> list[list[State] | DivergenceError]:
    """Return the states of each robot, those of each segment from its start to its end."""
    states: list[State] = [State.at_rest(parameters) for parameters, _, _ in cases]
    records: list[list[State]] = [[] for _ in cases]
    failed: dict[int, DivergenceError] = {}
    plans = {id(plan): plan for _, plan, _ in cases}.values()
    breaks = sorted({number for plan in plans for number in (
        *(start.interval for start in plan.starts), *plan.commands, plan.intervals)})
    for begin, end in itertools.pairwise(breaks):
        active = [index for index, (_, plan, _) in enumerate(cases) if begin < plan.intervals and index not in failed]
        begun = [(index, _put(states[index], start, change) if start.free else states[index]) for index in active
                 for start, change in zip(cases[index][1].starts, cases[index][2], strict=True)
                 if start.interval == begin]
        settled = _with_dynamics([cases[index][0] for index, _ in begun], [state for _, state in begun])
        for (index, _), state in zip(begun, settled, strict=True):
            if isinstance(state, DivergenceError):
                failed[index] = state
            else:
                states[index] = state
                records[index].append(state)
        active = [index for index in active if index not in failed]
        commands = [cases[index][1].commands.get(begin) for index in active]
        try:
            found = simulate_batch(
                [cases[index][0] for index in active], [states[index] for index in active], commands,
                (end - begin) * every, every=every)
        except ValueError as error:
            names = {cases[index][1].run.name: None for index, gaits in zip(active, commands, strict=True) if gaits}
            raise ValueError(f'{", ".join(names)}: at {begin * every:g} s: {error}') from error
        for index, record in zip(active, found, strict=True):
            if isinstance(record, DivergenceError):
                failed[index] = record
            else:
                records[index] += record
                states[index] = record[-1]
    return [failed.get(index, record) for index, record in enumerate(records)]


def _put(state: State, start: Start, change: FloatArray) -> State:
    """Return a state with the body at the start of a segment, and the fins as they are."""
    position, orientation, twist = (start.body.get(name, getattr(state, name)) for name in STARTS)
    return dataclasses.replace(
        state, position=position + change[:3], twist=twist + change[6:],
        orientation=(Rotation.from_rotvec(change[3:6]) * Rotation.from_quat(orientation)).as_quat())


def _with_dynamics(parameters: Sequence[Parameters], states: Sequence[State]) -> list[State | DivergenceError]:
    """Return states whose DYNAMIC values are those of their own motion; `_put` has left those of another one."""
    if not states:
        return []
    after = simulate_batch(parameters, states, None, DYNAMIC_STEPS * parameters[0].solver.time_step)
    return [end if isinstance(end, DivergenceError) else dataclasses.replace(
        state, **{name: getattr(end, name) for name in DYNAMIC}) for state, end in zip(states, after, strict=True)]


class _Record(NamedTuple):
    states: list[State]
    parameters: Parameters
    imu: Imu

    def of(self, name: str) -> FloatArray:
        return np.array([getattr(state, name) for state in self.states])

    def imu_orientation(self) -> FloatArray:
        return np.asarray((Rotation.from_quat(self.of('orientation')) * self.imu.rotation).as_quat())

    def angular_velocity(self) -> FloatArray:
        return np.asarray(self.imu.rotation.inv().apply(self.of('twist')[:, 3:]) + self.imu.angular_velocity_bias)

    def specific_force(self) -> FloatArray:
        twist, acceleration, arm = self.of('twist'), self.of('acceleration'), np.array(self.imu.position)
        velocity, omega = twist[:, :3], twist[:, 3:]
        up = Rotation.from_quat(self.of('orientation')).as_matrix()[:, 2]  # the world's z in the body frame
        force = acceleration[:, :3] + np.cross(omega, velocity) + self.parameters.body.gravity * up + (
            np.cross(acceleration[:, 3:], arm) + np.cross(omega, np.cross(omega, arm)))
        return np.asarray(self.imu.rotation.inv().apply(force) + self.imu.acceleration_bias)


_OBSERVED: dict[str, Callable[[_Record], FloatArray]] = {
    'position': lambda record: record.of('position'),
    'orientation': lambda record: record.of('orientation'),
    'twist': lambda record: record.of('twist'),
    'imu_orientation': _Record.imu_orientation,
    'angular_velocity': _Record.angular_velocity,
    'specific_force': _Record.specific_force,
    'wrench': lambda record: record.of('fin_wrenches').sum(axis=1),
    'rod_angles': lambda record: record.of('rod_angles').reshape(-1, 4),
    'rod_torques': lambda record: record.of('rod_torques').reshape(-1, 4),
}
"""What each channel of `measured.CHANNELS` measures in states, without noise."""


def _sampled(plan: Plan, record: _Record) -> Values:
    values = {}
    for name, (before, share) in plan.samples.items():
        states = _OBSERVED[name](record)
        value = states[before] + share[:, None] * (states[before + 1] - states[before])
        values[name] = value / np.linalg.norm(value, axis=1)[:, None] if name in ORIENTATIONS else value
    return values


def error(name: str, measured: FloatArray, simulated: FloatArray) -> FloatArray:
    """Return measured less simulated values (T, k) of a channel; rotation vectors (T, 3) [rad] for orientations."""
    if name in ORIENTATIONS:
        turned = Rotation.from_quat(simulated).inv() * Rotation.from_quat(measured)
        return np.asarray(turned.as_rotvec())
    return measured - simulated


def predicted(runs: Sequence[Run], parameters: Parameters) -> list[Run | DivergenceError]:
    """Return runs with the values that a simulation from the same starts gives, or the error of one that diverged."""
    every = interval_of(runs, parameters.solver.time_step)
    plans = [plan_of(run, parameters, every, None) for run in runs]
    found = simulate_runs([(parameters, plan, np.zeros((1, 12))) for plan in plans], every)
    return [each if isinstance(each, DivergenceError) else run._replace(channels={
        name: Series(series.time, each[name], series.deviations) for name, series in run.channels.items()})
        for run, each in zip(runs, found, strict=True)]

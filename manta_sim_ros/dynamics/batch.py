"""Many robots at once: `simulate_batch` advances independent robots on all cores."""

from __future__ import annotations

import contextlib
import os
import threading
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, overload

from manta_sim_ros.dynamics.command import FinCommand
from manta_sim_ros.dynamics.parameters import Parameters, check_parameters
from manta_sim_ros.dynamics.quantity import shown
from manta_sim_ros.dynamics.simulator import LINK_STEPS_AT_ONCE, DivergenceError, Simulator
from manta_sim_ros.dynamics.stability import ModelWarning, StabilityWarning
from manta_sim_ros.dynamics.state import State

Commands = Sequence[tuple[FinCommand, FinCommand] | None]
"""(left, right) of each robot, or None for a robot that goes on as before."""


@overload
def simulate_batch(
    parameters: Parameters | Sequence[Parameters], states: Sequence[State], commands: Commands | None,
    duration: float,
) -> list[State | DivergenceError]: ...


@overload
def simulate_batch(
    parameters: Parameters | Sequence[Parameters], states: Sequence[State], commands: Commands | None,
    duration: float, *, every: float,
) -> list[list[State] | DivergenceError]: ...


def simulate_batch(
    parameters: Parameters | Sequence[Parameters], states: Sequence[State], commands: Commands | None,
    duration: float, *, every: float | None = None,
) -> list[State | DivergenceError] | list[list[State] | DivergenceError]:
    """Advance many robots, which do not feel each other, by `duration` on all cores that this process may use.

    Each robot moves as a `Simulator` moves it. The results do not depend on the number of cores. Other threads run
    meanwhile. A warning that a `Simulator` would give is given once, for the first robot that it concerns, with the
    number of the others.

    Parameters
    ----------
    parameters
        All values of the model, of all robots or of each.
    states
        The state from which each robot starts.
    commands
        The commands of the left and the right fin of each robot during `duration`, or None for a robot that goes on as
        before. None in place of the sequence lets all robots go on.
    duration
        [s], a whole number of time steps of each robot.
    every
        Interval of the states that are returned [s]: a whole number of time steps, and `duration` is a multiple of it.
        By default only the last state of each robot is returned.

    Returns
    -------
    list
        The state of each robot after `duration`, in the order of `states`. With `every`, the list of its states after
        each interval: `duration` / `every` states, of which the last one is that after `duration`. A robot that
        diverged has its DivergenceError in this place; it does not touch the others.

    Raises
    ------
    ValueError
        What a `Simulator` of one robot refuses; names the index of the robot, the value and the bound. The numbers of
        parameters, states and commands differ, or `duration` is no multiple of `every`. Nothing is simulated then.

    """
    robots = _robots(parameters, states, commands)
    intervals = [robot.intervals(duration, every) for robot in robots]
    _warn_once(robots)
    stop = threading.Event()
    with ThreadPoolExecutor(max(1, min(_cores(), len(robots)))) as pool:
        try:
            results = list(pool.map(lambda robot, steps: robot.states_after(steps, stop), robots, intervals))
        except BaseException:  # also Ctrl-C, which comes to this thread
            stop.set()
            raise
    _warn_once(robots)
    if every is None:
        return [result if isinstance(result, DivergenceError) else result[-1] for result in results]
    return results


class _Robot(Simulator):
    """One robot of a batch. It keeps its warnings."""

    def __init__(
        self, index: int, parameters: Parameters, state: State, commands: Sequence[FinCommand] | None,
    ) -> None:
        self.index = index
        self.warnings: dict[type[Warning], str] = {}
        with self._named():
            check_parameters(parameters)
            super().__init__(parameters, state)
            if commands is not None:
                left, right = commands
                self.command(left=left, right=right)

    def _warn(self, message: str, category: type[Warning], stacklevel: int) -> None:
        self.warnings.setdefault(category, message)

    @contextlib.contextmanager
    def _named(self) -> Iterator[None]:
        """Name the robot in a refusal."""
        try:
            yield
        except ValueError as error:
            raise ValueError(f'robot {self.index}: {error}') from error

    def intervals(self, duration: float, every: float | None) -> list[int]:
        """Return the steps of each interval after which a state is wanted."""
        with self._named():
            steps = self._whole_steps('duration', duration)
            if every is None:
                return [steps]
            interval = self._whole_steps('every', every)
            if interval == 0:
                raise ValueError(f'every is {shown(every)} s, but must be above 0 s')
            if steps % interval:
                raise ValueError(f'duration is {shown(duration)} s, but must be a multiple of every, {shown(every)} s')
            return [interval] * (steps // interval)

    def states_after(self, intervals: list[int], stop: threading.Event) -> list[State] | DivergenceError:
        """Advance by intervals of so many steps; return the states after them, or the error if the robot diverges."""
        time_step = self.parameters.solver.time_step
        at_once = max(1, LINK_STEPS_AT_ONCE // self.state.joint_angles.size)
        states: list[State] = []
        try:
            for steps in intervals:
                for taken in range(0, max(steps, 1), at_once):
                    if stop.is_set():
                        return states
                    self.advance(min(steps - taken, at_once) * time_step)
                states.append(self.state)
        except DivergenceError as error:
            return error
        return states


def _robots(
    parameters: Parameters | Sequence[Parameters], states: Sequence[State], commands: Commands | None,
) -> list[_Robot]:
    """Return the robots of a batch, or raise a ValueError that names what is wrong."""
    states = _sequence('states', states, 'States', None)
    count = len(states)
    if isinstance(parameters, Parameters):
        parameters = [parameters] * count
    else:
        parameters = _sequence('parameters', parameters, 'Parameters', count)
    if commands is None:
        commands = [None] * count
    else:
        commands = _sequence('commands', commands, 'pairs of FinCommand', count)
    robots = []
    for index, (values, state, pair) in enumerate(zip(parameters, states, commands, strict=True)):
        if not isinstance(state, State):
            raise ValueError(f'robot {index}: state is {shown(state)}, but must be a State')
        if pair is not None and not (isinstance(pair, Sequence) and len(pair) == 2):
            raise ValueError(
                f'robot {index}: commands are {shown(pair)}, but must be a pair of FinCommand (left, right) or None')
        robots.append(_Robot(index, values, state, pair))
    return robots


def _sequence(name: str, values: Sequence[Any], content: str, count: int | None) -> list[Any]:
    """Return a sequence as a list, or raise a ValueError."""
    try:
        items = list(values)
    except TypeError:
        raise ValueError(f'{name} is {shown(values)}, but must be a sequence of {content}') from None
    if count is not None and len(items) != count:
        raise ValueError(f'{name} has {len(items)} entries, but must have one for each of {count} robots')
    return items


def _warn_once(robots: list[_Robot]) -> None:
    """Give each kind of the robots' warnings once: for the first robot, with the number of the others."""
    for category in (StabilityWarning, ModelWarning):
        warned = [robot for robot in robots if category in robot.warnings]
        if warned:
            more = f' (and {len(warned) - 1} more robots)' if len(warned) > 1 else ''
            message = f'robot {warned[0].index}: {warned[0].warnings[category]}{more}'
            warnings.warn(message, category, stacklevel=3)
    for robot in robots:
        robot.warnings.clear()


def _cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, 'sched_getaffinity'):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1

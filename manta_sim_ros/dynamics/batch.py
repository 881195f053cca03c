"""Many robots at once: `simulate_batch` advances independent robots on all cores."""

from __future__ import annotations

import contextlib
import os
import threading
import warnings
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, overload

import numpy as np

from manta_sim_ros.dynamics._kernels import packed
from manta_sim_ros.dynamics._kernels.compilation import announced_compilation
from manta_sim_ros.dynamics._kernels.constants import Constants
from manta_sim_ros.dynamics._kernels.motion import Motion
from manta_sim_ros.dynamics._kernels.packed import ROBOTS
from manta_sim_ros.dynamics.command import FinCommand
from manta_sim_ros.dynamics.parameters import SEQUENTIAL, Parameters, check_parameters
from manta_sim_ros.dynamics.quantity import FloatArray, shown
from manta_sim_ros.dynamics.simulator import LINK_STEPS_AT_ONCE, DivergenceError, Simulator
from manta_sim_ros.dynamics.stability import ModelWarning, StabilityWarning
from manta_sim_ros.dynamics.state import State

MOST_LINKS = 100
"""Links of a fin up to which robots are simulated together: with more, several robots do not fit into the cache."""

LINK_STEPS_IN_TURN = 100_000
"""The most steps times links that a core takes of one block before it takes the next one: all cores then end together.

It has no influence on the results.
"""

BLOCKS_IN_ROTATION = 16
"""Blocks that take turns before others begin: each keeps up to a megabyte of memory."""

_Packed = tuple['list[_Robot]', packed.Pack]
"""Robots, and their pack as the last interval left it."""

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

    Each robot moves as a `Simulator` moves it, to rounding. The results do not depend on the number of cores. Other
    threads run meanwhile. A warning that a `Simulator` would give is given once, for the first robot that it concerns,
    with the number of the others.

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
    waiting = deque(_turns(block, intervals[block[0].index]) for block in _blocks(robots))
    cores, stop = max(1, min(_cores(), len(waiting))), threading.Event()
    with ThreadPoolExecutor(cores) as pool:
        try:
            list(pool.map(lambda _: _take_turns(waiting, stop), range(cores)))
        except BaseException:  # also Ctrl-C, which comes to this thread
            stop.set()
            raise
    _warn_once(robots)
    if every is None:
        return [robot.state if robot.error is None else robot.error for robot in robots]
    return [robot.record if robot.error is None else robot.error for robot in robots]


class _Robot(Simulator):
    """One robot of a batch. It keeps its warnings, its error and its record."""

    error: DivergenceError | None = None

    def __init__(
        self, index: int, parameters: Parameters, state: State, commands: Sequence[FinCommand] | None,
    ) -> None:
        self.index = index
        self.warnings: dict[type[Warning], str] = {}
        self.record: list[State] = []
        with self._named():
            check_parameters(parameters)
            super().__init__(parameters, state)
            if commands is not None:
                left, right = commands
                self.command(left=left, right=right)

    def _warn(self, message: str, category: type[Warning], stacklevel: int) -> None:
        self.warnings.setdefault(category, message)

    def _warn_of_turn(self) -> None:
        """Give no warning within an interval: `end_interval` gives it."""

    def end_interval(self) -> None:
        """Record the state after an interval, and warn of it as `Simulator.advance` does."""
        if self.error is None:
            super()._warn_of_turn()
        self.record.append(self.state)

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

    @property
    def kind(self) -> tuple[object, ...] | None:
        """What robots that are simulated together have in common; None for a robot that is simulated alone."""
        fin, solver = self.parameters.fin, self.parameters.solver
        varying = any(self.parameters.water.current_deviation)
        if solver.coupling != SEQUENTIAL or varying or self.state.servos or fin.chains * fin.links > MOST_LINKS:
            return None
        known = self._constants
        return (
            fin.chains, fin.links, solver.time_step, solver.fixed_base, known.body.moves_water,
            known.fin.added_mass > 0.0, known.fin.twist_stiffness > 0.0 or known.fin.twist_damping > 0.0)

    @property
    def links(self) -> int:
        """The links of both fins."""
        return self.state.joint_angles.size

    def advance_alone(self, steps: int) -> Iterator[None]:
        """Advance by so many steps, or keep the error if the robot diverges; yield after each turn."""
        for turn in _in_turns(steps, self.links):
            try:
                self.advance(turn * self.parameters.solver.time_step)
            except DivergenceError as error:
                self.error = error
                return
            yield

    def member(self) -> tuple[Constants, FloatArray, Motion]:
        """Return what a pack needs of this robot."""
        motion = Motion(*(getattr(self.state, name) for name in Motion._fields))
        return self._constants, np.array(self.parameters.water.current), motion

    def go_on(self, motion: FloatArray, steps: int) -> None:
        """Continue from the motion after so many steps, which lies in one array."""
        before, time_step = self.state, self.parameters.solver.time_step
        count = before.step_count + steps
        self._go_on(
            motion, time=before.start_time + count * time_step, step_count=count, current_deviation=np.zeros(3),
            servos=before.servos)


def _blocks(robots: list[_Robot]) -> list[list[_Robot]]:
    """Return the robots in blocks of one kind, of which each is simulated on one core at a time."""
    kinds: dict[tuple[object, ...], list[_Robot]] = {}
    for robot in robots:
        kinds.setdefault(robot.kind or (robot.index,), []).append(robot)
    return [alike[start:start + ROBOTS] for alike in kinds.values() for start in range(0, len(alike), ROBOTS)]


def _take_turns(waiting: deque[Iterator[None]], stop: threading.Event) -> None:
    """Advance the block that has waited longest by one turn, and so on until no block waits or `stop` is set."""
    while not stop.is_set():
        try:
            turns = waiting.popleft()
        except IndexError:
            return
        try:
            next(turns)
        except StopIteration:
            continue
        except BaseException:
            stop.set()
            raise
        waiting.insert(BLOCKS_IN_ROTATION, turns)


def _turns(block: list[_Robot], intervals: list[int]) -> Iterator[None]:
    """Advance a block by intervals of so many steps, and record the states after them; yield after each turn."""
    at_once = max(1, LINK_STEPS_AT_ONCE // sum(robot.links for robot in block))
    packed_before: _Packed | None = None
    for steps in intervals:
        for taken in range(0, steps, at_once):
            packed_before = yield from _advance_together(
                [robot for robot in block if robot.error is None], min(steps - taken, at_once), packed_before)
        for robot in block:
            robot.end_interval()


def _advance_together(
    robots: list[_Robot], steps: int, before: _Packed | None,
) -> Generator[None, None, _Packed | None]:
    """Advance a block by so many steps: together, but for robots that diverge or come near the surface.

    Return the robots with their pack if they can go on in it next time, as `before`.
    """
    while len(robots) > ROBOTS // 2:  # fewer are faster one after the other
        pack = before[1] if before is not None and before[0] == robots else packed.pack_of(
            [robot.member() for robot in robots])
        failed = -1
        for turn in _in_turns(steps, ROBOTS * robots[0].links):
            with announced_compilation():
                failed = packed.advance(pack, turn)
            if failed >= 0:
                break
            yield
        if failed < 0:
            for robot, motion in zip(robots, packed.motions_of(pack), strict=False):  # a pack is filled up
                robot.go_on(motion, steps)
            return robots, pack
        yield from robots.pop(min(failed, len(robots) - 1)).advance_alone(steps)
    for robot in robots:
        yield from robot.advance_alone(steps)
    return None


def _in_turns(steps: int, links: int) -> Iterator[int]:
    """Yield the steps of each turn."""
    most = max(1, LINK_STEPS_IN_TURN // links)
    for taken in range(0, steps, most):
        yield min(steps - taken, most)


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

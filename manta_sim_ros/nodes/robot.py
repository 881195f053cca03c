"""The simulated robot behind the topics: it takes commands, advances in ticks, and is put at poses."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from manta_sim_ros.dynamics import DivergenceError, FinCommand, FloatArray, Simulator, State
from manta_sim_ros.nodes.settings import ROUNDING, Settings, whole_steps
from manta_sim_ros.nodes.transport import Transport


class Robot:
    """The simulator as the node runs it: no input stops it, and its time never runs backward.

    Parameters
    ----------
    settings
        All parameters of the node.
    error, warn
        Log a line: that the motion diverged and the robot was put at rest, and that no command came for too long.

    Raises
    ------
    ValueError
        A value is invalid.

    """

    def __init__(
        self, settings: Settings, error: Callable[[str], object], warn: Callable[[str], object],
    ) -> None:
        self._settings = settings
        self._error, self._warn = error, warn
        self._simulator = Simulator(settings.model, state=self._at_rest(*self._start, 0.0, np.zeros(3)))
        self._steps_due = 0.0
        self._steps_left = 0  # to the next output, while the robot follows a clock
        self._commanded_at: float | None = None  # simulated time of the last accepted command
        self._current: Sequence[float] | None = None  # instead of water.current
        self._body_wrench: Sequence[float] | None = None
        self._world_wrench: Sequence[float] | None = None
        self._wrench_ends = -math.inf  # simulated time
        self.timed_out = False
        """Whether the last command is older than `command_timeout`, so that amplitudes went to zero, or rods hold."""
        self.divergences = 0
        """Number of divergences of the motion."""
        self.transport = Transport()
        """Mean power and speed over the outputs."""

    @property
    def state(self) -> State:
        """The present state."""
        return self._simulator.state

    @property
    def turn_warning(self) -> str | None:
        """The warning of the simulator that its fins have chordwise instability in a turn, if it gave one."""
        return self._simulator.turn_warning

    @property
    def commands(self) -> tuple[FinCommand, FinCommand]:
        """The last commands of the left and the right fin."""
        left, right = (FinCommand(*command) for command in self.state.gait_commands)
        return left, right

    @property
    def flaps(self) -> bool:
        """Whether a fin is commanded to flap."""
        return any(command.amplitude > 0.0 and command.frequency > 0.0 for command in self.commands)

    @property
    def command_age(self) -> float:
        """Simulated time since the last accepted command [s], NaN if there was none."""
        return math.nan if self._commanded_at is None else self.state.time - self._commanded_at

    @property
    def finite(self) -> bool:
        """Whether the whole state is finite."""
        return all(bool(np.isfinite(value).all()) for value in vars(self.state).values())

    def check(self, settings: Settings) -> None:
        """Raise a ValueError if the present state does not fit other settings."""
        Simulator(settings.model, state=self.state)

    def apply(self, settings: Settings) -> None:
        """Continue with other settings, from the present step on."""
        if settings.model != self._settings.model:
            self._simulator = Simulator(settings.model, state=self.state)
        self._settings = settings

    def command(self, left: FinCommand, right: FinCommand) -> None:
        """Command the gaits of both fins.

        Raises
        ------
        ValueError
            A gait is impossible or cannot be reached; then nothing changes.

        """
        self._simulator.command(left=left, right=right)
        self._commanded_at, self.timed_out = self.state.time, False

    def command_rods(self, angles: FloatArray) -> bool:
        """Command the angles (2, 2) of the rods [rad]; return whether they are held where the support still closes.

        Raises
        ------
        ValueError
            An angle is out of its bounds, or the rods cannot be taken over from the present gait; then nothing changes.

        """
        self._simulator.command_rods(left=angles[0], right=angles[1])
        self._commanded_at, self.timed_out = self.state.time, False
        return not np.array_equal(self.rod_targets, angles)

    @property
    def rod_targets(self) -> FloatArray:
        """The angles (2, 2) of the rods that hold until others are commanded [rad]."""
        return self.state.rod_angles if self.state.rod_command is None else self.state.rod_command

    @property
    def commanding_topic(self) -> str:
        """The topic of the commands that are in force."""
        return 'rod_command' if self.state.servos else 'fin_command'

    @property
    def mean_current(self) -> Sequence[float]:
        """Mean velocity (3,) of the water, world frame [m/s]; `state.current_deviation` is added to it."""
        return self._settings.model.water.current if self._current is None else self._current

    @property
    def has_external_wrench(self) -> bool:
        """Whether an external wrench acts."""
        return self._wrench_ends > self.state.time + ROUNDING * self._time_step

    def set_current(self, current: Sequence[float] | None) -> None:
        """Set the mean velocity (3,) of the water, world frame [m/s]; None stands for `water.current`."""
        self._current = current

    def set_external_wrench(
        self, *, body_wrench: Sequence[float] | None = None, world_wrench: Sequence[float] | None = None,
    ) -> None:
        """Let an external wrench (6,) [N, N m] act from now on for `body_wrench_lifetime`, instead of the last one.

        It acts on the body about its center of mass, with components in the body frame or in the world frame.
        """
        lifetime = self._settings.node.body_wrench_lifetime
        self._body_wrench, self._world_wrench = body_wrench, world_wrench
        self._wrench_ends = self.state.time + lifetime if lifetime > 0.0 else math.inf

    def end_external_wrench(self) -> None:
        """Let no external wrench act from now on."""
        self._wrench_ends = -math.inf

    def tick(self) -> State:
        """Advance by one output period, `1 / publish_rate`, and return the state."""
        return self._advance(self._steps_to_output())

    def follow(self, time: float) -> bool:
        """Advance towards a time [s], but not beyond the next output; return whether that output is due now."""
        self._steps_left = self._steps_left or self._steps_to_output()
        steps = min(self._steps_left, self.steps_until(time))
        if steps <= 0:
            return False
        self._steps_left -= steps
        self._advance(steps)
        return self._steps_left == 0

    def steps_until(self, time: float) -> int:
        """Return the number of whole time steps until a time [s], negative after it, 0 if that is NaN."""
        if math.isnan(time):
            return 0
        rounding = ROUNDING + 4.0 * math.ulp(time) / self._time_step  # of times in nanoseconds since 1970, too
        return math.floor((time - self.state.time) / self._time_step + rounding)

    def continue_at(self, time: float) -> None:
        """Let the present state be that of another time [s], and let nothing else change."""
        shift = time - self.state.time
        self._simulator.reset(dataclasses.replace(self.state, time=time, start_time=time, step_count=0))
        self._wrench_ends += shift
        if self._commanded_at is not None:
            self._commanded_at += shift

    def ticks(self, duration: float, count: int = 1) -> Iterator[State]:
        """Yield the states of all outputs in the next `duration` [s], with one exactly at its end, `count` times.

        Raises
        ------
        ValueError
            `duration` is not a whole number of time steps.

        """
        steps = whole_steps(duration, self._time_step)
        return itertools.chain.from_iterable(self._states(steps) for _ in range(count))

    def _states(self, steps: int) -> Iterator[State]:
        self._steps_due = 0.0
        while steps > 0:
            taken = min(self._steps_to_output(), steps)
            steps -= taken
            yield self._advance(taken)

    def reset(self) -> State:
        """Put the robot at rest where it started, with flat fins, without gait and external wrench; time goes on.

        The deviation of the current starts again from zero.
        """
        return self._put(*self._start, self.state.time, np.zeros(3))

    def put(
        self, position: Sequence[float], orientation: Sequence[float], twist: FloatArray | None = None,
    ) -> State:
        """Put the robot at a pose [m; x, y, z, w], with flat fins, without gait and wrench; time goes on.

        It is at rest there, or moves with a twist (6,) [m/s, rad/s], components in the body frame.

        Raises
        ------
        ValueError
            A value is not finite, the orientation is not a unit quaternion, or the robot is to move although its base
            is fixed; then nothing changes.

        """
        return self._put(position, orientation, self.state.time, twist=twist)

    @property
    def _start(self) -> tuple[Sequence[float], FloatArray]:
        """Pose [m; x, y, z, w] at which the robot starts."""
        own = self._settings.node
        return own.initial_position, Rotation.from_euler('z', own.initial_yaw).as_quat()

    @property
    def _time_step(self) -> float:
        return self._settings.model.solver.time_step

    def _steps_to_output(self) -> int:
        self._steps_due += 1.0 / (self._settings.node.publish_rate * self._time_step)
        steps = max(1, math.floor(self._steps_due + ROUNDING))
        self._steps_due = max(0.0, self._steps_due - steps)
        return steps

    def _advance(self, steps: int) -> State:
        self._watch_commands()
        before, wrench_steps = self.state, self._steps_with_wrench(steps)
        try:
            if wrench_steps > 0:
                self._simulator.advance(
                    wrench_steps * self._time_step, current=self._current,
                    body_wrench=self._body_wrench, world_wrench=self._world_wrench)
            state = self._simulator.advance((steps - wrench_steps) * self._time_step, current=self._current)
        except DivergenceError as error:
            self.divergences += 1
            wrench = ' A body_wrench acted.' if wrench_steps > 0 else ''
            self._error(
                f'{error}.{wrench} The robot is put at rest where it was, with flat fins: publish a new fin_command.')
            return self._put(before.position, before.orientation, before.time + steps * self._time_step)
        self.transport.add(state, steps * self._time_step)
        return state

    def _steps_with_wrench(self, steps: int) -> int:
        """Return the number of the next steps in which the external wrench acts."""
        left = (self._wrench_ends - self.state.time) / self._time_step
        if left >= steps:
            return steps
        return math.ceil(left - ROUNDING) if left > ROUNDING else 0

    def _at_rest(
        self, position: Sequence[float] | FloatArray, orientation: Sequence[float] | FloatArray, time: float,
        current_deviation: FloatArray,
    ) -> State:
        return dataclasses.replace(
            State.at_rest(self._settings.model), time=time, position=np.array(position),
            orientation=np.array(orientation), current_deviation=current_deviation)

    def _put(
        self, position: Sequence[float] | FloatArray, orientation: Sequence[float] | FloatArray, time: float,
        current_deviation: FloatArray | None = None, twist: FloatArray | None = None,
    ) -> State:
        """Put the robot at rest unless a twist is given; the deviation of the current stays unless one is given."""
        state = self._at_rest(
            position, orientation, time,
            self.state.current_deviation if current_deviation is None else current_deviation)
        state = self._simulator.reset(state if twist is None else dataclasses.replace(state, twist=twist))
        self._commanded_at, self.timed_out = None, False
        self.end_external_wrench()
        return state

    def _watch_commands(self) -> None:
        """Command zero amplitudes if the last command is too old."""
        timeout = self._settings.node.command_timeout
        if timeout == 0.0 or self._commanded_at is None or self.timed_out:
            return
        if self.state.time - self._commanded_at < timeout - ROUNDING * self._time_step:
            return
        if self.state.servos:
            self.timed_out = True
            self._warn(f'no rod_command for {timeout:g} s of simulated time: the rods hold')
        else:
            left, right = (dataclasses.replace(command, amplitude=0.0) for command in self.commands)
            with contextlib.suppress(ValueError):  # not during a transition from which it is impossible
                self._simulator.command(left=left, right=right)
                self.timed_out = True
                self._warn(f'no fin_command for {timeout:g} s of simulated time: the fins glide to rest')

"""The simulated robot behind the topics: it takes commands, advances by ticks, and is put where it is wanted."""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from manta_sim_ros.dynamics import DivergenceError, FinCommand, Simulator, State
from manta_sim_ros.nodes.settings import Settings

ROUNDING = 1e-6  # of the steps due, far above that of their sum and far below a step


class Robot:
    """The simulator as the node runs it: never stopped by what it is told, and its time never runs backward.

    Parameters
    ----------
    settings
        All parameters of the node.
    error, warn
        Take a line: when the motion diverged and the robot was put at rest, and when no command came for too long.

    Raises
    ------
    ValueError
        A value is bad.

    """

    def __init__(
        self, settings: Settings, error: Callable[[str], object], warn: Callable[[str], object],
    ) -> None:
        self._settings = settings
        self._error, self._warn = error, warn
        self._simulator = Simulator(settings.model, state=self._at_rest(*self._start, 0.0, np.zeros(3)))
        self._steps_due = 0.0
        self._commanded_at: float | None = None  # simulated time of the last command that was taken
        self._current: Sequence[float] | None = None  # instead of water.current
        self._body_wrench: Sequence[float] | None = None
        self._world_wrench: Sequence[float] | None = None
        self._wrench_ends = -math.inf  # simulated time
        self.timed_out = False
        """Whether the last command is older than `command_timeout`, and the fins glide to rest."""
        self.divergences = 0
        """How often the motion diverged."""

    @property
    def state(self) -> State:
        """The present state."""
        return self._simulator.state

    @property
    def commands(self) -> tuple[FinCommand, FinCommand]:
        """What the left and the right fin go to."""
        left, right = (FinCommand(*command) for command in self.state.gait_commands)
        return left, right

    @property
    def command_age(self) -> float:
        """Simulated time since the last command that was taken [s], NaN when there was none."""
        return math.nan if self._commanded_at is None else self.state.time - self._commanded_at

    @property
    def finite(self) -> bool:
        """Whether the whole state is finite."""
        return all(bool(np.isfinite(value).all()) for value in vars(self.state).values())

    def check(self, settings: Settings) -> None:
        """Raise a ValueError if the present state could not go on with other settings."""
        Simulator(settings.model, state=self.state)

    def apply(self, settings: Settings) -> None:
        """Go on with other settings, from the present step on."""
        if settings.model != self._settings.model:
            self._simulator = Simulator(settings.model, state=self.state)
        self._settings = settings

    def command(self, left: FinCommand, right: FinCommand) -> None:
        """Command the gaits of both fins.

        Raises
        ------
        ValueError
            A gait is impossible or cannot be reached; nothing changes then.

        """
        self._simulator.command(left=left, right=right)
        self._commanded_at, self.timed_out = self.state.time, False

    @property
    def mean_current(self) -> Sequence[float]:
        """Mean velocity (3,) of the water, world frame [m/s]; `state.current_deviation` comes on top."""
        return self._settings.model.water.current if self._current is None else self._current

    @property
    def pushed(self) -> bool:
        """Whether a wrench from outside acts."""
        return self._wrench_ends > self.state.time + ROUNDING * self._time_step

    def flow(self, current: Sequence[float] | None) -> None:
        """Let the water flow with a mean velocity (3,) in the world frame [m/s]; None: with `water.current`."""
        self._current = current

    def push(
        self, *, body_wrench: Sequence[float] | None = None, world_wrench: Sequence[float] | None = None,
    ) -> None:
        """Let an external wrench (6,) [N, N m] act from now on for `body_wrench_lifetime`, in place of the last one.

        On the body about its center of mass, components in the body frame or in the world frame.
        """
        lifetime = self._settings.node.body_wrench_lifetime
        self._body_wrench, self._world_wrench = body_wrench, world_wrench
        self._wrench_ends = self.state.time + lifetime if lifetime > 0.0 else math.inf

    def release(self) -> None:
        """Let nothing push the robot from now on."""
        self._wrench_ends = -math.inf

    def tick(self) -> State:
        """Advance to the next output, `1 / publish_rate` on, and return its state."""
        return self._advance(self._steps_to_output())

    def ticks(self, duration: float) -> Iterator[State]:
        """Return the states of all outputs in exactly the next `duration` [s]; the last one is at its end.

        Raises
        ------
        ValueError
            It is no whole number of time steps.

        """
        steps = round(duration / self._time_step)
        if steps < 1 or abs(steps - duration / self._time_step) > ROUNDING:
            raise ValueError(
                f'step_duration is {duration:g} s, but must be a whole number of time steps, and solver.time_step is '
                f'{self._time_step:g} s')
        return self._states(steps)

    def _states(self, steps: int) -> Iterator[State]:
        self._steps_due = 0.0
        while steps > 0:
            taken = min(self._steps_to_output(), steps)
            steps -= taken
            yield self._advance(taken)

    def reset(self) -> State:
        """Put the robot at rest where it started, fins flat, not commanded and not pushed; time goes on.

        The deviation of the current begins anew from zero.
        """
        return self._put(*self._start, self.state.time, np.zeros(3))

    def put(self, position: Sequence[float], orientation: Sequence[float]) -> State:
        """Put the robot at rest at a pose [m; x, y, z, w], fins flat, not commanded and not pushed; time goes on.

        Raises
        ------
        ValueError
            A value is not finite, or the orientation is no unit quaternion; nothing changes then.

        """
        return self._put(position, orientation, self.state.time)

    @property
    def _start(self) -> tuple[Sequence[float], np.ndarray]:
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
        before, pushed_steps = self.state, self._pushed_steps(steps)
        try:
            if pushed_steps > 0:
                self._simulator.advance(
                    pushed_steps * self._time_step, current=self._current,
                    body_wrench=self._body_wrench, world_wrench=self._world_wrench)
            return self._simulator.advance((steps - pushed_steps) * self._time_step, current=self._current)
        except DivergenceError as error:
            self.divergences += 1
            pushed = ' A body_wrench acted.' if pushed_steps > 0 else ''
            self._error(f'{error}.{pushed} The robot is put at rest where it was, its fins flat; command it anew.')
            return self._put(before.position, before.orientation, before.time + steps * self._time_step)

    def _pushed_steps(self, steps: int) -> int:
        """Return in how many of the next steps the wrench from outside acts."""
        left = (self._wrench_ends - self.state.time) / self._time_step
        if left >= steps:
            return steps
        return math.ceil(left - ROUNDING) if left > ROUNDING else 0

    def _at_rest(
        self, position: Sequence[float] | np.ndarray, orientation: Sequence[float] | np.ndarray, time: float,
        current_deviation: np.ndarray,
    ) -> State:
        return dataclasses.replace(
            State.at_rest(self._settings.model), time=time, position=np.array(position),
            orientation=np.array(orientation), current_deviation=current_deviation)

    def _put(
        self, position: Sequence[float] | np.ndarray, orientation: Sequence[float] | np.ndarray, time: float,
        current_deviation: np.ndarray | None = None,
    ) -> State:
        """Put the robot at rest; the water goes on as it is if no `current_deviation` is given."""
        state = self._simulator.reset(self._at_rest(
            position, orientation, time,
            self.state.current_deviation if current_deviation is None else current_deviation))
        self._commanded_at, self.timed_out = None, False
        self.release()
        return state

    def _watch_commands(self) -> None:
        """Let the amplitudes glide to zero when the last command is too old."""
        timeout = self._settings.node.command_timeout
        if timeout == 0.0 or self._commanded_at is None or self.timed_out:
            return
        if self.state.time - self._commanded_at >= timeout - ROUNDING * self._time_step:
            left, right = (dataclasses.replace(command, amplitude=0.0) for command in self.commands)
            with contextlib.suppress(ValueError):  # not from where the gait is just now: it is on its way to another
                self._simulator.command(left=left, right=right)
                self.timed_out = True
                self._warn(f'no fin_command for {timeout:g} s of simulated time: the fins glide to rest')

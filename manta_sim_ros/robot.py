"""The simulated robot behind the topics: it takes commands, advances by ticks, and is put where it is wanted."""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from manta_sim_ros.dynamics import DivergenceError, FinCommand, Simulator, State
from manta_sim_ros.parameters_ros import Settings

LEVEL = (0.0, 0.0, 0.0, 1.0)  # x, y, z, w
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
        self._simulator = Simulator(settings.model)
        self._steps_due = 0.0
        self._commanded_at: float | None = None  # simulated time of the last command that was taken
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

    def put(self, position: Sequence[float] = (0.0, 0.0, 0.0), orientation: Sequence[float] = LEVEL) -> State:
        """Put the robot at rest at a pose [m; x, y, z, w], its fins flat and not commanded; time goes on from now.

        Raises
        ------
        ValueError
            A value is not finite, or the orientation is no unit quaternion; nothing changes then.

        """
        return self._put(np.array(position), np.array(orientation), self.state.time)

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
        try:
            return self._simulator.advance(steps * self._time_step)
        except DivergenceError as error:
            self.divergences += 1
            self._error(f'{error}. The robot is put at rest where it was, its fins flat; command it anew.')
            before = self.state
            return self._put(before.position, before.orientation, before.time + steps * self._time_step)

    def _put(self, position: np.ndarray, orientation: np.ndarray, time: float) -> State:
        state = self._simulator.reset(dataclasses.replace(
            State.at_rest(self._settings.model), time=time, position=position, orientation=orientation))
        self._commanded_at, self.timed_out = None, False
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

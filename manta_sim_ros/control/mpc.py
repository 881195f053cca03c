"""The model-predictive path follower: it plans the gaits of the next seconds with a model of the averaged motion."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

import numpy as np

from manta_sim_ros.control.averaged_model import GAIT, MODELS, AveragedModel, read_model
from manta_sim_ros.control.averaged_motion import STATES
from manta_sim_ros.control.averaging import PeriodAverage
from manta_sim_ros.control.follower import ARRIVED
from manta_sim_ros.control.gaits import Gaits, check_limits, gaits
from manta_sim_ros.control.motion_filter import MotionFilter
from manta_sim_ros.control.mpc_settings import MpcSettings
from manta_sim_ros.control.plan import SHORTEST_LAG, NoPlanError, Plan, Planner
from manta_sim_ros.control.polyline import Polyline
from manta_sim_ros.dynamics import FloatArray, Parameters

SEARCHED = 3.6
"""Length of the path in which the point nearest to the robot is searched [m]."""

SLOWEST, FASTEST = 0.4, 3.0
"""Speeds over ground between which the points of a plan are searched, over the speed that is preferred."""

AWAY = math.radians(100.0)
"""Angle between heading and path from which the robot turns to the path without an optimization, whose time ahead is
shorter than the turn."""

LONGEST_PAUSE = 1.0
"""Longest time between two commands [s]; after a longer one the estimate begins again."""


class MpcFollower:
    """Follows a path in space with the gaits of both fins, as `PathFollower` does, with a plan for each command.

    Parameters
    ----------
    path
        The path.
    settings
        Limits, horizon and weights.
    model
        The averaged model of the robot; by default that of config/freshwater.yaml.
    parameters
        All values of the model, whose mechanism limits the gaits.
    warn
        Called with one line when there is no plan, and with another one when the robot begins to glide for this reason.

    Raises
    ------
    ValueError
        The rods cannot follow a gait within the limits; names the value and the bound.

    """

    def __init__(
        self, path: Polyline, settings: MpcSettings | None = None, model: AveragedModel | None = None,
        parameters: Parameters | None = None, *, warn: Callable[[str], object] | None = None,
    ) -> None:
        settings = MpcSettings() if settings is None else settings
        model = read_model(MODELS['freshwater']) if model is None else model
        check_gaits(settings, model, Parameters() if parameters is None else parameters)
        self.settings, self._model = settings, model
        self._average = PeriodAverage(model.period)
        self._filter = MotionFilter(model)
        self._planner = Planner(model, settings)
        self._gaits: deque[tuple[float, FloatArray]] = deque()  # durations, and what was in force at their ends
        self._time = self._begun = self._planned = math.nan
        self._command, self._gait = np.zeros(len(GAIT)), np.zeros(len(GAIT))
        self._plan: Plan | None = None
        self._warn, self._warned = warn, ''
        self.follow(path)

    def follow(self, path: Polyline) -> None:
        """Follow another path from now on, from its beginning; what is known of the current is kept."""
        self.path, self._station = path, 0.0
        self._astray = True  # the last plan is no good guess

    @property
    def finished(self) -> bool:
        """Whether the end of the path was reached."""
        return self._station >= self.path.length - ARRIVED

    @property
    def current(self) -> FloatArray:
        """(2,) estimate of the velocity of the water [m/s], world frame."""
        return self._filter.state[len(STATES):len(STATES) + 2]

    def observe(self, time: float, position: FloatArray, orientation: FloatArray, twist: FloatArray) -> None:
        """Take a sample: time [s], position (3,) [m], orientation (x, y, z, w), twist (6,) in the body frame."""
        self._average.add(time, position, orientation, twist)

    def command(self, time: float) -> Gaits:
        """Return the gaits of both fins at a time [s], after one sample or more; at rest at the end of the path."""
        elapsed = time - self._time
        self._time = time
        if not 0.0 < elapsed <= LONGEST_PAUSE:  # also at the first time, and when it goes back
            elapsed = 0.0
            self._begin()
        state = self._estimate(elapsed)
        position = state[9:12]
        self._station = self.path.project(position, self._station, self._station + SEARCHED).station
        if self.finished:
            return self.glide()
        self._replan(state)
        change = self.settings.rate_limit * elapsed
        self._command = self._command + np.clip(self._wanted() - self._command, -change, change)
        return self._fins()

    def glide(self) -> Gaits:
        """Return the gaits with which the robot glides to rest, and forget how it moved."""
        self._time = math.nan
        self._average.clear()
        self._plan = None
        self._command = np.zeros(len(GAIT))
        return self._fins()

    def _begin(self) -> None:
        self._begun = self._time
        self._gaits.clear()
        self._gait = self._command
        self._plan = None
        self._filter.begin(self._average.mean)

    def _estimate(self, elapsed: float) -> FloatArray:
        """Return STATES and DISTURBANCES at this time, which is half a period later than the mean motion."""
        if elapsed > 0.0:
            approach = 1.0 - math.exp(-elapsed / max(self._model.gait_lag, SHORTEST_LAG))
            self._gait = self._gait + approach * (self._command - self._gait)
            self._gaits.append((elapsed, self._gait))
            while sum(step for step, _ in self._gaits) > self._model.period + 1e-9:
                self._gaits.popleft()
            self._filter.update(self._average.mean, np.mean([gait for _, gait in self._gaits], axis=0), elapsed)
        lag, since = 0.5 * min(self._model.period, self._time - self._begun), []
        for step, gait in reversed(self._gaits):
            if lag <= 0.0:
                break
            since.append((min(step, lag), gait))
            lag -= step
        return self._filter.ahead(since[::-1])

    def _replan(self, state: FloatArray) -> None:
        """Plan from STATES and DISTURBANCES on, or keep the last plan and say why."""
        settings = self.settings
        start = np.concatenate([state[:len(STATES)], self._gait])
        age = (self._time - self._planned) / settings.interval
        guess = self._first_guess(state) if self._plan is None or self._astray else self._plan.later(age)
        way = settings.speed * settings.interval
        if min(abs(self._turn(station, state)) for station in self._ahead()) > AWAY:
            self._plan, self._planned, self._astray = self._first_guess(state), self._time, True
            return
        points = self.path.points_near(guess.states[:, 9:12], self._station, (SLOWEST * way, FASTEST * way))
        try:
            self._plan = self._planner.plan(start, state[len(STATES):], points, guess)
            self._planned, self._warned, self._astray = self._time, '', False
        except NoPlanError as error:
            self._astray = True
            if not self._time - self._planned <= settings.patience:
                self._plan = None
            self._tell('the robot glides to rest' if self._plan is None else 'the last plan goes on', error)

    def _ahead(self) -> FloatArray:
        """Return the stations of a robot that swims along the path from now on, at the beginning of each stage [m]."""
        way = self.settings.interval * self.settings.speed
        return self._station + np.arange(self.settings.stages, dtype=float) * way

    def _turn(self, station: float, state: FloatArray) -> float:
        """Return the angle from the heading in a state to the direction of the path at a station [rad]."""
        x, y = self.path.leg_at(station)[3:5]
        return math.remainder(math.atan2(y, x) - float(state[8]), 2.0 * math.pi)

    def _tell(self, consequence: str, error: NoPlanError) -> None:
        """Warn, but only once of the same consequence."""
        if self._warn is not None and consequence != self._warned:
            self._warn(f'no plan ({error}): {consequence}')
        self._warned = consequence

    def _wanted(self) -> FloatArray:
        """Return the GAIT that the plan has for this time, or rest if there is no plan."""
        if self._plan is None:
            return np.zeros(len(GAIT))
        stage = int((self._time - self._planned) / self.settings.interval + 1e-6)
        return self._plan.commands[min(stage, self.settings.stages - 1)]

    def _first_guess(self, state: FloatArray) -> Plan:
        """Return a plan in which the robot turns to the path and cruises along it: from a given state on."""
        settings, limit = self.settings, self.settings.largest_steering
        amplitude = 0.5 * (settings.least_amplitude + settings.largest_amplitude)
        states, commands = [np.concatenate([state[:len(STATES)], self._gait])], []
        for station in self._ahead():
            turn = self._turn(station, state)
            gait = np.array([amplitude, min(max(turn, -limit), limit), 0.0])
            state = self._filter.moved(state, gait, settings.interval)
            states.append(np.concatenate([state[:len(STATES)], gait]))
            commands.append(gait)
        return Plan(np.array(states), np.array(commands))

    def _fins(self) -> Gaits:
        amplitude, steering, bias = self._command.tolist()
        return gaits(self._model.frequency, self._model.phase, amplitude, steering, bias)


def check_gaits(settings: MpcSettings, model: AveragedModel, parameters: Parameters) -> None:
    """Refuse settings whose gaits, up to the limits, the rods cannot follow.

    Raises
    ------
    ValueError
        Names the value and the bound.

    """
    if not settings.least_amplitude < settings.largest_amplitude:
        raise ValueError(f'least_amplitude is {settings.least_amplitude:g} rad, but must be below largest_amplitude, '
                         f'{settings.largest_amplitude:g} rad')
    check_limits('the path follower', parameters, model.frequency, model.phase, [settings.largest_amplitude],
                 settings.largest_steering, settings.largest_bias)

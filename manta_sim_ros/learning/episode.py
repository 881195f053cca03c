"""One robot on its way to a target: what the single and the vector environment have in common."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from manta_sim_ros.dynamics import LARGEST_SEED, DivergenceError, FloatArray, Parameters, Simulator, shown
from manta_sim_ros.learning.actions import check_limits, command
from manta_sim_ros.learning.observations import observe
from manta_sim_ros.learning.settings import SwimSettings
from manta_sim_ros.sensors import OdometryNoise

RANDOMIZED = (
    ('body', 'mass'), ('body', 'inertia'), ('body', 'drag_coefficient'), ('body', 'added_mass'),
    ('body', 'quadratic_damping'), ('water', 'density'), ('water', 'added_mass_density'),
)
"""Group and name of the parameters that are multiplied by a random factor each, vectors as a whole."""

SAMPLES = 4
"""Samples of the power of the motors in a step of the environment."""


class Outcome(NamedTuple):
    """What a step of the environment gives, beside the observation."""

    reward: float
    terminated: bool
    info: dict[str, Any]


class Episode:
    """A robot that swims to a target, from rest at the origin.

    Parameters
    ----------
    parameters
        All values of the model, before they are randomized.
    settings
        The options of the environment.

    Raises
    ------
    ValueError
        The mechanism cannot follow all actions, or the control period is no multiple of SAMPLES time steps.

    """

    def __init__(self, parameters: Parameters, settings: SwimSettings) -> None:
        check_limits(parameters, settings.action)
        self._parameters, self._settings = parameters, settings
        time_step, period = parameters.solver.time_step, settings.control_period
        samples = round(period / (SAMPLES * time_step))
        if samples < 1 or not math.isclose(samples * SAMPLES * time_step, period, rel_tol=1e-9):
            raise ValueError(
                f'control_period is {period:g} s, but must be a multiple of {SAMPLES} steps of solver.time_step, '
                f'{time_step:g} s')
        self._interval = period / SAMPLES
        self._simulator = Simulator(parameters)
        self._noise = OdometryNoise()
        self._target = np.zeros(3)
        self._divergence: DivergenceError | None = None
        self._distance = self._work = 0.0

    def begin(self, generator: np.random.Generator, options: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """Put the robot at rest at the origin, draw the target and what is randomized, and return the info.

        The options may have the key `target`: its position (3,) [m], world frame, which is then not drawn.

        Raises
        ------
        ValueError
            The options have another key, or the target is not three finite numbers.

        """
        options = {} if options is None else options
        if unknown := set(options) - {'target'}:
            raise ValueError(f'options has {shown(sorted(unknown, key=str)[0])}, but can have target only')
        settings = self._settings
        draws = generator.uniform(size=5)  # always as many, so that a target does not depend on the options
        factors = 1.0 + settings.randomization * generator.uniform(-1.0, 1.0, len(RANDOMIZED))
        self._noise = OdometryNoise(
            position=settings.position_noise, orientation=settings.orientation_noise,
            linear_velocity=settings.linear_velocity_noise, angular_velocity=settings.angular_velocity_noise,
            seed=int(generator.integers(LARGEST_SEED)))
        away = settings.nearest_target + (settings.farthest_target - settings.nearest_target) * draws[0]
        bearing = settings.largest_bearing * (2.0 * draws[1] - 1.0)
        self._target = np.array((
            away * math.cos(bearing), away * math.sin(bearing), settings.largest_height * (2.0 * draws[2] - 1.0)))
        if 'target' in options:
            self._target = _position(options['target'])
        speed, course = settings.largest_current * draws[3], 2.0 * math.pi * draws[4]
        if settings.randomization > 0.0 or speed > 0.0:
            self._simulator = Simulator(self._drawn(factors, speed, course))
        else:
            self._simulator.reset()
        self._divergence = None
        self._distance = self._true_distance()
        return {'target': self._target.copy()}

    def _drawn(self, factors: FloatArray, speed: float, course: float) -> Parameters:
        """Return the parameters with these factors, and with a current [m/s] added in a direction [rad]."""
        groups: dict[str, dict[str, Any]] = {'body': {}, 'water': {}}
        for (group, name), factor in zip(RANDOMIZED, factors.tolist(), strict=True):
            groups[group][name] = np.multiply(factor, getattr(getattr(self._parameters, group), name)).tolist()
        x, y, z = self._parameters.water.current
        groups['water']['current'] = (x + speed * math.cos(course), y + speed * math.sin(course), z)
        return self._parameters.replace(**groups)

    def command(self, action: NDArray[np.floating[Any]]) -> None:
        """Command the fins as an action says.

        Raises
        ------
        ValueError
            The action has a wrong shape or is not finite.

        """
        command(self._simulator, self._settings.action, action)

    def advance(self) -> None:
        """Advance by the control period; other threads run meanwhile. A robot that diverges stays where it was."""
        self._work = 0.0
        for _ in range(SAMPLES):
            try:
                state = self._simulator.advance(self._interval)
            except DivergenceError as error:
                self._divergence = error
                return
            self._work += self._interval * float(np.maximum(state.rod_torques * state.rod_rates, 0.0).sum())

    def observation(self) -> FloatArray:
        """Return the present observation (21,), as OBSERVATION says."""
        return observe(self._simulator.state, self._target, self._noise)

    def outcome(self) -> Outcome:
        """Return reward, end and info of the step that was made last.

        The reward is the progress toward the target [m] less the work of the motors with its weight. The work is the
        mean of SAMPLES of their power, times the period; power that a motor takes up is not counted.
        """
        before, work = self._distance, self._work
        self._distance = distance = self._true_distance()
        reached = distance <= self._settings.reach
        info: dict[str, Any] = {'distance': distance, 'work': work, 'is_success': reached}
        if self._divergence is not None:
            info['divergence'] = str(self._divergence)
        reward = before - distance - self._settings.effort_weight * work
        return Outcome(reward, reached or self._divergence is not None, info)

    def _true_distance(self) -> float:
        offset = self._target - self._simulator.state.position
        return math.sqrt(offset @ offset)


def _position(values: Any) -> FloatArray:
    """Return a position given by the user, or raise a ValueError."""
    try:
        position = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        position = np.full(0, math.nan)
    if position.shape != (3,) or not np.isfinite(position).all():
        raise ValueError(f'target is {shown(values)}, but must be three finite numbers [m]')
    return position

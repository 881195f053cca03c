"""The Poincaré map of a periodic gait: the state of the robot after one flapping period, and its fixed point.

Where the robot is and where it heads to has no influence on its motion, so that x, y and heading are left out, and the
depth, too, unless a part of the robot is above the surface of the water. A fixed point is a cruise or a steady turn.
"""

from __future__ import annotations

import dataclasses
import math
import warnings
from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from manta_sim_ros.dynamics import (
    DivergenceError,
    FinCommand,
    FloatArray,
    ModelWarning,
    Parameters,
    Simulator,
    State,
    immersed_shares,
    simulate_batch,
    step_warning,
)

BODY = ('u', 'v', 'w', 'p', 'q', 'r', 'roll', 'pitch')
"""Coordinates of the body: twist in the body frame [m/s, rad/s], roll and pitch [rad]."""

DEPTH = 'z'
"""Coordinate of the body near the surface: height of the center of mass in the world [m]."""

SAMPLES = 50
"""Samples of a period, for means."""

SETTLING = 20
"""Periods that the robot swims from rest before the fixed point is searched."""

MOST_ITERATIONS = 30

TOLERANCE = 1e-9
"""Largest change in a period of a coordinate of the body or of a joint at a fixed point [m/s, rad/s, rad]."""

STEP = 1e-5
"""Half of the difference of central differences [SI units]: errors of second order and of rounding are below 1e-8."""

DEEPEST_STEP = 0.01
"""Largest change of the depth in an iteration [m]: near the surface, the forces change within centimeters."""

STEEPEST = math.radians(80.0)
"""Largest roll and pitch of a robot that swims upright [rad]."""


class NoEquilibriumError(ValueError):
    """The gait has no cruise and no steady turn that was found."""


class PeriodMap:
    """The Poincaré map of two gaits of the same frequency.

    Parameters
    ----------
    parameters
        All values of the model. `solver.time_step` becomes the largest that is not larger and divides a sample.
    left, right
        The gaits.

    Raises
    ------
    ValueError
        There is no period, since the frequencies differ or a fin is at rest; a gait is impossible; the water flows; the
        body is held; or no step of this size is stable.

    """

    def __init__(self, parameters: Parameters, left: FinCommand, right: FinCommand) -> None:
        if left.frequency != right.frequency:
            raise ValueError(
                f'the frequencies are {left.frequency:g} Hz left and {right.frequency:g} Hz right, but must be the '
                'same: with different ones the motion has no period')
        for side, gait in (('left', left), ('right', right)):
            for name, unit in (('frequency', 'Hz'), ('amplitude', 'rad')):
                value = getattr(gait, name)
                if not value > STEP:
                    raise ValueError(
                        f'the {side} {name} is {value:g} {unit}, but must be above {STEP:g}: both fins flap')
        if any(parameters.water.current) or any(parameters.water.current_deviation):
            raise ValueError(
                f'water.current is {list(parameters.water.current)} m/s and water.current_deviation '
                f'{list(parameters.water.current_deviation)} m/s, but both must be 0: in a current the heading matters')
        if parameters.solver.fixed_base:
            raise ValueError('solver.fixed_base is true, but must be false: a body that is held has no motion')
        self.gaits = left, right
        self.period = 1.0 / left.frequency
        steps = SAMPLES * math.ceil(self.period / (SAMPLES * parameters.solver.time_step) - 1e-9)
        self.parameters = parameters.replace(solver={'time_step': self.period / steps})
        warning = step_warning(self.parameters, left, right)
        if warning is not None:
            raise ValueError(warning)
        self.names: tuple[str, ...] = BODY

    def coordinates(self, state: State) -> FloatArray:
        """Return the coordinates (`names`) of the body."""
        _, pitch, roll = Rotation.from_quat(state.orientation).as_euler('ZYX')
        values = np.array([*state.twist, roll, pitch, state.position[2]])
        return values[:len(self.names)]

    def moved(self, state: State, coordinates: FloatArray) -> State:
        """Return a state with these coordinates of the body, at x = y = 0 with heading 0 at time 0."""
        height = coordinates[len(BODY)] if DEPTH in self.names else state.position[2]
        roll, pitch = coordinates[6:8]
        return dataclasses.replace(
            state, time=0.0, start_time=0.0, step_count=0, position=np.array([0.0, 0.0, height]),
            orientation=Rotation.from_euler('ZYX', [0.0, pitch, roll]).as_quat(), twist=coordinates[:6])

    def advance(self, states: Sequence[State], gaits: Sequence[tuple[FinCommand, FinCommand] | None] | None = None,
                ) -> list[list[State]]:
        """Return the SAMPLES states of the next period of each robot.

        Raises
        ------
        NoEquilibriumError
            A robot diverged.

        """
        with warnings.catch_warnings():
            warnings.simplefilter('ignore', ModelWarning)
            records = simulate_batch(self.parameters, states, gaits, self.period, every=self.period / SAMPLES)
        for record in records:
            if isinstance(record, DivergenceError):
                raise NoEquilibriumError(f'no equilibrium: the robot diverges, {record}')
        return [record for record in records if not isinstance(record, DivergenceError)]

    def settle(self, start: State | None = None) -> State:
        """Return the state at a fixed point, at x = y = 0 with heading 0.

        The robot swims for SETTLING periods, from rest by default. Then the method of Newton and Picard goes on:
        Newton's method for the coordinates of the body, and the period map itself for the fins, which forget their
        state within a period or two. It also finds fixed points that are not stable.

        Raises
        ------
        NoEquilibriumError
            None was found, or the robot diverges or tumbles.

        """
        simulator = Simulator(self.parameters, start)
        simulator.command(left=self.gaits[0], right=self.gaits[1])
        state = simulator.state
        for _ in range(SETTLING):
            samples, = self.advance([state])
            state = self._upright(samples[-1])
        if self._at_surface(samples):
            self.names = (*BODY, DEPTH)
        change = math.inf
        for _ in range(MOST_ITERATIONS):
            state = self.moved(state, self.coordinates(state))
            samples, = self.advance([state])
            after = self._upright(samples[-1])
            residual = self.coordinates(after) - self.coordinates(state)
            change = max(float(np.abs(residual).max()), float(np.abs(after.joint_angles - state.joint_angles).max()))
            if change < TOLERANCE:
                if DEPTH in self.names and not self._at_surface(samples):
                    raise NoEquilibriumError(
                        f'no equilibrium: the robot leaves the surface of the water, z is {after.position[2]:.3g} m')
                return state
            newton = np.linalg.solve(np.eye(len(residual)) - self.body_jacobian(state), residual)
            if DEPTH in self.names:
                newton *= min(1.0, DEEPEST_STEP / abs(newton[-1]))
            state = self._upright(self.moved(after, self.coordinates(state) + newton))
        raise NoEquilibriumError(
            f'no equilibrium: after {MOST_ITERATIONS} iterations the state still changes by {change:.2g} in a period, '
            f'but the bound is {TOLERANCE:g}')

    def body_jacobian(self, state: State) -> FloatArray:
        """Return the derivatives of the coordinates after a period with respect to those before, fins as they are."""
        records = self.advance(self.perturbed(state))
        return difference([self.coordinates(record[-1]) for record in records])

    def perturbed(self, state: State) -> list[State]:
        """Return two states for each coordinate of the body: STEP above the given state, and STEP below."""
        coordinates = self.coordinates(state)
        return [self.moved(state, coordinates + step) for step in steps(len(coordinates))]

    def _at_surface(self, samples: Sequence[State]) -> bool:
        """Whether a part of the robot is above the surface of the water at a time."""
        return any(_above_water(self.parameters, sample) for sample in samples)

    def _upright(self, state: State) -> State:
        """Return the state, or raise an error if it is not upright."""
        roll, pitch = self.coordinates(state)[6:8]
        if not max(abs(roll), abs(pitch)) < STEEPEST:
            raise NoEquilibriumError(
                f'no equilibrium: the robot tumbles, roll is {math.degrees(roll):.0f} and pitch '
                f'{math.degrees(pitch):.0f} degrees, but both must stay within {math.degrees(STEEPEST):.0f}')
        return state


def steps(size: int) -> FloatArray:
    """Return the perturbations (2 size, size): for each coordinate STEP, then -STEP."""
    return np.repeat(STEP * np.eye(size), 2, axis=0) * np.tile([1.0, -1.0], size)[:, None]


def difference(values: Sequence[FloatArray]) -> FloatArray:
    """Return the derivatives (k, size) of values (2 size, k) that follow from `steps`."""
    array = np.array(values)
    return (array[::2] - array[1::2]).T / (2.0 * STEP)


def _above_water(parameters: Parameters, state: State) -> bool:
    body, links = immersed_shares(parameters, state)
    return min(body, float(links.min())) < 1.0

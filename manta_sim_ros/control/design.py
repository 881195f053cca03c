"""The command `path_gains`: gains of the path follower, from the linear model per flapping period."""

from __future__ import annotations

import dataclasses
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg

from manta_sim_ros.control.settings import FollowerSettings
from manta_sim_ros.dynamics import FloatArray, Parameters, compile_kernels
from manta_sim_ros.studies.arguments import Parser
from manta_sim_ros.studies.linear_model import FASTEST_DECAY, LinearModel
from manta_sim_ros.studies.linearize import linearize
from manta_sim_ros.studies.poincare import NoEquilibriumError

STEERING = {'left_phase': -1.0, 'right_phase': 1.0}
"""What each input is changed by, per unit of the control."""
BIAS = {'left_front_bias': 1.0, 'right_front_bias': 1.0, 'left_rear_bias': -1.0, 'right_rear_bias': -1.0}
AMPLITUDE = {'left_amplitude': 1.0, 'right_amplitude': 1.0}

LARGEST_STEERING, LARGEST_BIAS, LARGEST_AMPLITUDE = math.radians(12.0), math.radians(8.0), math.radians(10.0)
"""Controls [rad] that cost as much as the errors below: weights by the rule of Bryson."""
HEADING, CROSS_TRACK = math.radians(30.0), 0.1  # rad, m
HEIGHT, HEIGHT_INTEGRAL = 0.1, 1.5  # m, m s
SPEED, SPEED_INTEGRAL = 0.1, 0.3  # m/s, m


def gains(model: LinearModel) -> dict[str, tuple[float, ...]]:
    """Return the gains of FollowerSettings by name: linear-quadratic regulators of the motion per flapping period.

    The dynamics of each are a block of `body_A`. Heading, cross-track error and height are integrals of means over a
    period. The states of the body have no weight.
    """
    U, T = float(model.means[0]), model.period
    steering = _Block(model, ('v', 'p', 'r', 'roll'), STEERING)
    steering.add_integral(T * steering.mean('r'))
    steering.add_integral(T * (steering.mean('v') + U * steering.last))
    depth = _Block(model, ('w', 'q', 'pitch'), BIAS)
    depth.add_integral(T * (depth.mean('w') - U * depth.mean('pitch')))  # a positive pitch lowers the nose
    depth.add_integral(T * depth.last)
    speed = _Block(model, ('u',), AMPLITUDE)
    speed.add_integral(T * speed.mean('u'))
    return {
        'steering_gains': steering.regulator(LARGEST_STEERING, HEADING, CROSS_TRACK),
        'depth_gains': depth.regulator(LARGEST_BIAS, HEIGHT, HEIGHT_INTEGRAL),
        'speed_gains': speed.regulator(LARGEST_AMPLITUDE, SPEED, SPEED_INTEGRAL),
    }


def averaged(model: LinearModel) -> dict[str, float | tuple[float, ...]]:
    """Return what FollowerSettings has of the averaged motion by name: response to amplitude and steering, sideslip."""
    speed, turn = _Block(model, ('u',), AMPLITUDE), _Block(model, ('r',), STEERING)
    decay = max(float(speed.A[0, 0]), FASTEST_DECAY)
    drift = _Block(model, ('v', 'p', 'roll', 'r'), STEERING)
    with_rate = np.linalg.solve(np.eye(3) - drift.A[:3, :3], drift.A[:3, 3])  # per yaw rate, while that is constant
    return {
        'speed_model': (float(speed.B[0]) / (1.0 - decay), -model.period / math.log(decay)),
        'turn_response': float(turn.B[0]) / model.period,
        'sideslip': float(drift.mean('v')[:4] @ [*with_rate, 1.0]),
    }


class _Block:
    """Some states of the body, with one control, and integrals of them."""

    def __init__(self, model: LinearModel, states: tuple[str, ...], control: dict[str, float]) -> None:
        self._model = model
        self._index = [model.states.index(name) for name in states]
        self._change = np.array([control.get(name, 0.0) for name in model.inputs])
        self.A = model.body_A[np.ix_(self._index, self._index)]
        self.B = model.body_B[self._index] @ self._change

    def mean(self, name: str) -> FloatArray:
        """Return the mean over a period as a row of factors of the states and of the control (n + 1,)."""
        model, row = self._model, self._model.outputs.index(f'mean_{name}')
        smoothed = model.C[row, model.size + 2:]
        direct = (model.D[row] + smoothed if smoothed.size else model.D[row]) @ self._change
        integrals = np.zeros(len(self.A) - len(self._index))
        return np.concatenate([model.C[row, self._index], integrals, [direct]])

    @property
    def last(self) -> FloatArray:
        """The last state as a row as above."""
        return np.eye(len(self.A) + 1)[len(self.A) - 1]

    def add_integral(self, change: FloatArray) -> None:
        """Append a state that changes by this row in a period."""
        self.A = np.block([[self.A, np.zeros((len(self.A), 1))], [change[:-1], np.ones(1)]])
        self.B = np.append(self.B, change[-1])

    def regulator(self, control: float, *errors: float) -> tuple[float, ...]:
        """Return the gains of the regulator for which the last states with these errors cost as much as the control."""
        weights = np.concatenate([np.zeros(len(self.A) - len(errors)), np.array(errors) ** -2.0])
        B, R = self.B[:, np.newaxis], np.array([[control ** -2.0]])
        P = scipy.linalg.solve_discrete_are(self.A, B, np.diag(weights), R)
        return tuple(np.linalg.solve(R + B.T @ P @ B, B.T @ P @ self.A)[0].tolist())


def main(args: Sequence[str] | None = None) -> None:
    """Run the command; the exit status is 0, 1 if there is no cruise, or 2 for wrong input."""
    parser = Parser(prog='path_gains', description='Compute the gains of path_follower from the linear model of a '
                                                   'cruise, and print them as a parameter file.')
    parser.add_argument('--config', type=Path, metavar='FILE',
                        help='a ROS 2 parameter file with parameters of /manta_sim (default: the built-in values)')
    parser.add_argument('--amplitude', type=float, default=20.0, help='of the cruise [degrees] (default: 20)')
    parser.add_argument('--frequency', type=float, default=0.6, help='of the cruise [Hz] (default: 0.6)')
    options = parser.parse_args(args)
    try:
        parameters = Parameters() if options.config is None else Parameters.from_yaml(options.config)
        check_degrees(options.amplitude)
        settings = FollowerSettings(amplitude=math.radians(options.amplitude), frequency=options.frequency)
        compile_kernels(parameters, lambda line: print(line, file=sys.stderr))
        print(parameter_file(design(parameters, settings)), end='')
    except NoEquilibriumError as error:
        sys.exit(f'{parser.prog}: {error}')
    except (OSError, ValueError) as error:
        parser.error(str(error))


def check_degrees(amplitude: float) -> None:
    """Raise a ValueError if an amplitude [degrees] is out of the bounds of that of FollowerSettings."""
    about = FollowerSettings.quantities()['amplitude']
    low, high = math.degrees(about.low), math.degrees(about.high)
    if not low <= amplitude <= high:
        raise ValueError(f'--amplitude is {amplitude:g}, but must be from {low:.1f} to {high:.1f} degrees')


def design(parameters: Parameters, settings: FollowerSettings) -> FollowerSettings:
    """Return settings with the gains, the speed and the averaged motion of their cruise.

    Raises
    ------
    ValueError
        As of `linearize`.

    """
    model = linearize(parameters, settings.cruise, settings.cruise)
    rounded: dict[str, Any] = {
        name: tuple(map(_rounded, value)) if isinstance(value, tuple) else _rounded(value)
        for name, value in {**averaged(model), **gains(model)}.items()}
    return dataclasses.replace(settings, speed=math.floor(100.0 * model.means[0]) / 100.0, **rounded)


def _rounded(value: float) -> float:
    return float(f'{value:.4g}')


def parameter_file(settings: FollowerSettings) -> str:
    """Return the cruise, the speed and the gains as a parameter file of ROS 2."""
    names = ('amplitude', 'frequency', 'phase', 'speed', 'speed_model', 'turn_response', 'sideslip', 'steering_gains',
             'depth_gains', 'speed_gains')
    values = {name: getattr(settings, name) for name in names}
    lines = (f'    {name}: {list(value) if isinstance(value, tuple) else f"{value:.4g}"}'
             for name, value in values.items())
    return '\n'.join(['/**:', '  ros__parameters:', *lines, ''])

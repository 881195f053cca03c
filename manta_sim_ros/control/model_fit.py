"""The command `averaged_model`: the averaged model of a robot, fitted to simulated swims with gaits at random."""

from __future__ import annotations

import math
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from manta_sim_ros.control.averaged_model import TWIST, AveragedModel, product, terms_of, variables
from manta_sim_ros.control.mpc_settings import MpcSettings
from manta_sim_ros.dynamics import (
    DivergenceError,
    FinCommand,
    FloatArray,
    ModelWarning,
    Parameters,
    Simulator,
    State,
    compile_kernels,
    simulate_batch,
)
from manta_sim_ros.studies.arguments import Parser

SAMPLES = 20
"""Samples of the motion in a flapping period."""

HOLD = (2.0, 6.0)
"""Shortest and longest time for which a gait is held [s]."""

LEAST_AMPLITUDE = math.radians(7.0)
"""Least amplitude of a swim [rad]: below that of a plan, as gaits change gradually."""

DEGREE = 2
"""Largest number of variables in a term."""

LEAST_PART = 0.06
"""Part of the variation of a rate that a term must contribute; other terms are left out."""

RIDGE = 1e-4
"""Weight of the coefficients, which are scaled by the variation of their terms, in the least squares."""


def swims(parameters: Parameters, settings: MpcSettings, gait: FinCommand, robots: int, duration: float, seed: int,
          ) -> FloatArray:
    """Return the motion of robots whose amplitude, steering and bias change at random within the limits of a plan.

    Parameters
    ----------
    parameters
        All values of the model; the water must not flow.
    settings
        Limits of the gait.
    gait
        Its frequency and its phase are those of all gaits.
    robots, duration
        Number of swims, each of this duration [s].
    seed
        Of the gaits.

    Returns
    -------
    array
        (robots, n, 15): at SAMPLES times of each period twist (6), roll, pitch, heading, position (3) and GAIT (3).

    Raises
    ------
    ValueError
        The water flows, or a gait is impossible; names the value.
    DivergenceError
        A motion diverged.

    """
    if any(parameters.water.current) or any(parameters.water.current_deviation):
        raise ValueError(f'water.current is {list(parameters.water.current)} m/s, but must be 0 and constant')
    interval = 1.0 / (gait.frequency * SAMPLES)
    steps = math.ceil(interval / parameters.solver.time_step - 1e-9)
    parameters = parameters.replace(solver={'time_step': interval / steps})
    generator = np.random.default_rng(seed)
    high = np.array([settings.largest_amplitude, settings.largest_steering, settings.largest_bias])
    low = np.array([LEAST_AMPLITUDE, *-high[1:]])
    states = [Simulator(parameters).state] * robots
    ends = np.zeros(robots, dtype=int)
    rows = []
    for sample in range(round(duration / interval)):
        commands: list[tuple[FinCommand, FinCommand] | None] = [None] * robots
        for robot in np.flatnonzero(ends <= sample):
            amplitude, steering, bias = generator.uniform(low, high)
            left, right = (FinCommand(amplitude, gait.frequency, gait.phase + change, bias, -bias)
                           for change in (-steering, steering))
            commands[robot] = left, right
            ends[robot] = sample + round(generator.uniform(*HOLD) / interval)
        with warnings.catch_warnings():
            warnings.simplefilter('ignore', ModelWarning)
            states = [_moving(state) for state in simulate_batch(parameters, states, commands, interval)]
        rows.append([_row(state) for state in states])
    motion = np.array(rows).swapaxes(0, 1)
    motion[:, :, 8] = np.unwrap(motion[:, :, 8], axis=1)
    return motion


def _moving(state: State | DivergenceError) -> State:
    if isinstance(state, DivergenceError):
        raise state
    return state


def _row(state: State) -> list[float]:
    heading, pitch, roll = Rotation.from_quat(state.orientation).as_euler('ZYX')
    left, right = state.gait
    return [*state.twist, roll, pitch, heading, *state.position, left[0], 0.5 * (right[2] - left[2]), left[3]]


def averaged(motion: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return means over a period and their rates, both (robots, n - SAMPLES, 15), of motions (robots, n, 15).

    The rate of the mean over a moving period is exactly the change over this period, over its duration. The rates are
    per sample.
    """
    sums = np.concatenate([np.zeros_like(motion[:, :1]), np.cumsum(motion, axis=1)], axis=1)
    means = (sums[:, SAMPLES:] - sums[:, :-SAMPLES]) / SAMPLES
    return 0.5 * (means[:, 1:] + means[:, :-1]), (motion[:, SAMPLES:] - motion[:, :-SAMPLES]) / SAMPLES


def fit(means: FloatArray, rates: FloatArray, gait: FinCommand, gait_lag: float,
        ) -> tuple[AveragedModel, dict[str, float]]:
    """Return the model of means and their rates, as of `averaged`, and the part of the variation that it explains.

    Least squares; terms that contribute little are left out, one round after the other.
    """
    means, rates = (values.reshape(-1, values.shape[-1]) for values in (means, rates))
    known = variables([*means[:, :8].T, *means[:, 12:].T])
    fitted, explained = {}, {}
    for index, rate in enumerate(TWIST):
        terms = terms_of(rate, DEGREE)
        values = np.array([np.broadcast_to(product(term, known), len(means)) for term in terms])
        target = rates[:, index] * gait.frequency * SAMPLES
        scales = np.sqrt(np.mean(values ** 2, axis=1))
        kept, more = np.arange(len(terms)), True
        while more:
            A = (values[kept] / scales[kept, np.newaxis]).T
            found = np.linalg.solve(A.T @ A + RIDGE * len(A) * np.eye(len(kept)), A.T @ target)
            large = np.abs(found) > LEAST_PART * np.std(target)
            more = not large.all()
            kept, explained[rate] = kept[large], 1.0 - float(np.mean((target - A @ found) ** 2) / np.mean(target ** 2))
        fitted[rate] = {terms[term]: float(value / scales[term]) for term, value in zip(kept, found, strict=True)}
    return AveragedModel(gait.frequency, gait.phase, gait_lag, fitted), explained


def main(args: Sequence[str] | None = None) -> None:
    """Run the command; the exit status is 0, 1 if the robot diverges, or 2 for wrong input."""
    parser = Parser(prog='averaged_model', description='Fit the averaged model of mpc_follower to simulated swims with '
                                                       'gaits at random, and print it as a model file.')
    parser.add_argument('--config', type=Path, metavar='FILE',
                        help='a ROS 2 parameter file with parameters of /manta_sim (default: the built-in values)')
    parser.add_argument('--frequency', type=float, default=0.6, help='of the gaits [Hz] (default: 0.6)')
    parser.add_argument('--phase', type=float, default=40.0, help='mean phase of both fins [degrees] (default: 40)')
    parser.add_argument('--robots', type=int, default=40, help='number of swims (default: 40)')
    parser.add_argument('--duration', type=float, default=45.0, help='of a swim [s] (default: 45)')
    parser.add_argument('--seed', type=int, default=1, help='of the gaits (default: 1)')
    options = parser.parse_args(args)
    try:
        for name, low, high in (('frequency', 0.1, 2.0), ('phase', 6.0, 85.0), ('robots', 2, 10_000),
                                ('duration', 10.0, 10_000.0), ('seed', 0, 2 ** 32)):
            value = getattr(options, name)
            if not low <= value <= high:
                raise ValueError(f'--{name} is {value:g}, but must be from {low:g} to {high:g}')
        parameters = Parameters() if options.config is None else Parameters.from_yaml(options.config)
        gait = FinCommand(0.0, options.frequency, math.radians(options.phase))
        compile_kernels(parameters, lambda line: print(line, file=sys.stderr))
        motion = swims(parameters, MpcSettings(), gait, options.robots, options.duration, options.seed)
        model, explained = fit(*averaged(motion), gait, 2.0 * parameters.rods.command_time_constant)
    except DivergenceError as error:
        sys.exit(f'{parser.prog}: {error}')
    except (OSError, ValueError) as error:
        parser.error(str(error))
    print(f'# The averaged motion of {options.config or "the built-in robot"}: printed by averaged_model.')
    print('# Explained parts of the rates: ' + ', '.join(f'{name} {part:.2f}' for name, part in explained.items()))
    print(model.as_yaml(), end='')

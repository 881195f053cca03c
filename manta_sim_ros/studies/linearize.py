"""The command `linearize`: a linear model of the body, per flapping period, about a cruise or a steady turn."""

from __future__ import annotations

import dataclasses
import math
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.integrate import trapezoid
from scipy.spatial.transform import Rotation

from manta_sim_ros.dynamics import SIDES, FinCommand, FloatArray, Parameters, State, compile_kernels
from manta_sim_ros.figures.jobs import say
from manta_sim_ros.studies.arguments import Parser, check_output
from manta_sim_ros.studies.gaits import NAMES, ORDER, gaits_of
from manta_sim_ros.studies.linear_model import LinearModel
from manta_sim_ros.studies.poincare import BODY, STEP, NoEquilibriumError, PeriodMap, difference, steps

INPUTS = tuple(f'{side}_{name}' for side in SIDES for name in NAMES)
MEANS = tuple(f'mean_{name}' for name in BODY)
ANGLES = ('psi_left', 'psi_right')

LARGEST_MEMORY = 0.05
"""Error by the memory of the fins from which the command warns."""


def linearize(
    parameters: Parameters, left: FinCommand, right: FinCommand, *, start: State | None = None,
) -> LinearModel:
    """Find the periodic motion of two gaits, and linearize the motion of the body about it, per flapping period.

    The derivatives are central differences of the Poincaré map (`PeriodMap`). The fins begin each period as in the
    periodic motion: what they keep from the period before is left out, and measured as `fin_memory`.

    Parameters
    ----------
    parameters
        All values of the model.
    left, right
        The gaits, of the same frequency.
    start
        The state from which the robot swims until the motion is nearly periodic; by default at rest. Where a gait has
        several periodic motions, it decides which one is found.

    Raises
    ------
    ValueError
        The gaits have no common period or are at a bound, the water flows, or the body is held; names the value and the
        bound.
    NoEquilibriumError
        No cruise and no steady turn was found. This is a ValueError.

    """
    period_map = PeriodMap(parameters, left, right)
    for side, gait in zip(SIDES, (left, right), strict=True):
        for name, about in FinCommand.quantities().items():
            value = getattr(gait, name)
            if not about.low + STEP <= value <= about.high - STEP:
                raise ValueError(
                    f'the {side} {name} is {value:g}, but must be {STEP:g} away from its bounds, {about.low:g} and '
                    f'{about.high:g}: the derivatives are differences to both sides')
    state = period_map.settle(start)
    body = len(period_map.names)
    samples, = period_map.advance([state])
    gaits = (left, right)
    smoothed = INPUTS if parameters.rods.command_time_constant > 0.0 else ()

    perturbed = [
        *period_map.perturbed(state), *_with_cycle_angles(state), *(_with_gait(state) if smoothed else ()),
        *[state] * (2 * len(INPUTS))]
    commands = [None] * (len(perturbed) - 2 * len(INPUTS)) + _perturbed(gaits)
    records = period_map.advance(perturbed, commands)

    def coordinates(after: State) -> FloatArray:
        turned = np.angle(np.exp(1j * (after.cycle_angles - state.cycle_angles)))
        return np.concatenate(
            [period_map.coordinates(after), turned, after.gait.ravel() if smoothed else np.empty(0)])

    known = body + len(ANGLES) + len(smoothed)
    next_x = difference([coordinates(record[-1]) for record in records])
    means = difference([_means(period_map, before, record)
                        for before, record in zip(perturbed, records, strict=True)])
    again = difference([period_map.coordinates(record[-1])
                        for record in period_map.advance([record[-1] for record in records[:2 * body]])])
    body_A = next_x[:body, :body]
    return LinearModel(
        period=period_map.period, gaits=gaits, equilibrium=state, means=_means(period_map, state, samples),
        heading_rate=_turn(state, samples) / period_map.period,
        climb_rate=float(samples[-1].position[2] - state.position[2]) / period_map.period,
        states=(*period_map.names, *ANGLES, *smoothed), inputs=INPUTS, outputs=MEANS,
        A=next_x[:, :known], B=next_x[:, known:], C=means[:, :known], D=means[:, known:],
        fin_memory=float(np.abs(again - body_A @ body_A).max()),
    )


def _with_cycle_angles(state: State) -> list[State]:
    return [dataclasses.replace(state, cycle_angles=(state.cycle_angles + step) % (2.0 * math.pi)) for step in steps(2)]


def _with_gait(state: State) -> list[State]:
    return [dataclasses.replace(state, gait=state.gait + step.reshape(2, 5)) for step in steps(len(INPUTS))]


def _perturbed(gaits: tuple[FinCommand, FinCommand]) -> list[tuple[FinCommand, FinCommand]]:
    values = np.array([gait.as_array() for gait in gaits])
    return [(FinCommand(*left), FinCommand(*right)) for left, right in (
        values + step.reshape(2, 5) for step in steps(len(INPUTS)))]


def _turn(before: State, record: Sequence[State]) -> float:
    """Return by how much the heading turns over a period [rad]: in a sharp turn, that is more than half a turn."""
    attitudes = Rotation.from_quat([state.orientation for state in (before, *record)])
    headings = np.unwrap(attitudes.as_euler('ZYX')[:, 0])
    return float(headings[-1] - headings[0])


def _means(period_map: PeriodMap, before: State, record: Sequence[State]) -> FloatArray:
    """Return the means (8,) of twist, roll and pitch over a period, by the trapezoidal rule."""
    values = np.array([period_map.coordinates(state)[:len(BODY)] for state in (before, *record)])
    return np.asarray(trapezoid(values, dx=1.0 / (len(values) - 1), axis=0))


def main(args: Sequence[str] | None = None) -> None:
    """Run the command; the exit status is 0, 1 if there is no equilibrium, or 2 for wrong input."""
    parser = _parser()
    options = parser.parse_args(args)
    try:
        parameters = Parameters() if options.config is None else Parameters.from_yaml(options.config)
        left, right = gaits_of(options.gait)
        if options.output is not None:
            check_output('--output', options.output, '.npz', [options.config])
        compile_kernels(parameters, lambda line: say(line, sys.stderr))
        model = linearize(parameters, left, right)
    except NoEquilibriumError as error:
        sys.exit(f'{parser.prog}: {error}')
    except (OSError, ValueError) as error:
        parser.error(str(error))
    if options.output is not None:
        try:
            model.save(options.output)
        except OSError as error:
            sys.exit(f'{parser.prog}: {error}')
    say(str(model))
    if model.fin_memory > LARGEST_MEMORY:
        say(f'{parser.prog}: the fins keep {model.fin_memory:.2g} from one period to the next, more than '
            f'{LARGEST_MEMORY:g}: the model is rough', sys.stderr)


def _parser() -> Parser:
    parser = Parser(
        prog='linearize', description='Find the cruise or the steady turn of a gait, and linearize the motion of the '
                                      'body about it, per flapping period: modes, time constants, A and B.')
    parser.add_argument('--config', type=Path, metavar='FILE',
                        help='a ROS 2 parameter file with parameters of /manta_sim (default: the built-in values)')
    parser.add_argument('--gait', required=True, metavar=ORDER,
                        help='in degrees and Hz, both frequencies alike; ten values have the biases front_l, front_r, '
                             'rear_l, rear_r, too')
    parser.add_argument('--output', type=Path, metavar='FILE.npz',
                        help='write the model to this file of NumPy, with its equilibrium')
    return parser

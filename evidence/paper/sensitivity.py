"""The change of the paper's results when a value that the paper does not settle is 20 % smaller or greater.

One value is varied at a time, with the others at their defaults, and with the default time step. This step is below the
largest stable step of every variant, since a StabilityWarning would end the measurement. Everything is measured twice,
with the paper's number of chains per fin and with few chains, for which the chordwise instability sets in later. The
difference between the two is an effect of the grid. `record.flap` shortens a time step so that it divides the time
between two samples, so `solver.time_step` changes by about 20 %.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import warnings
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

import numpy as np

from evidence import report
from manta_sim_ros.dynamics import FloatArray, Parameters, StabilityWarning, largest_stable_step
from manta_sim_ros.figures.figure_8 import mean_thrust
from manta_sim_ros.figures.figure_9 import FREQUENCY, PHASE, WINDOW, swim
from manta_sim_ros.figures.gaits import FEW_CHAINS, STRAIGHT, TURN_FREQUENCY, TURNS, robot
from manta_sim_ros.figures.jobs import Done
from manta_sim_ros.figures.record import record
from manta_sim_ros.figures.turning import PERIODS, Turn

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SYMBOLS = {
    'rods.front_radius': 'r_1', 'fin.span': r'm\,\Delta l', 'fin.thickness': 'h', 'fin.drag_coefficient': 'C_D',
    'water.density': r'\rho', 'fin.density': r'\rho_f', 'fin.joint_damping': 'c', 'body.angular_damping': 'C_M',
    'solver.time_step': r'\Delta t',
}
"""The paper's symbol of each value that is varied.

The first four are assumed. The print leaves the next four unclear; a vector is scaled as a whole. The time step is
chosen. `rods.command_time_constant` is chosen too, but it is 0 in the paper's gaits and cannot be scaled.
"""
VALUES = tuple(SYMBOLS)
"""Names of the values that are varied, as in the parameter file."""

CHANGE = 0.2
FACTORS = (1.0 - CHANGE, 1.0 + CHANGE)
COLORS = ('#d55e00', '#0072b2')
"""Colors of the smaller and of the greater value."""
OFFSETS = (-0.2, 0.2)
"""Distances of their bars from the middle of a row."""
VISIBLE = 0.05
"""Smallest effect that is written beside its bar [%]."""
VARIANTS: tuple[tuple[str | None, float], ...] = ((None, 1.0), *itertools.product(VALUES, FACTORS))
"""Name and factor of the default robot, and of each value smaller and greater."""

AMPLITUDE = 40.0
"""Amplitude of the held robot and of the straight gait [degrees]."""
SECOND = 1
"""Index of the second flapping period, in which the number of chains hardly affects set 2."""


@dataclasses.dataclass(frozen=True)
class Result:
    """A result that the paper reports."""

    name: str
    unit: str


RESULTS = (
    Result('mean thrust, body held', 'N'),
    Result('mean speed', 'm/s'),
    Result('yaw rate in period 2, set 2', 'degrees/s'),
    Result('turning rate, set 2', 'degrees/s'),
    Result('yaw rate in period 2, set 1', 'degrees/s'),
    Result('turning rate, set 1', 'degrees/s'),
)
"""The first two are for A = 40 degrees, f = 0.6 Hz, phi = 40 degrees; the turns are those of Figure 10.

Rates are positive to the left.
"""


@dataclasses.dataclass(frozen=True)
class Case:
    """A robot whose `value` is `factor` times the default, or the default robot if it is None; turns last `periods`."""

    value: str | None
    factor: float
    chains: int
    periods: int

    def robot(self) -> Parameters:
        """Return its parameters.

        Raises
        ------
        ValueError
            The support cannot close, or a value is out of its bounds.

        """
        base = robot(fin={'chains': self.chains})
        if self.value is None:
            return base
        group, name = self.value.split('.')
        default = getattr(getattr(base, group), name)
        scaled = tuple(self.factor * part for part in default) if isinstance(default, tuple) else self.factor * default
        return robot(base, **{group: {name: scaled}})


def grid(quick: bool) -> tuple[int, int]:
    """Return the number of chains per fin besides FEW_CHAINS, and of periods of a turn; `quick` is for tests."""
    return (FEW_CHAINS, 4) if quick else (Parameters().fin.chains, PERIODS)


def cases(quick: bool = False) -> tuple[Case, ...]:
    """Return all cases, each of them once."""
    chains, periods = grid(quick)
    return tuple(dict.fromkeys(
        Case(value, factor, number, periods) for number in (chains, FEW_CHAINS) for value, factor in VARIANTS))


def run(case: Case) -> tuple[float, ...]:
    """Return RESULTS of a case; all of them are NaN if this robot or its gait is impossible.

    In every gait a fin has the amplitude and phase of the straight gait, so all gaits are impossible together.

    Raises
    ------
    StabilityWarning
        The time step is too large for one of the gaits.

    """
    try:
        parameters = case.robot()
        for left, right in ((STRAIGHT, STRAIGHT), *TURNS.values()):
            largest_stable_step(parameters, left, right)
    except ValueError:
        return (math.nan,) * len(RESULTS)
    with warnings.catch_warnings():
        warnings.simplefilter('error', StabilityWarning)
        return (
            mean_thrust(parameters, AMPLITUDE, FREQUENCY, PHASE)[1],
            swim(parameters, AMPLITUDE, case.chains).mean,
            *yaw_rates(parameters, 'set 2', case.periods),
            *yaw_rates(parameters, 'set 1', case.periods),
        )


def run_job(case: Case, done: Done) -> tuple[float, ...]:
    """Run a case as a job: call `done`, and return the results of `run`."""
    results = run(case)
    done()
    return results


def yaw_rates(parameters: Parameters, name: str, periods: int) -> tuple[float, float]:
    """Return the yaw rate of a turn in its second period and over its last quarter [degrees/s]."""
    turn = Turn(name, record(parameters, *TURNS[name], periods))
    return float(turn.yaw_rates[SECOND]), turn.turning_rate


@dataclasses.dataclass(frozen=True)
class Sensitivity:
    """The R RESULTS of the default robot, and of robots with each of the V VALUES smaller and greater."""

    height = 5.8

    chains: int
    periods: int
    """Number of flapping periods of a turn."""
    results: FloatArray
    """(1 + 2 V, R) results of VARIANTS in their units; NaN where a variant is impossible."""
    smooth: FloatArray
    """(1 + 2 V, R) the same with FEW_CHAINS chains per fin."""

    @classmethod
    def of(cls, outcomes: Iterable[tuple[float, ...]], quick: bool = False) -> Sensitivity:
        """Build the sensitivity from the results of `run` for each of `cases(quick)`."""
        outcome_of = dict(zip(cases(quick), outcomes, strict=True))
        chains, periods = grid(quick)
        results, smooth = (
            np.array([outcome_of[Case(value, factor, number, periods)] for value, factor in VARIANTS])
            for number in (chains, FEW_CHAINS))
        return cls(chains, periods, results, smooth)

    @property
    def base(self) -> FloatArray:
        """(R,) results of the default robot."""
        return self.results[0]

    @property
    def effects(self) -> FloatArray:
        """(V, 2, R) relative change of each result for the smaller and for the greater value [%]."""
        return changes(self.results)

    @property
    def smooth_effects(self) -> FloatArray:
        """(V, 2, R) the same with FEW_CHAINS chains per fin [%]."""
        return changes(self.smooth)

    @property
    def order(self) -> list[int]:
        """Indices of VALUES by their effect on the thrust, the largest first; impossible variants come before all."""
        largest = np.abs(self.effects[:, :, 0]).max(axis=1)
        return sorted(range(len(VALUES)), key=lambda row: -np.nan_to_num(largest[row], nan=math.inf))

    def columns(self) -> dict[str, FloatArray]:
        """Return all results as columns of equal length: first those of VARIANTS, then the same with FEW_CHAINS."""
        numbers = np.repeat([self.chains, FEW_CHAINS], len(VARIANTS))
        return {
            'varied': np.array([value or 'none' for value, _ in VARIANTS * 2]),
            'factor': np.array([factor for _, factor in VARIANTS * 2]),
            'chains': numbers,
            **{f'{result.name} [{result.unit}]': column
               for result, column in zip(RESULTS, np.concatenate([self.results, self.smooth]).T, strict=True)},
        }

    def table(self) -> str:
        """Return a Markdown table of the results, and of the change of each [%] at -20 % and at +20 % of each value.

        Each value has a row for the paper's number of chains, and below it one for FEW_CHAINS.
        """
        numbers = (self.chains, FEW_CHAINS)
        head = [f'change [%] at -{100.0 * CHANGE:.0f} / +{100.0 * CHANGE:.0f} %', 'chains',
                *(f'{result.name} [{result.unit}]' for result in RESULTS)]
        rows = []
        for number, results in zip(numbers, (self.results, self.smooth), strict=True):
            rows.append(['default robot', str(number), *map(three_digits, results[0])])
        for row in self.order:
            for number, effects in zip(numbers, (self.effects, self.smooth_effects), strict=True):
                pairs = (f'{percent(low)} / {percent(high)}' for low, high in effects[row].T)
                rows.append([f'`{VALUES[row]}`', str(number), *pairs])
        return report.table(head, rows)

    @property
    def caption(self) -> str:
        """What the chart shows."""
        (second, few_second), (rate, few_rate) = np.array([self.base, self.smooth[0]]).T[2:4]  # set 2
        return (
            f'Change of each result when one value is {100.0 * CHANGE:.0f} % smaller or greater, with {self.chains} '
            f'chains per fin (bars and numbers) and with {FEW_CHAINS} chains per fin (rings). The panels have '
            f'different scales. The thrust and the mean speed from {WINDOW[0]:g} to {WINDOW[1]:g} s are those of A = '
            f'{AMPLITUDE:g}°, f = {FREQUENCY:g} Hz, φ = {PHASE:g}°. The turns have f = {TURN_FREQUENCY:g} Hz, and the '
            f'turning rate is the mean over the last quarter of {self.periods} periods. A positive change is a faster '
            'turn to the same side, and a change below -100 % is a turn to the other side. Because of the chordwise '
            f'instability the turning rate is set by the grid: in set 2 it is {rate:.1f}°/s with {self.chains} chains '
            f'and {few_rate:.1f}°/s with {FEW_CHAINS} chains. In the second period the yaw rate of set 2 is '
            f'{second:.1f}°/s and {few_second:.1f}°/s.'
        )

    def draw(self, figure: Figure) -> None:
        """Draw a panel for each result, with a row for each value in the order of its effect on the thrust."""
        panels = figure.subplots(2, len(RESULTS) // 2, sharey=True)
        bars, rings = self.effects[self.order].T, self.smooth_effects[self.order].T
        for result, base, axes, effects, smooth in zip(RESULTS, self.base, panels.flat, bars, rings, strict=True):
            axes.set_title(f'{result.name}\n{three_digits(base)} {result.unit}'.replace('-', '−'), fontsize=8)
            draw_bars(axes, effects, smooth, self.chains)
        for axes in panels[:, 0]:
            axes.set_yticks(range(len(VALUES)), [f'{VALUES[row]}  ${SYMBOLS[VALUES[row]]}$' for row in self.order])
        for axes in panels[-1]:
            axes.set_xlabel('change of the result [%]')
        figure.legend(*panels[0, 0].get_legend_handles_labels(), loc='outside lower center', ncols=3)


def draw_bars(axes: Axes, effects: FloatArray, smooth: FloatArray, chains: int) -> None:
    """Draw the effects (2, V) of smaller and greater values [%] as bars, and those with few chains as rings."""
    rows = np.arange(len(VALUES)) + np.array(OFFSETS)[:, np.newaxis]
    for at, of_factor, of_few, factor, color in zip(rows, effects, smooth, FACTORS, COLORS, strict=True):
        label = f'value {100.0 * (factor - 1.0):+.0f} %, {chains} chains'.replace('-', '−')
        axes.barh(at, np.nan_to_num(of_factor), 0.4, color=color, label=label)
        for row, effect, few in zip(at, of_factor, of_few, strict=True):
            write_number(axes, row, effect, few)
    axes.plot(smooth.ravel(), rows.ravel(), 'o', label=f'the same, {FEW_CHAINS} chains', markersize=3.0,
              markerfacecolor='white', markeredgecolor='black', markeredgewidth=0.7)
    for row in range(0, len(VALUES), 2):
        axes.axhspan(row - 0.5, row + 0.5, color='0.955', linewidth=0.0, zorder=0)
    axes.axvline(0.0, color='0.3', linewidth=0.8)
    axes.margins(x=0.4)
    axes.set_ylim(len(VALUES) - 0.5, -0.5)
    axes.grid(axis='y', visible=False)
    axes.tick_params(axis='y', length=0)


def write_number(axes: Axes, row: float, effect: float, few: float) -> None:
    """Write an effect [%] beside its bar, or beside the ring if the ring is farther out."""
    if abs(effect) < VISIBLE:
        return
    side = -1.0 if effect < 0.0 else 1.0
    end = side * np.nanmax([side * effect, side * few, 0.0])
    axes.annotate(percent(effect).replace('-', '−'), (end, row), (4.0 * side, 0.0), textcoords='offset points',
                  ha='left' if side > 0.0 else 'right', va='center', fontsize=6.0, color='0.15')


def changes(results: FloatArray) -> FloatArray:
    """Return the relative changes (V, 2, R) [%] in the results (1 + 2 V, R) of VARIANTS."""
    return 100.0 * (results[1:].reshape(len(VALUES), len(FACTORS), -1) / results[0] - 1.0)


def three_digits(value: float) -> str:
    """Return a value with three significant digits: 17.1, -7.00, -119."""
    return f'{value:#.3g}'.rstrip('.')


def percent(change: float) -> str:
    """Return a change [%] with its sign and one decimal, or 'impossible' for NaN."""
    if math.isnan(change):
        return 'impossible'
    text = f'{change:+.1f}'
    return '0.0' if text in ('+0.0', '-0.0') else text


def measure(done: Callable[[], object] = lambda: None, quick: bool = False) -> Sensitivity:
    """Run all cases one after the other; `done` is called after each."""
    outcomes = []
    for case in cases(quick):
        outcomes.append(run(case))
        done()
    return Sensitivity.of(outcomes, quick)

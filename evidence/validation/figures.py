"""The plots of docs/validation.md."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from evidence.validation.facts import (
    AQUARAY_SPEED,
    CRUISE_RANGE,
    FISH_RADIUS,
    FISH_RATE,
    FOILS,
    MANTA_RADIUS,
    MANTA_RATE,
    STINGRAYS,
)
from evidence.validation.measurements import AMPLITUDES, RESULTS, VARIED, Measured
from evidence.validation.sensitivity import DAMPING, FACTORS, Sensitivity, Variant

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLORS = {'manta.yaml': '#d55e00', 'freshwater.yaml': '#0072b2'}
PUBLISHED = '#009e73'
FRESHWATER = 'freshwater.yaml'


@dataclasses.dataclass(frozen=True)
class Facts:
    """Speed, Strouhal number and turns of each configuration, with the published values."""

    height = 3.1

    measured: Mapping[str, Measured]
    sensitivity: Sensitivity

    def draw(self, figure: Figure) -> None:
        """Draw a panel for each of the three."""
        speed, strouhal, turn = figure.subplots(1, 3)
        speed.axhspan(*CRUISE_RANGE, color=PUBLISHED, alpha=0.2, label='mantas, published')
        speed.axhline(AQUARAY_SPEED, color=PUBLISHED, linestyle=':', label='AquaRay, greatest')
        speed.set(xlabel='amplitude A [degrees]', ylabel='cruise speed [m/s]', ylim=(0.0, 0.8))
        strouhal.axhspan(*STINGRAYS, color=PUBLISHED, alpha=0.2, label='stingrays, simulated')
        strouhal.axhspan(*FOILS, facecolor='none', edgecolor=PUBLISHED, linestyle=':', label='foils, most efficient')
        strouhal.set(xlabel='amplitude A [degrees]', ylabel='Strouhal number', ylim=(0.1, 0.7))
        for name, one in self.measured.items():
            color = COLORS[name]
            speed.plot(AMPLITUDES, [swim.speed for swim in one.swims], 'o-', color=color, label=name)
            strouhal.plot(AMPLITUDES, [swim.strouhal for swim in one.swims], 'o-', color=color, label=name)
        self.draw_turns(turn)
        for axes in (speed, strouhal, turn):
            axes.legend(loc='upper left' if axes is not turn else 'upper right', fontsize=6.5)

    def draw_turns(self, axes: Axes) -> None:
        """Draw yaw rate against radius, with the yaw damping in fresh water halved and doubled."""
        (mean, spread), (radius, radius_spread) = FISH_RATE, FISH_RADIUS
        axes.fill_between([radius - radius_spread, radius + radius_spread], mean - spread, mean + spread,
                          color=PUBLISHED, alpha=0.2, linewidth=0.0, label='mantas, Fish et al.')
        axes.plot(MANTA_RADIUS, MANTA_RATE, '*', color=PUBLISHED, markersize=9.0, label='mantas, 67°/s')
        for name, one in self.measured.items():
            for number, marker in (('1', 'o'), ('2', 's')):
                at, rate = one.results[f'radius {number}'], abs(one.results[f'rate {number}'])
                axes.plot(at, rate, marker, color=COLORS[name])
                axes.annotate(f'set {number}', (at, rate), (5.0, 4.0), textcoords='offset points', fontsize=6.5)
                if name == FRESHWATER:
                    varied = [self.sensitivity.results[Variant(name, DAMPING, factor)] for factor in FACTORS]
                    axes.plot([result[f'radius {number}'] for result in varied],
                              [abs(result[f'rate {number}']) for result in varied], '-', color=COLORS[name],
                              linewidth=0.9)
        axes.set(xscale='log', xlabel='turning radius [m]', ylabel='yaw rate [degrees/s]', xlim=(0.04, 6.0),
                 ylim=(0.0, 175.0))


@dataclasses.dataclass(frozen=True)
class Exponents:
    """The exponents of all results for all values, a map for each configuration."""

    height = 4.4

    sensitivity: Sensitivity

    def draw(self, figure: Figure) -> None:
        """Draw a map for each configuration; its numbers are the exponents."""
        tables = {name: self.sensitivity.exponents(name) for name in COLORS}
        panels = figure.subplots(
            2, 1, sharex=True, height_ratios=[len(of_values) for of_values in tables.values()])
        for axes, (name, of_values) in zip(panels, tables.items(), strict=True):
            numbers = np.array([[of_results[key] for key in VARIED] for of_results in of_values.values()])
            axes.imshow(numbers, cmap='RdBu_r', vmin=-1.0, vmax=1.0, aspect='auto')
            for (row, column), number in np.ndenumerate(numbers):
                axes.text(column, row, written(number).replace('-', '−'), ha='center', va='center', fontsize=6.5,
                          color='white' if abs(number) > 0.6 else '0.15')
            axes.set_yticks(range(len(of_values)), [str(value).replace('`', '') for value in of_values], fontsize=7)
            axes.set_title(name, fontsize=9)
            axes.grid(visible=False)
            axes.tick_params(length=0)
        names = [RESULTS[key].name.replace(', ', '\n').replace('cost of ', 'cost of\n').replace(' number', '\nnumber')
                 .replace('mean rod', 'mean rod\n').replace('greatest mean', 'greatest\nmean') for key in VARIED]
        panels[-1].set_xticks(range(len(VARIED)), names, fontsize=7)


def written(number: float) -> str:
    """Return an exponent with two digits, or a question mark if the result has none."""
    if np.isnan(number):
        return '?'
    text = f'{number:.2f}'
    return '0' if float(text) == 0.0 else text

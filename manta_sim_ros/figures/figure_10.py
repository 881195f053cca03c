"""Figure 10: trajectories of the two turning gaits, in plan view and in space."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from manta_sim_ros.dynamics import FloatArray
from manta_sim_ros.figures.gaits import TURN_FREQUENCY
from manta_sim_ros.figures.turning import Turn, Turning

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LINES = {'set 1': ('-', '#0072b2'), 'set 2': ('--', '#d55e00')}
"""Style and color: a solid and a dashed line, as in the paper."""


@dataclasses.dataclass(frozen=True)
class Figure10:
    """Trajectories of the center of mass."""

    height = 6.6

    turning: Turning

    def columns(self) -> dict[str, FloatArray]:
        """Return the data of the figure as columns of equal length."""
        columns = {'time [s]': self.turning.turns[0].record.time}
        for turn in self.turning.turns:
            for axis, values in zip('xyz', turn.record.position.T, strict=True):
                columns[f'{axis}, {turn.name}, {turn.chains} chains [m]'] = values
        return columns

    def draw(self, figure: Figure) -> None:
        """Draw a column for each number of chains, with the plan view above and the view in space below."""
        by_chains = self.turning.by_chains
        for column, (chains, turns) in enumerate(by_chains.items(), start=1):
            plan = figure.add_subplot(2, len(by_chains), column)
            space: Any = figure.add_subplot(2, len(by_chains), len(by_chains) + column, projection='3d')
            for turn in turns:
                style, color = LINES[turn.name]
                x, y, z = turn.record.position.T
                plan.plot(x, y, style, color=color, label=described(turn))
                plan.plot(x[-1], y[-1], 'o', color=color)
                space.plot(x, y, z, style, color=color, linewidth=1.0)
            plan.set_aspect('equal', adjustable='datalim')
            plan.set_xlabel('x, ahead [m]')
            plan.set_ylabel('y, to the left [m]')
            plan.set_title(f'{chains} chains per fin', fontsize=9)
            plan.legend(loc='upper center', bbox_to_anchor=(0.5, -0.2))
            for axis in 'xyz':
                space.locator_params(axis=axis, nbins=4)
            space.set(xlabel='x [m]', ylabel='y [m]', zlabel='z, enlarged [m]')
            space.tick_params(labelsize=7)
            space.set_box_aspect((1.0, 1.0, 0.6), zoom=0.85)
        periods = self.turning.turns[0].record.periods
        figure.suptitle(f'Turns from rest at the origin, f = {TURN_FREQUENCY:g} Hz, {periods} periods', fontsize=10)


def described(turn: Turn) -> str:
    """Return rate and radius of the turn, and whether it is steady, in words."""
    steady = 'not steady' if turn.steady_from is None else f'steady from period {turn.steady_from + 1}'
    return f'{turn.name}: {turn.turning_rate:.1f} °/s, radius {turn.turning_radius:.2f} m, {steady}'

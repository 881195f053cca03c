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
                columns[f'{axis}, {turn.name}, {turn.robot} [m]'] = values
        return columns

    def draw(self, figure: Figure) -> None:
        """Draw a column for each robot: above the plan view, below the view in space, where z is enlarged."""
        by_robot = self.turning.by_robot
        engine: Any = figure.get_layout_engine()
        engine.set(w_pad=0.12)  # [in]; labels of views in space would leave the figure
        for column, (name, turns) in enumerate(by_robot.items(), start=1):
            plan = figure.add_subplot(2, len(by_robot), column)
            space: Any = figure.add_subplot(2, len(by_robot), len(by_robot) + column, projection='3d')
            for turn in turns:
                style, color = LINES[turn.name]
                x, y, z = turn.record.position.T
                plan.plot(x, y, style, color=color, label=described(turn))
                plan.plot(x[-1], y[-1], 'o', color=color)
                space.plot(x, y, z, style, color=color, linewidth=1.0)
            plan.set_aspect('equal', adjustable='datalim')
            plan.set_xlabel('x, ahead [m]')
            if column == 1:
                plan.set_ylabel('y, to the left [m]')
            plan.locator_params(nbins=4)
            plan.set_title(title(name), fontsize=9)
            plan.legend(loc='upper center', bbox_to_anchor=(0.5, -0.2), fontsize=7)
            for axis in 'xyz':
                space.locator_params(axis=axis, nbins=4)
            space.set(xlabel='x [m]', ylabel='y [m]', zlabel='z [m]')
            space.tick_params(labelsize=7)
            space.set_box_aspect((1.0, 1.0, 0.6), zoom=0.75)
        periods = self.turning.turns[0].record.periods
        figure.suptitle(f'Turns from rest at the origin, f = {TURN_FREQUENCY:g} Hz, {periods} periods', fontsize=10)


def title(name: str) -> str:
    """Return the title of the column of a robot, in two lines."""
    chains, _, more = name.partition(', ')
    return f'{chains} per fin\n{more or "model of the paper"}'


def described(turn: Turn) -> str:
    """Return rate and radius of the turn, and whether it is steady, in words."""
    steady = 'not steady' if turn.steady_from is None else f'steady from period {turn.steady_from + 1}'
    return f'{turn.name}: {turn.turning_rate:.1f} °/s,\nradius {turn.turning_radius:.2f} m,\n{steady}'

"""Figure 11: the wrench of both fins in the two turning gaits, raw and averaged over a period."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from manta_sim_ros.dynamics import FloatArray
from manta_sim_ros.figures.figure_10 import LINES, title
from manta_sim_ros.figures.gaits import TURN_FREQUENCY
from manta_sim_ros.figures.periodic import period_average
from manta_sim_ros.figures.style import legend_below
from manta_sim_ros.figures.turning import Turning

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COMPONENTS = (('F_x', 'N'), ('F_y', 'N'), ('F_z', 'N'), ('M_x', 'N m'), ('M_y', 'N m'), ('M_z', 'N m'))


@dataclasses.dataclass(frozen=True)
class Figure11:
    """Force and moment of both fins on the body about its center of mass, in F_b."""

    height = 9.6

    turning: Turning

    def columns(self) -> dict[str, FloatArray]:
        """Return the data of the figure as columns of equal length."""
        columns = {'time [s]': self.turning.turns[0].record.time}
        for turn in self.turning.turns:
            average = period_average(turn.record.wrench, turn.record.samples)
            for kind, wrench in (('raw', turn.record.wrench), ('averaged', average)):
                for (name, unit), values in zip(COMPONENTS, wrench.T, strict=True):
                    columns[f'{name} {kind}, {turn.name}, {turn.robot} [{unit}]'] = values
        return columns

    def draw(self, figure: Figure) -> None:
        """Draw a row for each component, a row for the averaged M_z, and a column for each robot."""
        by_robot = self.turning.by_robot
        panels = figure.subplots(len(COMPONENTS) + 1, len(by_robot), sharex=True, sharey='row', squeeze=False)
        for column, (robot, turns) in zip(panels.T, by_robot.items(), strict=True):
            for turn in turns:
                style, color = LINES[turn.name]
                wrench = turn.record.wrench
                average = period_average(wrench, turn.record.samples)
                for axes, raw, smooth in zip(column, wrench.T, average.T, strict=False):
                    axes.plot(turn.record.time, raw, color=color, linewidth=0.5, alpha=0.45)
                    axes.plot(turn.record.time, smooth, style, color=color, label=turn.name)
                column[-1].plot(turn.record.time, average[:, -1], style, color=color)
            column[0].set_title(title(robot), fontsize=9)
            column[-1].set_xlabel('time [s]')
        for axes, (name, unit) in zip(panels[:, 0], COMPONENTS, strict=False):
            axes.set_ylabel(f'${name}$ [{unit}]')
        panels[-1, 0].set_ylabel('averaged\n$M_z$ [N m]')
        legend_below(figure, panels[0, 0].get_legend_handles_labels()[0], columns=2)
        figure.suptitle(
            f'Wrench of both fins, f = {TURN_FREQUENCY:g} Hz; thin: raw, thick: averaged over a period', fontsize=10)

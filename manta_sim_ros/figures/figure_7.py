"""Figure 7: the wave that travels along the chord and along the span of a fin, with the body held."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np

from manta_sim_ros.dynamics import FinCommand, FloatArray, Parameters
from manta_sim_ros.figures.gaits import STRAIGHT, robot
from manta_sim_ros.figures.periodic import fundamental, lag, recurring
from manta_sim_ros.figures.record import flap
from manta_sim_ros.figures.style import legend_below

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEADING, TRAILING = 0, -1
COLORS = ('#000000', '#d55e00')  # leading, trailing: the paper's black and red
CYCLES = 2


@dataclasses.dataclass(frozen=True)
class Figure7:
    """Joint angles of the left fin's leading and trailing chain over a period, once the motion is periodic."""

    height = 4.6

    gait: FinCommand
    chains: int
    transient: int
    """Number of periods before the motion is periodic."""
    cycle: FloatArray
    """(samples,) time over period, greater than 0 and up to 1."""
    angles: FloatArray
    """(samples, 2, m) joint angles [leading or trailing, joint] [degrees]."""

    @classmethod
    def measure(cls, parameters: Parameters | None = None, gait: FinCommand = STRAIGHT) -> Figure7:
        """Simulate a held robot, by default the paper's, until the motion is periodic."""
        held = robot(parameters, solver={'fixed_base': True})
        transient, period = recurring(
            flap(held, gait, gait), lambda record: record.joint_angles[:, 0, [LEADING, TRAILING]].reshape(
                len(record.time), -1))
        angles = np.degrees(period.joint_angles[:, 0, [LEADING, TRAILING]])
        return cls(gait, held.fin.chains, transient, np.arange(1, period.samples + 1) / period.samples, angles)

    @property
    def chordwise_lags(self) -> FloatArray:
        """(m,) lag of each joint of the trailing chain behind that of the leading chain [degrees]."""
        leading, trailing = fundamental(self.angles)
        return lag(leading, trailing)

    @property
    def spanwise_lags(self) -> FloatArray:
        """(2, m) lag of each joint behind the first of its chain, for the leading and the trailing chain [degrees]."""
        fundamentals = fundamental(self.angles)
        return lag(fundamentals[:, :1], fundamentals)

    @property
    def direction_lags(self) -> FloatArray:
        """(2, m) lag of the direction of each link behind that of the first link of its chain [degrees].

        The direction of a link in F_0 is the sum of the joint angles up to this link.
        """
        fundamentals = fundamental(np.cumsum(self.angles, axis=-1))
        return lag(fundamentals[:, :1], fundamentals)

    @property
    def cycles(self) -> tuple[FloatArray, FloatArray]:
        """Time over period (2 samples,) and angles (2 samples, 2, m) of the two cycles that are shown."""
        return (np.concatenate([self.cycle + whole for whole in range(CYCLES)]), np.concatenate([self.angles] * CYCLES))

    def columns(self) -> dict[str, FloatArray]:
        """Return the data of the figure as columns of equal length."""
        cycle, angles = self.cycles
        names = [f'{end} chain q{joint + 1} [deg]'
                 for end in ('leading', 'trailing') for joint in range(self.angles.shape[2])]
        curves = angles.reshape(len(cycle), -1).T
        return {'time / period': cycle, **dict(zip(names, curves, strict=True))}

    def draw(self, figure: Figure) -> None:
        """Draw two cycles of each joint, and those of all joints of the trailing chain on one scale."""
        cycle, angles = self.cycles
        axes = figure.subplots(2, 2, sharex=True).ravel()
        for joint, panel in enumerate(axes[:3]):
            for end, (name, color) in enumerate(zip(
                    ('chain 1, leading edge', f'chain {self.chains}, trailing edge'), COLORS, strict=True)):
                panel.plot(cycle, angles[:, end, joint], color=color, label=name)
            panel.set_title(f'joint {joint + 1}: trailing edge lags by {self.chordwise_lags[joint]:.1f}°', fontsize=9)
            panel.set_ylabel(f'$q_{joint + 1}$ [degrees]')
        for joint, style in enumerate(('-', '--', ':')):
            curve = angles[:, TRAILING, joint]
            lags = f', lags $q_1$ by {self.spanwise_lags[1, joint]:.1f}°' if joint else ''
            axes[3].plot(cycle, curve / np.abs(curve).max(), style, color=COLORS[1], label=f'$q_{joint + 1}${lags}')
        axes[3].set_title(f'chain {self.chains}, along the span', fontsize=9)
        axes[3].set_ylabel('$q_j$ / largest $q_j$')
        for panel in axes[2:]:
            panel.set_xlabel('time / period')
        lines = [*axes[0].get_lines(), *axes[3].get_lines()]
        legend_below(figure, lines, columns=3)
        figure.suptitle(
            f'Body held: A = {math.degrees(self.gait.amplitude):.0f}°, f = {self.gait.frequency:g} Hz, '
            f'φ = {math.degrees(self.gait.phase):.0f}°', fontsize=10)

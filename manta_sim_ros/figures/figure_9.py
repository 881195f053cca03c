"""Figure 9: forward speed of the straight gait from rest, with several amplitudes."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from manta_sim_ros.dynamics import FloatArray, Parameters
from manta_sim_ros.figures.gaits import FEW_CHAINS, gait, robot
from manta_sim_ros.figures.periodic import end_mean, period_average, settled
from manta_sim_ros.figures.record import record
from manta_sim_ros.figures.style import legend_below

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AMPLITUDES = (20.0, 30.0, 40.0, 50.0)
"""Amplitudes [degrees]."""
FREQUENCY, PHASE = 0.6, 40.0  # [Hz], [degrees]
WINDOW = (4.0, 10.0)
"""Times between which the paper averages [s]."""
SHOWN = 12.0  # [s]
PERIODS = 20
"""Number of periods of a swim, long enough for the speed to settle."""
SETTLED = 0.01
"""A swim has settled when the mean of each further period is within this share of the final speed."""


@dataclasses.dataclass(frozen=True)
class Swim:
    """A straight swim from rest."""

    amplitude: float
    """Amplitude [degrees]."""
    chains: int
    time: FloatArray
    """(T,) time [s]."""
    speed: FloatArray
    """(T,) forward velocity of the center of mass in F_b [m/s]."""
    samples: int
    """Samples per period."""
    attack: FloatArray
    """(T,) angle of attack of the body, atan2(-V_z, V_x) [degrees]."""

    @property
    def average(self) -> FloatArray:
        """(T,) speed averaged over the period around each time [m/s]; NaN where this period is not complete."""
        return period_average(self.speed, self.samples)

    @property
    def window(self) -> NDArray[np.bool_]:
        """(T,) whether a time is in the window."""
        return (self.time >= WINDOW[0] - 1e-9) & (self.time <= WINDOW[1] + 1e-9)

    @property
    def mean(self) -> float:
        """Mean speed in the window [m/s]."""
        return float(self.speed[self.window].mean())

    @property
    def oscillation(self) -> float:
        """Largest minus smallest deviation of the speed from its average over a period, in the window [m/s]."""
        return float(np.ptp((self.speed - self.average)[self.window]))

    @property
    def means(self) -> FloatArray:
        """(periods,) mean speed of each period [m/s]."""
        return self.speed.reshape(-1, self.samples).mean(axis=1)

    @property
    def final(self) -> float:
        """Mean speed of the last quarter of the periods [m/s]."""
        return end_mean(self.means)

    @property
    def settled_from(self) -> int | None:
        """First period (0 is the first) from which the means stay near the final speed; None if they do not."""
        return settled(self.means, SETTLED)


def swim(parameters: Parameters | None, amplitude: float, chains: int) -> Swim:
    """Simulate one amplitude [degrees] with a number of chains per fin."""
    both = gait(amplitude, FREQUENCY, PHASE)
    states = record(robot(parameters, fin={'chains': chains}), both, both, PERIODS)
    speed, up = states.twist[:, 0], states.twist[:, 2]
    return Swim(amplitude, chains, states.time, speed, states.samples, np.degrees(np.arctan2(-up, speed)))


@dataclasses.dataclass(frozen=True)
class Figure9:
    """Straight swims with the paper's number of chains, and with few chains, which stay stable along the chord."""

    height = 3.6

    swims: tuple[Swim, ...]
    """Swims with the paper's number of chains per fin."""
    smooth: tuple[Swim, ...]
    """Swims with FEW_CHAINS chains per fin."""

    @classmethod
    def measure(
        cls, parameters: Parameters | None = None, amplitudes: tuple[float, ...] = AMPLITUDES,
        done: Callable[[], object] = lambda: None,
    ) -> Figure9:
        """Simulate every amplitude [degrees]; `done` is called after each amplitude."""
        chains = robot(parameters).fin.chains
        swims: dict[int, list[Swim]] = {chains: [], FEW_CHAINS: []}
        for amplitude in amplitudes:
            for number, of_number in swims.items():
                of_number.append(swim(parameters, amplitude, number))
            done()
        return cls(tuple(swims[chains]), tuple(swims[FEW_CHAINS]))

    def columns(self) -> dict[str, FloatArray]:
        """Return the data of the figure as columns of equal length."""
        columns = {'time [s]': self.swims[0].time}
        for one in (*self.swims, *self.smooth):
            columns[f'forward speed, A = {one.amplitude:g} deg, {one.chains} chains [m/s]'] = one.speed
        return columns

    def draw(self, figure: Figure) -> None:
        """Draw the speed against time, with the mean and the oscillation of each amplitude in the legend."""
        axes = figure.subplots()
        axes.axvspan(*WINDOW, color='0.93', zorder=0)
        for full, smooth in zip(self.swims, self.smooth, strict=True):
            label = f'A = {full.amplitude:.0f}°: mean {full.mean:.3f}, oscillation {full.oscillation:.3f} m/s'
            color = axes.plot(full.time, full.speed, label=label)[0].get_color()
            axes.plot(smooth.time, smooth.speed, ':', color=color, linewidth=1.2)
        axes.plot([], [], 'k-', label=f'{self.swims[0].chains} chains per fin, as in the paper')
        axes.plot([], [], 'k:', label=f'{self.smooth[0].chains} chains per fin, stable along the chord')
        axes.set_xlim(0.0, SHOWN)
        axes.set_xlabel('time [s]')
        axes.set_ylabel('forward speed [m/s]')
        axes.set_title(f'f = {FREQUENCY:g} Hz, φ = {PHASE:.0f}°; gray: window of mean and oscillation', fontsize=9)
        legend_below(figure, axes.get_legend_handles_labels()[0], columns=2)

"""Figure 9: forward speed of the straight gait from rest on, at several amplitudes."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from manta_sim_ros.dynamics import Parameters
from manta_sim_ros.figures.gaits import FEW_CHAINS, gait, robot
from manta_sim_ros.figures.periodic import end_mean, period_average, settled
from manta_sim_ros.figures.record import record
from manta_sim_ros.figures.style import legend_below

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AMPLITUDES = (20.0, 30.0, 40.0, 50.0)
FREQUENCY, PHASE = 0.6, 40.0
WINDOW = (4.0, 10.0)
"""[s] over which the paper averages."""
SHOWN = 12.0  # s
PERIODS = 20
"""For how long the robot swims, to see whether it settles."""
SETTLED = 0.01
"""A swim has settled from when the mean of each period is within this part of the final one."""


@dataclasses.dataclass(frozen=True)
class Swim:
    """A straight swim from rest."""

    amplitude: float
    """[degrees]."""
    chains: int
    time: np.ndarray
    """(T,) [s]."""
    speed: np.ndarray
    """(T,) forward velocity of the center of mass, F_b [m/s]."""
    samples: int
    """Samples a period."""
    attack: np.ndarray
    """(T,) angle of attack of the body, atan2(-V_z, V_x) [degrees]."""

    @property
    def average(self) -> np.ndarray:
        """(T,) speed averaged over the period around each time, NaN where that is not whole [m/s]."""
        return period_average(self.speed, self.samples)

    @property
    def window(self) -> np.ndarray:
        """(T,) whether a time is in the window."""
        return (self.time >= WINDOW[0] - 1e-9) & (self.time <= WINDOW[1] + 1e-9)

    @property
    def mean(self) -> float:
        """Mean speed in the window [m/s]."""
        return float(self.speed[self.window].mean())

    @property
    def ripple(self) -> float:
        """Largest less smallest deviation of the speed from its average over a period, in the window [m/s]."""
        return float(np.ptp((self.speed - self.average)[self.window]))

    @property
    def means(self) -> np.ndarray:
        """(periods,) mean speed of each period [m/s]."""
        return self.speed.reshape(-1, self.samples).mean(axis=1)

    @property
    def final(self) -> float:
        """Mean speed of the last quarter of the periods [m/s]."""
        return end_mean(self.means)

    @property
    def settled_from(self) -> int | None:
        """From which period on (0 is the first) each period's mean stays near the final one; None if it does not."""
        return settled(self.means, SETTLED)


def swim(parameters: Parameters | None, amplitude: float, chains: int) -> Swim:
    """Simulate one amplitude [degrees] with so many chains a fin."""
    both = gait(amplitude, FREQUENCY, PHASE)
    swum = record(robot(parameters, fin={'chains': chains}), both, both, PERIODS)
    speed, up = swum.twist[:, 0], swum.twist[:, 2]
    return Swim(amplitude, chains, swum.time, speed, swum.samples, np.degrees(np.arctan2(-up, speed)))


@dataclasses.dataclass(frozen=True)
class Figure9:
    """Straight swims with the paper's number of chains, and with fewer, whose surface stays smooth."""

    height = 3.6

    swims: tuple[Swim, ...]
    smooth: tuple[Swim, ...]

    @classmethod
    def measure(
        cls, parameters: Parameters | None = None, amplitudes: tuple[float, ...] = AMPLITUDES,
        done: Callable[[], object] = lambda: None,
    ) -> Figure9:
        """Simulate every amplitude [degrees]; `done` is called after each."""
        chains = robot(parameters).fin.chains
        swims: dict[int, list[Swim]] = {chains: [], FEW_CHAINS: []}
        for amplitude in amplitudes:
            for number, of_number in swims.items():
                of_number.append(swim(parameters, amplitude, number))
            done()
        return cls(tuple(swims[chains]), tuple(swims[FEW_CHAINS]))

    def columns(self) -> dict[str, np.ndarray]:
        """Return what the figure shows as columns of equal length."""
        columns = {'time [s]': self.swims[0].time}
        for one in (*self.swims, *self.smooth):
            columns[f'forward speed, A = {one.amplitude:g} deg, {one.chains} chains [m/s]'] = one.speed
        return columns

    def draw(self, figure: Figure) -> None:
        """Draw speed against time, with mean and ripple of each amplitude in the legend."""
        axes = figure.subplots()
        axes.axvspan(*WINDOW, color='0.93', zorder=0)
        for full, smooth in zip(self.swims, self.smooth, strict=True):
            color = axes.plot(full.time, full.speed, label=(
                f'A = {full.amplitude:.0f}°: mean {full.mean:.3f} m/s, ripple {full.ripple:.3f} m/s'))[0].get_color()
            axes.plot(smooth.time, smooth.speed, ':', color=color, linewidth=1.2)
        axes.plot([], [], 'k-', label=f'{self.swims[0].chains} chains a fin, as the paper')
        axes.plot([], [], 'k:', label=f'{self.smooth[0].chains} chains, whose surface stays smooth')
        axes.set_xlim(0.0, SHOWN)
        axes.set_xlabel('time [s]')
        axes.set_ylabel('forward speed [m/s]')
        axes.set_title(f'f = {FREQUENCY:g} Hz, φ = {PHASE:.0f}°; gray: the window of mean and ripple', fontsize=9)
        legend_below(figure, axes.get_legend_handles_labels()[0], columns=2)

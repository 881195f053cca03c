"""Figure 8: mean thrust of both fins with the body held, against amplitude and against phase."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from manta_sim_ros.dynamics import FloatArray, Parameters
from manta_sim_ros.figures.gaits import gait, robot
from manta_sim_ros.figures.periodic import recurring
from manta_sim_ros.figures.record import flap
from manta_sim_ros.figures.style import MARKERS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FREQUENCIES = (0.2, 0.3, 0.4, 0.51, 0.6)
"""Frequencies [Hz]; the text names 0.51 Hz, and the prototype reaches 0.6 Hz."""
AMPLITUDES = (10.0, 20.0, 30.0, 40.0, 50.0)
"""Amplitudes [degrees]."""
PHASES = (-30.0, -20.0, -10.0, 0.0, 10.0, 20.0, 30.0)
"""Phases [degrees]."""
PHASE_OF_AMPLITUDES, AMPLITUDE_OF_PHASES = 30.0, 30.0
"""Constant phase of the left plot and constant amplitude of the right plot [degrees]."""


@dataclasses.dataclass(frozen=True)
class Figure8:
    """Mean thrust of both fins over one period, once it is periodic; a negative thrust is backward."""

    height = 3.2

    frequencies: tuple[float, ...]
    """The F frequencies [Hz]."""
    amplitudes: tuple[float, ...]
    """The A amplitudes [degrees], with a phase of 30 degrees."""
    phases: tuple[float, ...]
    """The P phases [degrees], with an amplitude of 30 degrees."""
    thrust_of_amplitude: FloatArray
    """(F, A) mean thrust [N]."""
    thrust_of_phase: FloatArray
    """(F, P) mean thrust [N]."""
    longest_transient: int
    """Largest number of periods before the thrust is periodic, over all gaits."""

    @classmethod
    def measure(
        cls, parameters: Parameters | None = None, frequencies: tuple[float, ...] = FREQUENCIES,
        amplitudes: tuple[float, ...] = AMPLITUDES, phases: tuple[float, ...] = PHASES,
        done: Callable[[], object] = lambda: None,
    ) -> Figure8:
        """Simulate a held robot, by default the paper's, in every gait; `done` is called after each gait."""
        transients = []

        def measured(amplitude: float, frequency: float, phase: float) -> float:
            transient, thrust = mean_thrust(parameters, amplitude, frequency, phase)
            transients.append(transient)
            done()
            return thrust

        of_amplitude = [[measured(amplitude, frequency, PHASE_OF_AMPLITUDES) for amplitude in amplitudes]
                        for frequency in frequencies]
        of_phase = [[measured(AMPLITUDE_OF_PHASES, frequency, phase) for phase in phases]
                    for frequency in frequencies]
        return cls(frequencies, amplitudes, phases, np.array(of_amplitude), np.array(of_phase), max(transients))

    def columns(self) -> dict[str, FloatArray]:
        """Return the data of the figure as columns of equal length, with the rows of the left plot first."""
        rows = [(frequency, amplitude, PHASE_OF_AMPLITUDES, thrust)
                for frequency, thrusts in zip(self.frequencies, self.thrust_of_amplitude, strict=True)
                for amplitude, thrust in zip(self.amplitudes, thrusts, strict=True)]
        rows += [(frequency, AMPLITUDE_OF_PHASES, phase, thrust)
                 for frequency, thrusts in zip(self.frequencies, self.thrust_of_phase, strict=True)
                 for phase, thrust in zip(self.phases, thrusts, strict=True)]
        names = ('frequency [Hz]', 'amplitude [deg]', 'phase [deg]', 'mean thrust [N]')
        return dict(zip(names, np.array(rows).T, strict=True))

    def draw(self, figure: Figure) -> None:
        """Draw the thrust against amplitude and against phase, with a line for each frequency."""
        left, right = figure.subplots(1, 2, sharey=True)
        for marker, frequency, of_amplitude, of_phase in zip(
                MARKERS, self.frequencies, self.thrust_of_amplitude, self.thrust_of_phase, strict=False):
            left.plot(self.amplitudes, of_amplitude, marker=marker, label=f'{frequency:g} Hz')
            right.plot(self.phases, of_phase, marker=marker)
        left.set_xlabel('amplitude A [degrees]')
        left.set_ylabel('mean thrust of both fins [N]')
        left.set_title(f'φ = {PHASE_OF_AMPLITUDES:.0f}°', fontsize=9)
        left.legend(title='frequency', title_fontsize=8)
        right.set_xlabel('phase φ by which the front rod leads [degrees]')
        right.set_title(f'A = {AMPLITUDE_OF_PHASES:.0f}°', fontsize=9)
        for axes in (left, right):
            axes.axhline(0.0, color='0.6', linewidth=0.8, zorder=0)


def mean_thrust(
    parameters: Parameters | None, amplitude: float, frequency: float, phase: float,
) -> tuple[int, float]:
    """Return the number of periods of the transient, with the body held, and the mean thrust [N] of the next period."""
    both = gait(amplitude, frequency, phase)
    held = robot(parameters, solver={'fixed_base': True})
    transient, period = recurring(flap(held, both, both), lambda record: record.wrench[:, 0])
    return transient, float(period.wrench[:, 0].mean())

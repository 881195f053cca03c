"""The gaits of both fins from three controls: amplitude, steering and bias."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from manta_sim_ros.dynamics import FinCommand, Parameters, Simulator

Gaits = tuple[FinCommand, FinCommand]
"""The gaits of the left and the right fin."""


def gaits(frequency: float, phase: float, amplitude: float, steering: float, bias: float) -> Gaits:
    """Return the gaits with a frequency [Hz], a mean phase [rad] and these controls [rad].

    A negative amplitude swims backward: the phase and the bias then have the other sign, so that the robot turns and
    climbs as it does forward. A positive steering turns to the left, and a positive bias climbs.
    """
    if amplitude < 0.0:
        amplitude, phase, bias = -amplitude, -phase, -bias
    left, right = (FinCommand(amplitude, frequency, phase + change, bias, -bias) for change in (-steering, steering))
    return left, right


def check_limits(
    what: str, parameters: Parameters, frequency: float, phase: float, amplitudes: Sequence[float], steering: float,
    bias: float,
) -> None:
    """Refuse limits [rad] of the controls at which the rods cannot follow the gaits.

    Raises
    ------
    ValueError
        Names `what` has these limits, the value and the bound.

    """
    simulator = Simulator(parameters)
    for amplitude, turn, climb in itertools.product(amplitudes, (-steering, steering), (-bias, bias)):
        left, right = gaits(frequency, phase, amplitude, turn, climb)
        try:
            simulator.command(left=left, right=right)
        except ValueError as error:
            raise ValueError(f'at the limits of {what}: {error}') from error

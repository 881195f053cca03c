"""The paper's gaits, in degrees as it has them."""

from __future__ import annotations

import math

from manta_sim_ros.dynamics import FinCommand


def gait(amplitude: float, frequency: float, phase: float = 40.0) -> FinCommand:
    """Return a gait of amplitude and phase in degrees, frequency in Hz."""
    return FinCommand(amplitude=math.radians(amplitude), frequency=frequency, phase=math.radians(phase))


SWIM = gait(40.0, 0.6)
GAITS = {
    'forward, A 40, 0.6 Hz': (SWIM, SWIM),
    'turn 1, phi 40/0, 0.8 Hz': (gait(40.0, 0.8), gait(40.0, 0.8, 0.0)),
    'turn 2, A 40/20, 0.8 Hz': (gait(40.0, 0.8), gait(20.0, 0.8)),
}
"""Left and right gait, of Figures 9 to 11."""

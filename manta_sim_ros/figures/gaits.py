"""The gaits of Section 5, and the parameters of the robot that swims with them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from manta_sim_ros.dynamics import MONOLITHIC, FinCommand, Parameters

FEW_CHAINS = 8
"""Number of chains per fin with which every straight gait of the paper is stable along the chord.

Its turns become unstable later than with the paper's number of chains. See docs/model.md on the number of chains.
"""


def gait(amplitude: float, frequency: float, phase: float = 40.0) -> FinCommand:
    """Return a gait from amplitude [degrees], frequency [Hz] and phase [degrees], by which the front rod leads."""
    return FinCommand(amplitude=math.radians(amplitude), frequency=frequency, phase=math.radians(phase))


STRAIGHT = gait(40.0, 0.6)
"""The gait of Figure 9, where the phase is printed with the opposite sign."""

TURN_FREQUENCY = 0.8
"""Frequency in Figures 10 and 11 [Hz]."""

TURNS = {
    'set 1': (gait(40.0, TURN_FREQUENCY, 40.0), gait(40.0, TURN_FREQUENCY, 0.0)),
    'set 2': (gait(40.0, TURN_FREQUENCY, 40.0), gait(20.0, TURN_FREQUENCY, 40.0)),
}
"""The left and the right fin's gait of the two parameter sets of Figures 10 and 11."""


IN_WATER: dict[str, dict[str, Any]] = {
    'water': {'density': 1000.0, 'added_mass_coefficient': 0.6, 'added_mass_density': 1000.0},
    'body': {
        'drag_coefficient': (0.1, 0.4, 1.0), 'added_mass': (1.4, 2.1, 106.0, 1.15, 2.4, 0.01),
        'quadratic_damping': (0.0, 0.0, 0.0, 2.7, 6.4, 1.28)},
    'fin': {'chains': 12, 'drag_coefficient': 6.0, 'density': 1000.0, 'shear_modulus': 3.8e7},
    'solver': {'time_step': 0.001, 'coupling': MONOLITHIC},
}
"""What config/freshwater.yaml changes: fins that resist twist, and a body in water. A test keeps it equal to the file.

The figures are drawn where the file is not installed.
"""


def robot(base: Parameters | None = None, **groups: Mapping[str, Any]) -> Parameters:
    """Return the paper's robot, which follows commands at once; `groups` replaces values, as in `fin={'chains': 8}`."""
    at_once = {'command_time_constant': 0.0, **groups.pop('rods', {})}
    return (Parameters() if base is None else base).replace(rods=at_once, **groups)

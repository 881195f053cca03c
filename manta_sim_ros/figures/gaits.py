"""The gaits of Section 5, in degrees as the paper has them, and the robot that swims them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from manta_sim_ros.dynamics import FinCommand, Parameters

FEW_CHAINS = 8
"""So few chains stay smooth in every straight gait of the paper, and longer in its turns: docs/model.md, "How many
chains"."""


def gait(amplitude: float, frequency: float, phase: float = 40.0) -> FinCommand:
    """Return a gait from amplitude [degrees], frequency [Hz] and phase [degrees], positive: the front rod leads."""
    return FinCommand(amplitude=math.radians(amplitude), frequency=frequency, phase=math.radians(phase))


STRAIGHT = gait(40.0, 0.6)
"""Figure 9, which prints its phase with the opposite sign."""

TURN_FREQUENCY = 0.8
"""Figures 10 and 11 [Hz]."""

TURNS = {
    'set 1': (gait(40.0, TURN_FREQUENCY, 40.0), gait(40.0, TURN_FREQUENCY, 0.0)),
    'set 2': (gait(40.0, TURN_FREQUENCY, 40.0), gait(20.0, TURN_FREQUENCY, 40.0)),
}
"""Left and right gait of the two parameter sets of Figures 10 and 11."""


def robot(base: Parameters | None = None, **groups: Mapping[str, Any]) -> Parameters:
    """Return the paper's robot, whose gaits begin at once; `groups` replaces values: `robot(fin={'chains': 8})`."""
    at_once = {'command_time_constant': 0.0, **groups.pop('rods', {})}
    return (Parameters() if base is None else base).replace(rods=at_once, **groups)

"""Actions: what each number between -1 and 1 means, and how it commands the fins."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from manta_sim_ros.dynamics import SIDES, FinCommand, FloatArray, Parameters, Simulator, shown
from manta_sim_ros.learning.settings import GAIT, RODS


class Number(NamedTuple):
    """What one number of an action or an observation means."""

    name: str
    unit: str
    low: float
    high: float
    meaning: str


OF_A_GAIT = (
    Number('amplitude', 'rad', 0.0, 0.7, 'amplitude of the rear rod; that of the front rod follows from it'),
    Number('frequency', 'Hz', 0.2, 0.8, 'flapping frequency'),
    Number('phase', 'rad', -0.9, 0.9, 'phase by which the front rod leads; the thrust is forward if it is positive'),
    Number('bias', 'rad', -0.2, 0.2, 'bias of the front rod; that of the rear rod is its opposite'),
)
"""The numbers of the gait of one fin. The rods can follow each gait within these limits, and each change of it: a
smoothed gait stays between the gaits that were commanded."""

OF_RODS = (
    Number('front_rod', 'rad', -0.7, 0.7, 'angle of the front rod, positive with the tip of the fin up'),
    Number('rear_rod', 'rad', -0.7, 0.7, 'angle of the rear rod, positive with the tip of the fin up'),
)
"""The numbers of the rods of one fin."""

OF_A_FIN = {GAIT: OF_A_GAIT, RODS: OF_RODS}
"""The numbers of one fin for each kind of action; an action has those of the left fin first."""


def action_numbers(kind: str) -> tuple[Number, ...]:
    """Return what the numbers of an action mean; -1 stands for `low` and 1 for `high`."""
    return tuple(number._replace(name=f'{side}_{number.name}') for side in SIDES for number in OF_A_FIN[kind])


def in_units(kind: str, action: NDArray[np.floating[Any]]) -> FloatArray:
    """Return an action in its units (2, k) by fin; numbers beyond +-1 are cut.

    Raises
    ------
    ValueError
        It has another shape than (2 k,), or a number is not finite.

    """
    low, high = (np.array([getattr(number, bound) for number in OF_A_FIN[kind]]) for bound in ('low', 'high'))
    numbers = np.asarray(action, dtype=np.float64)
    if numbers.shape != (2 * low.size,) or not np.isfinite(numbers).all():
        raise ValueError(f'the action is {shown(action)}, but must be {2 * low.size} finite numbers')
    return low + 0.5 * (high - low) * (np.clip(numbers, -1.0, 1.0).reshape(2, -1) + 1.0)


def command(simulator: Simulator, kind: str, action: NDArray[np.floating[Any]]) -> None:
    """Command the fins of a simulator as an action says.

    Raises
    ------
    ValueError
        As `in_units`, or the mechanism of these parameters cannot follow.

    """
    values = in_units(kind, action)
    if kind == RODS:
        simulator.command_rods(left=values[0], right=values[1])
        return
    left, right = (
        FinCommand(amplitude, frequency, phase, front_bias=bias, rear_bias=-bias)
        for amplitude, frequency, phase, bias in values.tolist())
    simulator.command(left=left, right=right)


def check_limits(parameters: Parameters, kind: str) -> None:
    """Refuse parameters of a mechanism that cannot follow all actions.

    Raises
    ------
    ValueError
        Names the value of the largest action that the rods cannot follow, and the bound.

    """
    for phase in (-1.0, 1.0):
        for bias in (-1.0, 1.0):
            corner = (1.0, 1.0, phase, bias) if kind == GAIT else (phase, bias)
            command(Simulator(parameters), kind, np.array(2 * corner))

"""Gaits, (38): what a fin may be commanded."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from manta_sim_ros.dynamics._kernels.compilation import announced_compilation
from manta_sim_ros.dynamics._kernels.gait import Gait, largest_rod_difference, largest_transition_difference
from manta_sim_ros.dynamics.parameters import Rods
from manta_sim_ros.dynamics.quantity import ParameterGroup, quantity

SIDES = ('left', 'right')
"""Names of the fins, in the order of every array that has both."""

HIGHEST_FREQUENCY = 5.0
"""Bound of the flapping frequency [Hz]: eight times what the prototype reaches."""


@dataclasses.dataclass(frozen=True)
class FinCommand(ParameterGroup):
    """The gait of one fin: rear rod A sin(psi) + delta_2, front rod A_1 sin(psi + phi) + delta_1, (38).

    Angles are positive with the fin's tip up, on both sides. phi > 0: the front rod leads, the thrust is forward.

    Raises
    ------
    ValueError
        A value is not finite or out of its bounds; names it and the bound.

    """

    amplitude: float = quantity(
        float, unit='rad', low=0.0, high=math.pi / 2,
        description='amplitude A of the rear rod', source='(38)',
    )
    frequency: float = quantity(
        float, unit='Hz', low=0.0, high=HIGHEST_FREQUENCY,
        description='flapping frequency f', source='(38)',
    )
    phase: float = quantity(
        float, unit='rad', low=-2 * math.pi, high=2 * math.pi,
        description='phase phi by which the front rod leads', source='(38)',
    )
    front_bias: float = quantity(
        0.0, unit='rad', low=-math.pi / 2, high=math.pi / 2,
        description='bias delta_1 of the front rod', source='(38)',
    )
    rear_bias: float = quantity(
        0.0, unit='rad', low=-math.pi / 2, high=math.pi / 2,
        description='bias delta_2 of the rear rod', source='(38)',
    )

    def as_array(self) -> np.ndarray:
        """Return amplitude, frequency, phase, front bias, rear bias as an array (5,)."""
        return np.array(dataclasses.astuple(self))


REST = FinCommand(amplitude=0.0, frequency=0.0, phase=0.0)
"""Both rods level and at rest."""


def closure_angle(rods: Rods) -> float:
    """Return the difference of the rod angles [rad] at which the support is fully stretched, |AB| = L in the y-z plane.

    From dy^2 + dz^2 = r_1^2 + r_2^2 - 2 r_1 r_2 cos(a_1 - a_2) = L^2; infinite when the rods cannot get so far apart.
    """
    front, rear = rods.front_radius, rods.rear_radius
    cosine = (front**2 + rear**2 - rods.support_length**2) / (2 * front * rear)
    return math.acos(cosine) if cosine > -1.0 else math.inf


def check_gait(rods: Rods, side: int, command: FinCommand) -> None:
    """Refuse a gait that the rods cannot follow somewhere in its cycle.

    Raises
    ------
    ValueError
        The front rod has no amplitude that reaches the rear rod's height, or the support does not close. Names the
        value and the bound.

    """
    reach = rods.rear_radius * math.sin(command.amplitude)
    if not reach < rods.front_radius:
        raise ValueError(
            f'{SIDES[side]} amplitude is {command.amplitude:g} rad, but the rear rod then reaches {reach:g} m high, '
            f'which must be less than rods.front_radius, {rods.front_radius:g} m'
        )
    difference = largest_rod_difference(rods.rear_radius / rods.front_radius, command.as_array())
    bound = closure_angle(rods)
    if not difference < bound:
        raise ValueError(
            f'{SIDES[side]} amplitude {command.amplitude:g} rad with phase {command.phase:g} rad and biases '
            f'{command.front_bias:g}, {command.rear_bias:g} rad sets the rods {difference:.4g} rad apart in the cycle, '
            f'but the support closes only below {bound:.4g} rad'
        )


def check_present_gait(rods: Rods, side: int, value: np.ndarray) -> None:
    """Refuse a smoothed gait (5,), as a state has it, at which the support does not close.

    Raises
    ------
    ValueError
        Names the difference of the rod angles, and the bound.

    """
    difference = largest_rod_difference(rods.rear_radius / rods.front_radius, value)
    bound = closure_angle(rods)
    if not difference < bound:
        raise ValueError(
            f'{SIDES[side]} state.gait {value.tolist()} sets the rods {difference:.4g} rad apart in the cycle, but the '
            f'support closes only below {bound:.4g} rad'
        )


def check_transition(rods: Rods, side: int, value: np.ndarray, rate: np.ndarray, command: FinCommand) -> None:
    """Refuse a command whose smoothed way from the present gait, `value` and `rate` (5,), breaks the closure.

    Raises
    ------
    ValueError
        Names the difference of the rod angles on the way, and the bound.

    """
    if rods.command_time_constant == 0.0:
        return
    ratio = rods.rear_radius / rods.front_radius
    way = Gait(value.copy(), rate.copy(), command.as_array(), 0.0)  # Numba would compile again for read-only arrays
    with announced_compilation():
        largest = largest_transition_difference(ratio, rods.command_time_constant, way, np.empty_like(way.value))
    bound = closure_angle(rods)
    if not largest < bound:
        apart = f'{largest:.4g} rad' if math.isfinite(largest) else 'further than the front rod can follow'
        raise ValueError(
            f'{SIDES[side]} amplitude {command.amplitude:g} rad with phase {command.phase:g} rad cannot be reached '
            f'from the present gait: on the way the rods come {apart} apart, but the support closes only below '
            f'{bound:.4g} rad; go there by way of a small amplitude'
        )

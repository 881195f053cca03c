"""The commands of the fins, and the checks that the rods can follow them, (38)."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from manta_sim_ros.dynamics._kernels.compilation import announced_compilation
from manta_sim_ros.dynamics._kernels.gait import Gait, largest_rod_difference, largest_transition_difference
from manta_sim_ros.dynamics.parameters import Rods
from manta_sim_ros.dynamics.quantity import FloatArray, ParameterGroup, quantity

SIDES = ('left', 'right')
"""Names of the fins, in the order of every array that has both."""

HIGHEST_FREQUENCY = 5.0
"""Bound of the flapping frequency [Hz]: eight times that of the prototype."""


@dataclasses.dataclass(frozen=True)
class FinCommand(ParameterGroup):
    """The gait of one fin: rear rod A sin(psi) + delta_2, front rod A_1 sin(psi + phi) + delta_1, (38).

    Angles are positive with the tip of the fin up, on both sides. With phi > 0 the front rod leads, and the thrust is
    forward.

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

    def as_array(self) -> FloatArray:
        """Return amplitude, frequency, phase, front bias, rear bias as an array (5,)."""
        return np.array(dataclasses.astuple(self))


REST = FinCommand(amplitude=0.0, frequency=0.0, phase=0.0)
"""Both rods level and at rest."""


def closure_angle(rods: Rods) -> float:
    """Return the difference of the rod angles [rad] at which the support lies in the y-z plane, where it cannot close.

    From dy^2 + dz^2 = r_1^2 + r_2^2 - 2 r_1 r_2 cos(a_1 - a_2) = L^2; infinite if the rod ends are never so far apart.
    """
    front, rear = rods.front_radius, rods.rear_radius
    cosine = (front**2 + rear**2 - rods.support_length**2) / (2 * front * rear)
    return math.acos(cosine) if cosine > -1.0 else math.inf


def check_gait(rods: Rods, side: int, command: FinCommand) -> None:
    """Refuse a gait that the rods cannot follow at some time in its cycle.

    Raises
    ------
    ValueError
        No amplitude of the front rod reaches the height of the rear rod, or the support does not close. Names the
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


def check_present_gait(rods: Rods, side: int, value: FloatArray) -> None:
    """Refuse a smoothed gait (5,) of a state if the support does not close in its cycle.

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


def check_transition(rods: Rods, side: int, value: FloatArray, rate: FloatArray, command: FinCommand) -> None:
    """Refuse a command if the support does not close during the smoothed transition to it.

    The transition starts from the present gait, `value` and `rate` (5,).

    Raises
    ------
    ValueError
        Names the largest difference of the rod angles during the transition, and the bound.

    """
    if rods.command_time_constant == 0.0:
        return
    ratio = rods.rear_radius / rods.front_radius
    transition = Gait(value.copy(), rate.copy(), command.as_array(), 0.0)  # copies: Numba compiles for writable arrays
    with announced_compilation():
        largest = largest_transition_difference(ratio, rods.command_time_constant, transition, np.empty(5))
    bound = closure_angle(rods)
    if not largest < bound:
        apart = f'{largest:.4g} rad' if math.isfinite(largest) else 'further than the front rod can follow'
        raise ValueError(
            f'{SIDES[side]} amplitude {command.amplitude:g} rad with phase {command.phase:g} rad cannot be reached '
            f'from the present gait: the rods come {apart} apart during the transition, but the support closes only '
            f'below {bound:.4g} rad; command a small amplitude in between'
        )

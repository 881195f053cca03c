"""The commands of the fins, and the checks that the rods can follow them, (38)."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from manta_sim_ros.dynamics._kernels.compilation import announced_compilation
from manta_sim_ros.dynamics._kernels.constants import closure_angle, largest_difference
from manta_sim_ros.dynamics._kernels.gait import Gait, largest_rod_difference, largest_transition_difference
from manta_sim_ros.dynamics.parameters import Rods
from manta_sim_ros.dynamics.quantity import FloatArray, ParameterGroup, quantity
from manta_sim_ros.dynamics.state import finite_array

SIDES = ('left', 'right')
"""Names of the fins, in the order of every array that has both."""

LARGEST_ROD_ANGLE = math.pi / 2
"""Bound of the angles that servos are commanded to [rad]."""

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
        return np.array((self.amplitude, self.frequency, self.phase, self.front_bias, self.rear_bias))


REST = FinCommand(amplitude=0.0, frequency=0.0, phase=0.0)
"""Both rods level and at rest."""


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


def servo_targets(rods: Rods, side: int, angles: Sequence[float] | FloatArray) -> FloatArray:
    """Return the angles (2,) of front and rear rod that servos go to when these are commanded [rad].

    They are held at the largest difference at which the support closes with a margin, their mean as commanded.

    Raises
    ------
    ValueError
        There are not two finite angles, or one is beyond +-pi/2; names the rod, the value and the bound.

    """
    wanted = finite_array(f'the {SIDES[side]} command', angles, (2,))
    for name, angle in zip(('front', 'rear'), wanted, strict=True):
        if not abs(angle) <= LARGEST_ROD_ANGLE:
            raise ValueError(
                f'{SIDES[side]} {name} rod is commanded to {angle:g} rad, but must be within +-{LARGEST_ROD_ANGLE:.4g}')
    half, bound = 0.5 * (wanted[0] - wanted[1]), 0.5 * largest_difference(rods)
    if abs(half) > bound:
        wanted = 0.5 * (wanted[0] + wanted[1]) + math.copysign(bound, half) * np.array((1.0, -1.0))
    return wanted


def check_taking_over(rods: Rods, side: int, angles: FloatArray, rates: FloatArray) -> None:
    """Refuse to let servos take over from a gait that turns the rods (2,) apart too fast to stop them in time.

    Raises
    ------
    ValueError
        Names the largest difference of the rod angles, and the bound.

    """
    bound, widest, time_constant = closure_angle(rods), largest_difference(rods), rods.servo_time_constant
    if math.isinf(bound):
        return
    sign = math.copysign(1.0, angles[0] - angles[1])
    left, approach = widest - sign * (angles[0] - angles[1]), sign * (rates[0] - rates[1])
    slope = left / time_constant - approach  # of the critically damped way to the largest difference
    reached = widest - left
    if slope < 0.0:
        reached = widest - slope * time_constant * math.exp(left / (slope * time_constant) - 1.0)
    if not reached < bound:
        raise ValueError(
            f'the {SIDES[side]} rods cannot be taken over from the present gait: they come {reached:.4g} rad apart, '
            f'but the support closes only below {bound:.4g} rad; command a smaller amplitude first')

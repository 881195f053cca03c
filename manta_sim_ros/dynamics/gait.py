"""Gaits, (38): what a fin may be commanded, and how a command becomes the motion of its two rods."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from math import asin, cos, exp, pi, sin, sqrt
from typing import Any

import numpy as np

from manta_sim_ros.dynamics.compilation import announced_compilation, entry_kernel, kernel, source_digest
from manta_sim_ros.dynamics.parameters import Group, Rods, Vector, quantity

SIDES = ('left', 'right')

HIGHEST_FREQUENCY = 5.0
"""Bound of the flapping frequency [Hz]: eight times what the prototype reaches."""


@dataclasses.dataclass(frozen=True)
class FinCommand(Group):
    """The gait of one fin: rear rod A sin(psi) + delta_2, front rod A_1 sin(psi + phi) + delta_1, (38).

    Angles are positive with the fin's tip up, on both sides. phi > 0: the front rod leads, the thrust is forward.

    Raises
    ------
    ValueError
        A value is not finite or out of its bounds; names it and the bound.

    """

    amplitude: float = quantity(float, 'rad', 0.0, pi / 2, 'amplitude A of the rear rod', '(38)')
    frequency: float = quantity(float, 'Hz', 0.0, HIGHEST_FREQUENCY, 'flapping frequency f', '(38)')
    phase: float = quantity(float, 'rad', -2 * pi, 2 * pi, 'phase phi by which the front rod leads', '(38)')
    front_bias: float = quantity(0.0, 'rad', -pi / 2, pi / 2, 'bias delta_1 of the front rod', '(38)')
    rear_bias: float = quantity(0.0, 'rad', -pi / 2, pi / 2, 'bias delta_2 of the rear rod', '(38)')

    def as_array(self) -> np.ndarray:
        """Return amplitude, frequency, phase, front bias, rear bias as an array (5,)."""
        return np.array(dataclasses.astuple(self))


REST = FinCommand(amplitude=0.0, frequency=0.0, phase=0.0)
AMPLITUDE, FREQUENCY, PHASE, FRONT_BIAS, REAR_BIAS = range(len(dataclasses.fields(FinCommand)))

TRANSITION_SAMPLES_PER_TIME_CONSTANT = 16
TRANSITION_TIME_CONSTANTS = 16


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

    The filter's response is known in closed form; it is sampled, and the curvature between samples is allowed for.

    Raises
    ------
    ValueError
        Names the difference of the rod angles on the way, and the bound.

    """
    if rods.command_time_constant == 0.0:
        return
    ratio = rods.rear_radius / rods.front_radius
    with announced_compilation():  # copies: Numba would compile anew for the read-only arrays of a state
        largest = _transition_kernel(ratio, rods.command_time_constant, value.copy(), rate.copy(), command.as_array())
    bound = closure_angle(rods)
    if not largest < bound:
        apart = f'{largest:.4g} rad' if math.isfinite(largest) else 'further than the front rod can follow'
        raise ValueError(
            f'{SIDES[side]} amplitude {command.amplitude:g} rad with phase {command.phase:g} rad cannot be reached '
            f'from the present gait: on the way the rods come {apart} apart, but the support closes only below '
            f'{bound:.4g} rad; go there by way of a small amplitude'
        )


def largest_rod_difference(ratio: float, gait: np.ndarray) -> float:
    """Return the largest |a_1 - a_2| [rad] in a cycle of the gait (5,); infinite when the front rod cannot follow.

    A_1 sin(psi + phi) - A sin(psi) is one sine, whose amplitude is the distance of two phasors.
    """
    rear = gait[0]
    height = ratio * sin(rear)
    if not abs(height) < 1.0:
        return math.inf
    front = asin(height)
    # (A_1 - A)^2 + 4 A_1 A sin^2(phi / 2): the distance of the phasors without cancellation
    swing = sqrt((front - rear) ** 2 + 4.0 * front * rear * sin(0.5 * gait[2]) ** 2)
    return swing + abs(gait[3] - gait[4])


_largest_rod_difference = kernel(largest_rod_difference)


@kernel
def smoothed(
    value: float, rate: float, target: float, time_constant: float, elapsed: float,
) -> tuple[float, float, float, float]:
    """Return value, rate, acceleration and integral of a critically damped second-order filter, `elapsed` [s] later.

    x'' = (u - x) / T^2 - 2 x' / T with u held, exact for any `elapsed`; T = 0 takes u at once.
    """
    if time_constant == 0.0:
        return target, 0.0, 0.0, target * elapsed
    error = value - target
    slope = rate + error / time_constant
    decay = exp(-elapsed / time_constant)
    left = (error + slope * elapsed) * decay
    left_rate = slope * decay - left / time_constant
    left_acceleration = -(slope * decay + left_rate) / time_constant
    integral = (error + slope * time_constant) * (1.0 - decay) - slope * elapsed * decay
    return target + left, left_rate, left_acceleration, target * elapsed + time_constant * integral


def _build_transition_kernel(digest: str) -> Callable[..., Any]:
    @entry_kernel
    def largest_difference_on_the_way(
        ratio: float, time_constant: float, value: np.ndarray, rate: np.ndarray, target: np.ndarray,
    ) -> float:
        _ = digest
        step = time_constant / TRANSITION_SAMPLES_PER_TIME_CONSTANT
        gait = np.empty(5)
        before, here, largest = 0.0, 0.0, 0.0
        for sample in range(TRANSITION_SAMPLES_PER_TIME_CONSTANT * TRANSITION_TIME_CONSTANTS + 1):
            for row in range(5):
                gait[row] = smoothed(value[row], rate[row], target[row], time_constant, sample * step)[0]
            after = _largest_rod_difference(ratio, gait)
            largest = max(largest, after)
            if sample >= 2:  # between samples a curve rises at most an eighth of its second difference above them
                largest = max(largest, here + abs(after - 2.0 * here + before) / 8.0)
            before, here = here, after
        return largest

    return largest_difference_on_the_way


_transition_kernel = _build_transition_kernel(source_digest())


@kernel
def rod_motion(
    ratio: float, time_constant: float, value: np.ndarray, rate: np.ndarray, target: np.ndarray,
    cycle_angle: float, elapsed: float,
) -> tuple[Vector, Vector]:
    """Return angle, rate and acceleration of the front rod, then of the rear rod, `elapsed` [s] after a smoothed gait.

    `value`, `rate`, `target` (5,) are the gait, its rate and the command; `cycle_angle` is psi [rad]; `ratio` is
    r_2 / r_1, from r_1 sin(A_1) = r_2 sin(A). All derivatives are analytic. Equation (38).
    """
    rear, rear_1, rear_2, _ = smoothed(value[AMPLITUDE], rate[AMPLITUDE], target[AMPLITUDE], time_constant, elapsed)
    frequency, frequency_1, _, turns = smoothed(
        value[FREQUENCY], rate[FREQUENCY], target[FREQUENCY], time_constant, elapsed)
    phase, phase_1, phase_2, _ = smoothed(value[PHASE], rate[PHASE], target[PHASE], time_constant, elapsed)
    front_bias = smoothed(value[FRONT_BIAS], rate[FRONT_BIAS], target[FRONT_BIAS], time_constant, elapsed)
    rear_bias = smoothed(value[REAR_BIAS], rate[REAR_BIAS], target[REAR_BIAS], time_constant, elapsed)

    sin_front = ratio * sin(rear)
    cos_front = sqrt(1.0 - sin_front * sin_front)
    front = asin(sin_front)
    front_1 = ratio * cos(rear) * rear_1 / cos_front
    front_2 = (ratio * (cos(rear) * rear_2 - sin(rear) * rear_1**2) + sin_front * front_1**2) / cos_front

    psi = cycle_angle + 2.0 * pi * turns
    psi_1 = 2.0 * pi * frequency
    psi_2 = 2.0 * pi * frequency_1
    return (
        _swing(front, front_1, front_2, psi + phase, psi_1 + phase_1, psi_2 + phase_2, front_bias),
        _swing(rear, rear_1, rear_2, psi, psi_1, psi_2, rear_bias),
    )


@kernel
def _swing(
    amplitude: float, amplitude_1: float, amplitude_2: float, angle: float, angle_1: float, angle_2: float,
    bias: tuple[float, float, float, float],
) -> Vector:
    """Return a = A sin(x) + delta and its first two derivatives; suffixes 1 and 2 are those of A and x."""
    s, c = sin(angle), cos(angle)
    return (
        amplitude * s + bias[0],
        amplitude_1 * s + amplitude * c * angle_1 + bias[1],
        amplitude_2 * s + 2.0 * amplitude_1 * c * angle_1 + amplitude * (c * angle_2 - s * angle_1**2) + bias[2],
    )


@kernel
def advance_gait(
    value: np.ndarray, rate: np.ndarray, target: np.ndarray, cycle_angle: float, time_constant: float,
    elapsed: float,
) -> float:
    """Move the smoothed gait, `value` and `rate` (5,), on by `elapsed` [s] in place; return psi in [0, 2 pi)."""
    turns = smoothed(value[FREQUENCY], rate[FREQUENCY], target[FREQUENCY], time_constant, elapsed)[3]
    for row in range(5):
        value[row], rate[row], _, _ = smoothed(value[row], rate[row], target[row], time_constant, elapsed)
    return (cycle_angle + 2.0 * pi * turns) % (2.0 * pi)

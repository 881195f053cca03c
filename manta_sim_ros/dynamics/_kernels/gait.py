"""Gaits, (38): how a command, smoothed, becomes the motion of the two rods of a fin."""

from __future__ import annotations

from math import asin, cos, exp, inf, pi, sin, sqrt
from typing import NamedTuple

from manta_sim_ros.dynamics._kernels.compilation import entry_kernel, kernel, rare_kernel
from manta_sim_ros.dynamics._kernels.constants import RodConstants
from manta_sim_ros.dynamics.quantity import FloatArray

AMPLITUDE, FREQUENCY, PHASE, FRONT_BIAS, REAR_BIAS = range(5)

_SAMPLES_PER_TIME_CONSTANT, _TIME_CONSTANTS = 16, 16
"""Of a transition from one gait to another."""


class Rod(NamedTuple):
    """Angle [rad] of a rod and its first two time derivatives."""

    angle: float
    angle_dot: float
    angle_ddot: float


class Smoothed(NamedTuple):
    """The output of the filter that smooths a command, and its integral over the time that went by."""

    value: float
    value_dot: float
    value_ddot: float
    integral: float


class Gait(NamedTuple):
    """The gait of one fin; each array (5,) holds amplitude, frequency, phase, front bias and rear bias."""

    value: FloatArray
    rate: FloatArray
    command: FloatArray
    cycle_angle: float  # psi [rad]


@kernel
def smoothed(gait: Gait, row: int, time_constant: float, elapsed: float) -> Smoothed:
    """Return one value of a gait, smoothed by a critically damped second-order filter, `elapsed` [s] later.

    x'' = (u - x) / T^2 - 2 x' / T with the command u held, exact for any `elapsed`; T = 0 takes u at once.
    """
    value, rate, command = gait.value[row], gait.rate[row], gait.command[row]
    if time_constant == 0.0:
        return Smoothed(command, 0.0, 0.0, command * elapsed)
    error = value - command
    slope = rate + error / time_constant
    decay = exp(-elapsed / time_constant)
    left = (error + slope * elapsed) * decay
    left_dot = slope * decay - left / time_constant
    left_ddot = -(slope * decay + left_dot) / time_constant
    integral = (error + slope * time_constant) * (1.0 - decay) - slope * elapsed * decay
    return Smoothed(command + left, left_dot, left_ddot, command * elapsed + time_constant * integral)


@kernel
def rod_motion(rods: RodConstants, gait: Gait, elapsed: float) -> tuple[Rod, Rod]:
    """Return the motion of the front rod, then of the rear rod, `elapsed` [s] after a gait was as it is, (38).

    The amplitude of the front rod is that of r_1 sin(A_1) = r_2 sin(A). All derivatives are analytic.
    """
    if rods.servos:
        return _servo_motion(rods, gait, elapsed)
    time_constant = rods.time_constant
    rear = smoothed(gait, AMPLITUDE, time_constant, elapsed)
    frequency = smoothed(gait, FREQUENCY, time_constant, elapsed)
    phase = smoothed(gait, PHASE, time_constant, elapsed)
    front_bias = smoothed(gait, FRONT_BIAS, time_constant, elapsed)
    rear_bias = smoothed(gait, REAR_BIAS, time_constant, elapsed)

    ratio = rods.rear_radius / rods.front_radius
    sin_front = ratio * sin(rear.value)
    cos_front = sqrt(1.0 - sin_front * sin_front)
    front_dot = ratio * cos(rear.value) * rear.value_dot / cos_front
    front_ddot = (
        ratio * (cos(rear.value) * rear.value_ddot - sin(rear.value) * rear.value_dot**2) + sin_front * front_dot**2
    ) / cos_front
    front = Smoothed(asin(sin_front), front_dot, front_ddot, 0.0)

    turn = 2.0 * pi
    psi = Rod(gait.cycle_angle + turn * frequency.integral, turn * frequency.value, turn * frequency.value_dot)
    ahead = Rod(psi.angle + phase.value, psi.angle_dot + phase.value_dot, psi.angle_ddot + phase.value_ddot)
    return _swing(front, ahead, front_bias), _swing(rear, psi, rear_bias)


@rare_kernel
def _servo_motion(rods: RodConstants, gait: Gait, elapsed: float) -> tuple[Rod, Rod]:
    """Return the motion of both rods that servos turn, `elapsed` [s] after they were as they are.

    a'' = (2 / T) (w - a') with the commanded rate w = (u - a) / (2 T), within the limit: critically damped as long as
    that does not act. The rates are brought closer to each other where the rods would come too far apart: the equation
    keeps a_1' - a_2' <= (D - a_1 + a_2) / T, so that their difference never passes D. Which case acts is decided at the
    beginning of a step.
    """
    time_constant, limit = rods.servo_time_constant, rods.servo_rate_limit
    front_wanted = (gait.command[FRONT_BIAS] - gait.value[FRONT_BIAS]) / (2.0 * time_constant)
    rear_wanted = (gait.command[REAR_BIAS] - gait.value[REAR_BIAS]) / (2.0 * time_constant)
    front, rear = min(max(front_wanted, -limit), limit), min(max(rear_wanted, -limit), limit)
    apart = gait.value[FRONT_BIAS] - gait.value[REAR_BIAS]
    widest = rods.largest_difference
    least, most = (-widest - apart) / (2.0 * time_constant), (widest - apart) / (2.0 * time_constant)
    excess = 0.5 * (front - rear - min(max(front - rear, least), most))
    front, rear = min(max(front - excess, -limit), limit), min(max(rear + excess, -limit), limit)
    return (_servo(gait, FRONT_BIAS, time_constant, front, front == front_wanted, elapsed),
            _servo(gait, REAR_BIAS, time_constant, rear, rear == rear_wanted, elapsed))


@kernel
def _servo(gait: Gait, row: int, time_constant: float, commanded: float, free: bool, elapsed: float) -> Rod:
    """Return the motion of one rod; the commanded rate [rad/s] holds, unless the servo is free of all limits."""
    if free:
        angle = smoothed(gait, row, time_constant, elapsed)
        return Rod(angle.value, angle.value_dot, angle.value_ddot)
    decay = exp(-2.0 * elapsed / time_constant)
    error = gait.rate[row] - commanded
    return Rod(
        gait.value[row] + commanded * elapsed + 0.5 * time_constant * error * (1.0 - decay),
        commanded + error * decay, -2.0 / time_constant * error * decay)


@kernel
def _swing(amplitude: Smoothed, angle: Rod, bias: Smoothed) -> Rod:
    """Return a = A sin(x) + delta with its first two derivatives."""
    s, c = sin(angle.angle), cos(angle.angle)
    return Rod(
        amplitude.value * s + bias.value,
        amplitude.value_dot * s + amplitude.value * c * angle.angle_dot + bias.value_dot,
        amplitude.value_ddot * s + 2.0 * amplitude.value_dot * c * angle.angle_dot
        + amplitude.value * (c * angle.angle_ddot - s * angle.angle_dot**2) + bias.value_ddot,
    )


@kernel
def advance_gait(rods: RodConstants, gait: Gait, elapsed: float) -> float:
    """Move the values and rates of a gait on by `elapsed` [s] in place; return psi then, in [0, 2 pi)."""
    time_constant = rods.time_constant
    if rods.servos:
        front, rear = _servo_motion(rods, gait, elapsed)
        gait.value[FRONT_BIAS], gait.rate[FRONT_BIAS] = front.angle, front.angle_dot
        gait.value[REAR_BIAS], gait.rate[REAR_BIAS] = rear.angle, rear.angle_dot
        return gait.cycle_angle
    turns = smoothed(gait, FREQUENCY, time_constant, elapsed).integral
    for row in range(5):
        later = smoothed(gait, row, time_constant, elapsed)
        gait.value[row], gait.rate[row] = later.value, later.value_dot
    return (gait.cycle_angle + 2.0 * pi * turns) % (2.0 * pi)


def largest_rod_difference(ratio: float, gait: FloatArray) -> float:
    """Return the largest |a_1 - a_2| [rad] in a cycle of the gait (5,); infinite when the front rod cannot follow.

    `ratio` is r_2 / r_1. A_1 sin(psi + phi) - A sin(psi) is one sine, whose amplitude is the distance of two phasors.
    """
    rear = gait[AMPLITUDE]
    height = ratio * sin(rear)
    if not abs(height) < 1.0:
        return inf
    front = asin(height)
    # (A_1 - A)^2 + 4 A_1 A sin^2(phi / 2): the distance of the phasors without cancellation
    swing = sqrt((front - rear) ** 2 + 4.0 * front * rear * sin(0.5 * gait[PHASE]) ** 2)
    return swing + abs(gait[FRONT_BIAS] - gait[REAR_BIAS])


_largest_rod_difference = kernel(largest_rod_difference)


@entry_kernel
def largest_transition_difference(ratio: float, time_constant: float, gait: Gait, scratch: FloatArray) -> float:
    """Return the largest |a_1 - a_2| [rad] on the smoothed way from a gait to its command; `scratch` is (5,).

    The filter's response is known in closed form; it is sampled, and the curvature between samples is allowed for.
    """
    step = time_constant / _SAMPLES_PER_TIME_CONSTANT
    before, here, largest = 0.0, 0.0, 0.0
    for sample in range(_SAMPLES_PER_TIME_CONSTANT * _TIME_CONSTANTS + 1):
        for row in range(5):
            scratch[row] = smoothed(gait, row, time_constant, sample * step).value
        after = _largest_rod_difference(ratio, scratch)
        largest = max(largest, after)
        if sample >= 2:  # between samples a curve rises at most an eighth of its second difference above them
            largest = max(largest, here + abs(after - 2.0 * here + before) / 8.0)
        before, here = here, after
    return largest

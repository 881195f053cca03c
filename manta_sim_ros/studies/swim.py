"""What a swim is worth: thrust, speed, turn, power, cost of transport and Strouhal number over a period."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from manta_sim_ros.dynamics import FloatArray, Parameters, State, fin_surfaces
from manta_sim_ros.nodes.transport import SLOWEST, cost_of_transport

SLOWEST_TURN = 0.01
"""Least yaw rate of a turn that has a radius [degrees/s]."""

CONVERGED = 0.01
"""Largest change of speed and yaw rate from period to period of a motion that has converged, as a share of it."""

SMALL_SPEED, SMALL_TURN = 0.01, 0.5
"""Speed [m/s] and yaw rate [degrees/s] of which that share is taken where they are smaller."""


class Swim(NamedTuple):
    """Means over the last period of a swim."""

    thrust: float
    """Forward force of both fins on the body [N]."""
    speed: float
    """Forward speed over ground [m/s]."""
    yaw_rate: float
    """Rate of the heading [degrees/s], positive to the left."""
    turning_radius: float
    """Speed along the path, without the flapping, over the yaw rate [m]; NaN below SLOWEST_TURN."""
    power: float
    """Power of the motors of all rods into the fins [W]."""
    cost_of_transport: float
    """Power over weight times speed; NaN if the robot does not swim, or has no weight."""
    strouhal: float
    """Frequency times excursion of the fin tips over the forward speed through the water; the mean climb of the
    body is no part of the excursion. NaN if the robot does not swim."""
    converged: bool
    """Whether speed and yaw rate are those of the period before."""


def strouhal(frequency: float, excursion: float, speed: float) -> float:
    """Return the Strouhal number from frequency [Hz], excursion [m] and speed [m/s]; NaN if the robot does not swim."""
    return frequency * excursion / abs(speed) if abs(speed) >= SLOWEST else math.nan


def tip_excursion(
    parameters: Parameters, position: FloatArray, orientation: FloatArray, rod_angles: FloatArray,
    joint_angles: FloatArray,
) -> float:
    """Return the distance [m] between the highest and the lowest position of a fin tip, the mean over all chains.

    The arrays are those of State with time as first axis: (T, 3) [m], (T, 4), (T, 2, 2) and (T, 2, n, m) [rad].
    """
    tips = fin_surfaces(parameters, rod_angles, joint_angles)[:, :, :, -1]
    up = Rotation.from_quat(orientation).as_matrix()[:, 2]
    heights = np.einsum('tfnx,tx->tfn', tips, up) + position[:, 2, None, None]
    return float(np.ptp(heights, axis=0).mean())


def swim(parameters: Parameters, states: Sequence[State], frequency: float, period: float) -> Swim:
    """Return the means over the last period of states at equal intervals, which must cover two periods.

    Parameters
    ----------
    parameters
        All values of the model.
    states
        The first one is at least two periods before the last one.
    frequency
        Of the flapping [Hz]; of two fins with different ones, the lower one.
    period
        Time after which both fins repeat their motion [s].

    """
    time = np.array([state.time for state in states])
    ends = time[-1] - period * np.array([2.0, 1.0, 0.0])
    attitude = Rotation.from_quat([state.orientation for state in states])
    heading = np.unwrap(attitude.as_euler('ZYX')[:, 0])
    turned = Rotation.from_euler('Z', -heading[:, None]) * attitude
    twist = np.array([state.twist for state in states])
    current = attitude.inv().apply(
        parameters.water.current + np.array([state.current_deviation for state in states]))
    along = turned.apply(twist[:, :3])  # in a frame that turns with the heading
    values = np.column_stack([
        [state.wrench[0] for state in states], twist[:, 0], [state.rod_power for state in states],
        twist[:, 0] - current[:, 0], along])
    before, last = np.diff(CubicSpline(time, values).antiderivative()(ends), axis=0) / period
    yaw_rates = np.degrees(np.diff(CubicSpline(time, heading)(ends))) / period
    thrust, speed, power, through_water = last[:4]
    rate = float(yaw_rates[1])
    of_period = states[int(np.searchsorted(time, ends[1], 'right')) - 1:]
    position, *others = (np.array([getattr(state, name) for state in of_period])
                         for name in ('position', 'orientation', 'rod_angles', 'joint_angles'))
    climb = np.linspace(0.0, 1.0, len(position))[:, None] * (position[-1] - position[0])
    excursion = tip_excursion(parameters, position - climb, *others)
    return Swim(
        thrust=float(thrust), speed=float(speed), yaw_rate=rate,
        turning_radius=float(np.linalg.norm(last[4:])) / math.radians(abs(rate)) if abs(rate) >= SLOWEST_TURN
        else math.nan,
        power=float(power), cost_of_transport=cost_of_transport(
            float(power), float(speed), parameters.body.mass * parameters.body.gravity),
        strouhal=strouhal(frequency, excursion, float(through_water)),
        converged=bool(
            abs(speed - before[1]) <= CONVERGED * max(abs(speed), SMALL_SPEED)
            and abs(rate - yaw_rates[0]) <= CONVERGED * max(abs(rate), SMALL_TURN)),
    )

"""The values of the model-predictive follower: limits, horizon and weights."""

from __future__ import annotations

import dataclasses
import math

from manta_sim_ros.dynamics import ParameterGroup, quantity

CHOSEN = 'chosen by measurement'


def error(value: float, unit: str, description: str) -> float:
    """Return a field for a deviation that costs as much as the others: a weight by the rule of Bryson."""
    return quantity(value, unit=unit, low=1e-3, high=1e3, source=CHOSEN,
                    description=f'{description} that costs as much as the other deviations')


@dataclasses.dataclass(frozen=True)
class MpcSettings(ParameterGroup):
    """What the model-predictive follower may be told.

    Raises
    ------
    ValueError
        A value is of another kind or out of its bounds; names it and the bound.

    """

    speed: float = quantity(
        0.22, unit='m/s', low=0.02, high=2.0, description='forward speed through the water that is preferred',
        source='that of path_follower')
    interval: float = quantity(
        0.5, unit='s', low=0.1, high=1.0, description='duration of a stage of the plan', source=CHOSEN)
    stages: int = quantity(20, low=5, high=100, description='number of stages of the plan', source=CHOSEN)
    least_amplitude: float = quantity(
        math.radians(15.0), unit='rad', low=0.0, high=1.0, description='lower limit of the amplitude of the plan',
        source='the robot keeps way in turns')
    largest_amplitude: float = quantity(
        math.radians(40.0), unit='rad', low=0.05, high=1.0, description='upper limit of the amplitude',
        source='the prototype')
    largest_steering: float = quantity(
        math.radians(15.0), unit='rad', low=0.01, high=1.0,
        description='limit of the phase added on the right and subtracted on the left, to turn to the left',
        source='that of path_follower')
    largest_bias: float = quantity(
        math.radians(12.0), unit='rad', low=0.01, high=0.5,
        description='limit of the bias added to the front rods and subtracted from the rear rods, to climb',
        source='that of path_follower')
    rate_limit: float = quantity(
        1.0, unit='rad/s', low=0.01, high=10.0,
        description='fastest change of amplitude, steering and bias', source='well below the rates of the stroke')
    time_limit: float = quantity(
        0.2, unit='s', low=1e-6, high=1e3,
        description='longest time for a plan: then the last plan goes on', source='ten times the usual time')
    patience: float = quantity(
        2.0, unit='s', low=0.0, high=10.0, description='time after the last plan from which the robot glides to rest',
        source=CHOSEN)
    cross_track: float = error(0.1, 'm', 'cross-track error')
    cross_track_rate: float = error(0.1, 'm/s', 'rate of the cross-track error')
    height: float = error(0.05, 'm', 'error of the height')
    height_rate: float = error(0.1, 'm/s', 'rate of the error of the height')
    speed_error: float = error(0.05, 'm/s', 'error of the speed')
    progress: float = error(
        0.05, 'm/s', 'error of the velocity through the water along the path, which tells which way to go,')
    gait_change: float = error(0.1, 'rad', 'difference of a command from the gait in force')
    steering_effort: float = error(0.5, 'rad', 'steering')
    bias_effort: float = error(0.5, 'rad', 'bias')

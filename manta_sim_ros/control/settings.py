"""The values of the path follower: limits, cruise and gains."""

from __future__ import annotations

import dataclasses
import math

from manta_sim_ros.control.gaits import check_limits
from manta_sim_ros.dynamics import FinCommand, ParameterGroup, Parameters, quantity

GAINS = 'computed by path_gains with config/freshwater.yaml'


@dataclasses.dataclass(frozen=True)
class FollowerSettings(ParameterGroup):
    """What the path follower may be told.

    Raises
    ------
    ValueError
        A value is of another kind or out of its bounds; names it and the bound.

    """

    amplitude: float = quantity(
        math.radians(20.0), unit='rad', low=0.05, high=1.0,
        description='amplitude of the cruise, about which the model is linear',
        source='0.2 m/s in fresh water: the faster it is, the more it pitches instead of climbing')
    frequency: float = quantity(
        0.6, unit='Hz', low=0.1, high=2.0, description='flapping frequency', source='the prototype')
    phase: float = quantity(
        math.radians(40.0), unit='rad', low=0.1, high=1.5,
        description='mean phase of both fins', source='the prototype')
    speed: float = quantity(
        0.22, unit='m/s', low=0.02, high=2.0,
        description='forward speed through the water that is held with the amplitude', source=GAINS)
    lookahead: float = quantity(
        2.4, unit='m', low=0.05, high=10.0,
        description='length over which the course of the path is taken, so that corners are rounded',
        source='chosen: with less, the robot overshoots at corners')
    largest_amplitude: float = quantity(
        math.radians(40.0), unit='rad', low=0.05, high=1.0, description='upper limit of the amplitude',
        source='the prototype')
    largest_steering: float = quantity(
        math.radians(17.0), unit='rad', low=0.01, high=1.0,
        description='limit of the phase added on the right and subtracted on the left, to turn to the left',
        source='more turns hardly faster, but swims slower, except in a climb')
    largest_bias: float = quantity(
        math.radians(12.0), unit='rad', low=0.01, high=0.5,
        description='limit of the bias added to the front rods and subtracted from the rear rods, to climb',
        source='beyond it the drag takes more speed than the lift gives')
    rate_limit: float = quantity(
        1.0, unit='rad/s', low=0.01, high=10.0,
        description='fastest change of amplitude, steering and bias', source='well below the rates of the stroke')
    steering_gains: tuple[float, ...] = quantity(
        (0.8791, -0.2201, 2.069, 0.1642, 1.325, 0.8487), low=-100.0, high=100.0,
        description='steering [rad] per v, p, r, roll, heading and cross-track error [SI, rad]',
        source=GAINS)
    depth_gains: tuple[float, ...] = quantity(
        (0.5181, -0.175, -0.1352, 1.635, 0.07604), low=-100.0, high=100.0,
        description='bias [rad] per w, q, pitch, height and its integral [SI, rad]', source=GAINS)
    speed_gains: tuple[float, ...] = quantity(
        (1.191, 0.4335), low=-100.0, high=100.0,
        description='amplitude [rad] per u and its integral [SI]', source=GAINS)
    speed_model: tuple[float, ...] = quantity(
        (0.5736, 2.781), low=0.0, high=100.0,
        description='change of the speed through the water per amplitude [m/s/rad], and its time constant [s]',
        source=GAINS)
    turn_response: float = quantity(
        0.329, unit='1/s^2', low=0.01, high=100.0, description='yaw acceleration per steering', source=GAINS)
    sideslip: float = quantity(
        -0.2793, unit='m', low=-10.0, high=10.0,
        description='lateral velocity through the water per yaw rate', source=GAINS)

    def __post_init__(self) -> None:
        """Check every field, and the gains that guidance divides by."""
        super().__post_init__()
        if not self.speed_model[1] > 0.0:
            raise ValueError(f'speed_model[1] is {self.speed_model[1]:g} s, but must be above 0')
        if not min(self.steering_gains[4:6]) > 0.0:
            raise ValueError(
                f'steering_gains of heading and cross-track error are {list(self.steering_gains[4:6])}, but must be '
                'above 0')

    @property
    def cruise(self) -> FinCommand:
        """The gait about which the model is linear."""
        return FinCommand(self.amplitude, self.frequency, self.phase)

    @property
    def period(self) -> float:
        """Flapping period [s]."""
        return 1.0 / self.frequency

    def check_limits(self, parameters: Parameters) -> None:
        """Refuse a robot whose rods cannot follow the gaits at the limits.

        Raises
        ------
        ValueError
            Names the value and the bound.

        """
        check_limits('the path follower', parameters, self.frequency, self.phase, [self.largest_amplitude],
                     self.largest_steering, self.largest_bias)

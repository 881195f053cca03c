"""Manual control: from throttle, steering and climb to the gaits of both fins, with limits and limited rates."""

from __future__ import annotations

import dataclasses
import math
from typing import NamedTuple

from manta_sim_ros.control.gaits import Gaits, check_limits, gaits
from manta_sim_ros.dynamics import ParameterGroup, Parameters, quantity


class Demand(NamedTuple):
    """What an operator asks for, each from -1 to 1."""

    throttle: float = 0.0
    """Amplitude of the fins, in parts of its limit; a negative one swims backward."""
    steer: float = 0.0
    """Difference of the phases, in parts of its limit; positive turns to the left."""
    climb: float = 0.0
    """Bias of the rods, in parts of its limit; positive climbs."""


NEUTRAL = Demand()


@dataclasses.dataclass(frozen=True)
class ManualSettings(ParameterGroup):
    """The gait of manual control, and its limits.

    Raises
    ------
    ValueError
        A value is of another kind or out of its bounds; names it and the bound.

    """

    frequency: float = quantity(
        0.6, unit='Hz', low=0.1, high=2.0, description='flapping frequency', source='the prototype')
    phase: float = quantity(
        math.radians(40.0), unit='rad', low=0.1, high=1.5,
        description='mean phase of both fins; its negative swims backward', source='the prototype')
    largest_amplitude: float = quantity(
        math.radians(40.0), unit='rad', low=0.05, high=1.0, description='amplitude at full throttle',
        source='the prototype')
    largest_steering: float = quantity(
        math.radians(15.0), unit='rad', low=0.01, high=1.0,
        description='phase added on the right and subtracted on the left to turn to the left',
        source='as of the path follower')
    largest_bias: float = quantity(
        math.radians(12.0), unit='rad', low=0.01, high=0.5,
        description='bias added to the front rods and subtracted from the rear rods to climb',
        source='as of the path follower')
    rate_limit: float = quantity(
        1.0, unit='rad/s', low=0.01, high=10.0, description='fastest change of amplitude, steering and bias',
        source='as of the path follower')


class ManualControl:
    """The gaits of both fins, on their way to what is demanded.

    Amplitude, steering and bias each change at the limited rate. The phase takes the sign of the amplitude where that
    passes 0, and so does the bias: then the robot turns and climbs as demanded when it swims backward, too.

    Parameters
    ----------
    settings
        The gait and its limits.
    parameters
        All values of the model, whose mechanism limits the gaits.

    Raises
    ------
    ValueError
        The rods cannot follow a gait within the limits; names the value and the bound.

    """

    def __init__(self, settings: ManualSettings | None = None, parameters: Parameters | None = None) -> None:
        self.settings = settings = ManualSettings() if settings is None else settings
        self._amplitude = self._steering = self._bias = 0.0  # [rad]; a negative amplitude swims backward
        check_limits(
            'manual control', Parameters() if parameters is None else parameters, settings.frequency, settings.phase,
            [-settings.largest_amplitude, settings.largest_amplitude], settings.largest_steering,
            settings.largest_bias)

    @property
    def gaits(self) -> Gaits:
        """The present gaits."""
        return gaits(self.settings.frequency, self.settings.phase, self._amplitude, self._steering, self._bias)

    def update(self, elapsed: float, demand: Demand) -> Gaits:
        """Return the gaits after `elapsed` [s] on their way to a demand; a demand beyond 1 counts as 1."""
        settings, step = self.settings, self.settings.rate_limit * elapsed
        throttle, steer, climb = (min(max(part, -1.0), 1.0) for part in demand)
        self._amplitude = _toward(self._amplitude, throttle * settings.largest_amplitude, step)
        self._steering = _toward(self._steering, steer * settings.largest_steering, step)
        self._bias = _toward(self._bias, climb * settings.largest_bias, step)
        return self.gaits

    def stop(self) -> Gaits:
        """Return the gaits with the amplitude 0 and level rods, from which the next ones start."""
        self._amplitude = self._steering = self._bias = 0.0
        return self.gaits


def _toward(value: float, wanted: float, step: float) -> float:
    return value + min(max(wanted - value, -step), step)

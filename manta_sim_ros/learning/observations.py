"""Observations: what each number means, and how it follows from a state."""

from __future__ import annotations

import math

import numpy as np

from manta_sim_ros.dynamics import SIDES, FloatArray, State
from manta_sim_ros.learning.actions import Number
from manta_sim_ros.sensors import OdometryNoise, read_odometry

AXES = ('x', 'y', 'z')
RODS = tuple(f'{side}_{rod}_rod' for side in SIDES for rod in ('front', 'rear'))

OBSERVATION = (
    Number('distance', 'm', 0.0, 100.0, 'distance of the target from the center of mass'),
    *(Number(f'direction_{axis}', '', -1.0, 1.0, f'direction to the target, body frame, along {axis}')
      for axis in AXES),
    *(Number(f'up_{axis}', '', -1.0, 1.0, f'direction upward, body frame, along {axis}') for axis in AXES),
    *(Number(f'velocity_{axis}', 'm/s', -5.0, 5.0, f'velocity over ground, body frame, along {axis}')
      for axis in AXES),
    *(Number(f'angular_velocity_{axis}', 'rad/s', -20.0, 20.0, f'angular velocity, body frame, about {axis}')
      for axis in AXES),
    *(Number(f'{rod}_angle', 'rad', -0.5 * math.pi, 0.5 * math.pi, 'angle of this rod, positive with the tip up')
      for rod in RODS),
    *(Number(f'{rod}_rate', 'rad/s', -20.0, 20.0, 'rate of this rod') for rod in RODS),
)
"""What the numbers of an observation mean; values beyond `low` and `high` are cut.

Body frame: x forward, y left, z up, origin at the center of mass.
"""

LOW, HIGH = (np.array([getattr(number, bound) for number in OBSERVATION]) for bound in ('low', 'high'))

_POLAR, _AXIAL = (1.0, -1.0, 1.0), (-1.0, 1.0, -1.0)
_SIGNS = np.array((1.0, *_POLAR, *_POLAR, *_POLAR, *_AXIAL, *8 * (1.0,)))
_ORDER = np.array((*range(13), 15, 16, 13, 14, 19, 20, 17, 18))


def observe(state: State, target: FloatArray, noise: OdometryNoise) -> FloatArray:
    """Return the observation (21,) of a state with a target (3,) [m], world frame, as OBSERVATION says.

    Position, orientation and twist have the noise; the rods have none.
    """
    reading = read_odometry(noise, state)
    x, y, z, w = reading.orientation.tolist()
    to_world = np.array((
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)),
        (2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)),
        (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y))))
    offset = target - reading.position
    distance = math.sqrt(offset @ offset)
    direction = offset @ to_world / distance if distance > 0.0 else np.zeros(3)
    values = np.concatenate((
        (distance,), direction, to_world[2], reading.twist, state.rod_angles.ravel(), state.rod_rates.ravel()))
    return np.clip(values, LOW, HIGH)


def mirrored(observations: FloatArray) -> FloatArray:
    """Return observations (..., 21) as they are in a world that is mirrored at the plane y = 0 of the body."""
    return _SIGNS * observations[..., _ORDER]

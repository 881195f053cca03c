"""The sensors of the robot: the exact values of a state, with a bias and noise."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import ClassVar, NamedTuple

import numpy as np

from manta_sim_ros.dynamics import (
    LARGEST_SEED,
    FloatArray,
    ParameterGroup,
    Parameters,
    State,
    Vector,
    gaussian_noise,
    quantity,
)

MICROSECONDS = 1_000_000
"""Resolution of the time on which the noise depends [1/s]."""

IMU_STREAM, PRESSURE_STREAM = 1, 2
"""Streams of random numbers: sensors with the same seed have independent noise."""


@dataclasses.dataclass(frozen=True)
class Imu(ParameterGroup):
    """An inertial measurement unit at the center of mass, its axes those of the body frame.

    The noise is Gaussian with zero mean, and independent from axis to axis and from reading to reading. A bias is added
    to each reading.
    """

    prefix: ClassVar[str] = 'imu.'

    acceleration_noise: float = quantity(
        0.02, unit='m/s^2', low=0.0, high=100.0, live=True,
        description='standard deviation of the noise of the specific force along each axis',
        source='chosen: a small MEMS unit',
    )
    acceleration_bias: Vector = quantity(
        (0.0, 0.0, 0.0), unit='m/s^2', low=-100.0, high=100.0, live=True,
        description='bias of the specific force, body frame [x, y, z]', source='chosen',
    )
    angular_velocity_noise: float = quantity(
        0.002, unit='rad/s', low=0.0, high=10.0, live=True,
        description='standard deviation of the noise of the angular velocity about each axis',
        source='chosen: a small MEMS unit',
    )
    angular_velocity_bias: Vector = quantity(
        (0.0, 0.0, 0.0), unit='rad/s', low=-10.0, high=10.0, live=True,
        description='bias of the angular velocity, body frame [x, y, z]', source='chosen',
    )
    orientation_noise: float = quantity(
        0.01, unit='rad', low=0.0, high=1.0, live=True,
        description='standard deviation of the error of the orientation, as an angle about each axis',
        source='chosen: a small MEMS unit',
    )
    seed: int = quantity(
        0, low=0, high=LARGEST_SEED, live=True,
        description='seed of the noise', source='chosen',
    )


@dataclasses.dataclass(frozen=True)
class Pressure(ParameterGroup):
    """A pressure sensor at the center of mass, with Gaussian noise and a bias like those of `Imu`."""

    prefix: ClassVar[str] = 'pressure.'

    noise: float = quantity(
        20.0, unit='Pa', low=0.0, high=1e6, live=True,
        description='standard deviation of the noise', source='chosen: 2 mm of water, as for depth sensors',
    )
    bias: float = quantity(
        0.0, unit='Pa', low=-1e6, high=1e6, live=True,
        description='bias', source='chosen',
    )
    atmospheric: float = quantity(
        101325.0, unit='Pa', low=0.0, high=1e6, live=True,
        description='pressure at and above the surface', source='ISO 2533',
    )
    water_density: float = quantity(
        1000.0, unit='kg/m^3', low=0.0, high=1e5, live=True,
        description='density of the water for the hydrostatic pressure; water.density is only for the drag',
        source='fresh water',
    )
    seed: int = quantity(
        0, low=0, high=LARGEST_SEED, live=True,
        description='seed of the noise', source='chosen',
    )


class ImuReading(NamedTuple):
    """The readings of an IMU at one time."""

    orientation: FloatArray
    """(4,) unit quaternion x, y, z, w: body to world components."""
    angular_velocity: FloatArray
    """(3,) body frame [rad/s]."""
    specific_force: FloatArray
    """(3,) acceleration less gravity, body frame [m/s^2]: +g upward at rest."""


def read_imu(imu: Imu, parameters: Parameters, state: State) -> ImuReading:
    """Return the readings of an IMU in a state; the noise depends only on the seed and on the time.

    Gravity is `body.gravity`, and the acceleration is that of the state.
    """
    noise = _noise(imu.seed, IMU_STREAM, state.time, 9)
    x, y, z, w = state.orientation.tolist()
    up = np.array((2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)))  # the world's z in F_b
    vx, vy, vz, wx, wy, wz = state.twist.tolist()
    turning = np.array((wy * vz - wz * vy, wz * vx - wx * vz, wx * vy - wy * vx))  # Omega x V; numpy.cross costs 20 us
    specific_force = state.acceleration[:3] + turning + parameters.body.gravity * up
    return ImuReading(
        orientation=_turned((x, y, z, w), (imu.orientation_noise * noise[6:]).tolist()),
        angular_velocity=state.twist[3:] + imu.angular_velocity_bias + imu.angular_velocity_noise * noise[3:6],
        specific_force=specific_force + imu.acceleration_bias + imu.acceleration_noise * noise[:3],
    )


def _turned(quaternion: Sequence[float], rotation_vector: Sequence[float]) -> FloatArray:
    """Return a quaternion (x, y, z, w) turned by a rotation vector in the moving frame [rad].

    SciPy's Rotation would take a quarter of the processor time of the whole node.
    """
    x, y, z, w = quaternion
    angle = math.hypot(*rotation_vector)
    p, q, r = (component * (math.sin(0.5 * angle) / angle if angle > 0.0 else 0.5) for component in rotation_vector)
    s = math.cos(0.5 * angle)
    return np.array((
        w * p + x * s + y * r - z * q, w * q - x * r + y * s + z * p, w * r + x * q - y * p + z * s,
        w * s - x * p - y * q - z * r))


def read_pressure(pressure: Pressure, parameters: Parameters, state: State) -> float:
    """Return the absolute pressure that a sensor reads in a state [Pa]; the noise depends only on seed and time.

    The water below `water.surface_height` is at rest under `body.gravity`; above the surface the pressure is that of
    the air.
    """
    depth = max(0.0, parameters.water.surface_height - float(state.position[2]))
    true = pressure.atmospheric + pressure.water_density * parameters.body.gravity * depth
    return true + pressure.bias + pressure.noise * float(_noise(pressure.seed, PRESSURE_STREAM, state.time, 1)[0])


def _noise(seed: int, stream: int, time: float, count: int) -> FloatArray:
    """Return `count` independent random numbers of zero mean and standard deviation 1 for a sensor at a time [s]."""
    return gaussian_noise(seed, stream, round(time * MICROSECONDS), count)

"""What the robot's sensors read: the truth of a state, with their biases and their noise."""

from __future__ import annotations

import dataclasses
import math
from typing import ClassVar, NamedTuple

import numpy as np

from manta_sim_ros.dynamics import Parameters, State
from manta_sim_ros.dynamics.parameters import LARGEST_SEED, Group, Vector, quantity

MICROSECONDS = 1_000_000
"""Readings less than that apart have the same noise [1/s]."""

IMU_STREAM, PRESSURE_STREAM = 1, 2
"""Keep the noises of sensors with one seed apart."""


@dataclasses.dataclass(frozen=True)
class Imu(Group):
    """An inertial measurement unit at the centre of mass, its axes those of the body frame.

    Noise is Gaussian, of zero mean and this standard deviation along each axis, independent from reading to reading;
    a bias is added to each reading.
    """

    prefix: ClassVar[str] = 'imu.'

    acceleration_noise: float = quantity(
        0.02, 'm/s^2', 0.0, 100.0, 'standard deviation of the noise of the specific force along each axis',
        'chosen: a small MEMS unit',
    )
    acceleration_bias: Vector = quantity(
        (0.0, 0.0, 0.0), 'm/s^2', -100.0, 100.0, 'bias of the specific force, body frame [x, y, z]', 'chosen',
    )
    angular_velocity_noise: float = quantity(
        0.002, 'rad/s', 0.0, 10.0, 'standard deviation of the noise of the angular velocity about each axis',
        'chosen: a small MEMS unit',
    )
    angular_velocity_bias: Vector = quantity(
        (0.0, 0.0, 0.0), 'rad/s', -10.0, 10.0, 'bias of the angular velocity, body frame [x, y, z]', 'chosen',
    )
    orientation_noise: float = quantity(
        0.01, 'rad', 0.0, 1.0, 'standard deviation of the angle by which the orientation is off about each axis',
        'chosen: a small MEMS unit',
    )
    seed: int = quantity(0, '', 0, LARGEST_SEED, 'seed of the noise', 'chosen')


@dataclasses.dataclass(frozen=True)
class Pressure(Group):
    """A pressure sensor at the centre of mass, Gaussian noise and a bias as those of `Imu`."""

    prefix: ClassVar[str] = 'pressure.'

    noise: float = quantity(
        20.0, 'Pa', 0.0, 1e6, 'standard deviation of the noise', 'chosen: 2 mm of water, as depth sensors resolve',
    )
    bias: float = quantity(0.0, 'Pa', -1e6, 1e6, 'bias', 'chosen')
    atmospheric: float = quantity(101325.0, 'Pa', 0.0, 1e6, 'pressure at and above the surface', 'ISO 2533')
    water_density: float = quantity(
        1000.0, 'kg/m^3', 0.0, 1e5, 'density that the pressure grows with; water.density is one of drag', 'fresh water',
    )
    seed: int = quantity(0, '', 0, LARGEST_SEED, 'seed of the noise', 'chosen')


class ImuReading(NamedTuple):
    """What an IMU reads at one time."""

    orientation: np.ndarray
    """(4,) unit quaternion x, y, z, w: body to world components."""
    angular_velocity: np.ndarray
    """(3,) body frame [rad/s]."""
    specific_force: np.ndarray
    """(3,) acceleration less gravity, body frame [m/s^2]: +g upwards at rest."""


def read_imu(imu: Imu, parameters: Parameters, state: State) -> ImuReading:
    """Return what an IMU reads in a state; the noise depends on the seed and on the time only.

    Gravity is `body.gravity`. The acceleration is the state's.
    """
    noise = _noise(imu.seed, IMU_STREAM, state.time, 9)
    (vx, vy, vz), (wx, wy, wz) = state.twist[:3].tolist(), state.twist[3:].tolist()
    x, y, z, w = state.orientation.tolist()
    up = (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y))  # third row of R_b
    turning = np.array((wy * vz - wz * vy, wz * vx - wx * vz, wx * vy - wy * vx))
    specific_force = state.acceleration[:3] + turning + np.multiply(parameters.body.gravity, up)
    return ImuReading(
        orientation=_turned((x, y, z, w), (imu.orientation_noise * noise[6:]).tolist()),
        angular_velocity=state.twist[3:] + imu.angular_velocity_bias + imu.angular_velocity_noise * noise[3:6],
        specific_force=specific_force + imu.acceleration_bias + imu.acceleration_noise * noise[:3],
    )


def read_pressure(pressure: Pressure, parameters: Parameters, state: State) -> float:
    """Return what a pressure sensor reads in a state [Pa], absolute; the noise depends on the seed and time only.

    Of water at rest below `water.surface_height`, with `body.gravity`; above the surface the pressure is the air's.
    """
    depth = max(0.0, parameters.water.surface_height - float(state.position[2]))
    true = pressure.atmospheric + pressure.water_density * parameters.body.gravity * depth
    return true + pressure.bias + pressure.noise * float(_noise(pressure.seed, PRESSURE_STREAM, state.time, 1)[0])


def _turned(orientation: tuple[float, float, float, float], rotation: list[float]) -> np.ndarray:
    """Return a quaternion (x, y, z, w) turned further by a rotation vector [rad] in the turned frame."""
    x, y, z, w = orientation
    angle = math.hypot(*rotation)
    part = 0.5 if angle == 0.0 else math.sin(0.5 * angle) / angle
    p, q, r = (part * component for component in rotation)
    s = math.cos(0.5 * angle)
    return np.array((
        w * p + x * s + y * r - z * q, w * q - x * r + y * s + z * p, w * r + x * q - y * p + z * s,
        w * s - x * p - y * q - z * r))


def _noise(seed: int, stream: int, time: float, count: int) -> np.ndarray:
    """Return `count` independent numbers of zero mean and standard deviation 1, those of a sensor at a time [s]."""
    moment = round(time * MICROSECONDS) % 2**64
    return np.random.Generator(np.random.Philox(key=seed, counter=[0, 0, stream, moment])).standard_normal(count)

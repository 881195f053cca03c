"""What the robot's sensors read: the truth of a state, with their biases and their noise."""

from __future__ import annotations

import dataclasses
from typing import ClassVar, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from manta_sim_ros.dynamics import LARGEST_SEED, ParameterGroup, Parameters, State, Vector, quantity

MICROSECONDS = 1_000_000
"""Readings less than that apart have the same noise [1/s]."""

IMU_STREAM, PRESSURE_STREAM = 1, 2
"""Keep the noises of sensors with one seed apart."""


@dataclasses.dataclass(frozen=True)
class Imu(ParameterGroup):
    """An inertial measurement unit at the center of mass, its axes those of the body frame.

    Noise is Gaussian, of zero mean and this standard deviation along each axis, independent from reading to reading;
    a bias is added to each reading.
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
        description='standard deviation of the angle by which the orientation is off about each axis',
        source='chosen: a small MEMS unit',
    )
    seed: int = quantity(
        0, low=0, high=LARGEST_SEED, live=True,
        description='seed of the noise', source='chosen',
    )


@dataclasses.dataclass(frozen=True)
class Pressure(ParameterGroup):
    """A pressure sensor at the center of mass, Gaussian noise and a bias as those of `Imu`."""

    prefix: ClassVar[str] = 'pressure.'

    noise: float = quantity(
        20.0, unit='Pa', low=0.0, high=1e6, live=True,
        description='standard deviation of the noise', source='chosen: 2 mm of water, as depth sensors resolve',
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
        description='density that the pressure grows with; water.density is one of drag', source='fresh water',
    )
    seed: int = quantity(
        0, low=0, high=LARGEST_SEED, live=True,
        description='seed of the noise', source='chosen',
    )


class ImuReading(NamedTuple):
    """What an IMU reads at one time."""

    orientation: np.ndarray
    """(4,) unit quaternion x, y, z, w: body to world components."""
    angular_velocity: np.ndarray
    """(3,) body frame [rad/s]."""
    specific_force: np.ndarray
    """(3,) acceleration less gravity, body frame [m/s^2]: +g upward at rest."""


def read_imu(imu: Imu, parameters: Parameters, state: State) -> ImuReading:
    """Return what an IMU reads in a state; the noise depends on the seed and on the time only.

    Gravity is `body.gravity`. The acceleration is the state's.
    """
    noise = _noise(imu.seed, IMU_STREAM, state.time, 9)
    attitude = Rotation.from_quat(state.orientation)
    up = attitude.as_matrix()[2]  # the world's z axis in F_b
    velocity, omega = state.twist[:3], state.twist[3:]
    specific_force = state.acceleration[:3] + np.cross(omega, velocity) + parameters.body.gravity * up
    return ImuReading(
        orientation=(attitude * Rotation.from_rotvec(imu.orientation_noise * noise[6:])).as_quat(),
        angular_velocity=omega + imu.angular_velocity_bias + imu.angular_velocity_noise * noise[3:6],
        specific_force=specific_force + imu.acceleration_bias + imu.acceleration_noise * noise[:3],
    )


def read_pressure(pressure: Pressure, parameters: Parameters, state: State) -> float:
    """Return what a pressure sensor reads in a state [Pa], absolute; the noise depends on the seed and time only.

    Of water at rest below `water.surface_height`, with `body.gravity`; above the surface the pressure is the air's.
    """
    depth = max(0.0, parameters.water.surface_height - float(state.position[2]))
    true = pressure.atmospheric + pressure.water_density * parameters.body.gravity * depth
    return true + pressure.bias + pressure.noise * float(_noise(pressure.seed, PRESSURE_STREAM, state.time, 1)[0])


def _noise(seed: int, stream: int, time: float, count: int) -> np.ndarray:
    """Return `count` independent numbers of zero mean and standard deviation 1, those of a sensor at a time [s]."""
    moment = round(time * MICROSECONDS) % 2**64
    return np.random.Generator(np.random.Philox(key=seed, counter=[0, 0, stream, moment])).standard_normal(count)

"""The sensors of the robot: the exact values of a state, with a bias and noise."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import ClassVar, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import ndtr

from manta_sim_ros.dynamics import (
    LARGEST_SEED,
    FloatArray,
    ParameterGroup,
    Parameters,
    State,
    Vector,
    gaussian_noise,
    quantity,
    random_walk,
)

MICROSECONDS = 1_000_000
"""Resolution of the time on which the noise depends [1/s]."""

IMU_STREAM, PRESSURE_STREAM, IMU_BIAS_STREAM, ODOMETRY_STREAM, VELOCITY_STREAM = 1, 2, 3, 4, 5
"""Streams of random numbers: sensors with the same seed have independent noise."""

BODY_FRAME = 'base_frame'
"""Stands for the name of the body frame, the node's parameter `base_frame`."""


@dataclasses.dataclass(frozen=True)
class Imu(ParameterGroup):
    """An inertial measurement unit, fixed to the body with a position and an orientation.

    The noise is Gaussian with zero mean, and independent from axis to axis and from reading to reading. A bias is added
    to each reading, which may walk from its first value as the integral of white noise does.
    """

    prefix: ClassVar[str] = 'imu.'

    rate: float = quantity(
        0.0, unit='Hz', low=0.0, high=1000.0, live=True,
        description='rate of imu/data in simulated time, at most publish_rate; 0 is publish_rate', source='chosen',
    )
    frame: str = quantity(
        BODY_FRAME,
        description=f'name of the frame of the IMU; {BODY_FRAME} is the body frame, without position and orientation',
        source='REP 145',
    )
    position: Vector = quantity(
        (0.0, 0.0, 0.0), unit='m', low=-10.0, high=10.0,
        description='position of the IMU from the center of mass, body frame [x, y, z]', source='chosen',
    )
    orientation: Vector = quantity(
        (0.0, 0.0, 0.0), unit='rad', low=-7.0, high=7.0,
        description='orientation of the IMU in the body frame, about its fixed axes [roll, pitch, yaw]',
        source='as in URDF',
    )

    acceleration_noise: float = quantity(
        0.02, unit='m/s^2', low=0.0, high=100.0, live=True,
        description='standard deviation of the noise of the specific force along each axis',
        source='chosen: a small MEMS unit',
    )
    acceleration_bias: Vector = quantity(
        (0.0, 0.0, 0.0), unit='m/s^2', low=-100.0, high=100.0, live=True,
        description='bias of the specific force at the start, axes of the IMU [x, y, z]', source='chosen',
    )
    acceleration_bias_walk: float = quantity(
        0.0, unit='m/s^2/sqrt(s)', low=0.0, high=100.0, live=True,
        description='random walk of that bias along each axis: standard deviation of its change in one second',
        source='chosen',
    )
    angular_velocity_noise: float = quantity(
        0.002, unit='rad/s', low=0.0, high=10.0, live=True,
        description='standard deviation of the noise of the angular velocity about each axis',
        source='chosen: a small MEMS unit',
    )
    angular_velocity_bias: Vector = quantity(
        (0.0, 0.0, 0.0), unit='rad/s', low=-10.0, high=10.0, live=True,
        description='bias of the angular velocity at the start, axes of the IMU [x, y, z]', source='chosen',
    )
    angular_velocity_bias_walk: float = quantity(
        0.0, unit='rad/s/sqrt(s)', low=0.0, high=10.0, live=True,
        description='random walk of that bias about each axis: standard deviation of its change in one second',
        source='chosen',
    )
    orientation_noise: float = quantity(
        0.01, unit='rad', low=0.0, high=1.0, live=True,
        description='standard deviation of the error of the orientation, as an angle about each axis',
        source='chosen: a small MEMS unit',
    )
    seed: int = quantity(
        0, low=0, high=LARGEST_SEED, live=True,
        description='seed of the noise and of the random walks', source='chosen',
    )

    @property
    def is_displaced(self) -> bool:
        """Whether it is not at the center of mass, or turned from the axes of the body."""
        return any(self.position) or any(self.orientation)

    @property
    def rotation(self) -> Rotation:
        """The rotation from the axes of the IMU to those of the body."""
        return Rotation.from_euler('xyz', self.orientation)


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


@dataclasses.dataclass(frozen=True)
class Velocity(ParameterGroup):
    """A Doppler velocity log at the center of mass: the velocity over ground, with Gaussian noise as that of `Imu`."""

    prefix: ClassVar[str] = 'velocity.'

    rate: float = quantity(
        5.0, unit='Hz', low=0.1, high=1000.0, live=True,
        description='rate of velocity in simulated time, at most publish_rate', source='chosen: a small unit',
    )
    noise: float = quantity(
        0.01, unit='m/s', low=0.0, high=100.0, live=True,
        description='standard deviation of the noise along each axis', source='chosen: a small unit',
    )
    dropout: float = quantity(
        0.0, low=0.0, high=1.0, live=True,
        description='probability that a reading is missing, as without an echo of the bottom', source='chosen',
    )
    seed: int = quantity(
        0, low=0, high=LARGEST_SEED, live=True,
        description='seed of the noise and of the missing readings', source='chosen',
    )


@dataclasses.dataclass(frozen=True)
class OdometryNoise(ParameterGroup):
    """The Gaussian noise of the odometry, independent as that of `Imu`; without noise it is the ground truth."""

    prefix: ClassVar[str] = 'odom_noise.'

    position: float = quantity(
        0.0, unit='m', low=0.0, high=1000.0, live=True,
        description='standard deviation of the noise of the position in odom, along each axis',
        source='0: the ground truth',
    )
    orientation: float = quantity(
        0.0, unit='rad', low=0.0, high=1.0, live=True,
        description='standard deviation of the error of the orientation in odom, as an angle about each axis',
        source='0: the ground truth',
    )
    linear_velocity: float = quantity(
        0.0, unit='m/s', low=0.0, high=100.0, live=True,
        description='standard deviation of the noise of the velocity in odom, along each axis',
        source='0: the ground truth',
    )
    angular_velocity: float = quantity(
        0.0, unit='rad/s', low=0.0, high=10.0, live=True,
        description='standard deviation of the noise of the angular velocity in odom, about each axis',
        source='0: the ground truth',
    )
    seed: int = quantity(
        0, low=0, high=LARGEST_SEED, live=True,
        description='seed of the noise of odom', source='chosen',
    )


class ImuReading(NamedTuple):
    """The readings of an IMU at one time."""

    orientation: FloatArray
    """(4,) unit quaternion x, y, z, w: axes of the IMU to world components."""
    angular_velocity: FloatArray
    """(3,) axes of the IMU [rad/s]."""
    specific_force: FloatArray
    """(3,) acceleration less gravity, axes of the IMU [m/s^2]: +g upward at rest."""


class OdometryReading(NamedTuple):
    """What the odometry says at one time."""

    position: FloatArray
    """(3,) world frame [m]."""
    orientation: FloatArray
    """(4,) unit quaternion x, y, z, w: body to world components."""
    twist: FloatArray
    """(6,) linear and angular velocity, body frame [m/s, rad/s]."""


def read_imu(imu: Imu, parameters: Parameters, state: State) -> ImuReading:
    """Return the readings of an IMU in a state; the noise depends only on the seed and on the time.

    The random walks of the biases begin at `state.start_time`, where the robot was started or put at a pose. Gravity is
    `body.gravity`, and the acceleration is that of the state.
    """
    noise = _noise(imu.seed, IMU_STREAM, state.time, 9).tolist()  # lists: arrays of three take several times as long
    vx, vy, vz, wx, wy, wz = state.twist.tolist()
    ax, ay, az, *angular_acceleration = state.acceleration.tolist()
    orientation, angular_velocity, gravity = state.orientation.tolist(), [wx, wy, wz], parameters.body.gravity
    up_x, up_y, up_z = state.up.tolist()
    specific_force = [  # with Omega x V, as the axes turn
        ax + (wy * vz - wz * vy) + gravity * up_x, ay + (wz * vx - wx * vz) + gravity * up_y,
        az + (wx * vy - wy * vx) + gravity * up_z]
    if imu.is_displaced:
        arm, to_imu = np.array(imu.position), imu.rotation.as_matrix().T
        specific_force = (to_imu @ (
            specific_force + np.cross(angular_acceleration, arm)
            + np.cross(angular_velocity, np.cross(angular_velocity, arm)))).tolist()
        angular_velocity = (to_imu @ angular_velocity).tolist()
        orientation = (Rotation.from_quat(orientation) * imu.rotation).as_quat().tolist()
    acceleration_bias: Sequence[float] | FloatArray = imu.acceleration_bias
    angular_velocity_bias: Sequence[float] | FloatArray = imu.angular_velocity_bias
    if imu.acceleration_bias_walk or imu.angular_velocity_bias_walk:
        walk = random_walk(imu.seed, IMU_BIAS_STREAM, state.time - state.start_time, 6)
        acceleration_bias = acceleration_bias + imu.acceleration_bias_walk * walk[:3]
        angular_velocity_bias = angular_velocity_bias + imu.angular_velocity_bias_walk * walk[3:]
    return ImuReading(
        orientation=_turned(orientation, [imu.orientation_noise * number for number in noise[6:]]),
        angular_velocity=_read(angular_velocity, angular_velocity_bias, imu.angular_velocity_noise, noise[3:6]),
        specific_force=_read(specific_force, acceleration_bias, imu.acceleration_noise, noise[:3]),
    )


def _read(
    true: Sequence[float], bias: Sequence[float] | FloatArray, deviation: float, noise: Sequence[float],
) -> FloatArray:
    return np.array([
        value + offset + deviation * number for value, offset, number in zip(true, bias, noise, strict=True)])


def _turned(quaternion: Sequence[float], rotation_vector: Sequence[float]) -> FloatArray:
    """Return a quaternion (x, y, z, w) turned by a rotation vector in the moving frame [rad].

    This is SciPy's product of two Rotations, written out: to make these for each reading takes several times as long.
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


def read_velocity(velocity: Velocity, state: State) -> FloatArray | None:
    """Return the velocity (3,) of the center of mass over ground, body frame [m/s], or None if the reading is missing.

    Noise and missing readings depend only on seed and time.
    """
    noise = _noise(velocity.seed, VELOCITY_STREAM, state.time, 4)
    if ndtr(noise[3]) < velocity.dropout:  # a number from 0 to 1, evenly distributed
        return None
    return state.twist[:3] + velocity.noise * noise[:3]


def read_odometry(deviations: OdometryNoise, state: State) -> OdometryReading:
    """Return what the odometry says in a state; the noise depends only on seed and time."""
    position, orientation, twist = state.position, state.orientation, state.twist
    if deviations.position or deviations.orientation or deviations.linear_velocity or deviations.angular_velocity:
        noise = _noise(deviations.seed, ODOMETRY_STREAM, state.time, 12)
        position = position + deviations.position * noise[:3]
        orientation = _turned(orientation.tolist(), (deviations.orientation * noise[3:6]).tolist())
        twist = twist + np.repeat((deviations.linear_velocity, deviations.angular_velocity), 3) * noise[6:]
    return OdometryReading(position, orientation, twist)


def _noise(seed: int, stream: int, time: float, count: int) -> FloatArray:
    """Return `count` independent random numbers of zero mean and standard deviation 1 for a sensor at a time [s]."""
    return gaussian_noise(seed, stream, round(time * MICROSECONDS), count)

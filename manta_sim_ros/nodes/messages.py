"""What of a state goes where in ROS messages, and from messages to commands: the one place that stamps."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import rclpy.time
from builtin_interfaces.msg import Time
from geometry_msgs.msg import (
    Point,
    PoseStamped,
    PoseWithCovarianceStamped,
    TransformStamped,
    TwistStamped,
    TwistWithCovarianceStamped,
    Vector3,
    Vector3Stamped,
    WrenchStamped,
)
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import FluidPressure, Imu, JointState
from std_msgs.msg import Float64MultiArray, Header

from manta_sim_ros import sensors
from manta_sim_ros.dynamics import (
    SIDES,
    FinCommand,
    FloatArray,
    Parameters,
    State,
    shown,
    support_angles,
    support_rates,
)
from manta_sim_ros.nodes.serialization import Template
from manta_sim_ros.nodes.settings import FARTHEST

NANOSECONDS = 1_000_000_000

FASTEST_CURRENT = Parameters.quantities()['water.current'].high
"""Bound of each component of a current [m/s]."""
LARGEST_FORCE, LARGEST_MOMENT = 1e6, 1e6
"""Bounds of each component of a wrench on the body [N, N m]: far above any load of a robot."""
LARGEST_TWIST = 100.0
"""Bound of each component of a twist at which the robot is put [m/s, rad/s]: far above any robot."""
UNIT_TOLERANCE = 0.01
"""Largest difference of the norm of an orientation from 1: the rounding of typed digits."""

UNKNOWN_VARIANCE = 1e6
"""Variance of a velocity that is not measured [rad^2/s^2]: filters take the absolute value of one that is negative."""

COMMAND_VALUES = 'amplitude_l, amplitude_r, frequency_l, frequency_r, phase_l, phase_r'
BIAS_VALUES = 'front_bias_l, front_bias_r, rear_bias_l, rear_bias_r'


def time_message(seconds: float) -> Time:
    """Return a time [s] as a stamp, to the nanosecond."""
    whole, rest = divmod(round(seconds * NANOSECONDS), NANOSECONDS)
    return Time(sec=whole, nanosec=rest)


def seconds(stamp: Time) -> float:
    """Return a stamp as a time [s]."""
    return float(rclpy.time.Time.from_msg(stamp).nanoseconds / NANOSECONDS)


def header(stamp: Time, frame: str) -> Header:
    """Return the header of a message with a stamp and the name of its frame."""
    return Header(stamp=stamp, frame_id=frame)


def clock_template() -> Template:
    """Return the template of the clock: its stamp alone."""
    return Template(Clock(), ('clock',), (), lambda state: ())


def pose_template(odom_frame: str) -> Template:
    """Return the template of the pose of the body frame in the world frame."""
    return Template(
        PoseStamped(header=Header(frame_id=odom_frame)), ('header.stamp',), ('pose.position', 'pose.orientation'),
        lambda state: (state.position, state.orientation))


def twist_template(base_frame: str) -> Template:
    """Return the template of the velocity of the body frame's origin relative to the world, in the body frame."""
    return Template(
        TwistStamped(header=Header(frame_id=base_frame)), ('header.stamp',), ('twist',), lambda state: (state.twist,))


def odometry_template(
    noise: sensors.OdometryNoise, odom_frame: str, base_frame: str,
    in_frames: Callable[[sensors.OdometryReading], sensors.OdometryReading] = lambda reading: reading,
) -> Template:
    """Return the template of pose and twist together; the covariances are those of the noise.

    `in_frames` returns a reading with the components in other frames than the world frame and the body frame.
    """
    message = Odometry(header=Header(frame_id=odom_frame), child_frame_id=base_frame)
    message.pose.covariance = _covariance_of_six(noise.position**2, noise.orientation**2)
    message.twist.covariance = _covariance_of_six(noise.linear_velocity**2, noise.angular_velocity**2)
    return Template(
        message, ('header.stamp',), ('pose.pose.position', 'pose.pose.orientation', 'twist.twist'),
        lambda state: in_frames(sensors.read_odometry(noise, state)))


def wrench_template(base_frame: str, wrench_of: Callable[[State], FloatArray]) -> Template:
    """Return the template of a wrench (6,) on the body about the origin of its frame, components in that frame."""
    return Template(
        WrenchStamped(header=Header(frame_id=base_frame)), ('header.stamp',), ('wrench',),
        lambda state: (wrench_of(state),))


def transform_template(message_class: type[Any], odom_frame: str, base_frame: str) -> Template:
    """Return the template of the transform from the world frame to the body frame, in a tf2_msgs/msg/TFMessage."""
    transform = TransformStamped(header=Header(frame_id=odom_frame), child_frame_id=base_frame)
    return Template(
        message_class(transforms=[transform]), ('transforms.0.header.stamp',),
        ('transforms.0.transform.translation', 'transforms.0.transform.rotation'),
        lambda state: (state.position, state.orientation))


def imu_template(imu: sensors.Imu, parameters: Parameters, frame: str) -> Template:
    """Return the template of the readings of the IMU, REP 145; the covariances are those of its noise."""
    return Template(
        Imu(
            header=Header(frame_id=frame), orientation_covariance=_covariance(imu.orientation_noise),
            angular_velocity_covariance=_covariance(imu.angular_velocity_noise),
            linear_acceleration_covariance=_covariance(imu.acceleration_noise)),
        ('header.stamp',), ('orientation', 'angular_velocity', 'linear_acceleration'),
        lambda state: sensors.read_imu(imu, parameters, state))


def pressure_template(pressure: sensors.Pressure, parameters: Parameters, base_frame: str) -> Template:
    """Return the template of the absolute pressure [Pa]; the variance [Pa^2] is that of its noise."""
    return Template(
        FluidPressure(header=Header(frame_id=base_frame), variance=pressure.noise * pressure.noise),
        ('header.stamp',), ('fluid_pressure',), lambda state: (sensors.read_pressure(pressure, parameters, state),))


def velocity_template(velocity: sensors.Velocity, base_frame: str) -> Template:
    """Return the template of a velocity (3,) over ground [m/s]: what is written are readings, not states.

    The covariance is that of the noise; the angular velocity is not measured and has `UNKNOWN_VARIANCE`.
    """
    message = TwistWithCovarianceStamped(header=Header(frame_id=base_frame))
    message.twist.covariance = _covariance_of_six(velocity.noise**2, UNKNOWN_VARIANCE)
    return Template(message, ('header.stamp',), ('twist.twist.linear',), lambda reading: (reading,))


ROD_NAMES = [f'{side}_{rod}_rod' for side in SIDES for rod in ('front', 'rear')]
"""Names of the rods in joint states, in the order of `State.rod_angles`."""


def joint_names(parameters: Parameters, fins: bool) -> list[str]:
    """Return the names of the joints in the order of `joint_state_template`.

    The four rods; with `fins`, then the two angles of each support, and the joints of each chain from its root on.
    """
    names = list(ROD_NAMES)
    if fins:
        names += [f'{side}_support_{angle}' for side in SIDES for angle in ('yaw', 'pitch')]
        names += [f'{side}_chain_{chain}_joint_{joint}' for side in SIDES
                  for chain in range(parameters.fin.chains) for joint in range(parameters.fin.links)]
    return names


def joint_state_template(parameters: Parameters, fins: bool, base_frame: str) -> Template:
    """Return the template of angles [rad] and rates [rad/s] of the joints, positive upward on both sides.

    The effort of a rod is the torque of its motor [N m]; that of the other joints is 0, as they have no motor. The
    angles of a support are those of F_0 about z and then y of the body frame, on the right of its mirror image.
    """
    names = joint_names(parameters, fins)
    zeros = [0.0] * len(names)

    def numbers_of(state: State) -> tuple[FloatArray, FloatArray, FloatArray]:
        angles, rates = [state.rod_angles], [state.rod_rates]
        if fins:
            angles += [np.stack(support_angles(parameters, state.rod_angles), axis=-1), state.joint_angles]
            rates += [
                np.stack(support_rates(parameters, state.rod_angles, state.rod_rates), axis=-1), state.joint_rates]
        efforts = [state.rod_torques, np.zeros(len(names) - len(ROD_NAMES))]
        position, velocity, effort = (
            np.concatenate([part.ravel() for part in parts]) for parts in (angles, rates, efforts))
        return position, velocity, effort

    return Template(
        JointState(header=Header(frame_id=base_frame), name=names, position=zeros, velocity=zeros, effort=zeros),
        ('header.stamp',), ('position', 'velocity', 'effort'), numbers_of)


def rod_power_of(message: JointState) -> float:
    """Return the power of the motors of all rods [W], effort times velocity; NaN if one of them is not there."""
    if not len(message.name) == len(message.velocity) == len(message.effort):
        return math.nan
    powers = {
        name: rate * torque for name, rate, torque in zip(message.name, message.velocity, message.effort, strict=True)}
    return sum(powers.get(name, math.nan) for name in ROD_NAMES)


def fin_commands(values: Sequence[float]) -> tuple[FinCommand, FinCommand]:
    """Return the left and right command from the data of a `fin_command` message.

    Raises
    ------
    ValueError
        There are neither six nor ten values, or a value is not finite or out of its bounds; names it and the bound.

    """
    if len(values) not in (6, 10):
        raise ValueError(
            f'there are {len(values)} values, but must be 6 ({COMMAND_VALUES}) or 10 (then {BIAS_VALUES})')
    commands = []
    for side, name in enumerate(SIDES):
        try:
            commands.append(FinCommand(*values[side::2]))
        except ValueError as error:
            raise ValueError(f'{name} {error}') from error
    return commands[0], commands[1]


def commands_of(message: Float64MultiArray) -> tuple[FinCommand, FinCommand]:
    """Return the left and right command of a `fin_command` message.

    Raises
    ------
    ValueError
        The layout does not say that the values stand one after the other, or as `fin_commands`.

    """
    count, layout = len(message.data), message.layout
    if layout.data_offset != 0:
        raise ValueError(f'layout.data_offset is {layout.data_offset}, but must be 0')
    if len(layout.dim) > 1:
        raise ValueError(f'layout.dim has {len(layout.dim)} dimensions, but must have one or none')
    for dimension in layout.dim:
        if dimension.size != count:
            raise ValueError(f'layout.dim[0].size is {dimension.size}, but must be the number of values, {count}')
        if dimension.stride not in (0, 1, count):  # not given, between values, and as defined: of the whole dimension
            raise ValueError(f'layout.dim[0].stride is {dimension.stride}, but must be the number of values, {count}')
    return fin_commands(message.data)


def rod_command(message: JointState, present: FloatArray) -> FloatArray:
    """Return the angles (2, 2) by fin and rod (front, rear) [rad] that a `rod_command` asks for.

    Rods that it does not name keep their `present` angle. Velocities and efforts are not used.

    Raises
    ------
    ValueError
        There is no name, a name is unknown or stands twice, there are more or fewer positions than names, or a position
        is not finite; names it.

    """
    if not message.name or len(message.name) != len(message.position):
        raise ValueError(
            f'there are {len(message.name)} names and {len(message.position)} positions, but must be as many, and at '
            'least one')
    angles = present.copy()
    for index, (name, position) in enumerate(zip(message.name, message.position, strict=True)):
        if name not in ROD_NAMES or name in message.name[:index]:
            raise ValueError(
                f'name {index} is {shown(name)}, but must be one of {", ".join(ROD_NAMES)}, each once')
        if not math.isfinite(position):
            raise ValueError(f'the position of {name} is {position}, but must be finite')
        angles.flat[ROD_NAMES.index(name)] = position
    return angles


def pose_of(message: PoseStamped, odom_frame: str) -> tuple[list[float], list[float]]:
    """Return position [m] and orientation (x, y, z, w) of a pose of the body in the world.

    Raises
    ------
    ValueError
        The pose is in another frame, a value is not finite or out of its bounds, or the orientation is not a unit
        quaternion; names it and the bound.

    """
    _check_frame(message.header, odom_frame)
    given = message.pose.orientation
    position = _checked('pose.position', message.pose.position, FARTHEST, 'm')
    orientation = [given.x, given.y, given.z, given.w]
    norm = math.hypot(*orientation)
    if not abs(norm - 1.0) <= UNIT_TOLERANCE:
        raise ValueError(
            f'pose.orientation has norm {norm:g}, but must be a unit quaternion: 1 within {UNIT_TOLERANCE:g}')
    return position, [part / norm for part in orientation]


def world_motion(state: State) -> tuple[FloatArray, FloatArray]:
    """Return twist [m/s, rad/s] and acceleration [m/s^2, rad/s^2], (6,) each, of the body frame in the world frame.

    They are those of its origin relative to the world, with components in the world frame.
    """
    to_world = Rotation.from_quat(state.orientation)
    velocity, rates = state.twist[:3], state.twist[3:]
    acceleration = state.acceleration[:3] + np.cross(rates, velocity)  # of the components, and as the frame turns
    return (
        to_world.apply([velocity, rates]).ravel(),
        to_world.apply([acceleration, state.acceleration[3:]]).ravel())


def twist_of(message: TwistStamped, odom_frame: str, orientation: Sequence[float]) -> FloatArray:
    """Return the twist (6,) of the body [m/s, rad/s], whose orientation is given, with components in the body frame.

    Raises
    ------
    ValueError
        The twist is not in the world frame, or a value is not finite or out of its bounds; names it and the bound.

    """
    _check_frame(message.header, odom_frame)
    twist = [
        _checked('twist.linear', message.twist.linear, LARGEST_TWIST, 'm/s'),
        _checked('twist.angular', message.twist.angular, LARGEST_TWIST, 'rad/s')]
    return np.asarray(Rotation.from_quat(orientation).inv().apply(twist)).ravel()


def odometry_of(message: Odometry) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return position (3,) [m], orientation (x, y, z, w) and twist (6,) [m/s, rad/s] of an odometry, in its frames.

    Raises
    ------
    ValueError
        A value is not finite, or the orientation is 0; names the values.

    """
    pose, twist = message.pose.pose, message.twist.twist
    position, orientation, linear, angular = (
        [getattr(vector, axis) for axis in axes] for vector, axes in (
            (pose.position, 'xyz'), (pose.orientation, 'xyzw'), (twist.linear, 'xyz'), (twist.angular, 'xyz')))
    values = [*position, *orientation, *linear, *angular]
    if not all(map(math.isfinite, values)) or not any(orientation):
        raise ValueError(f'pose and twist are {shown(values)}, but must be finite, with an orientation')
    return np.array(position), np.array(orientation), np.array(linear + angular)


def planar_pose_of(
    message: PoseWithCovarianceStamped, odom_frame: str, height: float,
) -> tuple[list[float], list[float]]:
    """Return position [m] and orientation (x, y, z, w) of the level body at x, y and heading of a pose, at a height.

    The heading is that of the forward axis. The covariance is not used.

    Raises
    ------
    ValueError
        As of `pose_of`.

    """
    (x, y, _), orientation = pose_of(PoseStamped(header=message.header, pose=message.pose.pose), odom_frame)
    forward = Rotation.from_quat(orientation).apply([1.0, 0.0, 0.0])
    half = 0.5 * math.atan2(forward[1], forward[0])
    return [x, y, height], [0.0, 0.0, math.sin(half), math.cos(half)]


def current_of(message: Vector3Stamped, odom_frame: str) -> list[float]:
    """Return the velocity (3,) of the water [m/s] in the world frame.

    Raises
    ------
    ValueError
        The message is in another frame, or a value is not finite or out of its bounds; names it and the bound.

    """
    _check_frame(message.header, odom_frame)
    return _checked('vector', message.vector, FASTEST_CURRENT, 'm/s')


def wrench_of(message: WrenchStamped, base_frame: str, odom_frame: str) -> tuple[str, list[float]]:
    """Return the frame and the values (6,) [N, N m] of a wrench on the body about its center of mass.

    Raises
    ------
    ValueError
        The wrench is in another frame, or a value is not finite or out of its bounds; names it and the bound.

    """
    _check_frame(message.header, base_frame, odom_frame)
    return message.header.frame_id, [
        *_checked('wrench.force', message.wrench.force, LARGEST_FORCE, 'N'),
        *_checked('wrench.torque', message.wrench.torque, LARGEST_MOMENT, 'N m'),
    ]


def _check_frame(given: Header, *frames: str) -> None:
    if given.frame_id not in frames:
        raise ValueError(
            f'header.frame_id is {shown(given.frame_id)}, but must be {" or ".join(map(shown, frames))}')


def _checked(name: str, vector: Point | Vector3, largest: float, unit: str) -> list[float]:
    values = [vector.x, vector.y, vector.z]
    for axis, value in zip('xyz', values, strict=True):
        if not abs(value) <= largest:  # also refuses nan
            raise ValueError(f'{name}.{axis} is {value}, but must be from {-largest:g} to {largest:g} {unit}')
    return values


def _covariance_of_six(linear: float, angular: float) -> FloatArray:
    """Return a covariance (36,) of six independent values, from the variance of the first three and of the others."""
    return np.diag(np.repeat((linear, angular), 3)).ravel()


def _covariance(deviation: float) -> list[float]:
    """Return a covariance (3, 3), row by row, of three independent values with the same standard deviation."""
    variance = deviation * deviation
    return [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance]

"""From a state to ROS messages, and from messages to commands: pure functions, and the one place that stamps."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import (
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    Transform,
    TransformStamped,
    Twist,
    TwistStamped,
    Vector3,
    Vector3Stamped,
    Wrench,
    WrenchStamped,
)
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
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
from manta_sim_ros.nodes.settings import FARTHEST

NANOSECONDS = 1_000_000_000

FASTEST_CURRENT = Parameters.quantities()['water.current'].high
"""Bound of each component of a current [m/s]."""
LARGEST_FORCE, LARGEST_MOMENT = 1e6, 1e6
"""Bounds of each component of a wrench on the body [N, N m]: far above any load of a robot."""
UNIT_TOLERANCE = 0.01
"""Largest difference of the norm of an orientation from 1: the rounding of typed digits."""

COMMAND_VALUES = 'amplitude_l, amplitude_r, frequency_l, frequency_r, phase_l, phase_r'
BIAS_VALUES = 'front_bias_l, front_bias_r, rear_bias_l, rear_bias_r'


def time_message(seconds: float) -> Time:
    """Return a time [s] as a stamp, to the nanosecond."""
    whole, rest = divmod(round(seconds * NANOSECONDS), NANOSECONDS)
    return Time(sec=whole, nanosec=rest)


def seconds(stamp: Time) -> float:
    """Return a stamp as a time [s]."""
    return float(stamp.sec + stamp.nanosec / NANOSECONDS)


def clock_message(stamp: Time) -> Clock:
    """Return the clock message of a stamp."""
    return Clock(clock=stamp)


def header(stamp: Time, frame: str) -> Header:
    """Return the header of a message with a stamp and the name of its frame."""
    return Header(stamp=stamp, frame_id=frame)


def pose_message(state: State, odom: Header) -> PoseStamped:
    """Return the pose of the body frame in the world frame."""
    x, y, z = state.position.tolist()
    qx, qy, qz, qw = state.orientation.tolist()
    return PoseStamped(
        header=odom, pose=Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw)))


def twist_message(state: State, base: Header) -> TwistStamped:
    """Return the velocity of the body frame's origin relative to the world, components in the body frame."""
    values = state.twist.tolist()
    return TwistStamped(header=base, twist=Twist(linear=_vector(values[:3]), angular=_vector(values[3:])))


def odometry_message(pose: PoseStamped, twist: TwistStamped) -> Odometry:
    """Return pose and twist in one message. It is the ground truth: all covariances are zero."""
    odometry = Odometry(header=pose.header, child_frame_id=twist.header.frame_id)
    odometry.pose.pose = pose.pose
    odometry.twist.twist = twist.twist
    return odometry


def wrench_message(wrench: FloatArray, base: Header) -> WrenchStamped:
    """Return a wrench (6,) on the body about the origin of its frame, components in that frame."""
    values = wrench.tolist()
    return WrenchStamped(header=base, wrench=Wrench(force=_vector(values[:3]), torque=_vector(values[3:])))


def transform_message(pose: PoseStamped, base_frame: str) -> TransformStamped:
    """Return a pose of the body as the transform from the frame of the pose to that of the body."""
    at = pose.pose.position
    return TransformStamped(
        header=pose.header, child_frame_id=base_frame,
        transform=Transform(translation=Vector3(x=at.x, y=at.y, z=at.z), rotation=pose.pose.orientation))


def imu_message(reading: sensors.ImuReading, imu: sensors.Imu, base: Header) -> Imu:
    """Return the readings of the IMU, REP 145; the covariances are those of its noise."""
    x, y, z, w = reading.orientation.tolist()
    return Imu(
        header=base,
        orientation=Quaternion(x=x, y=y, z=z, w=w),
        orientation_covariance=_covariance(imu.orientation_noise),
        angular_velocity=_vector(reading.angular_velocity.tolist()),
        angular_velocity_covariance=_covariance(imu.angular_velocity_noise),
        linear_acceleration=_vector(reading.specific_force.tolist()),
        linear_acceleration_covariance=_covariance(imu.acceleration_noise),
    )


def pressure_message(pressure: float, noise: float, base: Header) -> FluidPressure:
    """Return an absolute pressure [Pa] and the variance of its noise [Pa^2], given its standard deviation."""
    return FluidPressure(header=base, fluid_pressure=pressure, variance=noise * noise)


ROD_NAMES = [f'{side}_{rod}_rod' for side in SIDES for rod in ('front', 'rear')]
"""Names of the rods in joint states, in the order of `State.rod_angles`."""


def joint_names(parameters: Parameters, fins: bool) -> list[str]:
    """Return the names of the joints in the order of `joint_state_message`.

    The four rods; with `fins`, then the two angles of each support, and the joints of each chain from its root on.
    """
    names = list(ROD_NAMES)
    if fins:
        names += [f'{side}_support_{angle}' for side in SIDES for angle in ('yaw', 'pitch')]
        names += [f'{side}_chain_{chain}_joint_{joint}' for side in SIDES
                  for chain in range(parameters.fin.chains) for joint in range(parameters.fin.links)]
    return names


def joint_state_message(state: State, parameters: Parameters, names: list[str], header: Header) -> JointState:
    """Return angles [rad] and rates [rad/s] of the joints with these `joint_names`, positive upward on both sides.

    The effort of a rod is the torque of its motor [N m]; that of the other joints is 0, as they have no motor. The
    angles of a support are those of F_0 about z and then y of the body frame, on the right of its mirror image.
    """
    angles, rates = [state.rod_angles], [state.rod_rates]
    if len(names) > state.rod_angles.size:
        angles += [np.stack(support_angles(parameters, state.rod_angles), axis=-1), state.joint_angles]
        rates += [np.stack(support_rates(parameters, state.rod_angles, state.rod_rates), axis=-1), state.joint_rates]
    position, velocity = (np.concatenate([part.ravel() for part in parts]).tolist() for parts in (angles, rates))
    effort = state.rod_torques.ravel().tolist() + [0.0] * (len(names) - state.rod_torques.size)
    return JointState(header=header, name=names, position=position, velocity=velocity, effort=effort)


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


def _covariance(deviation: float) -> list[float]:
    """Return a covariance (3, 3), row by row, of three independent values with the same standard deviation."""
    variance = deviation * deviation
    return [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance]


def _vector(values: Sequence[float]) -> Vector3:
    return Vector3(x=values[0], y=values[1], z=values[2])

"""From a state to ROS messages: pure functions, and the one place that stamps. Units and frames as in `State`."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Twist, TwistStamped, Vector3, Wrench, WrenchStamped
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header

from manta_sim_ros.dynamics import FinCommand, State

NANOSECONDS = 1_000_000_000

FARTHEST = 1e6
"""Bound of a coordinate that the robot is put at [m]: a double still tells tenths of a nanometre there."""
UNIT_TOLERANCE = 0.01
"""How far the norm of an orientation may be from 1: of digits that were typed, not of a forgotten part."""

COMMAND_VALUES = 'amplitude_l, amplitude_r, frequency_l, frequency_r, phase_l, phase_r'
BIAS_VALUES = 'front_bias_l, front_bias_r, rear_bias_l, rear_bias_r'


def time_message(seconds: float) -> Time:
    """Return a time [s] as a stamp, to the nanosecond."""
    whole, rest = divmod(round(seconds * NANOSECONDS), NANOSECONDS)
    return Time(sec=whole, nanosec=rest)


def clock_message(stamp: Time) -> Clock:
    """Return the clock that announces a stamp."""
    return Clock(clock=stamp)


def header(stamp: Time, frame: str) -> Header:
    """Return the header of a message: its stamp and the name of its frame."""
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
    """Return pose and twist in one message. Ground truth: all covariances are zero."""
    odometry = Odometry(header=pose.header, child_frame_id=twist.header.frame_id)
    odometry.pose.pose = pose.pose
    odometry.twist.twist = twist.twist
    return odometry


def wrench_message(wrench: np.ndarray, base: Header) -> WrenchStamped:
    """Return a wrench (6,) on the body about the origin of its frame, components in that frame."""
    values = wrench.tolist()
    return WrenchStamped(header=base, wrench=Wrench(force=_vector(values[:3]), torque=_vector(values[3:])))


def fin_commands(values: Sequence[float]) -> tuple[FinCommand, FinCommand]:
    """Return the left and right command from the data of a `fin_command` message.

    Raises
    ------
    ValueError
        There are not six or ten values, or one is not finite or out of its bounds; names it and the bound.

    """
    if len(values) not in (6, 10):
        raise ValueError(
            f'there are {len(values)} values, but must be 6 ({COMMAND_VALUES}) or 10 (then {BIAS_VALUES})')
    commands = []
    for side, name in enumerate(('left', 'right')):
        try:
            commands.append(FinCommand(*values[side::2]))
        except ValueError as error:
            raise ValueError(f'{name} {error}') from error
    return commands[0], commands[1]


def pose_of(message: PoseStamped, odom_frame: str) -> tuple[list[float], list[float]]:
    """Return position [m] and orientation (x, y, z, w) of a pose of the body in the world.

    Raises
    ------
    ValueError
        The pose is in another frame, a value is not finite or out of its bounds, or the orientation is no unit
        quaternion; names it and the bound.

    """
    if message.header.frame_id != odom_frame:
        raise ValueError(f'header.frame_id is {message.header.frame_id!r}, but must be {odom_frame!r}')
    at, turned = message.pose.position, message.pose.orientation
    position, orientation = [at.x, at.y, at.z], [turned.x, turned.y, turned.z, turned.w]
    for name, value in zip(('x', 'y', 'z'), position, strict=True):
        if not abs(value) <= FARTHEST:
            raise ValueError(f'pose.position.{name} is {value}, but must be from {-FARTHEST:g} to {FARTHEST:g} m')
    norm = math.hypot(*orientation)
    if not abs(norm - 1.0) <= UNIT_TOLERANCE:
        raise ValueError(
            f'pose.orientation has norm {norm:g}, but must be a unit quaternion: 1 within {UNIT_TOLERANCE:g}')
    return position, [part / norm for part in orientation]


def _vector(values: Sequence[float]) -> Vector3:
    return Vector3(x=values[0], y=values[1], z=values[2])

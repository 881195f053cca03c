"""From a state to ROS messages: pure functions, and the one place that stamps. Units and frames as in `State`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Twist, TwistStamped, Vector3, Wrench, WrenchStamped
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header

from manta_sim_ros.dynamics import FinCommand, State

NANOSECONDS = 1_000_000_000

COMMAND_VALUES = 'amplitude_l, amplitude_r, frequency_l, frequency_r, phase_l, phase_r'
BIAS_VALUES = 'front_bias_l, front_bias_r, rear_bias_l, rear_bias_r'


def time_message(seconds: float) -> Time:
    """Return a time [s] as a stamp, to the nanosecond."""
    whole, rest = divmod(round(seconds * NANOSECONDS), NANOSECONDS)
    return Time(sec=whole, nanosec=rest)


def clock_message(stamp: Time) -> Clock:
    """Return the clock that announces a stamp."""
    return Clock(clock=stamp)


def pose_message(state: State, stamp: Time, odom_frame: str) -> PoseStamped:
    """Return the pose of the body frame in the world frame."""
    return PoseStamped(header=Header(stamp=stamp, frame_id=odom_frame), pose=_pose(state))


def twist_message(state: State, stamp: Time, base_frame: str) -> TwistStamped:
    """Return the velocity of the body frame's origin relative to the world, components in the body frame."""
    return TwistStamped(header=Header(stamp=stamp, frame_id=base_frame), twist=_twist(state))


def odometry_message(state: State, stamp: Time, odom_frame: str, base_frame: str) -> Odometry:
    """Return pose in the world frame and twist in the body frame. Ground truth: all covariances are zero."""
    odometry = Odometry(header=Header(stamp=stamp, frame_id=odom_frame), child_frame_id=base_frame)
    odometry.pose.pose = _pose(state)
    odometry.twist.twist = _twist(state)
    return odometry


def wrench_message(wrench: np.ndarray, stamp: Time, base_frame: str) -> WrenchStamped:
    """Return a wrench (6,) on the body about the origin of its frame, components in that frame."""
    values = wrench.tolist()
    return WrenchStamped(
        header=Header(stamp=stamp, frame_id=base_frame),
        wrench=Wrench(force=_vector(values[:3]), torque=_vector(values[3:])),
    )


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


def _pose(state: State) -> Pose:
    x, y, z = state.position.tolist()
    qx, qy, qz, qw = state.orientation.tolist()
    return Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw))


def _twist(state: State) -> Twist:
    values = state.twist.tolist()
    return Twist(linear=_vector(values[:3]), angular=_vector(values[3:]))


def _vector(values: Sequence[float]) -> Vector3:
    return Vector3(x=values[0], y=values[1], z=values[2])

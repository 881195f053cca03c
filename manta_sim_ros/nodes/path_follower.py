"""The node `manta_path_follower`: it follows a path in space with `fin_command`, from `odom` alone, as on the robot."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np
import rclpy
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry, Path
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float64MultiArray, Header

from manta_sim_ros.control.closed_loop import CONTROL_PERIOD, Follower
from manta_sim_ros.control.follower import PathFollower
from manta_sim_ros.control.mission import read_mission
from manta_sim_ros.control.polyline import Polyline
from manta_sim_ros.control.settings import FollowerSettings
from manta_sim_ros.dynamics import FinCommand, Parameters, shown
from manta_sim_ros.nodes.messages import seconds
from manta_sim_ros.nodes.parameters import ParameterNode, declare_group, declare_value
from manta_sim_ros.nodes.process import run_node
from manta_sim_ros.nodes.qos import publisher, subscription
from manta_sim_ros.nodes.refusals import Refusals

QUEUE_DEPTH = 1


FOLLOWED_PATH = 'followed_path'
"""Topic of the path that is followed; an empty one says that none is."""


def waypoints_of(message: Path, frame: str) -> list[list[float]]:
    """Return the positions [m] of a path in this frame.

    Raises
    ------
    ValueError
        The path is in another frame; names both.

    """
    if message.header.frame_id != frame:
        raise ValueError(f'header.frame_id is {shown(message.header.frame_id)}, but must be {shown(frame)}')
    return positions_of(message)


def positions_of(message: Path) -> list[list[float]]:
    """Return the positions [m] of a path."""
    positions = [stamped.pose.position for stamped in message.poses]
    return [[position.x, position.y, position.z] for position in positions]


def message_of(waypoints: list[list[float]], frame: str, stamp: Time) -> Path:
    """Return the message of a path with these waypoints [m]."""
    header = Header(frame_id=frame, stamp=stamp)
    message = Path(header=header)
    for x, y, z in waypoints:
        pose = PoseStamped(header=header)
        pose.pose.position.x, pose.pose.position.y, pose.pose.position.z = x, y, z
        message.poses.append(pose)
    return message


class Controller(Follower, Protocol):
    """A controller that follows a path, and glides."""

    def glide(self) -> tuple[FinCommand, FinCommand]:
        """Return the gaits with which the robot glides to rest, and forget how it moved."""


Design = Callable[[ParameterNode, Parameters], Callable[[Polyline], Controller]]


def line_of_sight(node: ParameterNode, robot: Parameters) -> Callable[[Polyline], Controller]:
    """Declare the parameters of the path follower, and return what makes it.

    Raises
    ------
    ValueError
        A parameter is invalid, or the rods of the robot cannot follow it; names the value and the bound.

    """
    settings = declare_group(node, FollowerSettings)
    settings.check_limits(robot)
    return lambda path: PathFollower(path, settings, robot)


class PathFollowerNode(ParameterNode):
    """Follows the last path that it was given, and glides to rest at its end or when no odometry comes.

    Parameters
    ----------
    name
        Its name.
    design
        Its controller: given the node and the robot, it declares its parameters, and returns what makes the controller
        for a first path.

    Raises
    ------
    ValueError
        A parameter or the mission is invalid; names the value and the bound.

    """

    def __init__(self, name: str = 'manta_path_follower', design: Design = line_of_sight) -> None:
        super().__init__(name)
        self._frame: str = declare_value(self, 'odom_frame', 'odom', 'frame of odom and of the path')
        self._timeout: float = declare_value(
            self, 'odom_timeout', 1.0, 'time without odom after which the robot glides to rest [s], from 0.05 to 60')
        if not 0.05 <= self._timeout <= 60.0:
            raise ValueError(f'odom_timeout is {self._timeout} s, but must be from 0.05 to 60 s')
        robot = declare_value(
            self, 'robot', '', 'parameter file of the robot, whose mechanism limits the gaits; empty: the defaults')
        mission = declare_value(self, 'mission', '', 'mission file to begin with; empty: wait for a path')
        try:
            robot_parameters = Parameters.from_yaml(robot) if robot else Parameters()
        except OSError as error:
            raise ValueError(f'robot {shown(robot)}: {error}') from error
        self._make = design(self, robot_parameters)
        self._follower: Controller | None = None
        self._commanded = -math.inf  # stamp of the odometry [s]
        self._heard = math.nan  # time of the node [s]
        self._gliding = False
        warn = self.get_logger().warning
        self._bad_paths = Refusals(warn, 'path', 'what was followed goes on')
        self._bad_odometry = Refusals(warn, 'odom', 'it is not used')
        self._publisher = publisher(self, 'fin_command')
        self._followed = self.create_publisher(
            Path, FOLLOWED_PATH, QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
        if mission:
            self._follow(read_mission(mission))
        subscription(self, 'odom', self._take)
        self.create_subscription(Path, 'path', self._take_path, QUEUE_DEPTH)
        self._timer = self.create_timer(CONTROL_PERIOD, self._watch)
        self.warn_of_unknown_parameters()

    def _follow(self, path: Polyline) -> None:
        if self._follower is None:
            self._follower = self._make(path)
        else:
            self._follower.follow(path)
        self.get_logger().info(f'following a path of {path.length:.2f} m')
        self._tell(path.waypoints.tolist())

    def _take_path(self, message: Path) -> None:
        try:
            self._follow(Polyline(waypoints_of(message, self._frame)))
        except ValueError as error:
            self._bad_paths.add(error)

    def _take(self, message: Odometry) -> None:
        pose, twist = message.pose.pose, message.twist.twist
        position, orientation, linear, angular = (
            [getattr(vector, axis) for axis in axes] for vector, axes in (
                (pose.position, 'xyz'), (pose.orientation, 'xyzw'), (twist.linear, 'xyz'), (twist.angular, 'xyz')))
        values = [*position, *orientation, *linear, *angular]
        if message.header.frame_id != self._frame:
            self._bad_odometry.add(
                f'header.frame_id is {shown(message.header.frame_id)}, but must be {shown(self._frame)}')
        elif not all(map(math.isfinite, values)) or not any(orientation):
            self._bad_odometry.add(f'pose and twist are {shown(values)}, but must be finite, with an orientation')
        elif self._follower is not None:
            self._control(self._follower, seconds(message.header.stamp), values)
        else:
            self._hear()

    def _hear(self) -> None:
        self._heard = self._now()
        if self._gliding:
            self._gliding = False
            self.get_logger().info('odom is back')

    def _control(self, follower: Controller, stamp: float, values: list[float]) -> None:
        self._hear()
        follower.observe(stamp, np.array(values[:3]), np.array(values[3:7]), np.array(values[7:]))
        if 0.0 <= stamp - self._commanded < CONTROL_PERIOD - 1e-6:
            return
        self._commanded = stamp
        before = follower.finished
        self._publish(follower.command(stamp))
        if follower.finished and not before:
            self.get_logger().info('the end of the path is reached: the robot glides to rest')
            self._tell([])

    def _watch(self) -> None:
        """Let the robot glide to rest when no odometry comes."""
        if self._follower is None or not self._now() - self._heard > self._timeout:
            return
        if not self._gliding:
            self._gliding = True
            self.get_logger().warning(f'no odom for more than {self._timeout:g} s: the robot glides to rest')
        self._publish(self._follower.glide())

    def _publish(self, gaits: tuple[FinCommand, FinCommand]) -> None:
        left, right = (gait.as_array() for gait in gaits)
        self._publisher.publish(Float64MultiArray(data=np.column_stack([left, right]).ravel().tolist()))

    def _tell(self, waypoints: list[list[float]]) -> None:
        self._followed.publish(message_of(waypoints, self._frame, self.get_clock().now().to_msg()))

    def _now(self) -> float:
        return float(self.get_clock().now().nanoseconds * 1e-9)


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    run_node(PathFollowerNode, lambda node: None, rclpy.spin_until_future_complete, args)

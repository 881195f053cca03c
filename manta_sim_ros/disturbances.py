"""What pushes the robot: the topics `current` and `body_wrench`, checked as commands are."""

from __future__ import annotations

from collections.abc import Callable

from geometry_msgs.msg import Vector3Stamped, WrenchStamped
from rclpy.node import Node

from manta_sim_ros import messages
from manta_sim_ros.parameters_ros import Settings
from manta_sim_ros.qos import drain, subscription
from manta_sim_ros.robot import Robot
from manta_sim_ros.time_control import REFUSAL_WARNING_PERIOD


class Disturbances:
    """The topics `current` and `body_wrench`.

    Parameters
    ----------
    node
        Whose topics they are.
    robot
        What they act upon.
    settings
        Gives the node's present parameters.

    """

    def __init__(self, node: Node, robot: Robot, settings: Callable[[], Settings]) -> None:
        self._node, self._robot, self._settings = node, robot, settings
        self._topics = (
            subscription(node, Vector3Stamped, 'current', self._take_current),
            subscription(node, WrenchStamped, 'body_wrench', self._take_wrench),
        )
        self.refusals = 0
        """How many messages were refused."""
        self.reason = ''
        """Of the last refusal."""

    def forget(self) -> None:
        """Let the water flow with `water.current` again, nothing push, and throw away what was sent before."""
        for topic in self._topics:
            drain(topic)
        self._robot.flow(None)
        self._robot.release()

    def _take_current(self, message: Vector3Stamped) -> None:
        try:
            self._robot.flow(messages.current_of(message, self._settings().node.odom_frame))
        except ValueError as error:
            self._refuse('current', 'the current before goes on', error)

    def _take_wrench(self, message: WrenchStamped) -> None:
        own = self._settings().node
        try:
            frame, wrench = messages.wrench_of(message, own.base_frame, own.odom_frame)
        except ValueError as error:
            self._refuse('body_wrench', 'it does not act', error)
            return
        if frame == own.base_frame:
            self._robot.push(body_wrench=wrench)
        else:
            self._robot.push(world_wrench=wrench)

    def _refuse(self, topic: str, consequence: str, error: ValueError) -> None:
        self.refusals, self.reason = self.refusals + 1, f'{topic}: {error}'
        self._node.get_logger().warning(
            f'{topic} refused, {consequence}: {error}', throttle_duration_sec=REFUSAL_WARNING_PERIOD)

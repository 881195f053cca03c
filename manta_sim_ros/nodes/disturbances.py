"""External disturbances: the topics `current` and `body_wrench`, checked as commands are."""

from __future__ import annotations

from collections.abc import Callable

from geometry_msgs.msg import Vector3Stamped, WrenchStamped
from rclpy.node import Node

from manta_sim_ros.nodes import messages
from manta_sim_ros.nodes.qos import Input
from manta_sim_ros.nodes.refusals import Refusals
from manta_sim_ros.nodes.robot import Robot
from manta_sim_ros.nodes.settings import Settings


class Disturbances:
    """The topics `current` and `body_wrench`.

    Parameters
    ----------
    node
        The node that subscribes.
    robot
        The robot on which they act.
    settings
        Returns the present parameters of the node.

    """

    def __init__(self, node: Node, robot: Robot, settings: Callable[[], Settings]) -> None:
        self._robot, self._settings = robot, settings
        self._topics = (
            Input(node, 'current', self._take_current),
            Input(node, 'body_wrench', self._take_wrench),
        )
        warn = node.get_logger().warning
        self.refusals = {
            'current': Refusals(warn, 'current', 'the previous current continues'),
            'body_wrench': Refusals(warn, 'body_wrench', 'it does not act'),
        }
        """The refused messages by topic."""

    def forget(self) -> None:
        """Let the water flow with `water.current` again, end the wrench, and drop messages that are not taken yet."""
        for topic in self._topics:
            topic.drain()
        self._robot.set_current(None)
        self._robot.end_external_wrench()

    def _take_current(self, message: Vector3Stamped) -> None:
        try:
            self._robot.set_current(messages.current_of(message, self._settings().node.odom_frame))
        except ValueError as error:
            self.refusals['current'].add(error)

    def _take_wrench(self, message: WrenchStamped) -> None:
        own = self._settings().node
        try:
            frame, wrench = messages.wrench_of(message, own.base_frame, own.odom_frame)
        except ValueError as error:
            self.refusals['body_wrench'].add(error)
            return
        if frame == own.base_frame:
            self._robot.set_external_wrench(body_wrench=wrench)
        else:
            self._robot.set_external_wrench(world_wrench=wrench)

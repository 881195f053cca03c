"""The clock of another node, by which a robot moves that does not publish the clock itself."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from rclpy.node import Node
from rclpy.qos import ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from manta_sim_ros.nodes.messages import seconds
from manta_sim_ros.nodes.qos import subscription
from manta_sim_ros.nodes.robot import Robot
from manta_sim_ros.nodes.settings import Settings

FOLLOWS = 'the node follows /clock: pause, step and pace are those of the simulator that publishes it'

LARGEST_JUMP = 60.0
"""Simulated time by which the clock may rise from one message to the next [s]; with more, it is another clock."""

LARGEST_LAG = 0.5
"""Simulated time by which the robot may be behind the clock before that is called trouble [s]."""

STILLNESS = 0.1
"""Elapsed time without a change after which the clock stands still [s]."""

SILENCE = 3.0
"""Elapsed time without a message after which the clock is silent [s]: a paused simulator repeats it once a second."""


class LeaderClock:
    """What a node hears on /clock, and what that means for its robot.

    Parameters
    ----------
    node
        The node that listens, if its parameter `publish_clock` is false.
    robot
        Its robot: it is put at the time of the clock when that is heard first, goes back, or jumps.
    settings
        Returns the present parameters of the node.

    """

    def __init__(self, node: Node, robot: Robot, settings: Callable[[], Settings]) -> None:
        self._node, self._robot = node, robot
        self._publishes = settings().node.publish_clock
        self._heard_at = self._changed_at = time.monotonic()
        self._log = node.get_logger().warning
        self.time = math.nan
        """The time of the clock [s], NaN before it was heard."""
        self._clock = None if self._publishes else subscription(  # best effort, as players of bags publish it
            node, '/clock', self._take, reliability=ReliabilityPolicy.BEST_EFFORT)

    def begin(self) -> None:
        """Let silence begin now: the node could not listen before."""
        self._heard_at = time.monotonic()

    @property
    def followed(self) -> bool:
        """Whether the node follows the clock: `publish_clock` is false and `use_sim_time` is true."""
        return not self._publishes and self._node.get_parameter('use_sim_time').value is True

    @property
    def stands_still(self) -> bool:
        """Whether the node follows the clock, and that has not changed for a while."""
        return self.followed and not math.isnan(self.time) and time.monotonic() - self._changed_at > STILLNESS

    @property
    def trouble(self) -> str:
        """What is wrong with the clock that is followed, empty if nothing is."""
        if self._clock is None or not self.followed:
            return ''
        if not self._node.count_publishers(self._clock.topic_name):
            return 'the node follows /clock, which nobody publishes: the robot stands still'
        silence = time.monotonic() - self._heard_at
        if silence > SILENCE:
            return f'no message on /clock, which the node follows, for {silence:.0f} s: the robot stands still'
        lag = self.time - self._robot.state.time
        return f'this machine cannot keep up with /clock: the robot is {lag:.2g} s behind' if lag > LARGEST_LAG else ''

    def _take(self, message: Clock) -> None:
        before, self.time = self.time, seconds(message.clock)
        self._heard_at = time.monotonic()
        if self.time != before:
            self._changed_at = self._heard_at
        if not self.followed or 0.0 <= self.time - before <= LARGEST_JUMP:
            return
        if not math.isnan(before):
            self._log(f'/clock went from {before:.3f} s to {self.time:.3f} s: the robot goes on from where it is')
        self._robot.continue_at(self.time)

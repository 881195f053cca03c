"""The outputs of the node: all messages of a state have one stamp, and the clock is published last."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher

from manta_sim_ros.dynamics import State
from manta_sim_ros.nodes import messages
from manta_sim_ros.nodes.interface import TOPICS
from manta_sim_ros.nodes.qos import QUEUE_DEPTH, publisher
from manta_sim_ros.nodes.settings import Settings
from manta_sim_ros.nodes.state_messages import TRANSFORMS, StateMessages, optional_topics

PATIENCE = 5.0
"""Longest wait for subscribers that do not take their messages [s]."""

COUNTING_PERIOD = 0.1
"""Elapsed time after which subscribers are counted again [s]: to count them with every state would take as long as to
write the messages."""

LATECOMER_DELAY = 0.5
"""Elapsed time after which a new subscriber knows its publisher [s]: with best effort it misses what came before."""

CLOCK_PERIOD = 1.0
"""Elapsed time after which the clock is published again while simulated time stands still [s]."""


class Outputs:
    """The publishers of the simulated robot.

    Parameters
    ----------
    node
        The node that publishes.
    settings
        Returns the present parameters of the node.
    mean_current
        Returns the mean velocity (3,) of the water, world frame [m/s].
    follows
        Returns whether the node follows the clock of another one, so that its stamps are simulated time.

    """

    def __init__(
        self, node: Node, settings: Callable[[], Settings], mean_current: Callable[[], Sequence[float]],
        follows: Callable[[], bool],
    ) -> None:
        self._node, self._settings, self._follows = node, settings, follows
        self._publishers = _publishers(node, settings())
        transforms = self._publishers.get('/tf') or self._publishers.get('/tf_static')
        markers = self._publishers['fin_markers']
        self._messages = StateMessages(
            settings, mean_current, lambda: markers.get_subscription_count() > 0,
            None if transforms is None else transforms.msg_type)
        self._queued: Counter[str] = Counter()  # messages without a receipt
        self._clock_due = math.inf  # steady time at which the clock is repeated [s]
        self._latest: dict[str, Any] = {}  # the last message
        self._subscribers: Counter[str] = Counter()  # when they were counted
        self._late: dict[str, float] = {}  # steady time at which new subscribers get the last state [s]
        self._counting_due = -math.inf  # steady time [s]

    @property
    def lacking(self) -> list[str]:
        """The topics of transforms that cannot be published because tf2_msgs is not installed."""
        wanted = optional_topics(self._settings())
        return [topic for topic in TRANSFORMS if wanted[topic] and topic not in self._publishers]

    @property
    def another_clock(self) -> bool:
        """Whether another node publishes /clock beside this one."""
        clock = self._publishers.get('/clock')
        return clock is not None and self._node.count_publishers(clock.topic_name) > 1

    def stamp(self, state: State) -> Time:
        """Return the stamp of a state: its time, or the time of the node if that has no part in /clock."""
        if '/clock' in self._publishers or self._follows():
            return messages.time_message(state.time)
        return self._node.get_clock().now().to_msg()

    def publish_all(self, states: Iterable[State]) -> None:
        """Publish the outputs of consecutive states at once, without losing a message.

        Whenever the queue of a publisher may be full, with `QUEUE_DEPTH` messages, this waits until all reliable
        subscribers have received them. If that takes longer than `PATIENCE` once, it does not wait any more. It does
        not wait for a queue that is not full: Fast DDS asks for receipts when it is full, but otherwise only every 3 s.
        """
        for topic in list(self._queued):
            if self._publishers[topic].wait_for_all_acked(Duration()):
                del self._queued[topic]
        waiting = self._wait_for_room()
        for state in states:
            self.publish(state)
            waiting = waiting and self._wait_for_room()

    def _wait_for_room(self) -> bool:
        """Wait for the receipts of publishers with a full queue; return False if that takes too long."""
        deadline = time.monotonic() + PATIENCE
        for full in [topic for topic, count in self._queued.items() if count >= QUEUE_DEPTH]:
            left = Duration(seconds=max(0.0, deadline - time.monotonic()))
            if not self._publishers[full].wait_for_all_acked(left):
                return False
            del self._queued[full]
        return True

    def _send(self, topic: str, message: Any) -> None:
        self._publishers[topic].publish(message)
        self._latest[topic] = message
        self._queued[topic] += 1
        if topic == '/clock':
            self._clock_due = time.monotonic() + CLOCK_PERIOD

    def lacks(self, state: State) -> bool:
        """Whether the time of a state is another one than that of the last outputs."""
        return self._messages.state is None or self._messages.state.time != state.time

    def repeat_clock(self) -> None:
        """Publish the clock again if the last time was `CLOCK_PERIOD` ago."""
        if time.monotonic() >= self._clock_due:
            self._send('/clock', self._latest['/clock'])

    def publish_to_latecomers(self) -> None:
        """Publish the last state again on the topics that got more subscribers than were counted, after a while."""
        if self._messages.state is None:
            return
        now = time.monotonic()
        for topic, to in self._publishers.items():
            before, self._subscribers[topic] = self._subscribers[topic], to.get_subscription_count()
            if self._subscribers[topic] > before:
                self._late[topic] = now + LATECOMER_DELAY
            if now >= self._late.get(topic, math.inf):
                del self._late[topic]
                message = self._messages.again(topic) or self._latest.get(topic)
                if message is not None:
                    self._send(topic, message)

    def publish(self, state: State) -> None:
        """Publish all outputs of a state that are due, then the clock."""
        now = time.monotonic()
        if now >= self._counting_due:  # all that get this state, so not those that come later
            self._counting_due = now + COUNTING_PERIOD
            self._late = {topic: due for topic, due in self._late.items() if due > now}
            for topic, to in self._publishers.items():
                self._subscribers[topic] = to.get_subscription_count()
        for topic, message in self._messages.of(state, self.stamp(state)):
            if topic in self._publishers:
                self._send(topic, message)


def _publishers(node: Node, settings: Settings) -> dict[str, Publisher[Any]]:
    """Return the publishers of the outputs by topic, without those that are switched off or not possible."""
    wanted, publishers = optional_topics(settings), {}
    for topic, about in TOPICS.items():
        if about.direction == 'out' and wanted.get(topic, True):
            try:
                publishers[topic] = publisher(node, topic)
            except ModuleNotFoundError:
                if topic not in TRANSFORMS:  # tf2_msgs alone is optional
                    raise
    return publishers

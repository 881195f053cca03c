"""The one place where topics are made, and their quality of service is chosen: reliable, with small queues.

Reliable publishers serve best-effort subscribers too, and an `Input` hears best-effort publishers too. The outputs of
the robot are transient local, so that whoever asks for that gets the last ones; time, transform and diagnostics are
volatile, as in other simulators. The parameters `qos_overrides.<topic>.<publisher or subscription>.<history, depth,
reliability or durability>`, which are read-only, change that at the start. rclpy logs a warning when the QoS of a
subscriber or of a publisher is incompatible.
"""

from __future__ import annotations

import contextlib
import copy
import importlib
from collections.abc import Callable, Iterator
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSPolicyKind, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import InvalidQosOverridesError, QosCallbackResult, QoSOverridingOptions
from rclpy.subscription import Subscription

from manta_sim_ros.dynamics import cut
from manta_sim_ros.nodes.interface import TOPICS

QUEUE_DEPTH = 10

WARNING_PERIOD = 10.0
"""Least time between two warnings that best-effort publishers are not heard [s]."""

VOLATILE = ('fin_command', '/clock', '/tf', '/diagnostics')
"""Topics whose publishers keep nothing for subscribers that come later."""


def publisher(node: Node, topic: str) -> Publisher[Any]:
    """Create the publisher of one of `TOPICS`; parameters of the node may change its quality of service.

    Raises
    ------
    ValueError
        Such a parameter is invalid; names the topic.
    ModuleNotFoundError
        The package of the topic's message type is not installed.

    """
    with _named_errors('publisher', topic):
        return node.create_publisher(
            message_class(TOPICS[topic].type), topic, _profile(lasts=topic not in VOLATILE),
            qos_overriding_options=_OVERRIDABLE)


def subscription(
    node: Node, topic: str, callback: Callable[[Any], None],
    reliability: ReliabilityPolicy = ReliabilityPolicy.RELIABLE,
    event_callbacks: SubscriptionEventCallbacks | None = None,
) -> Subscription[Any]:
    """Create the subscription to one of `TOPICS`; parameters of the node may change its quality of service.

    Raises
    ------
    ValueError
        Such a parameter is invalid; names the topic.

    """
    with _named_errors('subscription', topic):
        return node.create_subscription(
            message_class(TOPICS[topic].type), topic, callback, _profile(reliability),
            qos_overriding_options=_OVERRIDABLE, event_callbacks=event_callbacks)


class Input:
    """A reliable subscription to one of `TOPICS`, and a best-effort one beside it as soon as a publisher needs that.

    One best-effort subscription would hear all publishers, but not all that a new one says: reliable publishers repeat
    what was sent before the subscriber knew of them. Their messages come to both subscriptions, and are taken from the
    reliable one: while a topic has reliable publishers, the best-effort ones are not heard, which is warned of.

    Parameters
    ----------
    node
        The node that subscribes.
    topic
        The topic; parameters of the node may change its quality of service.
    callback
        Takes each message.

    Raises
    ------
    ValueError
        Such a parameter is invalid; names the topic.

    """

    def __init__(self, node: Node, topic: str, callback: Callable[[Any], None]) -> None:
        self._node, self._topic, self._callback = node, topic, callback
        self._reliable = subscription(
            node, topic, callback, event_callbacks=SubscriptionEventCallbacks(incompatible_qos=self._hear_all))
        self._all: Subscription[Any] | None = None  # with best effort

    @property
    def topic_name(self) -> str:
        """Its name with the namespace."""
        return self._reliable.topic_name

    def drain(self) -> None:
        """Drop the messages that were received but not taken yet."""
        for waiting in filter(None, (self._reliable, self._all)):
            with waiting.handle:
                while waiting.handle.take_message(waiting.msg_type, waiting.raw) is not None:
                    pass

    def _hear_all(self, event: object) -> None:
        """Subscribe with best effort too: a publisher does not fit. If it does not fit then either, rclpy says so."""
        if self._all is None:
            profile = copy.copy(self._reliable.qos_profile)
            profile.reliability = ReliabilityPolicy.BEST_EFFORT
            self._all = self._node.create_subscription(self._reliable.msg_type, self._topic, self._take, profile)

    def _take(self, message: Any) -> None:
        reliable = self._reliable.get_publisher_count()
        if reliable == 0:
            self._callback(message)
        elif self._all is not None and self._all.get_publisher_count() > reliable:
            self._node.get_logger().warning(
                f'best-effort publishers of {self._topic} are not heard while it has reliable ones',
                throttle_duration_sec=WARNING_PERIOD)


def message_class(type_name: str) -> type[Any]:
    """Return the class of a message type by its name, such as `nav_msgs/msg/Odometry`."""
    package, *_, name = type_name.split('/')
    kind: type[Any] = getattr(importlib.import_module(f'{package}.msg'), name)
    return kind


@contextlib.contextmanager
def _named_errors(entity: str, topic: str) -> Iterator[None]:
    """Name the topic in an error: rclpy only names the invalid value, if at all."""
    try:
        yield
    except (AssertionError, InvalidQosOverridesError, ParameterException, RuntimeError, TypeError) as error:
        kind = 'a value is of the wrong type: ' if isinstance(error, ParameterException) else ''
        raise ValueError(f'qos_overrides of the {entity} {topic}: {kind}{cut(str(error)) or "invalid"}') from error


def _profile(reliability: ReliabilityPolicy = ReliabilityPolicy.RELIABLE, *, lasts: bool = False) -> QoSProfile:
    durability = DurabilityPolicy.TRANSIENT_LOCAL if lasts else DurabilityPolicy.VOLATILE
    return QoSProfile(depth=QUEUE_DEPTH, reliability=reliability, durability=durability)


def _checked(profile: QoSProfile) -> QosCallbackResult:
    result = QosCallbackResult()
    result.successful = profile.depth >= 1
    result.reason = f'depth is {profile.depth}, but must be at least 1'
    return result


_OVERRIDABLE = QoSOverridingOptions(
    (QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, QoSPolicyKind.RELIABILITY, QoSPolicyKind.DURABILITY),
    callback=_checked)

"""The one place where topics are made, and their quality of service is chosen: reliable, with small queues.

Reliable publishers serve best-effort subscribers too. The outputs of the robot are transient local, so that whoever
asks for that gets the last ones; time, transform and diagnostics are volatile, as in other simulators. The parameters
`qos_overrides.<topic>.<publisher or subscription>.<history, depth, reliability or durability>`, which are read-only,
change that at the start. rclpy logs a warning when the QoS of a subscriber or of a publisher is incompatible.
"""

from __future__ import annotations

import contextlib
import importlib
from collections.abc import Callable, Iterator
from typing import Any

from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSPolicyKind, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import InvalidQosOverridesError, QosCallbackResult, QoSOverridingOptions
from rclpy.subscription import Subscription

from manta_sim_ros.dynamics import cut
from manta_sim_ros.nodes.interface import TOPICS

QUEUE_DEPTH = 10

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
            qos_overriding_options=_OVERRIDABLE)


def message_class(type_name: str) -> type[Any]:
    """Return the class of a message type by its name, such as `nav_msgs/msg/Odometry`."""
    package, *_, name = type_name.split('/')
    kind: type[Any] = getattr(importlib.import_module(f'{package}.msg'), name)
    return kind


def drain(waiting: Subscription[Any]) -> None:
    """Drop the messages that were received but not taken yet."""
    with waiting.handle:
        while waiting.handle.take_message(waiting.msg_type, waiting.raw) is not None:
            pass


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

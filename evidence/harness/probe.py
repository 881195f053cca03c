"""A node in the process of a test or a measurement: it records topics, publishes, and calls services."""

from __future__ import annotations

import bisect
import itertools
import math
import time

import rclpy
from rclpy.executors import SingleThreadedExecutor

from evidence.harness.processes import LIMIT, NodeProcess


class Recording(list):
    """The messages of one topic since the recording began; `sent` has when each was sent [ns, system clock]."""

    def __init__(self, node, message_type, topic):
        self.sent = []
        self._node = node
        self._subscription = node.create_subscription(message_type, topic, self._take, 10_000)

    def _take(self, message, info):
        self.append(message)
        self.sent.append(info['source_timestamp'])

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        self._node.destroy_subscription(self._subscription)

    @property
    def stamps(self):
        """Stamp of each message [ns]."""
        stamps = [message.header.stamp if hasattr(message, 'header') else message.clock for message in self]
        return [stamp.sec * 1_000_000_000 + stamp.nanosec for stamp in stamps]

    def first_sent_after(self, moment):
        """Return the index of the first message that was not sent yet at a moment [ns of the system clock]."""
        return bisect.bisect_right(self.sent, moment)

    @property
    def finite(self):
        return all(math.isfinite(value) for message in self for value in _numbers(message))

    @property
    def rising(self):
        stamps = self.stamps
        return all(before < after for before, after in itertools.pairwise(stamps))


def _numbers(value):
    if hasattr(value, 'get_fields_and_field_types'):
        for name in value.get_fields_and_field_types():
            yield from _numbers(getattr(value, name))
    elif isinstance(value, (list, tuple)):
        for part in value:
            yield from _numbers(part)
    elif not isinstance(value, (str, bytes)):
        yield from value if hasattr(value, '__len__') else [value]


class Probe:
    """A node in this process. It receives messages only while it waits for something."""

    def __init__(self):
        self._context = rclpy.Context()
        rclpy.init(context=self._context, args=[])
        self.node = rclpy.create_node('probe', context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)

    def record(self, message_type, topic):
        return Recording(self.node, message_type, topic)

    def until(self, condition, what, *, doing=None, every=0.1):
        """Wait for a condition; meanwhile call `doing` again and again, with `every` [s] in between."""
        deadline = time.monotonic() + LIMIT
        due = 0.0
        while not condition():
            for node in NodeProcess.present:
                node.check_running()
            assert time.monotonic() < deadline, f'waited {LIMIT:g} s in vain: {what}'
            if doing is not None and time.monotonic() >= due:
                doing()
                due = time.monotonic() + every
            self._executor.spin_once(timeout_sec=0.02)

    def listen(self, seconds):
        end = time.monotonic() + seconds
        self.until(lambda: time.monotonic() >= end, f'{seconds:g} s of listening')

    def call(self, service_type, name, **request):
        """Call a service of a node that may be new, and return the answer."""
        client = self.node.create_client(service_type, name)
        answer = self.first_answer(client, service_type.Request(**request))
        self.node.destroy_client(client)
        return answer

    def first_answer(self, client, request):
        """Call again and again until an answer comes: the middleware may lose the answer to a client that is new.

        A slow node may be asked more than once, so the request must be one that may act more than once.
        """
        self.until(client.service_is_ready, f'the service {client.srv_name}')
        asked = []
        self.until(
            lambda: any(future.done() for future in asked), f'an answer of {client.srv_name}',
            doing=lambda: asked.append(client.call_async(request)), every=5.0)
        return next(future for future in asked if future.done()).result()

    def topics_of(self, node, namespace='/'):
        """Return {topic: type} of the subscriptions of a simulator and of its publishers, without those of any node."""
        def ask(names_and_types_by_node):
            return {name: types[0] for name, types in names_and_types_by_node(node, namespace)
                    if name not in ('/rosout', '/parameter_events')}

        nodes, subscribed = self.node.get_node_names_and_namespaces, self.node.get_subscriber_names_and_types_by_node
        self.until(lambda: (node, namespace) in nodes(), f'the node {node} in {namespace}')
        published = self.node.get_publisher_names_and_types_by_node
        # A simulator makes these last, and whoever discovers it hears of its publishers, and of its subscriptions, in
        # the order in which they were made.
        self.until(lambda: '/diagnostics' in ask(published) and any(
            name.endswith('/initialpose') for name in ask(subscribed)), f'the topics of {node}')
        return ask(subscribed), ask(published)

    def close(self):
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.shutdown()

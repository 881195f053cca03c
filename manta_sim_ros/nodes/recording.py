"""The beginning of a recording: a simulator that was started paused runs when the recorder hears its first outputs."""

from __future__ import annotations

import asyncio
import functools
import time
from collections.abc import Callable, Mapping
from typing import Any

import rclpy
from nav_msgs.msg import Odometry
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.client import Client
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_srvs.srv import SetBool, Trigger

from manta_sim_ros.nodes.messages import seconds

PATIENCE = 30.0
"""Longest wait for recorders after the simulator is ready [s]."""

STEP_PERIOD = 2.0
"""Elapsed time between two outputs that are published while recorders do not hear [s]."""

POLL = 0.05  # s
ANSWER_LIMIT = 5.0  # s, then a service is called again: the middleware may lose the answer to a client that is new
LAST_TYPE = 'diagnostic_msgs/msg/DiagnosticArray'
"""Of the last publisher that a simulator makes: publishers are discovered in the order in which they were made."""
OF_EVERY_NODE = ('/rosout', '/parameter_events')


async def run_when_recorded(simulator: str, recorders: Mapping[str, str], warn: Callable[[str], object]) -> None:
    """Let a paused simulator run when all recorders have subscribed to all that is published, and followers hear it.

    Before, it is advanced by one output: `ros2 bag record --use-sim-time` does not subscribe until it has heard a
    `/clock` above 0. If it hears none within `STEP_PERIOD`, the next output follows.

    Parameters
    ----------
    simulator
        Name of the node of the simulator, with its namespace.
    recorders
        Name of the node of the recorder, without namespace, for each simulator whose recorder is waited for.
    warn
        Is called with a line if the recorders do not subscribe within `PATIENCE`; the simulator runs nevertheless.

    """
    graph = _Graph()
    try:
        await _run_when_recorded(graph, simulator, recorders, warn)
    finally:
        graph.close()


async def _run_when_recorded(
    graph: _Graph, simulator: str, recorders: Mapping[str, str], warn: Callable[[str], object],
) -> None:
    answer = await graph.call(GetParameters, f'{simulator}/get_parameters',
                              names=['publish_rate', 'solver.time_step', 'step_duration'])
    publish_rate, time_step, step_duration = (value.double_value for value in answer.values)

    async def set_step_duration(duration: float) -> None:
        await graph.call(SetParameters, f'{simulator}/set_parameters',
                         parameters=[Parameter('step_duration', value=duration).to_parameter_msg()])

    await set_step_duration(max(1, round(1.0 / (publish_rate * time_step))) * time_step)  # that of one output
    began, steps = time.monotonic(), 0
    while deaf := [name for name, recorder in recorders.items() if not graph.hears(recorder, name)]:
        if (waited := time.monotonic() - began) > PATIENCE:
            warn(f'{", ".join(recorders[name] for name in deaf)} did not subscribe to all topics of {", ".join(deaf)} '
                 f'within {PATIENCE:g} s: the recording misses the first outputs')
            break
        if waited >= steps * STEP_PERIOD:
            await graph.call(Trigger, f'{simulator}/step')
            steps += 1
        await graph.listen()
    await set_step_duration(step_duration)
    await graph.call(SetBool, f'{simulator}/pause', data=False)


class _Graph:
    """A node that sees all other nodes and calls their services."""

    def __init__(self) -> None:
        self._context = rclpy.Context()
        rclpy.init(args=[], context=self._context)
        self._node = rclpy.create_node('manta_recording', context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._times: dict[str, float] = {}

    def close(self) -> None:
        self._node.destroy_node()
        self._context.try_shutdown()

    async def listen(self) -> None:
        self._executor.spin_once(timeout_sec=0.0)
        await asyncio.sleep(POLL)

    def hears(self, recorder: str, simulator: str) -> bool:
        """Whether a simulator is there and has heard the first step, and a recorder has subscribed to its outputs."""
        namespace, _, name = simulator.rpartition('/')
        if simulator not in self._times:
            self._times[simulator] = 0.0
            self._node.create_subscription(
                Odometry, f'{namespace}/odom', functools.partial(self._take, simulator), QoSProfile(
                    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL))
        if self._times[simulator] == 0.0:
            return False
        if (name, namespace or '/') not in self._node.get_node_names_and_namespaces():
            return False
        published = self._node.get_publisher_names_and_types_by_node(name, namespace or '/')
        return any(LAST_TYPE in types for _, types in published) and all(
            any(subscriber.node_name == recorder for subscriber in self._node.get_subscriptions_info_by_topic(topic))
            for topic, _ in published if topic not in OF_EVERY_NODE)

    def _take(self, simulator: str, odometry: Odometry) -> None:
        self._times[simulator] = seconds(odometry.header.stamp)

    async def call(self, kind: Any, name: str, **request: Any) -> Any:
        """Wait for a service, call it, and return its answer."""
        client: Client[Any, Any] = self._node.create_client(kind, name)
        while not client.service_is_ready():
            await self.listen()
        while True:
            answer, deadline = client.call_async(kind.Request(**request)), time.monotonic() + ANSWER_LIMIT
            while time.monotonic() < deadline:
                await self.listen()
                if answer.done():
                    self._node.destroy_client(client)
                    return answer.result()

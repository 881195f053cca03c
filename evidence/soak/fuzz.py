"""A stateful fuzzer: any sequence of messages, parameters and service calls, valid and hostile, over DDS."""

from __future__ import annotations

import copy
import functools
import math
import random
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from hypothesis import HealthCheck, Phase, seed, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule, run_state_machine_as_test
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from std_srvs.srv import SetBool, Trigger

from evidence.soak.facts import Fact, Lengths, at_least, at_most, equal, nodes, printed, resident
from manta_sim_ros.dynamics import FinCommand
from manta_sim_ros.nodes.interface import TOPICS
from manta_sim_ros.nodes.messages import ROD_NAMES
from manta_sim_ros.nodes.qos import message_class
from manta_sim_ros.nodes.settings import Settings

TITLE = 'Any input'
ABOUT = """
A stateful fuzzer (Hypothesis) sends sequences of inputs over DDS: on every input topic, valid messages, messages with
one value that is broken (not finite, huge, a wrong frame, a wrong number of values, a text of 10,000 characters), and
bytes that are no message; parameters, valid ones and wrong ones; and the services `~/pause`, `~/step` and `~/reset`.
After each step the node must live, every number on its topics must be finite, stamps must not go backward,
quaternions must have the norm 1, and a message that must be refused must be counted as refused. Diagnostics must come
all the time. The same seed gives the same inputs (`--seed`)."""
NOT_SURVIVED = """
Nothing was found that ends the node. Values that are valid but extreme can make it useless, and the fuzzer avoids
them: with a `publish_rate` times `real_time_factor` far below one, outputs are rare, and during a long `~/step`, of
at most 50 s of elapsed time, the node answers nothing else, except signals."""

DEPTH = 1000  # of the queues of the node's subscriptions: no input is lost
BATCH = 8  # messages on each topic between two checks
NORM_TOLERANCE = 1e-9  # measured: 4e-16
OTHER = ('parameters', 'service calls')  # whose refusals are not counted here
NOT_FINITE = (math.nan, math.inf, -math.inf)
HOSTILE = (*NOT_FINITE, 1e308, -1e308)
IN_FRAME = ('set_pose', 'initialpose', 'current', 'body_wrench')
SLOW = {  # bounds of valid values, so that outputs come all the time and the fuzzer does not wait for long
    'publish_rate': (10.0, 500.0), 'real_time_factor': (0.2, 2.0), 'step_duration': (0.002, 0.2)}


def valid(topic: str, random: random.Random) -> Any:
    """Return a message that an input topic accepts, or that is empty if this topic is not known here."""
    message = message_class(TOPICS[topic].type)()
    if topic == 'fin_command':
        gaits = [[random.uniform(0.3 * about.low, 0.3 * about.high) for about in FinCommand.quantities().values()]
                 for _ in range(2)]
        message.data = [value for pair in zip(*gaits, strict=True) for value in pair][:random.choice((6, 10))]
    if topic == 'rod_command':
        message.name = random.sample(ROD_NAMES, random.randint(1, 4))
        message.position = [random.uniform(-0.3, 0.3) for _ in message.name]
    if topic in IN_FRAME:
        message.header.frame_id = 'odom'
    if topic in ('set_pose', 'initialpose'):
        pose, half_yaw = message.pose if topic == 'set_pose' else message.pose.pose, random.uniform(-4.0, 4.0)
        pose.orientation.z, pose.orientation.w = math.sin(half_yaw), math.cos(half_yaw)
        pose.position.x = random.uniform(-1e6, 1e6)
    if topic == 'current':
        message.vector.x = random.uniform(-10.0, 10.0)
    if topic == 'body_wrench':
        message.header.frame_id = random.choice(('odom', 'base_link'))
        message.wrench.force.y = 10.0 ** random.uniform(-3.0, 6.0)
    return message


def leaves(message: Any, path: str = '') -> list[tuple[Any, str, str]]:
    """Return all fields of a message as (message, name, path)."""
    found = []
    for name in message.get_fields_and_field_types():
        value = getattr(message, name)
        if hasattr(value, 'get_fields_and_field_types'):
            found += leaves(value, f'{path}{name}.')
        else:
            found.append((message, name, path + name))
    return found


def broken(topic: str, message: Any, random: random.Random) -> tuple[Any, bool]:
    """Return the message with one field broken, and whether it must be refused."""
    message = copy.deepcopy(message)
    owner, name, path = random.choice(leaves(message))
    value = getattr(owner, name)
    if isinstance(value, float):
        setattr(owner, name, random.choice(HOSTILE))
        return message, True
    if isinstance(value, str):
        setattr(owner, name, random.choice(('', 'map', 'x' * 10_000, '\u202e\n\0'[:2])))
        return message, path == 'header.frame_id' and topic in IN_FRAME
    if path in ('data', 'position'):
        wrong = random.choice(([], [0.0] * 7, [0.0] * 5000, None))
        setattr(owner, name, [*value[:-1], random.choice(NOT_FINITE)] if wrong is None else wrong)
        return message, True
    if path == 'name':
        owner.name = random.choice(([], ['x' * 10_000] * len(value), [*value, value[0]]))
        return message, True
    if isinstance(value, int):
        setattr(owner, name, random.choice((0, 2**31 - 1)))
    return message, False


def parameter(random: random.Random) -> ParameterMessage:
    """Return a parameter of the node or of nobody, with a valid or a wrong value."""
    quantities = Settings.quantities()
    name = random.choice([*quantities, 'use_sim_time', 'no.such.parameter'])
    about = quantities.get(name)
    wrong = [*HOSTILE, True, 'x' * 10_000, -2**60, [1.0] * 100, ['a'], [], [b'x'], None]
    if about is None or random.random() < 0.3:
        return Parameter(name, value=random.choice(wrong)).to_parameter_msg()
    value: Any = random.choice(about.choices) if about.choices else random.random() < 0.5
    if about.kind in (float, int, tuple):
        low, high = SLOW.get(name, (about.low, about.high))
        value = [random.choice((low, high, random.uniform(low, min(high, 2.0 + low)))) for _ in range(about.size or 1)]
        value = value if about.kind is tuple else about.kind(value[0])
    if name == 'step_duration':
        value = 0.002 * random.randint(1, 100)
    return Parameter(name, value=value).to_parameter_msg()


def noticed(method: Any) -> Any:
    """Let a method of a target remember the first failure: a node that failed once may behave otherwise in a replay."""
    @functools.wraps(method)
    def watched(self: Target, *arguments: Any, **named: Any) -> Any:
        try:
            return method(self, *arguments, **named)
        except AssertionError as error:
            self.failure = self.failure or f'{error} after {self.inputs} inputs'
            raise
    return watched


class Target:
    """The node under test, what it was sent, and what it published."""

    def __init__(self, launch: Any, probe: Any) -> None:
        self.launch, self.probe = launch, probe
        self.node: Any = None
        self.failure = ''
        self.starts = self.inputs = self.outputs = self.diagnostics = self.refused = self.hostile = 0
        self.norm_error = 0.0
        self.last: dict[str, int] = {}
        self.inputs_of = {
            topic: probe.node.create_publisher(message_class(about.type), topic, DEPTH)
            for topic, about in TOPICS.items() if about.direction == 'in'}
        self.recordings = {
            topic: probe.record(message_class(about.type), topic) for topic, about in TOPICS.items()
            if about.direction == 'out' and topic not in ('/tf', '/tf_static', 'fin_markers')}
        self.clients = {
            name: probe.node.create_client(kind, f'/manta_sim/{name}') for name, kind in (
                ('pause', SetBool), ('step', Trigger), ('reset', Trigger), ('set_parameters', SetParameters),
                ('get_parameters', GetParameters))}
        self.defaults = [Parameter(name, value=_plain(Settings().value(name))).to_parameter_msg()
                         for name, about in Settings.quantities().items() if about.live]

    @noticed
    def begin(self) -> None:
        """Start the node if it does not run, and let it run with its defaults."""
        if self.node is None or self.node.process.poll() is not None:
            queues = ' '.join(f'-p qos_overrides./{topic}.subscription.depth:={DEPTH}' for topic in self.inputs_of)
            if self.node is not None:
                self.node.exit_status()
            self.starts, self.refused, self.hostile = self.starts + 1, 0, 0
            self.last.clear()
            self.node = self.launch('sim_node', queues)
            self.probe.until(lambda: all(each.get_subscription_count() for each in self.inputs_of.values()), 'the node')
            self.probe.first_answer(self.clients['get_parameters'], GetParameters.Request(names=['publish_rate']))
            self.memory = resident(self.node.process.pid)
        self.call('set_parameters', parameters=self.defaults)
        self.call('pause', data=False)
        self.reset()

    def reset(self) -> None:
        """Reset, when nothing is on its way that must be refused: a reset drops it uncounted."""
        self.settle()
        self.call('reset')

    @noticed
    def call(self, name: str, times: int = 1, **request: Any) -> None:
        """Call a service some times at once, and wait for the answers."""
        client = self.clients[name]
        futures = [client.call_async(client.srv_type.Request(**request)) for _ in range(times)]
        self.probe.until(lambda: all(future.done() for future in futures), f'the answers of {name}')

    def send(self, random: random.Random, count: int) -> None:
        """Send this many messages on each input topic, and wait until they were taken."""
        for topic, publisher in self.inputs_of.items():
            for _ in range(count):
                message, how = valid(topic, random), random.random()
                if how < 0.5:
                    message, refused = broken(topic, message, random)
                    self.hostile += refused
                elif how < 0.55:
                    message = serialize_message(message)[:random.randint(4, 40)]
                publisher.publish(message)
        self.inputs += count * len(self.inputs_of)
        self.call('get_parameters', times=count, names=['publish_rate'])  # between two, one message of each topic

    @noticed
    def check(self) -> None:
        """Check what was published since the last check."""
        assert self.node.process.poll() is None, f'the node ended with status {self.node.process.returncode}'
        for topic, recording in self.recordings.items():
            if not recording:
                continue
            assert recording.finite, f'{topic} is not finite'
            stamps = [self.last.get(topic, 0), *recording.stamps]
            assert stamps == sorted(stamps), f'stamps of {topic} go backward'
            self.last[topic] = stamps[-1]
            for message in recording:
                self._check_message(message)
            self.outputs += len(recording)
            recording.clear()

    def _check_message(self, message: Any) -> None:
        if isinstance(message, DiagnosticArray):
            self.diagnostics += 1
            self.refused = sum(int(value.value) for status in message.status for value in status.values
                               if value.key.endswith('refused') and not value.key.startswith(OTHER))
        elif isinstance(message, PoseStamped):
            turn = message.pose.orientation
            error = abs(math.hypot(turn.x, turn.y, turn.z, turn.w) - 1.0)
            assert error <= NORM_TOLERANCE, f'the norm of a quaternion differs from 1 by {error:g}'
            self.norm_error = max(self.norm_error, error)

    @noticed
    def end(self) -> None:
        """Wait for diagnostics of what was sent."""
        def told() -> bool:
            self.check()
            return self.diagnostics > before

        before = self.diagnostics
        self.probe.until(told, 'diagnostics')

    @noticed
    def settle(self) -> None:
        """Wait until all messages that must be refused are counted: one may be lost, and be sent again."""
        def counted() -> bool:
            self.check()
            return self.refused >= self.hostile

        self.probe.until(counted, f'{self.hostile} refusals')


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def machine(target: Target) -> type[RuleBasedStateMachine]:
    """Return the fuzzer of a target."""
    numbers = st.integers(0, 2**32 - 1)

    class Fuzzer(RuleBasedStateMachine):
        @initialize()
        def begin(self) -> None:
            target.begin()

        @rule(number=numbers, count=st.integers(1, BATCH))
        def messages(self, number: int, count: int) -> None:
            target.send(random.Random(number), count)

        @rule(number=numbers, count=st.integers(1, BATCH))
        def parameters(self, number: int, count: int) -> None:
            chosen = random.Random(number)
            target.call('set_parameters', parameters=[parameter(chosen) for _ in range(count)])
            target.inputs += count

        @rule(name=st.sampled_from(('step', 'reset')))
        def trigger(self, name: str) -> None:
            target.reset() if name == 'reset' else target.call(name)
            target.inputs += 1

        @rule(data=st.booleans())
        def pause(self, data: bool) -> None:
            target.call('pause', data=data)
            target.inputs += 1

        @invariant()
        def check(self) -> None:
            if target.node is not None:
                target.check()

        def teardown(self) -> None:
            if target.node is not None and target.node.process.poll() is None:
                target.end()

    return Fuzzer


def measure(lengths: Lengths) -> list[Fact]:
    """Send inputs until there were as many as wanted."""
    began, rounds, failure = time.monotonic(), 0, 'none'
    effort = settings(
        max_examples=min(10, lengths.inputs // 150), stateful_step_count=min(200, lengths.inputs // 20), deadline=None,
        database=None, phases=(Phase.generate, Phase.shrink), report_multiple_bugs=False,
        suppress_health_check=list(HealthCheck))
    with nodes() as (launch, probe):
        target = Target(launch, probe)
        while target.inputs < lengths.inputs and failure == 'none':
            try:
                run_state_machine_as_test(seed(lengths.seed + rounds)(machine(target)), settings=effort)
                target.settle()
            except Exception as error:  # whatever was found, with the steps to it
                found = [target.failure, str(error), *getattr(error, '__notes__', ())]
                failure = ' '.join('; '.join(found).split())[:1000]
            rounds += 1
        return [
            equal('failures found', failure, 'none'),
            at_least('inputs', target.inputs, lengths.inputs),
            printed('first seed, and number of seeds', f'{lengths.seed}, {rounds}'),
            equal('starts of the node', target.starts, 1),
            at_least('messages refused', target.refused, target.hostile),
            printed('output messages checked', target.outputs),
            at_least('diagnostics', target.diagnostics, 1),
            at_most('largest difference of the norm of a quaternion from 1', target.norm_error, NORM_TOLERANCE),
            printed('memory of the node at the beginning [MiB]', target.memory),
            printed('memory of the node at the end [MiB]', resident(target.node.process.pid)),
            printed('inputs per second', round(target.inputs / (time.monotonic() - began))),
        ]

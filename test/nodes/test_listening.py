"""What an executor runs of all that was received, and what the node takes when more comes than it can take."""

import collections
import itertools
import types

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

from manta_sim_ros.nodes.process import executor, run_waiting
from manta_sim_ros.nodes.sim_node import LONGEST_LISTENING, SimNode


class Queue:
    """An executor that runs what came first, and to which one more comes with each that it runs."""

    def __init__(self, context, came, comes=lambda: None):
        self.context, self.waiting, self._comes = context, collections.deque(came), comes

    def create_task(self, callback):
        done = []
        self.waiting.append(lambda: done.append(callback()))
        return types.SimpleNamespace(done=lambda: bool(done))

    def spin_once(self, timeout_sec):
        assert timeout_sec == 0.0
        self.waiting.popleft()()
        self.waiting.append(self._comes)


def test_all_that_waits_is_run_however_much_comes_meanwhile(probe):
    ran = []
    queue = Queue(probe.node.context, [lambda k=k: ran.append(k) for k in range(1000)], lambda: ran.append('late'))
    assert run_waiting(queue)
    assert ran == list(range(1000))
    assert len(queue.waiting) == 1001  # one came with each, and with the end


def test_it_ends_at_its_time_and_leaves_the_rest(probe, monkeypatch):
    times = itertools.count()
    monkeypatch.setattr('time.monotonic', lambda: float(next(times)))
    ran = []
    queue = Queue(probe.node.context, [lambda k=k: ran.append(k) for k in range(1000)])
    assert not run_waiting(queue, 9.0)
    assert ran == list(range(10))


def test_a_service_that_was_called_behind_messages_has_its_turn():
    context = rclpy.Context()
    rclpy.init(context=context, args=[])
    node, heard = rclpy.create_node('behind', context=context), []
    node.create_subscription(Float64MultiArray, 'behind/messages', lambda message: heard.append(message.data[0]), 100)
    node.create_service(Trigger, 'behind/service', lambda request, response: heard.append('service') or response)
    publisher = node.create_publisher(Float64MultiArray, 'behind/messages', 100)
    client = node.create_client(Trigger, 'behind/service')
    callbacks = executor(context)
    callbacks.add_node(node)
    try:
        while not (publisher.get_subscription_count() and client.service_is_ready()):
            callbacks.spin_once(timeout_sec=0.1)
        for k in range(50):
            publisher.publish(Float64MultiArray(data=[float(k)]))
        future = client.call_async(Trigger.Request())
        while not future.done():
            run_waiting(callbacks)
        while len(heard) < 51:
            run_waiting(callbacks)
        assert [each for each in heard if each != 'service'] == list(range(50)) and heard.count('service') == 1
    finally:
        callbacks.shutdown()
        node.destroy_node()
        context.try_shutdown()


def test_the_single_threaded_executor_runs_one_of_what_is_ready(monkeypatch):
    context = rclpy.Context()
    rclpy.init(context=context, args=[])
    callbacks, waits = SingleThreadedExecutor(context=context), []
    monkeypatch.setattr(callbacks, 'spin_once', lambda timeout_sec: waits.append(timeout_sec))
    assert run_waiting(callbacks) and waits == [0.0]
    callbacks.shutdown()
    context.try_shutdown()


@pytest.fixture
def node():
    context = rclpy.Context()
    rclpy.init(context=context, args=['--ros-args', '-r', '__ns:=/overwhelmed', '-r', '/clock:=clock'])
    node = SimNode(context)
    yield node
    node.destroy_node()
    context.try_shutdown()


def commands(count):
    """Commands of which each has another amplitude."""
    data = [[0.01 * k, 0.01 * k, 0.5, 0.5, 0.0, 0.0] for k in range(count)]
    return [Float64MultiArray(data=each) for each in data]


def amplitude(node):
    return node._robot.commands[0].amplitude


def test_of_too_many_commands_the_last_valid_one_counts(node, monkeypatch):
    taken = []
    monkeypatch.setattr(node._robot, 'command', lambda left, right: taken.append(left.amplitude))
    queue = Queue(node.context, [lambda message=message: node._take_command(message) for message in commands(50)])
    times = itertools.count(0.0, LONGEST_LISTENING / 10)
    monkeypatch.setattr('time.monotonic', lambda: next(times))
    node._listen(queue)
    first = [round(100 * each) for each in taken[:-1]]
    assert first == list(range(len(first))) and 5 < len(first) < 15  # one by one, until they were too many
    assert taken[-1] == pytest.approx(0.49)

    invalid = Float64MultiArray(data=[1.0])
    queue.waiting.extend([lambda message=message: node._take_command(message) for message in [*commands(31), invalid]])
    node._listen(queue)
    assert taken[-1] == pytest.approx(0.3)
    assert node._refusals.take().total == 1


def test_of_too_many_rod_commands_each_rod_has_its_last_angle(node):
    node._keeps = True
    for name, angle in (('left_front_rod', 0.3), ('right_rear_rod', -0.1), ('left_front_rod', 0.2)):
        node._take_rod_command(JointState(name=[name], position=[angle]))
    assert not node._robot.rod_targets.any()
    node._take_kept()
    assert node._robot.rod_targets.tolist() == [[0.2, 0.0], [0.0, -0.1]]


def test_a_step_and_a_reset_come_after_the_commands_before_them(node, monkeypatch):
    monkeypatch.setattr(node._outputs, 'publish_all', lambda states: list(states))
    node._time.pause(True)
    node._keeps = True
    node._take_command(commands(31)[-1])
    assert amplitude(node) == 0.0
    assert node._time.step()[0]
    assert amplitude(node) == pytest.approx(0.3)
    assert node._robot.state.gait[0, 0] > 0.0  # the step was taken with the command
    node._take_command(commands(32)[-1])
    node._time.reset()
    node._take_kept()
    assert amplitude(node) == 0.0

"""What `monitor_node` prints, from odometry that the test publishes."""

import math
import signal

import pytest
from builtin_interfaces.msg import Time
from nav_msgs.msg import Odometry

SPEED, DEPTH, HEADING = 0.25, 1.5, 60.0  # [m/s, m, degrees]


@pytest.fixture
def swim(probe):
    """Publishes odometry of a straight swim, 10 ms a message, until a condition holds."""
    publisher = probe.node.create_publisher(Odometry, 'odom', 10)
    message = Odometry()
    message.pose.pose.position.z = -DEPTH
    message.pose.pose.orientation.z = math.sin(math.radians(HEADING) / 2)
    message.pose.pose.orientation.w = math.cos(math.radians(HEADING) / 2)
    message.twist.twist.linear.x = SPEED
    ticks = 0

    def publish():
        nonlocal ticks
        ticks += 1
        message.header.stamp = Time(sec=ticks // 100, nanosec=ticks % 100 * 10_000_000)
        publisher.publish(message)

    yield lambda condition, what: probe.until(condition, what, doing=publish, every=0.01)
    probe.node.destroy_publisher(publisher)


def test_it_says_what_it_waits_for_then_prints_a_line_a_second_and_ends_after_its_duration(launch, swim):
    node = launch('monitor_node', '-p duration:=2')
    node.wait_for_output('waiting for /odom')
    node.may_end = True
    swim(lambda: node.process.poll() is not None, 'its end')
    assert node.exit_status() == 0

    lines = [line for line in node.output.splitlines() if 'waiting' not in line]
    assert lines[0].split() == ['time', 'speed', 'heading', 'depth', 'real-time']
    assert lines[1].split() == ['s', 'm/s', 'deg', 'm', 'factor']
    rows = [[float(value) for value in line.split()] for line in lines[2:]]
    assert 1 <= len(rows) <= 2
    for _, speed, heading, depth, factor in rows:
        assert (speed, heading, depth) == (SPEED, HEADING, DEPTH)
        assert factor > 0.0
    assert all(before[0] < after[0] for before, after in zip(rows, rows[1:]))


def test_it_listens_in_its_namespace(launch):
    launch('monitor_node', '-r __ns:=/a').wait_for_output('waiting for /a/odom')


@pytest.mark.parametrize('ending', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it(launch, ending):
    node = launch('monitor_node')
    node.wait_for_output('waiting')
    node.send(ending)
    assert node.exit_status() == 0
    assert 'Traceback' not in node.output


@pytest.mark.parametrize(('arguments', 'words'), [
    ('-p duration:=-1.0', ['duration', '-1.0', '0']),
    ('-p duration:=.nan', ['duration', 'nan', '0']),
    ('-p duration:=long', ['duration', 'long']),
])
def test_an_invalid_duration_ends_it_with_one_line(launch, arguments, words):
    (line,) = launch('monitor_node', arguments).refusal()
    for word in words:
        assert word in line

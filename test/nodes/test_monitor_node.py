"""What `monitor_node` prints, from odometry and joint states that the test publishes."""

import itertools
import math
import re
import signal
import subprocess

import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose, PoseWithCovariance, Quaternion
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState

from evidence.harness.processes import command_of, own_lines

SPEED, DEPTH, HEADING = 0.25, 1.5, 60.0  # [m/s, m, degrees]
QUEUE = 1000  # messages: none is lost when the node or this process stands still for a while
QUEUES = ' '.join(f'-p qos_overrides./{topic}.subscription.depth:={QUEUE}' for topic in ('odom', 'joint_states'))
RODS = ['left_front_rod', 'left_rear_rod', 'right_front_rod', 'right_rear_rod']


@pytest.fixture
def swim(probe):
    """Publishes odometry of a straight swim, 10 ms a message, and joint states, until a condition holds."""
    publisher = probe.node.create_publisher(Odometry, 'odom', QUEUE)
    joints = probe.node.create_publisher(JointState, 'joint_states', QUEUE)
    message = Odometry()
    message.pose.pose.position.z = -DEPTH
    message.pose.pose.orientation.z = math.sin(math.radians(HEADING) / 2)
    message.pose.pose.orientation.w = math.cos(math.radians(HEADING) / 2)

    def swim(condition, what, speed=lambda time: SPEED, joint_states=lambda time: None):
        ticks = 0

        def publish():
            nonlocal ticks
            ticks += 1
            message.header.stamp = Time(sec=ticks // 100, nanosec=ticks % 100 * 10_000_000)
            message.twist.twist.linear.x = speed(0.01 * ticks)
            publisher.publish(message)
            if (state := joint_states(0.01 * ticks)) is not None:
                state.header.stamp = message.header.stamp
                joints.publish(state)

        probe.until(condition, what, doing=publish, every=0.01)

    yield swim
    probe.node.destroy_publisher(publisher)
    probe.node.destroy_publisher(joints)


def lines_of(launch, swim, duration=2, **how):
    """Return the cells of each line that it prints about a swim, without those of the head."""
    node = launch('monitor_node', f'-p duration:={duration} {QUEUES}')
    node.wait_for_output('waiting for /odom')
    node.may_end = True
    swim(lambda: node.process.poll() is not None, 'its end', **how)
    assert node.exit_status() == 0
    lines = [line for line in node.output.splitlines() if 'waiting' not in line]
    assert max(map(len, lines)) < 80
    assert lines[0].split() == ['time', 'speed', 'heading', 'depth', 'real-time', 'power', 'energy']
    assert lines[1].split() == ['s', 'm/s', 'deg', 'm', 'factor', 'W', 'J/m']
    assert duration - 1 <= len(lines[2:]) <= duration
    return [line.split() for line in lines[2:]]


def test_it_says_what_it_waits_for_then_prints_a_line_a_second_and_ends_after_its_duration(launch, swim):
    lines = lines_of(launch, swim)
    assert {(*line[1:4], *line[5:]) for line in lines} == {(f'{SPEED:.3f}', f'{HEADING:.1f}', f'{DEPTH:.3f}', '-', '-')}
    assert all(float(line[4]) > 0.0 for line in lines)
    times = [float(line[0]) for line in lines]
    assert all(before < after for before, after in itertools.pairwise(times))


def joint_states(power):
    """Return joint states of the rods and of another joint, where the motors of the rods have this power [W]."""
    return JointState(
        name=['fin', *RODS], velocity=[9.0, 1.0, -2.0, 3.0, 4.0], effort=[9.0, 1.0, 0.5, 0.0, 0.25 * power])


@pytest.mark.parametrize(('speed', 'energy'), [(SPEED, '20.0'), (-SPEED, '20.0'), (0.005, '-')])
def test_it_prints_the_power_of_the_rods_and_the_energy_per_distance(launch, swim, speed, energy):
    lines = lines_of(launch, swim, speed=lambda time: speed, joint_states=lambda time: joint_states(5.0))
    assert {(line[1], *line[5:]) for line in lines} == {(f'{speed:.3f}', '5.00', energy)}


def test_joint_states_without_efforts_have_no_power(launch, swim):
    lines = lines_of(launch, swim, joint_states=lambda time: JointState(name=RODS, velocity=4 * [1.0]))
    assert {(*line[5:],) for line in lines} == {('-', '-')}


def test_speed_and_power_are_means_of_the_same_time_since_the_last_line(launch, swim):
    lines = lines_of(
        launch, swim, duration=3, speed=lambda time: time, joint_states=lambda time: joint_states(10.0 * time))
    ends = [float(line[0]) for line in lines]
    assert len(lines) > 1
    for (began, ended), line in zip(itertools.pairwise(ends), lines[1:]):  # the topics of the first began at any time
        assert float(line[1]) == pytest.approx(0.5 * (began + ended), abs=0.02)  # a message more or less
        assert float(line[5]) == pytest.approx(10.0 * float(line[1]), abs=0.2)
        assert float(line[6]) == pytest.approx(10.0, abs=0.4)


@pytest.fixture
def publish(probe):
    """Publishes odometry with a stamp [s]; `publish.listeners()` counts who hears that."""
    publisher = probe.node.create_publisher(Odometry, 'odom', QUEUE)

    def publish(stamp):
        message = Odometry()
        message.header.stamp = Time(sec=int(stamp), nanosec=round(stamp % 1.0 * 1e9))
        message.pose.pose.orientation.w = 1.0
        publisher.publish(message)

    publish.listeners = publisher.get_subscription_count
    yield publish
    probe.node.destroy_publisher(publisher)


def rows(node):
    """Return the real-time factors of the lines that it has printed about the robot."""
    return [float(row.split()[4]) for row in node.output.splitlines() if re.match(r'\s*\d', row)]


def test_while_no_odometry_comes_it_says_for_how_long_and_then_goes_on(launch, probe):
    node = launch('monitor_node', '-r odom:=/swum')
    publisher = probe.node.create_publisher(Odometry, '/swum', 10)

    def send():
        publisher.publish(Odometry(pose=PoseWithCovariance(pose=Pose(orientation=Quaternion(w=1.0)))))

    def silences():
        return [int(n) for n in re.findall(r'^no /swum for (\d+) s$', node.output, re.MULTILINE)]

    probe.until(lambda: rows(node), 'a line', doing=send)
    assert silences() == []
    probe.until(lambda: len(silences()) > 2, 'three lines about the silence')
    assert silences() == sorted(silences()) and 2 <= silences()[0] < silences()[-1]
    before = len(rows(node))
    probe.until(lambda: len(rows(node)) > before, 'a line', doing=send)
    probe.node.destroy_publisher(publisher)


def test_it_says_that_time_went_back_and_its_factors_stay_positive(launch, probe, publish):
    node = launch('monitor_node', QUEUES)
    node.wait_for_output('waiting for /odom')
    probe.until(publish.listeners, 'its subscription')
    stamps = itertools.chain((12.0 + 0.01 * k for k in range(31)), (0.01 * k for k in itertools.count()))
    probe.until(lambda: 'back' in node.output, 'it to see that', doing=lambda: publish(next(stamps)), every=0.05)
    probe.until(lambda: len(rows(node)) > 2, 'lines after it', doing=lambda: publish(next(stamps)), every=0.05)
    restarts = re.findall(r'^time went back .*$', node.output, re.MULTILINE)
    assert restarts == ['time went back from 12.3 s to 0.0 s: the simulator was restarted']
    assert min(rows(node)) >= 0.0


def test_it_ends_quietly_when_nobody_reads_its_lines_any_more(probe, publish):
    process = subprocess.Popen(
        command_of('monitor_node'), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    try:
        process.stdout.readline()
        process.stdout.close()
        probe.until(lambda: process.poll() is not None, 'its end', doing=lambda: publish(1.0))
        assert (process.returncode, own_lines(process.stderr.read().decode())) == (0, [])
    finally:
        process.kill()
        process.wait()


def test_it_listens_in_its_namespace(launch):
    launch('monitor_node', '-r __ns:=/a').wait_for_output('waiting for /a/odom')


@pytest.mark.parametrize('ending', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
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

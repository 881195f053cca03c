"""Quality of service: reliable by default, best-effort peers are served, parameters override it, misfits are logged."""

import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float64MultiArray

QUEUE = 2000
BEST_EFFORT = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
OVERRIDES = ('-p qos_overrides./odd/pose.publisher.reliability:=best_effort '
             '-p qos_overrides./odd/pose.publisher.depth:=3 '
             '-p qos_overrides./odd/fin_command.subscription.reliability:=best_effort')


@pytest.fixture(scope='module')
def overridden(module_launch, probe):
    node = module_launch('sim_node', f'{OVERRIDES} -r __ns:=/odd -r /clock:=/odd/clock')
    probe.until(lambda: probe.node.get_publishers_info_by_topic('/odd/pose'), 'the node')
    return node


def test_best_effort_and_reliable_subscribers_are_both_served(overridden, probe):
    heard = []
    subscription = probe.node.create_subscription(Odometry, '/odd/odom', heard.append, BEST_EFFORT)
    with probe.record(Odometry, '/odd/odom') as reliable:
        probe.until(lambda: len(heard) > 10 and len(reliable) > 10, 'both')
    probe.node.destroy_subscription(subscription)


def test_parameters_override_what_they_name_and_nothing_else(overridden, probe):
    def found():
        publishers, subscriptions = probe.node.get_publishers_info_by_topic, probe.node.get_subscriptions_info_by_topic
        return publishers('/odd/pose'), publishers('/odd/twist'), subscriptions('/odd/fin_command')

    probe.until(lambda: all(found()), 'its topics')
    (pose,), (twist,), (command,) = found()
    assert pose.qos_profile.reliability == command.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
    assert twist.qos_profile.reliability == ReliabilityPolicy.RELIABLE
    assert 'no parameter of this node' not in overridden.output


def test_a_best_effort_command_is_taken_where_that_is_asked_for(overridden, probe):
    commands = probe.node.create_publisher(Float64MultiArray, '/odd/fin_command', BEST_EFFORT)
    command = Float64MultiArray(data=[0.7, 0.7, 0.6, 0.6, 0.7, 0.7])
    with probe.record(Odometry, '/odd/odom') as odometry:
        probe.until(lambda: odometry and odometry[-1].twist.twist.linear.x, 'motion',
                    doing=lambda: commands.publish(command))


@pytest.fixture(scope='module')
def plain(module_launch, probe):
    """A node that takes both kinds, with a queue for all commands of a test, and its diagnostics."""
    node = module_launch('sim_node', f'-p qos_overrides./plain/fin_command.subscription.depth:={QUEUE} '
                                     '-r __ns:=/plain -r /clock:=/plain/clock -r /diagnostics:=/plain/diagnostics')
    node.heard = probe.record(DiagnosticArray, '/plain/diagnostics')
    probe.until(lambda: node.heard, 'diagnostics')
    return node


def counted(node):
    return [int(value.value) for status in node.heard[-1].status for value in status.values if value.key == 'refused']


@pytest.mark.parametrize('reliability', [ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT])
def test_each_command_is_taken_once_at_a_kilohertz_however_it_is_published(plain, probe, reliability):
    commands = probe.node.create_publisher(
        Float64MultiArray, '/plain/fin_command', QoSProfile(depth=QUEUE, reliability=reliability))
    probe.until(commands.get_subscription_count, 'the subscription')
    others = counted(plain)
    probe.until(  # until the node has heard of the end of other publishers, it takes no best-effort ones
        lambda: counted(plain) > others, 'a first one', doing=lambda: commands.publish(Float64MultiArray()), every=0.5)
    heard = len(plain.heard)
    probe.until(lambda: len(plain.heard) > heard + 1, 'the count of all of these')
    (before,) = counted(plain)
    for _ in range(1000):  # they have no value, so that each is counted
        commands.publish(Float64MultiArray())
        time.sleep(0.001)
    lossless = reliability == ReliabilityPolicy.RELIABLE
    probe.until(lambda: counted(plain) >= [before + (1000 if lossless else 500)], 'the count')
    heard = len(plain.heard)
    probe.until(lambda: len(plain.heard) > heard + 1, 'later diagnostics')
    assert counted(plain) <= [before + 1000]
    probe.node.destroy_publisher(commands)
    assert 'are not heard' not in plain.output


def test_best_effort_publishers_are_not_heard_beside_reliable_ones_and_that_is_said(plain, probe):
    reliable, best_effort = (
        probe.node.create_publisher(
            Float64MultiArray, '/plain/fin_command', QoSProfile(depth=10, reliability=reliability))
        for reliability in (ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT))
    probe.until(lambda: 'best-effort publishers of fin_command are not heard' in plain.output, 'a warning',
                doing=lambda: best_effort.publish(Float64MultiArray()))
    probe.node.destroy_publisher(reliable)
    (before,) = counted(plain)
    probe.until(lambda: counted(plain) > [before], 'a command',
                doing=lambda: best_effort.publish(Float64MultiArray()))
    probe.node.destroy_publisher(best_effort)


def test_a_subscriber_that_asks_for_more_is_warned_of(overridden, probe):
    with probe.record(PoseStamped, '/odd/pose') as reliable:
        probe.until(lambda: 'incompatible QoS' in overridden.output, 'a warning')
        assert not reliable
    line = next(line for line in overridden.output.splitlines() if 'incompatible QoS' in line)
    assert "topic 'pose'" in line and 'RELIABILITY' in line


@pytest.mark.parametrize(('override', 'words'), [
    ('pose.publisher.reliability:=often', ['publisher pose', 'reliability', 'often']),
    ('odom.publisher.reliability:=3', ['publisher odom']),
    ('fin_command.subscription.depth:=many', ['subscription fin_command', 'wrong type']),
    ('twist.publisher.depth:=-3', ['publisher twist', 'depth is -3, but must be at least 1']),
])
def test_an_invalid_override_ends_it_with_one_line_that_names_it(launch, override, words):
    node = launch('sim_node', f'-p qos_overrides./{override}')
    (line,) = node.refusal()
    assert all(word in line for word in ['qos_overrides', *words])

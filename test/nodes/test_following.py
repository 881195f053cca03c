"""Robots that follow the clock of another one: its pauses, steps and pace hold for all of them, and its end as well."""

import itertools
import math
import re
import signal

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rosgraph_msgs.msg import Clock

from evidence.harness.lockstep import LockstepRobot, numbers
from manta_sim_ros.dynamics import FinCommand, Simulator

SWIM = [0.7, 0.7, 0.6, 0.6, 0.7, 0.7]
TURN = [0.5, 0.2, 0.8, 0.8, 0.6, -0.3]
TICK = 10_000_000  # ns
FOLLOWS = '-p publish_clock:=false -p use_sim_time:=true -r /diagnostics:=/diagnostics_of_followers'


@pytest.fixture
def start(launch, probe):
    """`start('a')` starts a simulator that leads, `start('b', follows='a')` one that follows it."""
    def start(name, arguments='', follows=None):
        return LockstepRobot(
            launch, probe, name, f'{arguments} {FOLLOWS if follows else ""}', clock=f'/{follows or name}/clock')
    return start


def library(state):
    return [*state.position.tolist(), *state.twist.tolist(), *state.wrench.tolist()]


def heard(robot):
    position = robot.odometry[-1].pose.pose.position
    return [position.x, position.y, position.z, *numbers(robot.odometry[-1], robot.wrench[-1])]


def twin(values):
    simulator = Simulator()
    simulator.command(left=FinCommand(*values[::2]), right=FinCommand(*values[1::2]))
    return simulator


def wait_for_stamp(probe, stamp, *robots):
    def is_there(robot):
        return robot.odometry.stamps[-1:] == [stamp] == robot.wrench.stamps[-1:]
    probe.until(lambda: all(map(is_there, robots)), f'all at {stamp}')


def wait_for_line(probe, pattern, *robots):
    probe.until(lambda: all(re.search(pattern, robot.node.output) for robot in robots), pattern)


def test_in_lockstep_three_robots_are_the_library_bit_for_bit_also_with_a_new_leader(start, probe):
    leader = start('lead')
    assert leader.pause().success
    followers = [start('near', follows='lead'), start('far', '-p publish_rate:=25.0', follows='lead')]

    def steps_are_those_of_the_library():
        for follower in followers:
            assert follower.trigger('reset').success
        wait_for_stamp(probe, leader.now(), *followers)
        gaits = [SWIM, TURN]
        for follower, gait in zip(followers, gaits):
            follower.command(gait)
        twins = [twin(gait) for gait in gaits]
        for duration in (0.05, 1.0, 0.006):  # the last one ends between two outputs
            assert leader.set_parameter('step_duration', duration).successful
            wait_for_stamp(probe, leader.step(), *followers)
            for follower, same in zip(followers, twins):
                assert heard(follower) == library(same.advance(duration))

    steps_are_those_of_the_library()
    assert all(follower.odometry.finite for follower in followers)
    assert leader.set_parameter('step_duration', 5.0).successful  # beyond what a new clock has when it is heard
    wait_for_stamp(probe, leader.step(), *followers)
    leader.node.send(signal.SIGKILL)
    leader.node.exit_status()
    wait_for_line(probe, 'follows /clock, which nobody publishes', *followers)
    leader = start('lead', '-p start_paused:=true')
    wait_for_line(probe, r'/clock went from \S+ s to \S+ s: the robot goes on', *followers)
    steps_are_those_of_the_library()


def test_pause_step_and_pace_of_a_follower_are_refused(start):
    start('first', '-p start_paused:=true')
    follower = start('second', '-p start_paused:=true', follows='first')
    reason = 'the node follows /clock: pause, step and pace are those of the simulator that publishes it'
    assert f'start_paused has no effect: {reason}' in follower.node.output
    for answer in (follower.pause(), follower.pause(False), follower.trigger('step')):
        assert not answer.success and answer.message == reason
    answer = follower.set_parameter('real_time_factor', 2.0)
    assert not answer.successful and answer.reason == f'real_time_factor cannot be set: {reason}'


@pytest.mark.parametrize('factor', [0.5, 3.0])
def test_a_follower_has_the_pace_and_the_pauses_of_its_leader(start, probe, factor):
    leader = start('pacer', f'-p real_time_factor:={factor}')
    follower = start('paced', follows='pacer')
    follower.command(SWIM)
    probe.until(lambda: len(follower.odometry) > 100, 'some outputs')
    assert leader.pause().success
    wait_for_stamp(probe, leader.now(), follower)
    moved, count = heard(follower), len(follower.odometry)
    probe.listen(1.5)
    assert heard(follower) == moved and len(follower.odometry) == count
    assert leader.pause(False).success

    def in_a_row():
        """Return the last messages, each one tick after the one before; a lost message leaves a gap."""
        stamps = follower.odometry.stamps
        gaps = (index for index in range(len(stamps) - 1, count, -1) if stamps[index] - stamps[index - 1] != TICK)
        return follower.odometry[next(gaps, count):]

    probe.until(lambda: len(in_a_row()) > 50, 'some more outputs')
    assert follower.odometry.rising and follower.odometry.finite
    places, speeds = zip(*map(where_and_how_fast, in_a_row()))
    way = sum(itertools.starmap(math.dist, itertools.pairwise(places)))
    assert way == pytest.approx(1e-9 * TICK * (sum(speeds) - 0.5 * (speeds[0] + speeds[-1])), rel=0.05)


def where_and_how_fast(message):
    position, velocity = message.pose.pose.position, message.twist.twist.linear
    return (position.x, position.y, position.z), math.hypot(velocity.x, velocity.y, velocity.z)


def test_a_follower_begins_at_the_time_that_it_hears_first_and_jumps_with_another_clock(launch, probe):
    clock = probe.node.create_publisher(Clock, '/lone/clock', 10)
    diagnostics = probe.record(DiagnosticArray, '/diagnostics_of_followers')
    follower = LockstepRobot(launch, probe, 'lone', FOLLOWS)
    follower.command(SWIM)
    probe.until(lambda: clock.get_subscription_count() >= 3, 'both of the follower, and the recording')

    def publish(milliseconds):
        message = Clock()
        message.clock.sec, rest = divmod(milliseconds, 1000)
        message.clock.nanosec = rest * 1_000_000
        probe.until(lambda: follower.odometry.stamps[-1:] == [milliseconds * 1_000_000], 'the follower',
                    doing=lambda: clock.publish(message), every=1.0)  # it is heard with best effort
        wait_for_stamp(probe, milliseconds * 1_000_000, follower)

    assert not follower.odometry  # there is no time yet
    since_1970 = 1_795_000_000_000
    for begin in (12_340, since_1970, 0):
        before = heard(follower) if follower.odometry else library(twin(SWIM).state)
        publish(begin)
        assert heard(follower) == before
        publish(begin + 500)
        assert heard(follower) != before
    same = twin(SWIM)
    for _ in range(3):
        same.advance(0.5)
    assert heard(follower) == library(same.state)
    wait_for_line(probe, 'no message on /clock, which the node follows, for', follower)
    probe.until(lambda: any('no message on /clock' in message.status[0].message for message in diagnostics),
                'the same in the diagnostics')

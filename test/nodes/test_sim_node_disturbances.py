"""The topics `current` and `body_wrench`: what they do is what the library does, invalid messages are refused."""

import dataclasses
import math
import re

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Point, Pose, PoseStamped, Vector3Stamped, WrenchStamped
from rclpy.duration import Duration
from std_msgs.msg import Header

from evidence.harness.lockstep import LockstepRobot, numbers
from evidence.harness.processes import LIMIT
from manta_sim_ros.dynamics import Parameters, Simulator

VARYING = {'current_deviation': (0.2, 0.1, 0.05), 'current_correlation_time': 1.0, 'current_seed': 3}


class Disturbed(LockstepRobot):
    """A held robot with the topics that disturb it."""

    def __init__(self, launch, probe, name, ros_arguments=''):
        super().__init__(launch, probe, name, f'-p start_paused:=true {ros_arguments}')
        self.currents = probe.node.create_publisher(Vector3Stamped, f'/{name}/current', 10)
        self.wrenches = probe.node.create_publisher(WrenchStamped, f'/{name}/body_wrench', 10)
        probe.until(
            lambda: self.currents.get_subscription_count() and self.wrenches.get_subscription_count(), 'its topics')

    def flow(self, x, y, z, frame='odom'):
        """Set the current, and wait until it was taken: a refused one behind it is warned of."""
        self._send(self.currents, current(x, y, z, frame), current(0.0, 0.0, 0.0, 'nowhere'), 'current refused')

    def push(self, *values, frame='base_link'):
        self._send(self.wrenches, wrench(*values, frame=frame), wrench(frame='nowhere'), 'body_wrench refused')

    def _send(self, publisher, message, refused, words):
        refusals = self.node.output.count(words)
        publisher.publish(message)
        self.probe.until(
            lambda: self.node.output.count(words) > refusals, words, doing=lambda: publisher.publish(refused),
            every=0.3)


def current(x, y, z, frame='odom'):
    message = Vector3Stamped()
    message.header.frame_id = frame
    message.vector.x, message.vector.y, message.vector.z = x, y, z
    return message


def wrench(*values, frame='base_link'):
    message = WrenchStamped()
    message.header.frame_id = frame
    force, torque = message.wrench.force, message.wrench.torque
    force.x, force.y, force.z, torque.x, torque.y, torque.z = values or (0.0,) * 6
    return message


@pytest.fixture(scope='module')
def disturbed_robot(module_launch, probe):
    robot = Disturbed(module_launch, probe, 'disturbed')
    robot.trigger('step')
    probe.until(lambda: robot.odometry and robot.wrench and robot.clock, 'outputs')
    return robot


@pytest.fixture
def robot(disturbed_robot):
    """The paused robot at rest at the origin in still water, and its twin in the library."""
    for name, value in (('step_duration', 0.1), ('body_wrench_lifetime', 0.5), ('water.current', [0.0, 0.0, 0.0])):
        assert disturbed_robot.set_parameter(name, value).successful
    assert disturbed_robot.trigger('reset').success
    return disturbed_robot


@pytest.fixture
def twin():
    return Simulator(Parameters())


def assert_same(robot, state):
    assert numbers(robot.odometry[-1], robot.wrench[-1]) == [*state.twist.tolist(), *state.wrench.tolist()]
    assert any(state.twist)


def test_a_current_acts_until_the_next_one_as_it_does_in_the_library(robot, twin):
    robot.flow(0.3, -0.2, 0.1)
    for _ in range(3):
        robot.step()
        assert_same(robot, twin.advance(0.1, current=(0.3, -0.2, 0.1)))
    robot.flow(-0.1, 0.0, 0.0)
    robot.step()
    assert_same(robot, twin.advance(0.1, current=(-0.1, 0.0, 0.0)))


def test_the_parameter_takes_the_place_of_a_current_also_when_its_value_is_the_same(robot, twin):
    robot.flow(0.3, -0.2, 0.1)
    robot.step()
    twin.advance(0.1, current=(0.3, -0.2, 0.1))
    assert robot.set_parameter('water.current', [0.0, 0.0, 0.0]).successful
    robot.step()
    assert_same(robot, twin.advance(0.1))


@pytest.mark.parametrize(('frame', 'argument'), [('base_link', 'body_wrench'), ('odom', 'world_wrench')])
def test_a_wrench_acts_for_its_lifetime_to_the_step(robot, twin, frame, argument):
    assert robot.set_parameter('body_wrench_lifetime', 0.154).successful
    values = (3.0, -2.0, 1.0, 0.3, -0.2, 0.5)
    turned = (0.0, 0.0, 0.0, 0.2, 0.4, -0.3)  # so that the frames are not the same any more
    robot.push(*turned)
    robot.step()
    twin.advance(0.1, body_wrench=turned)
    robot.push(*values, frame=frame)  # in place of the one before
    robot.step()
    assert_same(robot, twin.advance(0.1, **{argument: values}))
    robot.step()
    twin.advance(0.054, **{argument: values})
    assert_same(robot, twin.advance(0.046))
    robot.step()
    assert_same(robot, twin.advance(0.1))


def test_without_a_lifetime_a_wrench_acts_until_the_next(robot, twin):
    assert robot.set_parameter('body_wrench_lifetime', 0.0).successful
    assert robot.set_parameter('step_duration', 3.0).successful
    robot.push(1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    robot.step()
    assert_same(robot, twin.advance(3.0, body_wrench=(1.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
    robot.push(*(0.0,) * 6)
    robot.step()
    assert_same(robot, twin.advance(3.0))


def test_a_reset_ends_all_disturbances_and_those_that_were_sent_before(robot):
    assert robot.set_parameter('body_wrench_lifetime', 0.0).successful
    robot.flow(0.3, -0.2, 0.1)
    robot.push(3.0, -2.0, 1.0, 0.3, -0.2, 0.5)
    robot.step()
    assert any(numbers(robot.odometry[-1], robot.wrench[-1]))
    assert robot.set_parameter('step_duration', 20.0).successful  # busy for a while: what is sent now waits
    began, stepping = robot.now(), robot.ask('step')
    robot.probe.until(lambda: robot.clock.stamps[-1] > began, 'the long step')
    for _ in range(10):  # the whole queue: Fast DDS asks for a receipt at once
        robot.currents.publish(current(0.3, -0.2, 0.1))
        robot.wrenches.publish(wrench(3.0, -2.0, 1.0, 0.3, -0.2, 0.5))
        robot.poses.publish(PoseStamped(header=Header(frame_id='odom'), pose=Pose(position=Point(x=9.0))))
    for publisher in (robot.currents, robot.wrenches, robot.poses):
        assert publisher.wait_for_all_acked(Duration(seconds=LIMIT))
    assert robot.trigger('reset').success
    robot.probe.until(stepping.done, 'the long step')
    assert robot.set_parameter('step_duration', 0.1).successful
    robot.step()
    assert not any(numbers(robot.odometry[-1], robot.wrench[-1]))
    assert robot.odometry[-1].pose.pose.position.x == 0.0


REFUSED = {
    'current not finite': ('currents', current(0.0, math.nan, 0.0), 'vector.y is nan, but must be from -10 to 10 m/s'),
    'current too fast': ('currents', current(-10.5, 0.0, 0.0), 'vector.x is -10.5, but must be from -10 to 10 m/s'),
    'current in the body frame': (
        'currents', current(0.1, 0.0, 0.0, 'base_link'), "header.frame_id is 'base_link', but must be 'odom'"),
    'wrench not finite': (
        'wrenches', wrench(0.0, 0.0, math.inf, 0.0, 0.0, 0.0),
        'wrench.force.z is inf, but must be from -1e+06 to 1e+06 N'),
    'wrench too large': (
        'wrenches', wrench(0.0, 0.0, 0.0, -2e6, 0.0, 0.0),
        'wrench.torque.x is -2000000.0, but must be from -1e+06 to 1e+06 N m'),
    'wrench in no frame': (
        'wrenches', wrench(frame=''), "header.frame_id is '', but must be 'base_link' or 'odom'"),
}


@pytest.mark.parametrize(('publisher', 'message', 'words'), REFUSED.values(), ids=REFUSED)
def test_an_invalid_disturbance_is_refused_and_the_previous_one_continues(robot, twin, publisher, message, words):
    robot.flow(0.3, 0.0, 0.0)
    robot.push(0.0, 2.0, 0.0, 0.0, 0.0, 0.0)
    refused = {'currents': 'current refused, the previous current continues',
               'wrenches': 'body_wrench refused, it does not act'}[publisher]
    line = re.compile(rf'{refused} \(\d+ refused so far\): {re.escape(words)}')
    robot.probe.until(
        lambda: line.search(robot.node.output), line.pattern,
        doing=lambda: getattr(robot, publisher).publish(message), every=0.3)
    robot.step()
    assert_same(robot, twin.advance(0.1, current=(0.3, 0.0, 0.0), body_wrench=(0.0, 2.0, 0.0, 0.0, 0.0, 0.0)))


def test_the_largest_wrench_cannot_stop_the_node_or_put_a_nan_on_a_topic(robot):
    robot.push(1e6, -1e6, 1e6, 1e6, 1e6, -1e6, frame='odom')
    assert not robot.trigger('step').success
    robot.probe.until(lambda: 'The robot is put at rest where it was' in robot.node.output, 'the error')
    assert robot.odometry.finite and robot.wrench.finite
    robot.step()
    assert not any(numbers(robot.odometry[-1], robot.wrench[-1]))  # at rest, and not pushed any more


def test_a_step_in_which_the_motion_diverges_answers_so(robot):
    robot.push(0.0, 0.0, 0.0, 1e6, 0.0, 0.0)
    answer = robot.trigger('step')
    assert not answer.success
    assert 'but the motion diverged and the robot was put at rest where it was' in answer.message
    assert robot.trigger('step').success


def test_a_current_that_varies_is_that_of_the_library_bit_for_bit(launch, probe):
    robot = Disturbed(
        launch, probe, 'varying', '-p step_duration:=0.25 -p water.current_deviation:=[0.2,0.1,0.05] '
        '-p water.current_correlation_time:=1.0 -p water.current_seed:=3')
    assert robot.trigger('reset').success  # at whatever time it is by now
    robot.step()
    robot.step()
    end = robot.now() * 1e-9
    parameters = Parameters().replace(water=VARYING)
    at_rest = Simulator(parameters).state
    twin = Simulator(parameters, state=dataclasses.replace(at_rest, time=round(end - 0.5, 9)))
    assert_same(robot, twin.advance(0.5))
    assert np.all(twin.state.current_deviation != 0.0)


def test_diagnostics_say_what_acts_and_what_was_refused(robot):
    diagnostics = robot.probe.record(DiagnosticArray, '/diagnostics')

    def latest():
        for message in reversed(diagnostics):
            for status in message.status:
                if status.name == '/disturbed/manta_sim: disturbances':
                    return status

    robot.flow(0.3, 0.4, 0.0)
    robot.push(0.0, 2.0, 0.0, 0.0, 0.0, 0.0)
    robot.probe.until(
        lambda: latest() and latest().message == 'the water flows at 0.5 m/s, a body_wrench acts', 'the words')
    assert {value.key: value.value for value in latest().values}['current [m/s]'] == '0.3 0.4 0'
    robot.probe.until(
        lambda: 'current refused just now: vector.x is 99.0' in latest().message, 'the refusal',
        doing=lambda: robot.currents.publish(current(99.0, 0.0, 0.0)), every=0.3)
    assert latest().level == b'\x01'

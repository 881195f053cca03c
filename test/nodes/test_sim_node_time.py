"""Pause, step, reset and a new pose: others hold the robot's time, exactly; in lockstep it is the library's twin."""

import dataclasses
import itertools
import math
import re
import signal
import time

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import (
    PoseStamped,
    PoseWithCovarianceStamped,
    TwistStamped,
    TwistWithCovarianceStamped,
    WrenchStamped,
)
from nav_msgs.msg import Odometry
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import FluidPressure, Imu, JointState
from std_msgs.msg import Float64MultiArray
from visualization_msgs.msg import MarkerArray

from evidence.harness.lockstep import LockstepRobot, numbers
from evidence.harness.processes import LIMIT
from manta_sim_ros.dynamics import FinCommand, Parameters, Simulator, State

SWIM = [0.7, 0.7, 0.6, 0.6, 0.7, 0.7]
TURN = [0.5, 0.2, 0.8, 0.8, 0.6, -0.3]
TICK = 10_000_000  # ns
HALF = math.sqrt(0.5)


@pytest.fixture(scope='module')
def paused_robot(module_launch, probe):
    robot = LockstepRobot(module_launch, probe, 'held', '-p start_paused:=true')
    robot.trigger('step')
    probe.until(lambda: robot.odometry and robot.wrench and robot.clock, 'outputs')
    return robot


@pytest.fixture
def held(paused_robot):
    """The paused robot at rest at the origin, as it was at its start but for the time."""
    for name, value in (('step_duration', 0.01), ('command_timeout', 0.0)):
        assert paused_robot.set_parameter(name, value).successful
    assert paused_robot.trigger('reset').success
    paused_robot.step()
    return paused_robot


def rises(stamps, began):
    """Return the stamps that are later than all before: a paused simulator repeats its clock."""
    return [stamp for before, stamp in itertools.pairwise([began, *stamps]) if stamp != before]


def library_numbers(state):
    return [*state.twist.tolist(), *state.wrench.tolist()]


def test_paused_it_stands_still_and_goes_on_from_there(launch, probe):
    robot = LockstepRobot(launch, probe, 'paused')
    probe.until(lambda: len(robot.clock) > 20, 'the clock')
    answer = robot.pause()
    assert answer.success and re.fullmatch(r'paused at \S+ s of simulated time', answer.message)
    stopped = robot.now()
    probe.until(lambda: robot.odometry.stamps[-1:] == [stopped], 'the last output')
    heard, outputs = len(robot.clock), len(robot.odometry)
    probe.until(lambda: len(robot.clock) >= heard + 3, 'the clock, which is repeated')
    assert set(robot.clock.stamps[heard:]) == {stopped} and len(robot.odometry) == outputs
    assert robot.clock.sent[-1] - robot.clock.sent[heard] > 1.8e9  # about two seconds, for two of them
    assert float(answer.message.split()[2]) == pytest.approx(stopped * 1e-9)
    assert robot.pause().success  # once more is as good as once
    began = time.time_ns()
    assert robot.pause(False).success
    probe.until(lambda: robot.clock.stamps[-1] >= stopped + 20 * TICK, 'the clock')
    assert all(stamp - stopped <= max(0, sent - began)  # nothing was made up for
               for stamp, sent in zip(robot.clock.stamps[heard:], robot.clock.sent[heard:]))
    assert robot.clock.stamps == sorted(robot.clock.stamps) and robot.odometry.rising


def test_a_step_is_refused_while_time_runs(launch, probe):
    robot = LockstepRobot(launch, probe, 'runs')
    answer = robot.trigger('step')
    assert not answer.success
    assert answer.message.startswith('not paused: simulated time is running')


@pytest.mark.parametrize(('duration', 'ticks'), [(0.01, [10]), (0.002, [2]), (0.054, [10, 20, 30, 40, 50, 54])])
def test_a_step_takes_exactly_its_duration_with_all_outputs_of_it(held, duration, ticks):
    assert held.set_parameter('step_duration', duration).successful
    for _ in range(3):
        began, heard = held.now(), len(held.clock)
        assert held.step() == began + round(duration * 1e9)
        announced = rises(held.clock.stamps[heard:], began)
        assert [stamp - began for stamp in announced] == [tick * 1_000_000 for tick in ticks]
        assert held.odometry.stamps[-len(ticks):] == announced == held.wrench.stamps[-len(ticks):]


def test_a_long_step_loses_no_message_of_any_topic(held):
    assert held.set_parameter('step_duration', 20.0).successful
    heard = len(held.clock)
    began, end = held.now(), held.step()
    expected = [began + tick * TICK for tick in range(1, 2001)]
    assert end == expected[-1]
    assert rises(held.clock.stamps[heard:], began) == expected
    assert held.odometry.stamps[-2000:] == held.wrench.stamps[-2000:] == expected


def test_a_step_of_no_whole_number_of_time_steps_is_refused_when_it_is_set(held):
    for duration in (0.0033, 0.005, 0.0001):
        refused = held.set_parameter('step_duration', duration)
        assert not refused.successful
        assert refused.reason == (f'step_duration is {duration} s, but must be a whole number of time steps, and '
                                  'solver.time_step is 0.002 s')
    refused = held.set_parameter('step_duration', -1.0)
    assert not refused.successful and 'step_duration' in refused.reason
    assert held.trigger('step').success  # with the one before


def test_a_default_step_that_does_not_fit_the_time_step_is_refused_only_when_it_is_used(launch, probe):
    robot = LockstepRobot(launch, probe, 'unfit', '-p start_paused:=true -p solver.time_step:=0.003')
    answer = robot.trigger('step')
    assert not answer.success and answer.message == (
        'step_duration is 0.01 s, but must be a whole number of time steps, and solver.time_step is 0.003 s')
    assert robot.set_parameter('water.density', 1000.0).successful
    assert not robot.set_parameter('step_duration', 0.01).successful
    assert robot.set_parameter('step_duration', 0.009).successful
    assert robot.trigger('step').success


def test_in_lockstep_it_is_the_library_bit_for_bit(held):
    assert held.set_parameter('step_duration', 0.05).successful
    runs = []
    for _ in range(2):
        assert held.trigger('reset').success
        twin, run = Simulator(Parameters()), []
        for values in (SWIM, None, TURN, None, None):
            if values is not None:
                held.command(values)
                twin.command(left=FinCommand(*values[::2]), right=FinCommand(*values[1::2]))
            held.step()
            run.append(numbers(held.odometry[-1], held.wrench[-1]))
            assert run[-1] == library_numbers(twin.advance(0.05))
            position = held.odometry[-1].pose.pose.position
            assert [position.x, position.y, position.z] == twin.state.position.tolist()
        assert any(run[-1])
        runs.append(run)
    assert runs[0] == runs[1]


def test_a_reset_goes_back_to_the_start_and_the_clock_goes_on(held):
    assert held.set_parameter('step_duration', 1.0).successful
    held.command(SWIM)
    now = held.step()
    assert held.odometry[-1].pose.pose.position.x > 0.01
    heard = len(held.odometry)
    answer = held.trigger('reset')
    assert answer.success and answer.message.startswith('at rest where it started')
    held.probe.until(lambda: len(held.odometry) > heard, 'the state after the reset')
    assert held.odometry.stamps[-1] == now
    for _ in range(2):
        pose, twist = held.odometry[-1].pose.pose, held.odometry[-1].twist.twist
        assert (pose.position.x, pose.position.y, pose.position.z, pose.orientation.w) == (0.0, 0.0, 0.0, 1.0)
        assert (twist.linear.x, twist.linear.z) == (0.0, 0.0)
        now = held.step()  # nobody commands it any more
    assert now >= held.clock.stamps[0] + 3_000_000_000


def test_commands_that_were_sent_before_a_reset_are_dropped(held):
    held.command(TURN)  # so that what comes is heard
    assert held.set_parameter('step_duration', 30.0).successful  # busy for a while: what is sent now waits
    began, stepping = held.now(), held.ask('step')
    held.probe.until(lambda: held.clock.stamps[-1] > began, 'the long step')
    for _ in range(10):  # the whole queue: Fast DDS asks for a receipt at once
        held.commands.publish(Float64MultiArray(data=SWIM))
    assert held.commands.wait_for_all_acked(Duration(seconds=LIMIT))
    assert held.trigger('reset').success
    held.probe.until(stepping.done, 'the long step')
    assert held.set_parameter('step_duration', 0.1).successful
    held.step()
    assert not any(numbers(held.odometry[-1], held.wrench[-1]))


def test_it_starts_at_its_initial_pose_and_goes_back_there(launch, probe):
    robot = LockstepRobot(launch, probe, 'elsewhere', '-p start_paused:=true -p step_duration:=1.0 '
                 '-p initial_position:=[3.0,-2.0,-1.5] -p initial_yaw:=1.5')
    turned = [0.0, 0.0, math.sin(0.75), math.cos(0.75)]
    twin = Simulator(Parameters(), state=dataclasses.replace(
        State.at_rest(Parameters()), position=np.array([3.0, -2.0, -1.5]), orientation=np.array(turned)))
    assert robot.trigger('reset').success
    twin.command(left=FinCommand(*SWIM[::2]), right=FinCommand(*SWIM[1::2]))
    robot.command(SWIM)
    robot.step()
    pose, state = robot.odometry[-1].pose.pose, twin.advance(1.0)
    assert [pose.position.x, pose.position.y, pose.position.z] == state.position.tolist()
    assert numbers(robot.odometry[-1], robot.wrench[-1]) == library_numbers(state)
    assert pose.position.y > -2.0 + 0.01  # it swims where it heads
    heard = len(robot.odometry)
    assert robot.trigger('reset').success
    probe.until(lambda: len(robot.odometry) > heard, 'the state after the reset')
    pose = robot.odometry[-1].pose.pose
    assert [pose.position.x, pose.position.y, pose.position.z] == [3.0, -2.0, -1.5]
    assert [pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w] == turned


def pose_message(frame='odom', position=(1.0, -2.0, -3.0), orientation=(0.0, 0.0, HALF, HALF)):
    message = PoseStamped()
    message.header.frame_id = frame
    at, turned = message.pose.position, message.pose.orientation
    at.x, at.y, at.z = position
    turned.x, turned.y, turned.z, turned.w = orientation
    return message


def test_a_pose_that_is_set_is_where_it_rests_and_swims_on_from(held):
    held.command(SWIM)
    held.step()
    held.poses.publish(pose_message(orientation=(0.0, 0.0, 0.707, 0.707)))  # as somebody types it
    held.probe.until(lambda: held.odometry[-1].pose.pose.position.z == -3.0, 'the new pose')
    held.step()
    pose = held.odometry[-1].pose.pose
    assert (pose.position.x, pose.position.y, pose.position.z) == (1.0, -2.0, -3.0)
    assert pose.orientation.z == pytest.approx(math.sqrt(0.5), abs=1e-12)
    assert not any(numbers(held.odometry[-1], held.wrench[-1]))  # at rest, and not commanded
    held.command(SWIM)
    assert held.set_parameter('step_duration', 2.0).successful
    held.step()
    position = held.odometry[-1].pose.pose.position
    assert position.y > -1.9 and position.x == pytest.approx(1.0, abs=1e-9)  # forward is to the world's left now


@pytest.fixture
def estimates(held):
    publisher = held.probe.node.create_publisher(PoseWithCovarianceStamped, '/held/initialpose', 10)
    held.probe.until(publisher.get_subscription_count, 'the subscription')
    yield publisher
    held.probe.node.destroy_publisher(publisher)


def test_an_initial_pose_is_planar_and_keeps_the_depth(held, estimates):
    held.poses.publish(pose_message(position=(0.0, 0.0, -3.0), orientation=(0.5, 0.5, 0.5, 0.5)))
    held.probe.until(lambda: held.odometry[-1].pose.pose.position.z == -3.0, 'the depth')
    held.command(SWIM)
    estimate = PoseWithCovarianceStamped()
    estimate.header.frame_id, estimate.pose.pose = 'odom', pose_message(position=(4.0, 5.0, 0.0)).pose
    estimates.publish(estimate)
    held.probe.until(lambda: held.odometry[-1].pose.pose.position.x == 4.0, 'the new pose')
    held.step()
    pose = held.odometry[-1].pose.pose
    assert (pose.position.x, pose.position.y, pose.position.z) == (4.0, 5.0, -3.0)
    turned = [pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w]
    assert turned == pytest.approx([0.0, 0.0, HALF, HALF], abs=1e-15)
    assert not any(numbers(held.odometry[-1], held.wrench[-1]))  # at rest, and not commanded


def test_an_initial_pose_in_another_frame_is_refused(held, estimates):
    line = 'initialpose refused, the robot stays where it is'
    held.probe.until(lambda: line in held.node.output, line,
                     doing=lambda: estimates.publish(PoseWithCovarianceStamped()), every=0.3)
    assert "header.frame_id is '', but must be 'odom'" in held.node.output
    held.step()
    assert held.odometry[-1].pose.pose.position.x == 0.0


def test_settings_that_change_again_and_again_keep_diagnostics_and_time_going(launch, probe):
    robot = LockstepRobot(launch, probe, 'busy')
    diagnostics, heard = probe.record(DiagnosticArray, '/diagnostics'), len(robot.clock)
    rates = itertools.cycle((5.0, 6.0))

    def change():
        assert robot.set_parameter('marker_rate', next(rates)).successful

    def ours():
        return [message for message in diagnostics if message.status[0].name.startswith('/busy/')]
    probe.until(lambda: len(ours()) > 2 and len(robot.clock) > heard + 50, 'both', doing=change, every=0.0)


REFUSED = {
    'another frame': (pose_message(frame='map'), "header.frame_id is 'map', but must be 'odom'"),
    'no frame': (pose_message(frame=''), "header.frame_id is '', but must be 'odom'"),
    'nan': (pose_message(position=(0.0, math.nan, 0.0)), 'pose.position.y is nan, but must be from'),
    'too far': (pose_message(position=(0.0, 0.0, -1e7)), 'pose.position.z is -10000000.0, but must be from'),
    'no quaternion': (pose_message(orientation=(0.0, 0.0, 0.0, 0.0)), 'pose.orientation has norm 0, but must be'),
    'nan in the quaternion': (pose_message(orientation=(0.0, 0.0, 0.0, math.nan)), 'pose.orientation has norm nan'),
}


@pytest.mark.parametrize(('message', 'words'), REFUSED.values(), ids=REFUSED)
def test_an_invalid_pose_is_refused_and_the_robot_stays(held, message, words):
    before = numbers(held.odometry[-1], held.wrench[-1])
    line = re.compile(
        rf'set_pose refused, the robot stays where it is \(\d+ refused so far\): {re.escape(words)}')
    held.probe.until(
        lambda: line.search(held.node.output), line.pattern,
        doing=lambda: held.poses.publish(message), every=0.3)
    held.step()
    assert numbers(held.odometry[-1], held.wrench[-1]) == before
    assert held.odometry[-1].pose.pose.position.x == 0.0


def test_without_commands_for_too_long_the_fins_glide_to_rest_until_the_next(held):
    assert held.set_parameter('command_timeout', 1.0).successful
    assert held.set_parameter('step_duration', 0.5).successful
    held.command(SWIM)

    def largest_force():
        heard = len(held.wrench)
        held.step()
        return max(abs(message.wrench.force.z) for message in held.wrench[heard:])

    warning = 'no fin_command for 1 s of simulated time: the fins glide to rest'
    swimming = [largest_force() for _ in range(2)]
    assert warning not in held.node.output
    gliding = [largest_force() for _ in range(8)]
    assert held.node.output.count(warning) == 1
    assert max(swimming) > 5.0 and gliding[-1] < 0.05 * max(swimming)
    held.command(SWIM)
    assert max(largest_force() for _ in range(2)) > 5.0


@pytest.mark.parametrize('ending', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_paused_it_ends_with_status_zero(launch, probe, ending):
    name = f'ended_by_{ending.name.lower()}'  # one of its own: the graph remembers those before for a while
    node = launch('sim_node', f'-p start_paused:=true -r __ns:=/{name} -r /clock:=/{name}/clock')
    probe.until(lambda: ('manta_sim', f'/{name}') in probe.node.get_node_names_and_namespaces(), 'the node')
    node.send(ending)
    assert node.exit_status() == 0


def test_who_comes_while_it_is_paused_gets_time_and_state(launch, probe):
    robot = LockstepRobot(
        launch, probe, 'early', '-p start_paused:=true -p step_duration:=0.03 -p publish_fin_joints:=true '
        '-p imu.rate:=10.0')
    robot.command(SWIM)
    end = robot.step()  # between two joint_states
    repeated = len(robot.clock)
    probe.until(lambda: len(robot.clock) > repeated + 1, 'the clock: who came until now has got the state')
    before = {topic: len(heard) for topic, heard in (('odom', robot.odometry), ('clock', robot.clock))}
    kinds = {'pose': PoseStamped, 'twist': TwistStamped, 'odom': Odometry, 'fin_wrench': WrenchStamped,
             'left_fin/wrench': WrenchStamped, 'right_fin/wrench': WrenchStamped, 'imu/data': Imu,
             'pressure': FluidPressure, 'joint_states': JointState, 'velocity': TwistWithCovarianceStamped,
             'clock': Clock}
    late = {topic: probe.record(kind, f'/early/{topic}') for topic, kind in kinds.items()}
    markers = probe.record(MarkerArray, '/early/fin_markers')
    probe.until(lambda: all(late.values()) and markers, 'all outputs')
    assert {topic: set(heard.stamps) for topic, heard in late.items()} == dict.fromkeys(kinds, {end})
    assert len(late['joint_states'][0].name) == len(late['joint_states'][0].position) > 100
    assert late['odom'][0] == robot.odometry[-1]
    probe.until(lambda: len(robot.clock) >= before['clock'] + 3 and len(robot.odometry) > before['odom'],
                'the clock, which goes on, and the state')
    assert len(robot.odometry) == before['odom'] + 1  # who was there gets it once more, and not again and again


def test_who_asks_for_what_lasts_gets_it_unless_an_override_says_otherwise(launch, probe):
    lasting = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node = launch('sim_node', '-p start_paused:=true -r __ns:=/lasting -r /clock:=/lasting/clock '
                              '-p qos_overrides./lasting/twist.publisher.durability:=volatile')
    heard = []
    subscriptions = [
        probe.node.create_subscription(kind, f'/lasting/{topic}', heard.append, lasting)
        for kind, topic in ((PoseStamped, 'pose'), (TwistStamped, 'twist'))]
    probe.until(lambda: heard and "topic 'twist'" in node.output, 'the pose, and a warning')
    assert {type(message) for message in heard} == {PoseStamped} and 'DURABILITY' in node.output
    for subscription in subscriptions:
        probe.node.destroy_subscription(subscription)

"""What `sim_node` publishes: types, frames, rates and stamps, and the values of the library."""

import math
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, TwistStamped, TwistWithCovarianceStamped, WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.qos import ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import FluidPressure, Imu, JointState
from std_msgs.msg import Float64MultiArray
from visualization_msgs.msg import MarkerArray

from manta_sim_ros.dynamics import FinCommand, Parameters, Simulator

OUTPUTS = {
    'pose': PoseStamped, 'twist': TwistStamped, 'odom': Odometry, 'fin_wrench': WrenchStamped,
    'left_fin/wrench': WrenchStamped, 'right_fin/wrench': WrenchStamped,
    'imu/data': Imu, 'pressure': FluidPressure,
}
FRAMES = {'pose': 'odom', 'odom': 'odom'}  # all others: base_link
GAIT = [0.7, 0.4, 0.6, 0.5, 0.7, 0.3]
TICK = 10_000_000  # [ns] at 100 Hz
STEP = 2_000_000  # [ns]
TICKS = 100
ROUNDING = 1e-12  # relative, of one addition in double precision and a margin


@pytest.fixture(scope='module')
def robot(module_launch):
    return module_launch('sim_node')


@pytest.fixture(scope='module')
def heard(robot, probe):
    """Recordings of all outputs and of /clock, from before the first motion on; at least TICKS moving ticks each."""
    heard = {topic: probe.record(kind, topic) for topic, kind in {**OUTPUTS, '/clock': Clock}.items()}
    probe.until(lambda: all(heard.values()), 'a first message on each topic')
    commands = probe.node.create_publisher(Float64MultiArray, 'fin_command', 10)
    command = Float64MultiArray(data=GAIT)
    probe.until(  # said again and again, it is the same command
        lambda: heard['odom'][-1].twist.twist.linear.x, 'motion', doing=lambda: commands.publish(command))
    longest = max(len(recording) for recording in heard.values()) + TICKS
    probe.until(lambda: all(len(recording) > longest for recording in heard.values()), 'some ticks of motion')
    return heard


def at_stamps(recording):
    return dict(zip(recording.stamps, recording))


def vector(force_and_torque):
    return [getattr(part, axis) for part in (force_and_torque.force, force_and_torque.torque) for axis in 'xyz']


def test_each_topic_has_its_type_and_there_are_no_others(heard, probe):
    taken, published = probe.topics_of('manta_sim')
    expected = {f'/{topic}': kind for topic, kind in OUTPUTS.items()} | {
        '/joint_states': JointState, '/fin_markers': MarkerArray, '/clock': Clock, '/diagnostics': DiagnosticArray,
        '/velocity': TwistWithCovarianceStamped}
    published.pop('/tf', None)  # where tf2_msgs is installed
    assert published == {
        topic: f'{kind.__module__.split(".")[0]}/msg/{kind.__name__}' for topic, kind in expected.items()}
    assert taken == {
        '/fin_command': 'std_msgs/msg/Float64MultiArray', '/rod_command': 'sensor_msgs/msg/JointState',
        '/set_pose': 'geometry_msgs/msg/PoseStamped',
        '/initialpose': 'geometry_msgs/msg/PoseWithCovarianceStamped', '/current': 'geometry_msgs/msg/Vector3Stamped',
        '/body_wrench': 'geometry_msgs/msg/WrenchStamped'}


def test_each_topic_is_reliable(heard, probe):
    for topic in heard:
        (publisher,) = probe.node.get_publishers_info_by_topic(topic)
        assert publisher.qos_profile.reliability == ReliabilityPolicy.RELIABLE


def test_positions_are_in_odom_and_all_else_in_base_link(heard):
    for topic in OUTPUTS:
        assert {message.header.frame_id for message in heard[topic]} == {FRAMES.get(topic, 'base_link')}
    assert {message.child_frame_id for message in heard['odom']} == {'base_link'}


def test_stamps_rise_by_ten_milliseconds_of_simulated_time(heard):
    for recording in heard.values():
        assert recording.rising
        assert not any(stamp % TICK for stamp in recording.stamps)
        stamps = recording.stamps
        assert min(after - before for before, after in zip(stamps, stamps[1:])) == TICK  # a lost message leaves a gap


def test_all_outputs_of_a_tick_share_its_stamp(heard, probe):
    def longest_run_of_complete_ticks():
        complete = set.intersection(*(set(recording.stamps) for recording in heard.values()))
        longest = run = 0
        for stamp in sorted(complete):
            run = run + 1 if stamp - TICK in complete else 1
            longest = max(longest, run)
        return longest

    probe.until(lambda: longest_run_of_complete_ticks() >= TICKS, 'ticks in a row with a message on each topic')


def test_outputs_are_sent_before_the_clock_that_announces_them(heard):
    announced = dict(zip(heard['/clock'].stamps, heard['/clock'].sent))
    for topic in OUTPUTS:
        sent = dict(zip(heard[topic].stamps, heard[topic].sent))
        both = sent.keys() & announced.keys()
        assert len(both) > TICKS
        assert all(sent[stamp] <= announced[stamp] for stamp in both)


def test_odometry_is_pose_and_twist(heard):
    poses, twists = at_stamps(heard['pose']), at_stamps(heard['twist'])
    compared = 0
    for stamp, odometry in at_stamps(heard['odom']).items():
        if stamp in poses and stamp in twists:
            assert odometry.pose.pose == poses[stamp].pose
            assert odometry.twist.twist == twists[stamp].twist
            compared += 1
    assert compared > TICKS


def test_the_fin_wrench_is_the_sum_of_both_fins(heard):
    left, right = at_stamps(heard['left_fin/wrench']), at_stamps(heard['right_fin/wrench'])
    compared = 0
    for stamp, message in at_stamps(heard['fin_wrench']).items():
        if stamp in left and stamp in right:
            parts = vector(left[stamp].wrench), vector(right[stamp].wrench)
            for total, one, other in zip(vector(message.wrench), *parts):
                assert math.isclose(total, one + other, rel_tol=ROUNDING, abs_tol=ROUNDING * abs(one))
            compared += any(parts[0]) and parts[0] != parts[1]
    assert compared > TICKS // 2


def test_values_are_those_of_the_library_bit_for_bit(heard):
    wrenches = at_stamps(heard['left_fin/wrench']), at_stamps(heard['right_fin/wrench'])
    moving = [message for message in heard['odom'] if message.twist.twist.linear.x]
    simulator = Simulator(Parameters())
    simulator.command(left=FinCommand(*GAIT[0::2]), right=FinCommand(*GAIT[1::2]))
    while simulator.advance(0.01).twist[0] != moving[0].twist.twist.linear.x:  # rest is rest, whenever the command came
        assert simulator.state.time < 1.0
    began = heard['odom'].stamps[-len(moving)] - round(simulator.state.time * 1e9)
    for message, stamp in zip(moving, heard['odom'].stamps[-len(moving):]):
        state = simulator.advance((stamp - began) * 1e-9 - simulator.state.time)
        pose, twist = message.pose.pose, message.twist.twist
        assert [getattr(pose.position, axis) for axis in 'xyz'] == state.position.tolist()
        assert [getattr(pose.orientation, axis) for axis in 'xyzw'] == state.orientation.tolist()
        assert [getattr(part, axis) for part in (twist.linear, twist.angular) for axis in 'xyz'] == state.twist.tolist()
        for side in range(2):
            if stamp in wrenches[side]:
                assert vector(wrenches[side][stamp].wrench) == state.fin_wrenches[side].tolist()


def test_frames_and_a_rate_between_two_steps_are_as_asked(launch, probe):
    with probe.record(Odometry, '/sixty/odom') as odometry, probe.record(TwistStamped, '/sixty/twist') as twist:
        launch('sim_node', '-p odom_frame:=map -p base_frame:=manta -p publish_rate:=60.0 '
                           '-r __ns:=/sixty -r /clock:=/sixty/clock')
        probe.until(lambda: len(odometry) > TICKS and twist, 'odometry at 60 Hz')
    assert {(message.header.frame_id, message.child_frame_id) for message in odometry} == {('map', 'manta')}
    assert {message.header.frame_id for message in twist} == {'manta'}
    stamps = odometry.stamps
    assert odometry.rising and not any(stamp % STEP for stamp in stamps)
    assert min(after - before for before, after in zip(stamps, stamps[1:])) == 8 * STEP
    for stamp in stamps:  # each tick is at the step nearest to it, so two ticks are at most one step off
        ticks = round((stamp - stamps[0]) * 60e-9)
        assert abs(stamp - stamps[0] - ticks / 60e-9) <= STEP * (1.0 + ROUNDING)


def test_without_publish_clock_there_is_none_and_stamps_are_of_the_system_clock(launch, probe):
    before = time.time_ns()
    launch('sim_node', '-p publish_clock:=false -r __ns:=/silent')
    with probe.record(Odometry, '/silent/odom') as odometry:
        probe.until(lambda: len(odometry) > 10, 'odometry')
        _, published = probe.topics_of('manta_sim', '/silent')
        assert '/silent/odom' in published and '/clock' not in published
    assert odometry.rising
    assert before < odometry.stamps[0] and odometry.stamps[-1] < time.time_ns()


def test_two_simulators_with_a_clock_are_warned_of(robot, launch, probe):
    assert 'publishes /clock too' not in robot.output
    other = launch('sim_node', '-r __ns:=/other')
    probe.until(lambda: 'publishes /clock too' in robot.output + other.output, 'a warning')

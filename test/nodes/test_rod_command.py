"""Commands of the rods: servos follow them as in the library, bit for bit, until the next gait."""

import math
import re

import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from evidence.harness.lockstep import LockstepRobot, numbers
from manta_sim_ros.dynamics import FinCommand, Simulator
from manta_sim_ros.nodes.messages import ROD_NAMES, rod_command

SWIM = [0.7, 0.7, 0.6, 0.6, 0.7, 0.7]
PRESENT = np.array([[0.1, 0.2], [0.3, 0.4]])


@pytest.fixture(scope='module')
def rods(module_launch, probe):
    robot = LockstepRobot(module_launch, probe, 'rods', '-p start_paused:=true -p joint_state_rate:=100.0')
    robot.joints = probe.record(JointState, '/rods/joint_states')
    robot.rods = probe.node.create_publisher(JointState, '/rods/rod_command', 10)
    probe.until(lambda: robot.rods.get_subscription_count(), 'the subscription')
    return robot


@pytest.fixture
def robot(rods):
    for name, value in (('step_duration', 0.04), ('command_timeout', 0.0)):
        assert rods.set_parameter(name, value).successful
    assert rods.trigger('reset').success
    rods.step()
    return rods


def command(robot, **positions):
    """Command rods, and wait until that was taken: the node warns of a message without names behind it."""
    empty, before = 'rod_command refused', robot.node.output.count('names and')
    robot.rods.publish(JointState(name=list(positions), position=list(positions.values())))
    robot.probe.until(
        lambda: robot.node.output.count('names and') > before, empty,
        doing=lambda: robot.rods.publish(JointState()), every=0.3)


def compared(robot, simulator, duration=0.04):
    robot.step()
    state = simulator.advance(duration)
    assert numbers(robot.odometry[-1], robot.wrench[-1]) == [*state.twist.tolist(), *state.wrench.tolist()]
    robot.probe.until(lambda: robot.joints.stamps[-1:] == robot.odometry.stamps[-1:], 'the joints')
    assert robot.joints[-1].position.tolist() == state.rod_angles.ravel().tolist()
    assert robot.joints[-1].effort.tolist() == state.rod_torques.ravel().tolist()


def test_in_lockstep_the_rods_are_those_of_the_library_bit_for_bit(robot):
    simulator = Simulator()
    command(robot, left_front_rod=0.5, left_rear_rod=0.4, right_front_rod=0.5, right_rear_rod=0.4)
    simulator.command_rods(left=(0.5, 0.4), right=(0.5, 0.4))
    compared(robot, simulator)
    command(robot, right_rear_rod=-0.3)  # the others hold what they were commanded
    simulator.command_rods(left=(0.5, 0.4), right=(0.5, -0.3))
    compared(robot, simulator)
    robot.command(SWIM)
    simulator.command(left=FinCommand(*SWIM[::2]), right=FinCommand(*SWIM[1::2]))
    for _ in range(3):
        compared(robot, simulator)
    command(robot, left_front_rod=0.1)  # from the gait: the others hold where they are
    angles = simulator.state.rod_angles
    simulator.command_rods(left=(0.1, angles[0, 1]), right=angles[1])
    compared(robot, simulator)
    assert robot.trigger('reset').success
    simulator.reset()
    compared(robot, simulator)
    assert not np.any(robot.joints[-1].position)


def test_a_command_that_would_break_the_support_is_held_and_counted(robot):
    command(robot, left_front_rod=1.5, left_rear_rod=-1.5)
    line = 'rod_command held, as the support must close (1 held so far)'
    robot.probe.until(lambda: line in robot.node.output, line)
    assert robot.set_parameter('step_duration', 2.0).successful
    robot.step()
    robot.probe.until(lambda: robot.joints.stamps[-1:] == robot.odometry.stamps[-1:], 'the joints')
    front, rear, *_ = robot.joints[-1].position
    assert front == pytest.approx(-rear) and 1.5 < front - rear < 1.684


def test_without_commands_for_too_long_the_rods_hold(robot):
    assert robot.set_parameter('command_timeout', 0.5).successful
    assert robot.set_parameter('step_duration', 1.0).successful
    command(robot, left_front_rod=0.5, left_rear_rod=0.5)
    robot.step()
    robot.step()
    assert 'no rod_command for 0.5 s of simulated time: the rods hold' in robot.node.output
    robot.probe.until(lambda: robot.joints.stamps[-1:] == robot.odometry.stamps[-1:], 'the joints')
    assert robot.joints[-1].position[0] == pytest.approx(0.5, abs=1e-6)


@pytest.mark.parametrize(('names', 'positions', 'words'), [
    ([], [], 'there are 0 names and 0 positions'),
    (['left_front_rod'], [], 'there are 1 names and 0 positions'),
    (['left_front_rod', 'tail'], [0.1, 0.1], "name 1 is 'tail', but must be one of left_front_rod, left_rear_rod"),
    (['left_front_rod'] * 2, [0.1, 0.1], "name 1 is 'left_front_rod', but must be one of .*, each once"),
    (['left_rear_rod'], [math.nan], 'the position of left_rear_rod is nan, but must be finite'),
    (['x' * 10**6], [0.0], 'name 0 is .{,250}, but must be one of'),
])
def test_what_is_no_command_is_refused_by_name(names, positions, words):
    with pytest.raises(ValueError, match=words):
        rod_command(JointState(name=names, position=positions), PRESENT)


def test_rods_that_are_not_named_keep_their_angle():
    angles = rod_command(JointState(name=['right_rear_rod', 'left_front_rod'], position=[-0.4, 0.0]), PRESENT)
    assert angles.tolist() == [[0.0, 0.2], [0.3, -0.4]]
    assert rod_command(JointState(name=ROD_NAMES, position=[1.0, 2.0, 3.0, 4.0]), PRESENT).ravel().tolist() == [
        1.0, 2.0, 3.0, 4.0]


@pytest.mark.parametrize(('name', 'position', 'words'), [
    ('left_front_rod', 1.6, r'left front rod is commanded to 1\.6 rad'), ('tail', 0.0, "name 0 is 'tail'")])
def test_a_live_node_refuses_with_a_warning_and_the_rods_stay(robot, name, position, words):
    command(robot, left_front_rod=0.2, left_rear_rod=0.2)
    wrong = JointState(name=[name], position=[position])
    line = 'rod_command refused, the rods stay as they were commanded'
    robot.probe.until(lambda: re.search(f'{line}.*{words}', robot.node.output), line,
                      doing=lambda: robot.rods.publish(wrong), every=0.3)
    assert robot.set_parameter('step_duration', 2.0).successful
    robot.step()
    robot.probe.until(lambda: robot.joints.stamps[-1:] == robot.odometry.stamps[-1:], 'the joints')
    assert robot.joints[-1].position[:2].tolist() == pytest.approx([0.2, 0.2], abs=1e-6)


def test_a_gait_takes_over_again(robot):
    command(robot, left_front_rod=0.3, left_rear_rod=0.3)
    robot.step()
    robot.commands.publish(Float64MultiArray(data=SWIM))
    robot.command(SWIM)
    assert robot.set_parameter('step_duration', 5.0).successful
    robot.step()
    assert robot.odometry[-1].pose.pose.position.x > 0.1

"""The examples with ROS run as they are beside a real simulator."""

import math
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState

from evidence.harness.processes import LIMIT
from manta_sim_ros.dynamics import FinCommand, Simulator

EXAMPLES = Path(__file__).parents[2] / 'examples'
CONFIG = EXAMPLES.parent / 'config'
FREQUENCY, PHASE = 0.6, math.radians(40.0)
DESIRED = -0.8  # rad
HELD = 500  # outputs: 5 s of simulated time; the body oscillates with the fins


def test_lockstep_moves_the_robot_as_the_library_does(launch):
    node = launch('sim_node', '-p start_paused:=true -p step_duration:=0.5')
    node.wait_for_output('ready')
    ended = subprocess.run([sys.executable, EXAMPLES / 'lockstep.py'], capture_output=True, text=True, timeout=LIMIT)
    assert ended.returncode == 0, ended.stderr
    expected, simulator = [], Simulator()
    for amplitude in (5, 10, 15, 20, 25, 30, 35, 40):
        gait = FinCommand(amplitude=math.radians(amplitude), frequency=FREQUENCY, phase=PHASE)
        simulator.command(left=gait, right=gait)
        state = simulator.advance(0.5)
        expected.append(f'{state.time:.1f} s: x = {state.position[0]:.4f} m')
    assert ended.stdout.splitlines() == expected


def test_lockstep_without_a_simulator_says_so():
    ended = subprocess.run([sys.executable, EXAMPLES / 'lockstep.py'], capture_output=True, text=True, timeout=LIMIT)
    assert ended.returncode == 1
    assert ended.stderr.splitlines()[-1] == (
        'RuntimeError: no service manta_sim/reset within 10 s: is the simulator running?')


@pytest.mark.parametrize('configuration', ['manta', 'freshwater'])
def test_turn_with_feedback_turns_to_the_heading_and_holds_it(launch, probe, configuration):
    launch('sim_node', f'--params-file {CONFIG / configuration}.yaml -p real_time_factor:=4.0')
    odometry = probe.record(Odometry, 'odom')

    def is_held(message):
        q = message.pose.pose.orientation
        return abs(2.0 * math.atan2(q.z, q.w) - DESIRED) < 0.1

    controller = subprocess.Popen(
        [sys.executable, EXAMPLES / 'turn_with_feedback.py', '--ros-args', '-p', 'use_sim_time:=true',
         '-p', f'heading:={DESIRED}'], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=os.environ)
    try:
        probe.until(lambda: controller.poll() is not None or (
            len(odometry) > HELD and all(is_held(message) for message in odometry[-HELD:])), 'the heading, held')
    finally:
        controller.terminate()
        _, errors = controller.communicate(timeout=LIMIT)
    assert controller.returncode == 0, errors
    assert is_held(odometry[-1])
    assert re.search(r'heading -?0\.\d\d rad', errors)


def test_the_pattern_generator_swims_with_front_rods_that_lead(launch, probe):
    launch('sim_node', f'--params-file {CONFIG / "freshwater.yaml"}')
    odometry, joints = probe.record(Odometry, 'odom'), probe.record(JointState, 'joint_states')
    generator = subprocess.Popen(
        [sys.executable, EXAMPLES / 'pattern_generator.py', '--ros-args', '-p', 'use_sim_time:=true'],
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=os.environ)
    try:
        probe.until(lambda: generator.poll() is not None or (
            odometry and odometry[-1].pose.pose.position.x > 1.5), 'a way of 1.5 m')
    finally:
        generator.terminate()
        _, errors = generator.communicate(timeout=LIMIT)
    assert generator.returncode == 0, errors
    assert abs(odometry[-1].pose.pose.position.y) < 0.3
    front, rear = ([message.position[rod] for message in joints] for rod in (0, 1))
    assert 0.5 < max(rear) < 0.65
    crossing = next(i for i in reversed(range(1, len(rear))) if rear[i - 1] < 0.0 <= rear[i])
    assert front[crossing] > 0.2  # the front rod is up when the rear rod passes the middle on its way up


def test_the_depth_from_the_pressure_is_the_height_of_the_robot_with_its_variance(launch, probe):
    launch('sim_node', '-p initial_position:=[0.0,0.0,-3.0] -p pressure.noise:=98.1')
    heard = probe.record(PoseWithCovarianceStamped, 'depth')
    converter = subprocess.Popen(
        [sys.executable, EXAMPLES / 'depth_from_pressure.py', '--ros-args', '-p', 'use_sim_time:=true'],
        stderr=subprocess.PIPE, text=True, env=os.environ)
    try:
        probe.until(lambda: converter.poll() is not None or len(heard) > 50, 'depths')
    finally:
        converter.terminate()
        _, errors = converter.communicate(timeout=LIMIT)
    assert converter.returncode == 0, errors
    heights = [message.pose.pose.position.z for message in heard]
    assert abs(sum(heights) / len(heights) + 3.0) < 0.01  # five standard deviations of a mean of 50
    assert 0.0 < max(abs(height + 3.0) for height in heights) < 0.06
    assert list(heard[0].pose.covariance)[::7] == pytest.approx([1e6, 1e6, 1e-4, 1e6, 1e6, 1e6])
    assert heard[0].header.frame_id == 'odom' and heard.rising

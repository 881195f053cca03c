"""What `gait_node` commands, on a clock that the test keeps."""

import math
import signal

import pytest
from builtin_interfaces.msg import Time
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64MultiArray

from evidence.harness.processes import own_lines

FORTY, TWENTY = math.radians(40.0), math.radians(20.0)
STRAIGHT = [FORTY, FORTY, 0.6, 0.6, FORTY, FORTY, 0.0, 0.0, 0.0, 0.0]
TURN = [FORTY, TWENTY, *STRAIGHT[2:]]
FIRST_TICK = 20  # [ms], and each tick after it


class Robot:
    """Stands in for the simulator: keeps the clock and takes commands."""

    def __init__(self, probe):
        self._probe = probe
        self._clock = probe.node.create_publisher(Clock, '/clock', 10)
        self.commands = probe.record(Float64MultiArray, 'fin_command')
        self.time = 0  # [ms]

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        self.commands.__exit__()
        self._probe.node.destroy_publisher(self._clock)

    @property
    def latest(self):
        return list(self.commands[-1].data) if self.commands else None

    def tick(self):
        if not self._clock.get_subscription_count():
            return
        self.time += FIRST_TICK
        self._clock.publish(Clock(clock=Time(sec=self.time // 1000, nanosec=self.time % 1000 * 1_000_000)))

    def until(self, condition, what):
        self._probe.until(condition, what, doing=self.tick, every=0.02)


@pytest.fixture
def robot(probe):
    with Robot(probe) as robot:
        yield robot


def test_by_default_it_swims_straight_then_turns_right_then_begins_again(launch, robot):
    launch('gait_node', '-p use_sim_time:=true -p durations:=[1.0,1.0]')
    robot.until(lambda: robot.commands, 'a first command')
    assert robot.latest == STRAIGHT
    robot.until(lambda: robot.latest == TURN, 'the turn')
    assert {tuple(command.data) for command in robot.commands[:-1]} == {tuple(STRAIGHT)}
    assert robot.time >= FIRST_TICK + 1000  # its first gait began at the first tick or later
    robot.until(lambda: robot.latest == STRAIGHT, 'the beginning')
    assert robot.time >= FIRST_TICK + 2000


def test_without_repeat_the_last_gait_stays(launch, robot):
    launch('gait_node', '-p use_sim_time:=true -p durations:=[0.5,0.5] -p repeat:=false')
    robot.until(lambda: robot.latest == TURN, 'the turn')
    turned = len(robot.commands) - 1
    later = robot.time + 3000
    robot.until(lambda: robot.time > later and len(robot.commands) > turned + 10, 'three more seconds')
    assert all(list(command.data) == TURN for command in robot.commands[turned:])


def test_with_a_simulator_that_starts_again_it_begins_again(launch, robot):
    robot.time = 100_000
    launch('gait_node', '-p use_sim_time:=true -p durations:=[3.0,1000.0]')
    robot.until(lambda: robot.latest == TURN, 'the turn')
    robot.time = 0
    robot.until(lambda: robot.latest == STRAIGHT, 'the beginning')  # else only after the 1000 s of the turn


def test_lists_and_single_numbers_of_its_parameters_are_gaits_in_degrees_and_hertz(launch, robot):
    launch('gait_node', '-p use_sim_time:=true -p durations:=100 -p left_amplitude_degrees:=10.0 '
           '-p right_amplitude_degrees:=[20] -p left_frequency:=[0.3] -p right_frequency:=[0.4] '
           '-p left_phase_degrees:=[30.0] -p right_phase_degrees:=[-40.0] -p left_front_bias_degrees:=[1.0] '
           '-p right_front_bias_degrees:=[2.0] -p left_rear_bias_degrees:=[3.0] -p right_rear_bias_degrees:=[-4.0]')
    robot.until(lambda: robot.commands, 'a command')
    angles = [math.radians(angle) for angle in (10.0, 20.0, 30.0, -40.0, 1.0, 2.0, 3.0, -4.0)]
    assert robot.latest == [*angles[:2], 0.3, 0.4, *angles[2:]]


@pytest.mark.parametrize('ending', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_it(launch, robot, ending):
    node = launch('gait_node', '-p use_sim_time:=true')
    robot.until(lambda: robot.commands, 'a command')
    node.send(ending)
    assert node.exit_status() == 0
    assert own_lines(node.output) == []


@pytest.mark.parametrize(('arguments', 'words'), [
    ('-p durations:=[1.0,2.0,3.0]', ['right_amplitude_degrees', '2', '3', 'durations']),
    ('-p durations:=[-1.0,1.0]', ['durations', '-1.0', 'greater than 0']),
    ('-p durations:=[]', []),  # rclpy's own refusal: an empty list has no type
    ('-p durations:=[one,two]', ['durations', 'one']),
    ('-p publish_rate:=0.0', ['publish_rate', '0.0', 'from 0.1 to 200']),
    ('-p left_frequency:=[50.0]', ['left', 'frequency', '50', 'from 0 to 5 Hz']),
    ('-p left_phase_degrees:=[.nan]', ['left', 'phase', 'nan', 'from']),
    ('-p publish_rate:=often', ['publish_rate', 'often']),
])
def test_an_invalid_parameter_ends_it_with_one_line(launch, arguments, words):
    (line,) = launch('gait_node', arguments).refusal()
    for word in words:
        assert word in line

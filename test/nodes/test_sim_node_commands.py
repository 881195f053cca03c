"""From `fin_command` to motion, and the commands that are refused while the gait before goes on."""

import math
import random
import re
import time

import pytest
from geometry_msgs.msg import WrenchStamped
from nav_msgs.msg import Odometry
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout

from manta_sim_ros.dynamics import FinCommand, Parameters, Simulator

STRAIGHT = [0.7, 0.7, 0.6, 0.6, 0.7, 0.7]
TURNING = [0.5, 0.2, 0.8, 0.8, 0.6, -0.3]
BIASED = [0.4, 0.5, 0.6, 0.7, 0.3, -0.2, 0.05, -0.06, 0.07, 0.08]
SLOTS = ['left amplitude', 'right amplitude', 'left frequency', 'right frequency', 'left phase', 'right phase',
         'left front_bias', 'right front_bias', 'left rear_bias', 'right rear_bias']
NOT_FINITE = [math.nan, math.inf, -math.inf]
SEED = 7

REFUSED = {
    **{f'{length} values': ([0.1] * length, [f'{length} values', '6', '10']) for length in (0, 1, 5, 7, 9, 11)},
    **{f'{NOT_FINITE[slot % 3]} as {name}': (
        [*BIASED[:slot], NOT_FINITE[slot % 3], *BIASED[slot + 1:]], [f'{name} is {NOT_FINITE[slot % 3]}', 'from'],
    ) for slot, name in enumerate(SLOTS)},
    'nan in six values': ([*STRAIGHT[:5], math.nan], ['right phase is nan', 'from -6.28319 to 6.28319']),
    'negative amplitude': ([-0.1, *STRAIGHT[1:]], ['left amplitude is -0.1', 'from 0 to 1.5708 rad']),
    'too high frequency': ([0.7, 0.7, 0.6, 50.0, 0.7, 0.7], ['right frequency is 50.0', 'from 0 to 5 Hz']),
    'left that cannot close': ([1.5, 0.7, 0.6, 0.6, 3.0, 0.7], ['left amplitude 1.5', 'phase 3', 'below 1.68']),
    'right that cannot close': ([0.7, 1.5, 0.6, 0.6, 0.7, 3.0], ['right amplitude 1.5', 'phase 3', 'below 1.68']),
    'biases that cannot close': ([*STRAIGHT, 1.2, 0.0, -1.2, 0.0], ['left', 'biases 1.2, -1.2', 'below 1.68']),
}


NOT_FLAT = MultiArrayLayout(dim=[MultiArrayDimension(size=3, stride=6), MultiArrayDimension(size=2, stride=2)])


def heading(message):
    orientation = message.pose.pose.orientation
    return 2.0 * math.atan2(orientation.z, orientation.w)


class Twin:
    """The library, commanded as the robot was, beside the robot's odometry from the first motion on."""

    def __init__(self, odometry, command):
        self._odometry = odometry
        self._simulator = Simulator(Parameters())
        left, right = (
            FinCommand(*(command[slot] for slot in range(side, len(command), 2))) for side in range(2))
        self._simulator.command(left=left, right=right)
        self._compared = next(index for index, message in enumerate(odometry) if message.twist.twist.linear.x)
        first = odometry[self._compared].twist.twist.linear.x
        while self._simulator.advance(0.01).twist[0] != first:
            assert self._simulator.state.time < 1.0
        self._began = odometry.stamps[self._compared] - round(self._simulator.state.time * 1e9)

    def check(self):
        """Compare what has come since the last time; return how many messages that were."""
        new = list(zip(self._odometry, self._odometry.stamps))[self._compared:]
        for message, stamp in new:
            state = self._simulator.advance((stamp - self._began) * 1e-9 - self._simulator.state.time)
            twist = message.twist.twist
            assert [twist.linear.x, twist.linear.y, twist.linear.z] == list(state.twist[:3])
            assert [twist.angular.x, twist.angular.y, twist.angular.z] == list(state.twist[3:])
        self._compared += len(new)
        return len(new)


class Robot:
    """A robot in a namespace of its own, with recordings of odometry and wrench."""

    def __init__(self, launch, probe, name, ros_arguments=''):
        self._probe = probe
        self.node = launch('sim_node', f'{ros_arguments} -r __ns:=/{name} -r /clock:=/{name}/clock')
        self.odometry = probe.record(Odometry, f'/{name}/odom')
        self.wrench = probe.record(WrenchStamped, f'/{name}/fin_wrench')
        self._commands = probe.node.create_publisher(Float64MultiArray, f'/{name}/fin_command', 10)
        probe.until(lambda: self.odometry and self.wrench, f'odometry of {name}')

    def command(self, values, layout=None):
        self._commands.publish(Float64MultiArray(data=values, layout=layout or MultiArrayLayout()))

    def command_until(self, values, condition, what):
        """Command it again and again, which is as good as once, until something happens."""
        self._probe.until(condition, what, doing=lambda: self.command(values))

    def latest(self):
        return self.odometry[-1]


@pytest.fixture(scope='module')
def swimmer(module_launch, probe):
    """A robot that swims straight, with its twin."""
    robot = Robot(module_launch, probe, 'swimmer')
    robot.command_until(STRAIGHT, lambda: robot.latest().twist.twist.linear.x, 'motion')
    robot.twin = Twin(robot.odometry, STRAIGHT)
    return robot


def test_values_in_another_order_are_refused(swimmer, probe):
    probe.until(lambda: 'layout.dim has 2 dimensions' in swimmer.node.output, 'a warning',
                doing=lambda: swimmer.command(TURNING, NOT_FLAT))
    assert swimmer.twin.check()


@pytest.mark.parametrize(('values', 'words'), REFUSED.values(), ids=REFUSED)
def test_a_refused_command_is_warned_of_and_the_gait_before_goes_on(swimmer, probe, values, words):
    before = len(swimmer.node.output)

    def warned():
        lines = swimmer.node.output[before:].splitlines()
        return any('fin_command refused' in line and all(word in line for word in words) for line in lines)

    swimmer.command_until(values, warned, f'a warning that names {words}')
    now = time.time_ns()
    heard = (swimmer.wrench, swimmer.odometry)
    probe.until(lambda: all(len(each) - each.first_sent_after(now) >= 10 for each in heard), 'ten more ticks')
    forces = [message.wrench.force.x for message in swimmer.wrench[-10:]]
    assert all(forces) and len(set(forces)) == len(forces)
    assert swimmer.twin.check() >= 10
    assert swimmer.wrench.finite and swimmer.odometry.finite


def test_refusals_are_counted(swimmer, probe):
    def counts():
        return [int(count) for count in re.findall(r'\((\d+) refused so far\)', swimmer.node.output)]

    heard = len(counts())
    swimmer.command_until([], lambda: len(counts()) >= heard + 2, 'two more warnings')
    assert counts()[0] >= 1 and all(before < after for before, after in zip(counts(), counts()[1:]))


def test_six_values_swim_forward_and_the_stronger_fin_turns_away(launch, probe):
    robot = Robot(launch, probe, 'turner', '-p real_time_factor:=5.0 -p publish_rate:=20.0')
    robot.command_until(STRAIGHT, lambda: robot.latest().pose.pose.position.x > 0.5, 'half a meter forward')
    assert abs(heading(robot.latest())) < 1e-9
    robot.command_until([0.7, 0.35, *STRAIGHT[2:]], lambda: abs(heading(robot.latest())) > 0.3, 'a turn')
    rightmost = heading(robot.latest())
    assert rightmost < 0.0
    # it may turn on until it hears of the other gait
    robot.command_until([0.35, 0.7, *STRAIGHT[2:]], lambda: heading(robot.latest()) > rightmost + 0.3, 'a turn back')
    assert heading(robot.latest()) < rightmost + 1.0  # and not all the way around


def test_ten_values_move_it_as_they_move_the_library(launch, probe):
    robot = Robot(launch, probe, 'biased')
    robot.command_until(BIASED, lambda: robot.latest().twist.twist.linear.x, 'motion')
    moving = len(robot.odometry) + 50
    probe.until(lambda: len(robot.odometry) > moving, 'some motion')
    assert Twin(robot.odometry, BIASED).check() >= 50


def test_a_flood_of_garbage_neither_stops_it_nor_reaches_a_topic(launch, probe):
    robot = Robot(launch, probe, 'flooded', '-p real_time_factor:=5.0 -p publish_rate:=20.0')
    generator = random.Random(SEED)

    def garbage():
        kind = generator.choice(['gait', 'noise', 'special'])
        length = generator.choice([6, 10, generator.randrange(40)])
        if kind == 'gait':
            return [generator.uniform(0.0, 1.4) for _ in range(length)]
        if kind == 'noise':
            return [generator.uniform(-1.0, 1.0) * 10.0 ** generator.randint(-320, 308) for _ in range(length)]
        return [generator.choice([*NOT_FINITE, -0.0, 5e-324, 1.7e308, 0.5]) for _ in range(length)]

    sent = 0

    def flood():
        nonlocal sent
        robot.command(garbage())
        sent += 1

    before = len(robot.odometry)
    probe.until(lambda: sent >= 400 and len(robot.odometry) >= before + 100 and
                'fin_command refused' in robot.node.output, 'a flood', doing=flood, every=0.0)

    def thrust():
        return max(abs(message.wrench.force.x) for message in robot.wrench[-20:])

    robot.command_until([0.0] * 6, lambda: thrust() < 0.1, 'calm')
    robot.command_until(STRAIGHT, lambda: thrust() > 1.0, 'thrust of a good command')
    assert robot.odometry.finite and robot.wrench.finite
    assert robot.odometry.rising

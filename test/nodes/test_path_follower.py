"""The node `path_follower` with a real simulator in lockstep, and what it refuses."""

import math
import signal
import time

import pytest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry, Path
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

STEP = 0.1  # of the simulator, and between two commands [s]
LATEST = 1.0  # elapsed time after which the next odometry comes without a command, for who came late [s]
MOST_STEPS = 300


def path_of(*waypoints, frame='odom'):
    path = Path()
    path.header.frame_id = frame
    for waypoint in waypoints:
        pose = PoseStamped()
        pose.pose.position.x, pose.pose.position.y, pose.pose.position.z = waypoint
        path.poses.append(pose)
    return path


def test_it_follows_a_path_and_glides_to_rest_at_its_end(launch, probe):
    launch('sim_node', f'--params-file config/freshwater.yaml -p start_paused:=true -p step_duration:={STEP} '
                       '-p publish_rate:=50.0')
    follower = launch('path_follower', '-p use_sim_time:=true')
    paths = probe.node.create_publisher(Path, 'path', 1)
    followed = []
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    probe.node.create_subscription(Path, 'followed_path', lambda path: followed.append(len(path.poses)), latched)
    with probe.record(Odometry, 'odom') as odometry, probe.record(Float64MultiArray, 'fin_command') as commands:
        step = probe.node.create_client(Trigger, '/manta_sim/step')
        probe.until(lambda: paths.get_subscription_count() and step.service_is_ready(), 'both nodes')
        probe.until(lambda: 'following a path of 2.00 m' in follower.output, 'the path',
                    doing=lambda: paths.publish(path_of((0.0, 0.0, 0.0), (2.0, 0.0, 0.05))), every=1.0)
        for _ in range(MOST_STEPS):
            due = len(commands) + 1
            probe.until(lambda due=due: len(commands) >= due, 'a command',  # a step or its odometry may be lost
                        doing=lambda: step.call_async(Trigger.Request()), every=5.0)
            if 'the end of the path is reached' in follower.output:
                break
        end = odometry[-1].pose.pose.position
        assert commands[-1].data[:2].tolist() == [0.0, 0.0]
    probe.until(lambda: followed[-1:] == [0], 'an empty path')  # none is followed any more
    assert set(followed) == {2, 0}
    assert end.x > 1.9 and abs(end.y) < 0.05 and abs(end.z - 0.05) < 0.1
    follower.send(signal.SIGINT)
    assert follower.exit_status() == 0


class Robot:
    """Stands in for the simulator: keeps the clock, and publishes odometry at rest."""

    def __init__(self, probe):
        self._clock = probe.node.create_publisher(Clock, '/clock', 10)
        self._odom = probe.node.create_publisher(Odometry, 'odom', 10)
        self.paths = probe.node.create_publisher(Path, 'path', 1)
        self._node = probe.node
        self._time = 0  # [ms]
        self._due = 0.0  # steady time [s]
        self._answered = 0
        self.silent = False
        self.frame, self.height = 'odom', 0.0

    def close(self):
        for publisher in (self._clock, self._odom, self.paths):
            self._node.destroy_publisher(publisher)

    def tick(self):
        self._time += round(1000 * STEP)
        message = Odometry()
        message.header.frame_id = self.frame
        message.header.stamp.sec, message.header.stamp.nanosec = self._time // 1000, self._time % 1000 * 1_000_000
        message.pose.pose.position.z, message.pose.pose.orientation.w = self.height, 1.0
        if not self.silent:
            self._odom.publish(message)
        self._clock.publish(Clock(clock=message.header.stamp))

    def tick_when_answered(self, commands):
        """Tick if there is another command than at the last tick: odometry is never late, however slow the node is."""
        if len(commands) > self._answered or time.monotonic() > self._due:
            self._answered, self._due = len(commands), time.monotonic() + LATEST
            self.tick()


@pytest.fixture
def robot(probe):
    robot = Robot(probe)
    yield robot
    robot.close()


def test_without_odometry_it_glides_to_rest_says_so_once_and_goes_on_afterwards(launch, probe, robot, tmp_path):
    mission = tmp_path / 'mission.yaml'
    mission.write_text('waypoints: [[0, 0, 0], [5, 0, 0]]')
    node = launch('path_follower', f'-p use_sim_time:=true -p mission:={mission} -p odom_timeout:=2.0')
    with probe.record(Float64MultiArray, 'fin_command') as commands:
        def until(condition, what):
            probe.until(condition, what, doing=lambda: robot.tick_when_answered(commands), every=0.0)

        until(lambda: commands and commands[-1].data[0] > 0.1, 'a stroke')
        robot.silent = True
        probe.until(lambda: commands[-1].data[0] == 0.0, 'rest', doing=robot.tick, every=0.02)
        rest = len(commands)
        probe.until(lambda: len(commands) > rest + 10, 'ten more commands', doing=robot.tick, every=0.02)
        assert {command.data[0] for command in commands[rest:]} == {0.0}
        assert node.output.count('no odom for more than 2 s: the robot glides to rest') == 1
        robot.silent = False
        until(lambda: commands[-1].data[0] > 0.1, 'a stroke again')
        assert node.output.count('odom is back') == 1
        assert len(commands[-1].data) == 10


BAD_PATHS = [
    (path_of(), 'the path has 0 waypoints'),
    (path_of((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), frame='map'), "frame_id is 'map', but must be 'odom'"),
    (path_of((0.0, 0.0, 0.0), (math.inf, 0.0, 0.0)), 'waypoint 1 is [inf, 0.0, 0.0], but must be'),
]


def test_bad_paths_and_odometry_are_refused_in_one_line(launch, probe, robot):
    node = launch('path_follower', '-p use_sim_time:=true')
    probe.until(robot.paths.get_subscription_count, 'the node')
    for bad, words in BAD_PATHS:
        probe.until(lambda words=words: words in node.output, words,
                    doing=lambda bad=bad: robot.paths.publish(bad), every=1.1)
    robot.frame = 'map'
    probe.until(lambda: 'odom refused, it is not used' in node.output, 'a refusal', doing=robot.tick)
    robot.frame, robot.height = 'odom', math.nan
    probe.until(lambda: 'nan' in node.output and 'must be finite' in node.output, 'another', doing=robot.tick)
    assert 'Traceback' not in node.output


@pytest.mark.parametrize(('arguments', 'words'), [
    ('-p speed:=9.0', ['speed is 9.0', 'from 0.02 to 2 m/s']),
    ('-p depth_gains:=[1.0]', ['depth_gains', 'list of 5 numbers']),
    ('-p steering_gains:=[0.0,0.0,0.0,0.0,0.0,0.0]', ['steering_gains', 'must be above 0']),
    ('-p largest_bias:=0.5 -p largest_steering:=1.0', ['at the limits', 'closes only below']),
    ('-p speed_model:=[0.5,0.0]', ['speed_model[1] is 0 s', 'above 0']),
    ('-p odom_timeout:=0.0', ['odom_timeout is 0.0 s', 'from 0.05 to 60 s']),
    ('-p mission:=/none.yaml', ['/none.yaml', 'No such file']),
    ('-p mission:=config/manta.yaml', ['config/manta.yaml', 'waypoints']),
    ('-p robot:=/none.yaml', ['/none.yaml', 'No such file']),
])
def test_an_invalid_parameter_ends_it_with_one_line(launch, arguments, words):
    (line,) = launch('path_follower', arguments).refusal()
    for word in words:
        assert word in line

"""The node `track_node` with a robot that stands in for the simulator: end of the path, loss of the track, refusals."""

import itertools
import signal

import pytest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry, Path
from rclpy.qos import DurabilityPolicy, QoSProfile

PNG = b'\x89PNG'


class Robot:
    """Publishes the path that it follows, and odometry."""

    def __init__(self, probe):
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._paths = probe.node.create_publisher(Path, 'followed_path', latched)
        self._odom = probe.node.create_publisher(Odometry, 'odom', 10)
        self._node = probe.node
        self._time = 0  # [s]

    def close(self):
        for publisher in (self._paths, self._odom):
            self._node.destroy_publisher(publisher)

    def follow(self, *waypoints):
        path = Path()
        for x, y, z in waypoints:
            pose = PoseStamped()
            pose.pose.position.x, pose.pose.position.y, pose.pose.position.z = x, y, z
            path.poses.append(pose)
        self._paths.publish(path)

    def move(self, x, y, z=0.0, elapsed=1):
        self._time += elapsed
        message = Odometry()
        message.header.stamp.sec = self._time
        message.pose.pose.position.x, message.pose.pose.position.y, message.pose.pose.position.z = x, y, z
        self._odom.publish(message)


@pytest.fixture
def robot(probe):
    robot = Robot(probe)
    robot.follow((0.0, 0.0, 0.0), (4.0, 0.0, 0.0))
    yield robot
    robot.close()


def ended(node, probe, doing):
    """Do something again and again until the node has ended, and return its exit status."""
    node.may_end = True
    probe.until(lambda: node.process.poll() is not None, 'the end', doing=doing, every=0.05)
    return node.exit_status()


def test_at_the_end_of_the_path_it_prints_the_errors_and_draws_the_figure(launch, probe, robot, tmp_path):
    picture = tmp_path / 'swim.png'
    node = launch('track_node', f'-p output:={picture}')
    probe.until(lambda: 'recording along a path of 4.00 m' in node.output, 'the path')
    moves = iter([*[(2.0, -0.5, 0.125)] * 40, *[(4.0, 0.0)] * 5000])  # the first ones may be lost

    def doing():
        robot.move(*next(moves))
        if robot._time > 50:
            robot.follow()  # an empty path: none is followed any more

    assert ended(node, probe, doing) == 0
    assert '4.0 m of 4.0 m of the path in ' in node.output
    assert '0.50 m at most; height error: ' in node.output and node.output.count('0.12 m at most') == 1
    assert f'the path and the track are drawn in {picture}' in node.output
    assert picture.read_bytes().startswith(PNG)


def test_ctrl_c_ends_it_without_a_report(launch, probe, robot, tmp_path):
    picture = tmp_path / 'swim.png'
    node = launch('track_node', f'-p output:={picture}')
    probe.until(lambda: 'recording along a path of 4.00 m' in node.output, 'the path')
    moved = itertools.count()
    probe.until(lambda: next(moved) > 20, 'some motion', doing=lambda: robot.move(2.0, 0.5), every=0.0)
    node.send(signal.SIGINT)
    assert node.exit_status() == 0
    assert 'of the path in' not in node.output and not picture.exists()


@pytest.mark.parametrize(('arguments', 'x', 'y', 'elapsed', 'why'), [
    ('-p lost_distance:=2.0', 1.0, -2.1, 1, 'the robot is more than 2 m beside the path'),
    ('', 1.0, 0.5, 25, 'there is no progress along the path for 60 s')])
def test_when_the_track_is_lost_it_says_why_and_ends_with_status_1(
        launch, probe, robot, arguments, x, y, elapsed, why):
    node = launch('track_node', arguments)
    assert ended(node, probe, lambda: robot.move(x, y, elapsed=elapsed)) == 1
    assert '1.0 m of 4.0 m of the path' in node.output
    assert node.output.splitlines()[-1] == f'track_node: the track is lost: {why}'
    assert 'Traceback' not in node.output


@pytest.mark.parametrize(('arguments', 'words'), [
    ('-p lost_distance:=0.0', ['lost_distance is 0.0 m', 'at least 0.1 m']),
    ('-p output:=/none/swim.png', ["output is '/none/swim.png'", '.png file in a directory that exists']),
    ('-p output:=swim.jpg', ["output is 'swim.jpg'", '.png file']),
])
def test_an_invalid_parameter_ends_it_with_one_line(launch, arguments, words):
    (line,) = launch('track_node', arguments).refusal()
    for word in words:
        assert word in line

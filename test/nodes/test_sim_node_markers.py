"""The markers on the topic: of the state that its stamp says, at their rate; the path begins again after a reset."""

import numpy as np
import pytest
from geometry_msgs.msg import Vector3, Vector3Stamped
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray

from evidence.harness.lockstep import LockstepRobot
from manta_sim_ros.dynamics import FinCommand, Parameters, Simulator, fin_surfaces

SWIM = [0.7, 0.7, 0.6, 0.6, 0.7, 0.7]
PARAMETERS = Parameters()


@pytest.fixture(scope='module')
def robot(module_launch, probe):
    robot = LockstepRobot(module_launch, probe, 'marked', '-p start_paused:=true -p step_duration:=0.5')
    robot.markers = probe.record(MarkerArray, '/marked/fin_markers')
    robot.step()
    probe.until(lambda: robot.markers, 'markers')
    robot.wait_for_repeats()
    return robot


def stamp_of(message):
    (stamp,) = {(marker.header.stamp.sec, marker.header.stamp.nanosec) for marker in message.markers}
    return stamp[0] * 1_000_000_000 + stamp[1]


def by_name(message):
    return {(marker.ns, marker.id): marker for marker in message.markers}


def points(marker):
    return np.array([(point.x, point.y, point.z) for point in marker.points])


def test_markers_have_their_rate_and_are_of_the_state_of_their_stamp(robot):
    assert robot.trigger('reset').success
    robot.command(SWIM)
    began, heard = robot.now(), len(robot.markers)
    end = robot.step()
    robot.probe.until(lambda: stamp_of(robot.markers[-1]) == end // 100_000_000 * 100_000_000, 'markers')
    shown = robot.markers[heard:]
    first = (began // 100_000_000 + 1) * 100_000_000
    assert [stamp_of(message) for message in shown][-5:] == list(range(first, end + 1, 100_000_000))
    twin = Simulator(PARAMETERS)
    twin.command(left=FinCommand(*SWIM[::2]), right=FinCommand(*SWIM[1::2]))
    for message in shown[-5:]:
        state = twin.advance(round((stamp_of(message) - began) * 1e-9 - twin.state.time, 9))
        nodes = fin_surfaces(PARAMETERS, state.rod_angles, state.joint_angles)
        for side, name in enumerate(('left_fin', 'right_fin')):
            corners = {tuple(point) for point in points(by_name(message)[name, 0])}
            assert corners == {tuple(node) for node in nodes[side].reshape(-1, 3)}
        assert {marker.header.frame_id for marker in message.markers} == {'base_link', 'odom'}


def test_the_load_is_that_of_the_current_on_the_topic(robot):
    assert robot.trigger('reset').success
    currents = robot.probe.node.create_publisher(Vector3Stamped, '/marked/current', 10)
    robot.probe.until(currents.get_subscription_count, 'the topic')
    message = Vector3Stamped(header=Header(frame_id='odom'), vector=Vector3(z=0.5))
    assert robot.set_parameter('step_duration', 0.1).successful

    def pushed_up():
        """Whether the fins are red: the water presses from below."""
        colors = by_name(robot.markers[-1])['left_fin', 0].colors
        return all(color.r > color.b + 0.3 for color in colors)

    def look():
        currents.publish(message)
        robot.step()
    assert not pushed_up()
    robot.probe.until(pushed_up, 'red fins', doing=look)
    assert robot.set_parameter('step_duration', 0.5).successful


def test_the_path_grows_as_it_swims_and_begins_again_after_a_reset(robot):
    assert robot.trigger('reset').success
    robot.command(SWIM)
    assert robot.set_parameter('step_duration', 3.0).successful
    heard, end = len(robot.markers), robot.step()
    robot.probe.until(lambda: stamp_of(robot.markers[-1]) > end - 100_000_000, 'markers')
    path = points(by_name(robot.markers[-1])['path', 0])
    np.testing.assert_array_equal(path[0], 0.0)
    assert path[-1, 0] > 0.3 and len(path) >= 4
    lengths = [len(marker.points) for message in robot.markers[heard:]
               for (name, _), marker in by_name(message).items() if name == 'path' and marker.action == Marker.ADD]
    assert lengths[-1] == max(lengths)
    heard = len(robot.markers)
    assert robot.trigger('reset').success
    robot.probe.until(lambda: len(robot.markers) > heard, 'markers of the reset')  # at once, whatever their rate
    assert by_name(robot.markers[-1])['path', 0].action == Marker.DELETE

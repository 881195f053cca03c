"""The transform from odom to base_link on /tf, where tf2_msgs is installed, and what is said where it is not."""

import importlib.util
import os

import pytest
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock

INSTALLED = importlib.util.find_spec('tf2_msgs') is not None
MISSING = 'no transform is published, as tf2_msgs is not installed'
STAND_IN = '''
from geometry_msgs.msg import TransformStamped


class TFMessage(TransformStamped):
    """On the wire one transform where tf2_msgs has a list of them."""

    def __init__(self, transforms):
        (only,) = transforms
        super().__init__(header=only.header, child_frame_id=only.child_frame_id, transform=only.transform)

    @property
    def transforms(self):
        return [self]


TFMessage.__name__, TFMessage.__module__ = TransformStamped.__name__, TransformStamped.__module__
'''


@pytest.fixture(params=['installed', 'stand-in'])
def tf2_msgs(request, tmp_path):
    """Environment of a node that finds tf2_msgs, its message type, and how to read a transform from it."""
    if request.param == 'installed':
        if not INSTALLED:
            pytest.skip('tf2_msgs is not installed')
        from tf2_msgs.msg import TFMessage
        return {}, TFMessage, lambda message: message.transforms[0]
    package = tmp_path / 'tf2_msgs'
    package.mkdir()
    (package / '__init__.py').touch()
    (package / 'msg.py').write_text(STAND_IN, encoding='utf-8')
    paths = [str(tmp_path), *filter(None, [os.environ.get('PYTHONPATH')])]
    return {'PYTHONPATH': os.pathsep.join(paths)}, TransformStamped, lambda message: message


def stamp_of(message):
    return message.header.stamp.sec, message.header.stamp.nanosec


def test_the_transform_is_the_pose_with_its_stamp_and_frames(launch, probe, tf2_msgs):
    environment, message_type, transform_of = tf2_msgs
    with probe.record(message_type, '/shown/tf') as heard, probe.record(Odometry, '/shown/odom') as odometry:
        node = launch(
            'sim_node', '-p odom_frame:=map -p base_frame:=manta -r __ns:=/shown -r /clock:=/shown/clock '
            '-r /tf:=/shown/tf -p water.current:=[0.5,0.3,0.1]', environment=environment)

        def of_both():
            return {stamp_of(transform_of(message)) for message in heard} & set(map(stamp_of, odometry))

        probe.until(lambda: len(of_both()) > 50, 'transforms')
    assert MISSING not in node.output
    transforms = [transform_of(message) for message in heard]
    stamps = list(map(stamp_of, transforms))
    poses = {stamp_of(pose): pose.pose.pose for pose in odometry}
    for transform, stamp in zip(transforms, stamps):
        assert (transform.header.frame_id, transform.child_frame_id) == ('map', 'manta')
        pose = poses.get(stamp)
        if pose is not None:
            at = transform.transform.translation
            assert (at.x, at.y, at.z) == (pose.position.x, pose.position.y, pose.position.z)
            assert transform.transform.rotation == pose.orientation
    assert any(pose.position.x for pose in poses.values())
    assert len(set(stamps)) == len(stamps)


def test_the_transform_to_the_imu_is_there_for_who_comes_later_without_publish_tf_too(launch, probe, tf2_msgs):
    environment, message_type, transform_of = tf2_msgs
    launch(
        'sim_node', '-p publish_tf:=false -p imu.frame:=imu_link -p imu.position:=[0.1,0.2,0.3] -r __ns:=/mounted '
        '-r /clock:=/mounted/clock -r /tf_static:=/mounted/tf_static', environment=environment)
    with probe.record(Clock, '/mounted/clock') as clock:
        probe.until(lambda: len(clock) > 20, 'the clock')
    heard, lasting = [], QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    subscription = probe.node.create_subscription(message_type, '/mounted/tf_static', heard.append, lasting)
    probe.until(lambda: heard, 'the transform')
    probe.node.destroy_subscription(subscription)
    transform = transform_of(heard[0])
    assert (transform.header.frame_id, transform.child_frame_id) == ('base_link', 'imu_link')
    at, turned = transform.transform.translation, transform.transform.rotation
    assert (at.x, at.y, at.z, turned.x, turned.w) == (0.1, 0.2, 0.3, 0.0, 1.0)
    _, published = probe.topics_of('manta_sim', '/mounted')
    assert '/mounted/tf_static' in published and '/tf' not in published


def test_with_publish_tf_false_there_is_none_and_nothing_is_said(launch, probe, tf2_msgs):
    environment, _, _ = tf2_msgs
    node = launch(
        'sim_node', '-p publish_tf:=false -r __ns:=/quiet -r /clock:=/quiet/clock', environment=environment)
    with probe.record(Clock, '/quiet/clock') as clock:
        probe.until(lambda: clock, 'the clock')
    _, published = probe.topics_of('manta_sim', '/quiet')
    assert '/quiet/odom' in published and '/tf' not in published
    assert MISSING not in node.output


@pytest.mark.skipif(INSTALLED, reason='tf2_msgs is installed')
def test_without_tf2_msgs_a_static_transform_is_missed_too(launch):
    node = launch('sim_node', '-p publish_tf:=false -p publish_ned:=true -r __ns:=/static -r /clock:=/static/clock')
    node.wait_for_output(f'{MISSING}: install it\n')


@pytest.mark.skipif(INSTALLED, reason='tf2_msgs is installed')
def test_without_tf2_msgs_one_line_says_so_and_all_else_goes_on(launch, probe):
    with probe.record(Odometry, '/without/odom') as odometry:
        node = launch('sim_node', '-r __ns:=/without -r /clock:=/without/clock')
        probe.until(lambda: len(odometry) > 100, 'odometry')
    assert node.output.count(MISSING) == 1

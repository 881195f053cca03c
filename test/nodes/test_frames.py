"""The frames of marine robots and of the IMU: each transform closes the loop with the poses."""

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from scipy.spatial.transform import Rotation

from manta_sim_ros.dynamics import Parameters, State
from manta_sim_ros.nodes.frames import in_ned, ned_templates, static_transforms
from manta_sim_ros.nodes.settings import Settings
from manta_sim_ros.sensors import OdometryNoise, OdometryReading, read_odometry

RANDOM = np.random.default_rng(4)


def matrix(position, orientation):
    """Return a pose as a homogeneous matrix."""
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = Rotation.from_quat(orientation).as_matrix(), position
    return made


def transforms(**values):
    """Return the static transforms as matrices by the names of parent and child."""
    settings = Settings().replace((name.replace('__', '.'), value) for name, value in values.items())
    found = {}
    for each in static_transforms(settings):
        at, turned = each.transform.translation, each.transform.rotation
        found[each.header.frame_id, each.child_frame_id] = matrix(
            [at.x, at.y, at.z], [turned.x, turned.y, turned.z, turned.w])
    return found


def test_by_default_there_is_no_other_frame():
    assert transforms() == {}


@pytest.mark.parametrize(('orientation', 'yaw'), [((0.0, 0.0, 0.0, 1.0), 90.0), ((0.0, 0.0, 0.5**0.5, 0.5**0.5), 0.0)])
def test_x_is_east_and_a_robot_that_looks_there_has_a_heading_of_90_degrees(orientation, yaw):
    reading = in_ned(OdometryReading(
        np.array([1.0, 2.0, 3.0]), np.array(orientation), np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])))
    np.testing.assert_allclose(reading.position, [2.0, 1.0, -3.0], atol=1e-14)
    np.testing.assert_allclose(Rotation.from_quat(reading.orientation).as_euler('ZYX', True), [yaw, 0, 0], atol=1e-12)
    np.testing.assert_allclose(reading.twist, [1.0, -2.0, -3.0, 4.0, -5.0, -6.0], atol=1e-14)


def test_a_pose_in_ned_is_the_pose_through_the_static_transforms():
    static = transforms(publish_ned=True, odom_frame='world', base_frame='manta')
    assert set(static) == {('world', 'world_ned'), ('manta', 'manta_frd')}
    for _ in range(20):
        position, orientation = RANDOM.normal(size=3), Rotation.from_quat(RANDOM.normal(size=4)).as_quat()
        reading = in_ned(OdometryReading(position, orientation, np.zeros(6)))
        np.testing.assert_allclose(
            static['world', 'world_ned'] @ matrix(reading.position, reading.orientation),
            matrix(position, orientation) @ static['manta', 'manta_frd'], atol=1e-14)


def test_the_transform_to_the_imu_is_its_position_and_its_orientation_as_in_urdf():
    static = transforms(imu__frame='imu_link', imu__position=[0.1, -0.2, 0.3], imu__orientation=[0.4, 0.5, -2.0])
    expected = np.eye(4)
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(angle), np.sin(angle)) for angle in (0.4, 0.5, -2.0))
    expected[:3, :3] = (  # yaw after pitch after roll, about the axes of the body
        np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]) @ [[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]]
        @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]]))
    expected[:3, 3] = [0.1, -0.2, 0.3]
    np.testing.assert_allclose(static['base_link', 'imu_link'], expected, atol=1e-14)


def test_the_odometry_in_ned_is_the_noisy_one_and_the_pose_is_exact():
    state, noise = State.at_rest(Parameters()), OdometryNoise(position=1.0, linear_velocity=2.0)
    made = ned_templates(noise, 'odom_ned', 'base_link_frd')
    odometry, pose = (made[topic].message(Time(), state) for topic in ('odom_ned', 'pose_ned'))
    assert (odometry.header.frame_id, odometry.child_frame_id) == ('odom_ned', 'base_link_frd')
    read = read_odometry(noise, state)
    at = odometry.pose.pose.position
    np.testing.assert_allclose([at.y, at.x, -at.z], read.position, atol=1e-14)
    np.testing.assert_allclose(odometry.twist.twist.linear.y, -read.twist[1], atol=1e-14)
    assert odometry.pose.covariance[0] == 1.0 and odometry.twist.covariance[0] == 4.0
    assert pose.header.frame_id == 'odom_ned' and abs(pose.pose.position.x) < 1e-14 < abs(at.x)

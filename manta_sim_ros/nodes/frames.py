"""The frames beside those of world and body: that of the IMU, and those of marine robots, with down as their z axis.

REP 103 has x east or forward, y north or left, and z up; for north, east and down it asks for frames of their own with
the suffix `_ned`. The body frame forward, right and down has the suffix `_frd`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import PoseStamped, Quaternion, TransformStamped, Vector3
from scipy.spatial.transform import Rotation
from std_msgs.msg import Header

from manta_sim_ros.dynamics import State
from manta_sim_ros.nodes.messages import odometry_template
from manta_sim_ros.nodes.serialization import Template
from manta_sim_ros.nodes.settings import Settings
from manta_sim_ros.sensors import OdometryNoise, OdometryReading, read_odometry

ENU_TO_NED = Rotation.from_matrix([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""From components east, north and up to north, east and down; its own inverse."""
FLU_TO_FRD = Rotation.from_matrix(np.diag([1.0, -1.0, -1.0]))
"""From components forward, left and up to forward, right and down; its own inverse."""

ORIGIN = (0.0, 0.0, 0.0)


def ned_templates(noise: OdometryNoise, odom_frame_ned: str, base_frame_frd: str) -> dict[str, Template]:
    """Return the templates of `pose_ned`, the ground truth, and of `odom_ned` by topic."""
    def pose(state: State) -> OdometryReading:
        return in_ned(read_odometry(OdometryNoise(), state))

    return {
        'pose_ned': Template(
            PoseStamped(header=Header(frame_id=odom_frame_ned)), ('header.stamp',),
            ('pose.position', 'pose.orientation'), lambda state: pose(state)[:2]),
        'odom_ned': odometry_template(noise, odom_frame_ned, base_frame_frd, in_ned),
    }


def in_ned(reading: OdometryReading) -> OdometryReading:
    """Return a reading of the odometry with the pose of the body frame forward-right-down in north-east-down."""
    x, y, z = reading.position
    orientation = ENU_TO_NED * Rotation.from_quat(reading.orientation) * FLU_TO_FRD
    return OdometryReading(np.array((y, x, -z)), orientation.as_quat(), reading.twist * (1, -1, -1, 1, -1, -1))


def static_transforms(settings: Settings) -> list[TransformStamped]:
    """Return the transforms that never change, without stamps: to the frame of the IMU, and with `publish_ned`."""
    own, imu, transforms = settings.node, settings.imu, []
    if settings.imu_frame != own.base_frame:
        transforms.append(_transform(own.base_frame, settings.imu_frame, imu.position, imu.rotation))
    if own.publish_ned:
        transforms.append(_transform(own.odom_frame, own.odom_frame_ned, ORIGIN, ENU_TO_NED))
        transforms.append(_transform(own.base_frame, own.base_frame_frd, ORIGIN, FLU_TO_FRD))
    return transforms


def _transform(parent: str, child: str, position: Sequence[float], rotation: Rotation) -> TransformStamped:
    transform = TransformStamped(header=Header(frame_id=parent), child_frame_id=child)
    transform.transform.translation = Vector3(**dict(zip('xyz', position, strict=True)))
    transform.transform.rotation = Quaternion(**dict(zip('xyzw', rotation.as_quat().tolist(), strict=True)))
    return transform

"""The topics and services of the simulator node: names, types and meaning, once for the code and for the docs."""

from __future__ import annotations

from typing import NamedTuple


class Topic(NamedTuple):
    """What is known about one topic."""

    type: str
    """Its message type, as `ros2 topic info` prints it."""
    direction: str
    """`in` where the simulator subscribes, `out` where it publishes."""
    meaning: str


class Service(NamedTuple):
    """What is known about one service."""

    type: str
    meaning: str


TOPICS = {
    'fin_command': Topic(
        'std_msgs/msg/Float64MultiArray', 'in',
        '`[A_l, A_r, f_l, f_r, phi_l, phi_r]` in rad, Hz, rad; or ten: then `front_bias_l, front_bias_r, rear_bias_l, '
        'rear_bias_r` in rad'),
    'rod_command': Topic(
        'sensor_msgs/msg/JointState', 'in',
        'angles [rad] as positions of the rods `left_front_rod`, `left_rear_rod`, `right_front_rod`, `right_rear_rod`, '
        'all or some, the others hold; servos follow them until the next `fin_command`'),
    'set_pose': Topic(
        'geometry_msgs/msg/PoseStamped', 'in',
        'puts the robot at rest at this pose, in `odom`; its gait is forgotten'),
    'initialpose': Topic(
        'geometry_msgs/msg/PoseWithCovarianceStamped', 'in',
        'as `set_pose`, but x, y and heading only: the robot keeps its depth and is level; what *2D Pose Estimate* of '
        'RViz sends, in `odom`; the covariance is not used'),
    'current': Topic(
        'geometry_msgs/msg/Vector3Stamped', 'in',
        'mean velocity of the water in `odom`, until the next message or until `water.current` is set'),
    'body_wrench': Topic(
        'geometry_msgs/msg/WrenchStamped', 'in',
        'external force and moment on the body about its center of mass, in `base_link` or `odom`; acts for '
        '`body_wrench_lifetime`, or until the next message'),
    'pose': Topic(
        'geometry_msgs/msg/PoseStamped', 'out',
        'pose of `base_link` (at the center of mass: x forward, y left, z up) in `odom`'),
    'twist': Topic(
        'geometry_msgs/msg/TwistStamped', 'out',
        'velocity of `base_link` relative to `odom`, components in `base_link`'),
    'odom': Topic(
        'nav_msgs/msg/Odometry', 'out',
        'pose and twist together, with the noise `odom_noise` and its covariances; without it, the ground truth with '
        'covariances of zero'),
    'fin_wrench': Topic(
        'geometry_msgs/msg/WrenchStamped', 'out',
        'force and moment of both fins on the body about its center of mass, in `base_link`'),
    'left_fin/wrench': Topic('geometry_msgs/msg/WrenchStamped', 'out', "the left fin's part of `fin_wrench`"),
    'right_fin/wrench': Topic('geometry_msgs/msg/WrenchStamped', 'out', "the right fin's part of `fin_wrench`"),
    'imu/data': Topic(
        'sensor_msgs/msg/Imu', 'out',
        'attitude, angular velocity and specific force (+g upward at rest) in `imu.frame`, with bias and noise, at '
        '`imu.rate`; REP 145'),
    'pressure': Topic(
        'sensor_msgs/msg/FluidPressure', 'out',
        'absolute pressure at the depth below `water.surface_height`, with bias and noise'),
    'velocity': Topic(
        'geometry_msgs/msg/TwistWithCovarianceStamped', 'out',
        'velocity over ground of `base_link`, in `base_link`, as of a Doppler velocity log: with noise and missing '
        'readings, at `velocity.rate`; the angular part is unknown and has a variance of 1e6'),
    'joint_states': Topic(
        'sensor_msgs/msg/JointState', 'out',
        'angles [rad], rates [rad/s] and, as effort, motor torques [N m] of the four rods; with `publish_fin_joints` '
        'also the joints of the supports and the chains, whose effort is 0, as they have no motor'),
    'fin_markers': Topic(
        'visualization_msgs/msg/MarkerArray', 'out',
        'body, fins colored by their load, wrenches and path for RViz; published only while somebody subscribes'),
    '/tf': Topic(
        'tf2_msgs/msg/TFMessage', 'out',
        'transform from `odom` to `base_link`, with `publish_tf` and where tf2_msgs is installed'),
    '/tf_static': Topic(
        'tf2_msgs/msg/TFMessage', 'out',
        'once: transform from `base_link` to `imu.frame` if that is another frame, and with `publish_ned` from `odom` '
        'to `odom_ned` and from `base_link` to `base_link_frd`; where tf2_msgs is installed'),
    'pose_ned': Topic(
        'geometry_msgs/msg/PoseStamped', 'out',
        'pose of `base_link_frd` (x forward, y right, z down) in `odom_ned` (x north, y east, z down), with '
        '`publish_ned`'),
    'odom_ned': Topic(
        'nav_msgs/msg/Odometry', 'out', '`odom` in `odom_ned` and `base_link_frd`, with `publish_ned`'),
    '/clock': Topic('rosgraph_msgs/msg/Clock', 'out', 'simulated time, with `publish_clock`'),
    '/diagnostics': Topic(
        'diagnostic_msgs/msg/DiagnosticArray', 'out',
        'once a second: pace, commands, disturbances, motion, time step, power and water, in words'),
}
"""Names are relative, so that namespaces and remaps work, but for four whose names ROS 2 fixes."""

SERVICES = {
    '~/pause': Service(
        'std_srvs/srv/SetBool', 'true: simulated time stands still; false: it runs on from there'),
    '~/step': Service(
        'std_srvs/srv/Trigger',
        'advances by exactly `step_duration`, with all outputs in it; refused unless the simulator is paused'),
    '~/reset': Service(
        'std_srvs/srv/Trigger',
        'puts the robot at rest where it started; the clock goes on; commands, poses and disturbances sent before are '
        'dropped'),
    **{
        f'~/{name}': Service(
            f'simulation_interfaces/srv/{kind}', f'{meaning}; where simulation_interfaces is installed')
        for name, kind, meaning in (
            ('get_simulator_features', 'GetSimulatorFeatures', 'what of the standard is supported'),
            ('get_simulation_state', 'GetSimulationState', 'whether simulated time runs or stands still'),
            ('set_simulation_state', 'SetSimulationState', 'playing or paused, as `~/pause`'),
            ('step_simulation', 'StepSimulation', 'as `~/step`, so many times'),
            ('reset_simulation', 'ResetSimulation', 'with SCOPE_STATE as `~/reset`'),
            ('get_entities', 'GetEntities', 'the name of the robot, which is the full name of the node'),
            ('get_entity_info', 'GetEntityInfo', 'that it is a robot'),
            ('get_entity_state', 'GetEntityState', 'its pose, twist and acceleration, in `odom`'),
            ('set_entity_state', 'SetEntityState', 'puts it at a pose in `odom`, as `set_pose`, and with a twist'),
        )},
}
"""`~` is the name of the node."""

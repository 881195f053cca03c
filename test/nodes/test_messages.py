"""A state becomes messages, and a message becomes commands, value for value."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import (
    PoseStamped,
    PoseWithCovarianceStamped,
    TwistStamped,
    Vector3,
    Vector3Stamped,
    Wrench,
    WrenchStamped,
)
from nav_msgs.msg import Odometry
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout

from evidence.scenarios import SWIM, TURN, sized
from manta_sim_ros.dynamics import FinCommand, Parameters, Simulator, State, fin_surfaces
from manta_sim_ros.nodes import messages, serialization
from manta_sim_ros.sensors import Imu, OdometryNoise, Pressure, Velocity, read_imu, read_pressure

STAMP = Time(sec=3, nanosec=20_000_000)
SIX = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
TEN = [*SIX, 0.07, -0.08, 0.09, -0.11]
SLOTS = [
    ('left', 'amplitude'), ('right', 'amplitude'), ('left', 'frequency'), ('right', 'frequency'), ('left', 'phase'),
    ('right', 'phase'), ('left', 'front_bias'), ('right', 'front_bias'), ('left', 'rear_bias'), ('right', 'rear_bias'),
]


@pytest.fixture
def state():
    """A state in which no two values are equal."""
    return dataclasses.replace(
        State.at_rest(Parameters()), position=np.array([1.0, 2.0, 3.0]), orientation=np.array([0.1, 0.5, 0.5, 0.7]),
        twist=np.array([0.4, 0.5, 0.6, 0.7, 0.8, 0.9]),
    )


def xyz(vector):
    return [vector.x, vector.y, vector.z]


def quaternion(orientation):
    return [orientation.x, orientation.y, orientation.z, orientation.w]


@pytest.mark.parametrize(('seconds', 'sec', 'nanosec'), [
    (0.0, 0, 0),
    (0.01 * 3, 0, 30_000_000),
    (29.000000000000004, 29, 0),
    (1.9999999999, 2, 0),
    (86400.002, 86400, 2_000_000),
    (2_000_000.998, 2_000_000, 998_000_000),
])
def test_a_time_is_stamped_to_the_nearest_nanosecond(seconds, sec, nanosec):
    assert messages.time_message(seconds) == Time(sec=sec, nanosec=nanosec)


def test_the_clock_announces_its_stamp():
    assert messages.clock_template().message(STAMP, None) == Clock(clock=STAMP)


def test_the_pose_is_that_of_the_body_in_the_world_frame(state):
    message = messages.pose_template('world').message(STAMP, state)
    assert isinstance(message, PoseStamped)
    assert (message.header.stamp, message.header.frame_id) == (STAMP, 'world')
    assert xyz(message.pose.position) == [1.0, 2.0, 3.0]
    assert quaternion(message.pose.orientation) == [0.1, 0.5, 0.5, 0.7]


def test_the_twist_is_in_the_body_frame(state):
    message = messages.twist_template('body').message(STAMP, state)
    assert isinstance(message, TwistStamped)
    assert (message.header.stamp, message.header.frame_id) == (STAMP, 'body')
    assert xyz(message.twist.linear) == [0.4, 0.5, 0.6]
    assert xyz(message.twist.angular) == [0.7, 0.8, 0.9]


def test_odometry_joins_pose_and_twist_and_has_no_uncertainty(state):
    pose = messages.pose_template('world').message(STAMP, state)
    twist = messages.twist_template('body').message(STAMP, state)
    message = messages.odometry_template(OdometryNoise(), 'world', 'body').message(STAMP, state)
    assert isinstance(message, Odometry)
    assert (message.header.stamp, message.header.frame_id, message.child_frame_id) == (STAMP, 'world', 'body')
    assert (message.pose.pose, message.twist.twist) == (pose.pose, twist.twist)
    assert not np.any(message.pose.covariance) and not np.any(message.twist.covariance)


def test_the_covariances_of_the_odometry_are_those_of_its_noise(state):
    noise = OdometryNoise(position=0.1, orientation=0.2, linear_velocity=0.3, angular_velocity=0.4)
    message = messages.odometry_template(noise, 'world', 'body').message(STAMP, state)
    for covariance, (linear, angular) in (
            (message.pose.covariance, (0.1, 0.2)), (message.twist.covariance, (0.3, 0.4))):
        np.testing.assert_array_equal(
            np.reshape(covariance, (6, 6)), np.diag([linear**2] * 3 + [angular**2] * 3))


def test_a_velocity_says_that_the_angular_part_is_unknown():
    message = messages.velocity_template(Velocity(noise=0.5), 'body').message(STAMP, np.array([1.0, 2.0, 3.0]))
    assert (message.header.stamp, message.header.frame_id) == (STAMP, 'body')
    assert xyz(message.twist.twist.linear) == [1.0, 2.0, 3.0] and xyz(message.twist.twist.angular) == [0.0] * 3
    np.testing.assert_array_equal(
        np.reshape(message.twist.covariance, (6, 6)), np.diag([0.25] * 3 + [1e6] * 3))


def test_a_wrench_is_a_force_then_a_moment():
    message = messages.wrench_template('body', lambda wrench: wrench).message(STAMP, np.arange(1.0, 7.0))
    assert isinstance(message, WrenchStamped)
    assert (message.header.stamp, message.header.frame_id) == (STAMP, 'body')
    assert xyz(message.wrench.force) == [1.0, 2.0, 3.0]
    assert xyz(message.wrench.torque) == [4.0, 5.0, 6.0]


def test_six_values_are_amplitudes_frequencies_and_phases_left_then_right():
    left, right = messages.fin_commands(Float64MultiArray(data=SIX).data)
    assert left == FinCommand(amplitude=0.1, frequency=0.3, phase=0.5)
    assert right == FinCommand(amplitude=0.2, frequency=0.4, phase=0.6)


def test_ten_values_have_the_biases_after_these():
    left, right = messages.fin_commands(Float64MultiArray(data=TEN).data)
    assert left == FinCommand(amplitude=0.1, frequency=0.3, phase=0.5, front_bias=0.07, rear_bias=0.09)
    assert right == FinCommand(amplitude=0.2, frequency=0.4, phase=0.6, front_bias=-0.08, rear_bias=-0.11)


def layout(*sizes_and_strides, offset=0):
    return MultiArrayLayout(
        dim=[MultiArrayDimension(label='any', size=size, stride=stride) for size, stride in sizes_and_strides],
        data_offset=offset)


@pytest.mark.parametrize('values', [SIX, TEN])
def test_a_flat_layout_may_be_left_out_or_given(values):
    count = len(values)
    for given in (layout(), layout((count, count)), layout((count, 0)), layout((count, 1))):
        message = Float64MultiArray(layout=given, data=values)
        assert messages.commands_of(message) == messages.fin_commands(values)


@pytest.mark.parametrize(('given', 'reason'), [
    (layout(offset=4), 'data_offset is 4, but must be 0'),
    (layout((6, 6), offset=2**32 - 1), 'data_offset is 4294967295, but must be 0'),
    (layout((10, 10)), r'dim\[0\].size is 10, but must be the number of values, 6'),
    (layout((0, 0)), r'dim\[0\].size is 0, but must be the number of values, 6'),
    (layout((6, 2)), r'dim\[0\].stride is 2, but must be the number of values, 6'),
    (layout((2, 6), (3, 3)), 'dim has 2 dimensions, but must have one or none'),
    (layout(*1000 * [(1, 1)]), 'dim has 1000 dimensions, but must have one or none'),
])
def test_a_layout_that_is_not_flat_is_refused(given, reason):
    with pytest.raises(ValueError, match=f'^layout.{reason}$'):
        messages.commands_of(Float64MultiArray(layout=given, data=SIX))


@pytest.mark.parametrize('length', [0, 1, 5, 7, 8, 9, 11, 1000])
def test_another_number_of_values_is_refused(length):
    with pytest.raises(ValueError, match=rf'\b{length} values.* 6 .* 10 '):
        messages.fin_commands([0.1] * length)


@pytest.mark.parametrize('invalid', [math.nan, math.inf, -math.inf, 1e300])
@pytest.mark.parametrize('slot', range(10))
def test_an_invalid_value_is_refused_by_its_name_with_its_bound(slot, invalid):
    side, field = SLOTS[slot]
    lengths = (6, 10) if slot < 6 else (10,)
    for length in lengths:
        values = TEN[:length]
        values[slot] = invalid
        with pytest.raises(ValueError, match=rf'{side}.*{field}.*{str(invalid).replace("+", ".")}.* from .* to '):
            messages.fin_commands(values)


class TFMessage:
    """As the class of tf2_msgs, which need not be installed."""

    def __init__(self, transforms):
        self.transforms = transforms


def test_a_transform_is_the_pose(state, monkeypatch):
    monkeypatch.setattr(serialization, 'serialize_message', lambda message: serialize_message(message.transforms[0]))
    message, = messages.transform_template(TFMessage, 'world', 'manta').message(STAMP, state).transforms
    assert (message.header.stamp, message.header.frame_id, message.child_frame_id) == (STAMP, 'world', 'manta')
    assert xyz(message.transform.translation) == state.position.tolist()
    assert quaternion(message.transform.rotation) == state.orientation.tolist()


def test_what_the_imu_reads_is_said_with_the_variances_of_its_noise(state):
    imu = Imu(orientation_noise=0.5, angular_velocity_noise=0.25, acceleration_noise=2.0)
    message = messages.imu_template(imu, Parameters(), 'base_link').message(STAMP, state)
    reading = read_imu(imu, Parameters(), state)
    assert message.header.frame_id == 'base_link' and message.header.stamp == STAMP
    assert quaternion(message.orientation) == reading.orientation.tolist()
    assert xyz(message.angular_velocity) == reading.angular_velocity.tolist()
    assert xyz(message.linear_acceleration) == reading.specific_force.tolist()
    for covariance, deviation in ((message.orientation_covariance, 0.5), (message.angular_velocity_covariance, 0.25),
                                  (message.linear_acceleration_covariance, 2.0)):
        np.testing.assert_array_equal(np.reshape(covariance, (3, 3)), deviation**2 * np.eye(3))


def test_a_pressure_is_said_with_the_variance_of_its_noise(state):
    pressure = Pressure(noise=30.0)
    message = messages.pressure_template(pressure, Parameters(), 'base_link').message(STAMP, state)
    assert (message.fluid_pressure, message.variance) == (read_pressure(pressure, Parameters(), state), 900.0)
    assert message.header == messages.header(STAMP, 'base_link')


RODS = ['left_front_rod', 'left_rear_rod', 'right_front_rod', 'right_rear_rod']


def test_the_joints_are_the_rods_and_if_wanted_supports_and_chains():
    parameters = sized(3, 2)
    simulator = Simulator(parameters)
    simulator.command(left=SWIM, right=TURN)
    state = simulator.advance(0.5)
    message = messages.joint_state_template(parameters, False, 'base_link').message(STAMP, state)
    assert message.header == messages.header(STAMP, 'base_link')
    assert message.name == RODS and list(message.position) == state.rod_angles.ravel().tolist()
    later = simulator.advance(0.002)
    expected = (later.rod_angles - state.rod_angles).ravel() / 0.002
    np.testing.assert_allclose(message.velocity, expected, atol=0.02 * np.abs(expected).max())  # half a step later
    assert np.dot(message.effort, message.velocity) == pytest.approx(state.rod_power, rel=1e-12)
    assert state.rod_torques.all() and list(message.effort) == state.rod_torques.ravel().tolist()

    template = messages.joint_state_template(parameters, True, 'base_link')
    message = template.message(STAMP, state)
    names = messages.joint_names(parameters, fins=True)
    assert message.name == names
    angles = dict(zip(message.name, message.position, strict=True))
    rates = dict(zip(message.name, message.velocity, strict=True))
    efforts = dict(zip(message.name, message.effort, strict=True))
    assert [efforts.pop(name) for name in RODS] == state.rod_torques.ravel().tolist()
    assert set(efforts.values()) == {0.0}  # these joints have no motor
    after = template.message(STAMP, later)
    assert len(angles) == len(message.name) == 4 + 4 + 2 * 3 * 2
    assert [angles[name] for name in RODS] == state.rod_angles.ravel().tolist()
    for side, name in enumerate(('left', 'right')):
        for chain, joint in itertools.product(range(3), range(2)):
            assert angles[f'{name}_chain_{chain}_joint_{joint}'] == state.joint_angles[side, chain, joint]
    roots = fin_surfaces(parameters, state.rod_angles, state.joint_angles)[..., 0, :]  # on the supports
    for side, (name, mirrored) in enumerate((('left', 1.0), ('right', -1.0))):
        x, y, z = (roots[side, 0] - roots[side, -1]) * [1.0, mirrored, 1.0]  # along x_0, as on the left
        assert angles[f'{name}_support_yaw'] == pytest.approx(math.atan2(y, x), abs=1e-12)
        assert angles[f'{name}_support_pitch'] == pytest.approx(math.atan2(-z, math.hypot(x, y)), abs=1e-12)
        for joint in ('yaw', 'pitch'):
            joint = f'{name}_support_{joint}'
            change = (dict(zip(names, after.position))[joint] - angles[joint]) / 0.002
            assert rates[joint] == pytest.approx(change, abs=0.05 * max(abs(change), 0.1))
        for chain, joint in itertools.product(range(3), range(2)):
            assert rates[f'{name}_chain_{chain}_joint_{joint}'] == state.joint_rates[side, chain, joint]
        assert x > 0.0 and angles[f'{name}_support_yaw'] and angles[f'{name}_support_pitch']


def test_the_power_of_the_rods_is_read_from_their_efforts_and_velocities():
    parameters = sized(3, 2)
    simulator = Simulator(parameters)
    simulator.command(left=SWIM, right=TURN)
    state = simulator.advance(0.5)
    for fins in (False, True):
        message = messages.joint_state_template(parameters, fins, 'base_link').message(STAMP, state)
        assert messages.rod_power_of(message) == pytest.approx(state.rod_power, rel=1e-12)
    shuffled = JointState(**{field: list(getattr(message, field))[::-1] for field in ('name', 'velocity', 'effort')})
    assert messages.rod_power_of(shuffled) == pytest.approx(state.rod_power, rel=1e-12)
    for lacking in (
            JointState(), JointState(name=RODS, velocity=4 * [1.0]), JointState(name=RODS, effort=4 * [1.0]),
            JointState(name=RODS[1:], velocity=3 * [1.0], effort=3 * [1.0]),
            JointState(name=RODS, velocity=4 * [1.0], effort=[1.0, 1.0, math.nan, 1.0])):
        assert math.isnan(messages.rod_power_of(lacking))


def vector(*values):
    return Vector3(**dict(zip('xyz', values)))


def current(*values, frame='world'):
    return Vector3Stamped(header=messages.header(STAMP, frame), vector=vector(*values))


def wrench(force=(0.0, 0.0, 0.0), torque=(0.0, 0.0, 0.0), frame='manta'):
    return WrenchStamped(
        header=messages.header(STAMP, frame), wrench=Wrench(force=vector(*force), torque=vector(*torque)))


def test_the_motion_in_the_world_is_that_of_the_pose_and_changes_with_the_acceleration(state):
    state = dataclasses.replace(state, acceleration=np.array([1.0, -2.0, 3.0, -4.0, 5.0, -6.0]))
    step = 1e-4

    def after(time):
        """Return the state a short time later, to the second order in it."""
        turn = Rotation.from_rotvec(time * state.twist[3:] + 0.5 * time * time * state.acceleration[3:])
        attitude = Rotation.from_quat(state.orientation)
        moved = time * state.twist[:3] + 0.5 * time * time * (
            state.acceleration[:3] + np.cross(state.twist[3:], state.twist[:3]))
        return dataclasses.replace(
            state, position=state.position + attitude.apply(moved), orientation=(attitude * turn).as_quat(),
            twist=state.twist + time * state.acceleration)

    twist, acceleration = messages.world_motion(state)
    earlier, later = after(-step), after(step)
    velocity = (later.position - earlier.position) / (2.0 * step)
    turned = Rotation.from_quat(later.orientation) * Rotation.from_quat(earlier.orientation).inv()
    np.testing.assert_allclose(twist, [*velocity, *turned.as_rotvec() / (2.0 * step)], rtol=1e-6)
    change = (messages.world_motion(later)[0] - messages.world_motion(earlier)[0]) / (2.0 * step)
    np.testing.assert_allclose(acceleration, change, rtol=1e-6)


def test_a_twist_in_the_world_is_read_as_one_of_the_body(state):
    twist, _ = messages.world_motion(state)
    message = TwistStamped()
    message.header.frame_id = 'world'
    for part, values in ((message.twist.linear, twist[:3]), (message.twist.angular, twist[3:])):
        part.x, part.y, part.z = values.tolist()
    read = messages.twist_of(message, 'world', state.orientation)
    np.testing.assert_allclose(read, state.twist, rtol=0.0, atol=1e-14)
    message.twist.angular.y = -101.0
    with pytest.raises(ValueError, match=r'^twist.angular.y is -101.0, but must be from -100 to 100 rad/s$'):
        messages.twist_of(message, 'world', state.orientation)
    with pytest.raises(ValueError, match=r"^header.frame_id is 'world', but must be 'map'$"):
        messages.twist_of(message, 'map', state.orientation)


def test_a_current_is_read_and_so_are_its_bounds():
    assert messages.current_of(current(0.1, -10.0, 10.0), 'world') == [0.1, -10.0, 10.0]


@pytest.mark.parametrize(('message', 'words'), [
    (current(0.0, 10.001, 0.0), r'vector\.y is 10\.001, but must be from -10 to 10 m/s'),
    (current(0.0, 0.0, -math.inf), r'vector\.z is -inf, but must be from -10 to 10 m/s'),
    (current(math.nan, 0.0, 0.0), r'vector\.x is nan, but must be from -10 to 10 m/s'),
    (current(0.1, 0.0, 0.0, frame='manta'), "header.frame_id is 'manta', but must be 'world'"),
    (current(0.1, 0.0, 0.0, frame=''), "header.frame_id is '', but must be 'world'"),
])
def test_an_invalid_current_is_refused_by_name_with_its_bound(message, words):
    with pytest.raises(ValueError, match=words):
        messages.current_of(message, 'world')


@pytest.mark.parametrize('frame', ['manta', 'world'])
def test_a_wrench_is_read_with_its_frame(frame):
    message = wrench((1.0, 2.0, -1e6), (4.0, 5.0, 1e6), frame=frame)
    assert messages.wrench_of(message, 'manta', 'world') == (frame, [1.0, 2.0, -1e6, 4.0, 5.0, 1e6])


@pytest.mark.parametrize(('message', 'words'), [
    (wrench(force=(0.0, 1.1e6, 0.0)), r'wrench\.force\.y is 1100000\.0, but must be from -1e\+06 to 1e\+06 N'),
    (wrench(torque=(0.0, 0.0, math.nan)), r'wrench\.torque\.z is nan, but must be from -1e\+06 to 1e\+06 N m'),
    (wrench(frame='map'), "header.frame_id is 'map', but must be 'manta' or 'world'"),
])
def test_an_invalid_wrench_is_refused_by_name_with_its_bound(message, words):
    with pytest.raises(ValueError, match=words):
        messages.wrench_of(message, 'manta', 'world')


def test_an_endless_frame_is_refused_in_a_short_line():
    with pytest.raises(ValueError) as refusal:
        messages.current_of(current(0.1, 0.0, 0.0, frame='x' * 8_000_000), 'world')
    assert len(str(refusal.value)) < 400 and "must be 'world'" in str(refusal.value)


def estimate(orientation, position=(1.0, 2.0, 3.0), frame='world'):
    message = PoseWithCovarianceStamped(header=messages.header(STAMP, frame))
    pose = message.pose.pose
    pose.position.x, pose.position.y, pose.position.z = position
    pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w = orientation
    return message


@pytest.mark.parametrize('yaw', [-3.0, -0.5, 0.0, 1.0, 3.0])
@pytest.mark.parametrize('tilt', [(0.0, 0.0), (1.0, 0.5), (3.0, -1.5)])
def test_a_planar_pose_has_the_heading_and_no_other_angle(yaw, tilt):
    given = Rotation.from_euler('ZYX', [yaw, tilt[1], tilt[0]]).as_quat()
    position, orientation = messages.planar_pose_of(estimate(given), 'world', -7.0)
    assert position == [1.0, 2.0, -7.0]
    np.testing.assert_allclose(orientation, Rotation.from_euler('z', yaw).as_quat(), rtol=0.0, atol=1e-14)


@pytest.mark.parametrize(('message', 'words'), [
    (estimate((0.0, 0.0, 0.0, 1.0), frame='map'), "header.frame_id is 'map', but must be 'world'"),
    (estimate((0.0, 0.0, 0.0, 2.0)), 'pose.orientation has norm 2'),
    (estimate((0.0, 0.0, 0.0, 1.0), position=(math.inf, 0.0, 0.0)), 'pose.position.x is inf'),
])
def test_an_invalid_planar_pose_is_refused_as_a_pose_is(message, words):
    with pytest.raises(ValueError, match=words):
        messages.planar_pose_of(message, 'world', 0.0)

"""A state becomes messages, and a message becomes commands, value for value."""

import dataclasses
import math

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64MultiArray

from manta_sim_ros import messages
from manta_sim_ros.dynamics import FinCommand, Parameters, State

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
    assert messages.clock_message(STAMP) == Clock(clock=STAMP)


def test_the_pose_is_that_of_the_body_in_the_world_frame(state):
    message = messages.pose_message(state, messages.header(STAMP, 'world'))
    assert isinstance(message, PoseStamped)
    assert (message.header.stamp, message.header.frame_id) == (STAMP, 'world')
    assert xyz(message.pose.position) == [1.0, 2.0, 3.0]
    assert quaternion(message.pose.orientation) == [0.1, 0.5, 0.5, 0.7]


def test_the_twist_is_in_the_body_frame(state):
    message = messages.twist_message(state, messages.header(STAMP, 'body'))
    assert isinstance(message, TwistStamped)
    assert (message.header.stamp, message.header.frame_id) == (STAMP, 'body')
    assert xyz(message.twist.linear) == [0.4, 0.5, 0.6]
    assert xyz(message.twist.angular) == [0.7, 0.8, 0.9]


def test_odometry_joins_pose_and_twist_and_has_no_uncertainty(state):
    pose = messages.pose_message(state, messages.header(STAMP, 'world'))
    twist = messages.twist_message(state, messages.header(STAMP, 'body'))
    message = messages.odometry_message(pose, twist)
    assert isinstance(message, Odometry)
    assert (message.header.stamp, message.header.frame_id, message.child_frame_id) == (STAMP, 'world', 'body')
    assert (message.pose.pose, message.twist.twist) == (pose.pose, twist.twist)
    assert not np.any(message.pose.covariance) and not np.any(message.twist.covariance)


def test_a_wrench_is_a_force_then_a_moment():
    message = messages.wrench_message(np.arange(1.0, 7.0), messages.header(STAMP, 'body'))
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


@pytest.mark.parametrize('length', [0, 1, 5, 7, 8, 9, 11, 1000])
def test_another_number_of_values_is_refused(length):
    with pytest.raises(ValueError, match=rf'\b{length} values.* 6 .* 10 '):
        messages.fin_commands([0.1] * length)


@pytest.mark.parametrize('bad', [math.nan, math.inf, -math.inf, 1e300])
@pytest.mark.parametrize('slot', range(10))
def test_a_bad_value_is_refused_by_its_name_with_its_bound(slot, bad):
    side, field = SLOTS[slot]
    lengths = (6, 10) if slot < 6 else (10,)
    for length in lengths:
        values = TEN[:length]
        values[slot] = bad
        with pytest.raises(ValueError, match=rf'{side}.*{field}.*{str(bad).replace("+", ".")}.* from .* to '):
            messages.fin_commands(values)

"""What a template writes is what rclpy serializes, byte for byte."""

import dataclasses
import math
import struct

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped
from rclpy.serialization import deserialize_message, serialize_message

from evidence.scenarios import SWIM, TURN, sized
from manta_sim_ros.dynamics import Simulator
from manta_sim_ros.nodes import messages, serialization
from manta_sim_ros.sensors import Imu, OdometryNoise, Pressure, Velocity

PARAMETERS = sized(3, 2)
STAMPS = [Time(), Time(sec=3, nanosec=20_000_000), Time(sec=2**31 - 1, nanosec=999_999_999), Time(sec=-1, nanosec=1)]
UNUSUAL = [math.nan, -math.nan, math.inf, -math.inf, -0.0, 5e-324, 1.7e308]
FRAMES = [name * length for length in range(1, 17) for name in ('o', '\u00e9')]
FORMATS = {'double': 'd', 'float': 'f', 'int32': 'i', 'uint32': 'I'}


class TFMessage:
    """As the class of tf2_msgs, which need not be installed."""

    def __init__(self, transforms):
        self.transforms = transforms

    def get_fields_and_field_types(self):
        return {'transforms': 'sequence<geometry_msgs/TransformStamped>'}


def cdr(message):
    """Return what the rules of the OMG for CDR make of a message, and the positions of its bytes that say nothing."""
    data, padding = bytearray(b'\0\1\0\0'), []

    def number(kind, value):
        size = struct.calcsize(kind)
        while (len(data) - 4) % size:
            padding.append(len(data))
            data.append(0)
        data.extend(struct.pack('<' + kind, value))

    def value_of(kind, value):
        if kind.startswith('sequence<'):
            number('I', len(value))
        if kind.startswith('sequence<') or kind.endswith(']'):
            for element in value:
                value_of(kind.removeprefix('sequence<').rstrip('>[]0123456789'), element)
        elif kind == 'string':
            text = value.encode() + b'\0'
            number('I', len(text))
            data.extend(text)
        elif kind in FORMATS:
            number(FORMATS[kind], value)
        else:
            for name, inner in value.get_fields_and_field_types().items():
                value_of(inner, getattr(value, name))

    value_of('message', message)
    return bytes(data), padding


def without(padding, data):
    return bytes(byte for at, byte in enumerate(data) if at not in set(padding))


def templates(odom, base):
    """Every template of the node by the name of its topic."""
    return {
        'pose': messages.pose_template(odom),
        'twist': messages.twist_template(base),
        'odom': messages.odometry_template(OdometryNoise(), odom, base),
        'fin_wrench': messages.wrench_template(base, lambda state: state.wrench),
        'imu': messages.imu_template(Imu(seed=3), PARAMETERS, base),
        'pressure': messages.pressure_template(Pressure(seed=3), PARAMETERS, base),
        'velocity': messages.velocity_template(Velocity(), base),
        'rods': messages.joint_state_template(PARAMETERS, False, base),
        'joints': messages.joint_state_template(PARAMETERS, True, base),
        'clock': messages.clock_template(),
    }


@pytest.fixture(scope='module')
def states():
    """Two states of a swim, and one in which no number is usual."""
    simulator = Simulator(PARAMETERS)
    simulator.command(left=SWIM, right=TURN)
    first, second = simulator.advance(0.5), simulator.advance(0.5)
    unusual = dataclasses.replace(second)
    for name, value in vars(second).items():
        if isinstance(value, np.ndarray):
            object.__setattr__(unusual, name, np.resize(UNUSUAL, value.shape))
    return [first, second, unusual]


@pytest.mark.filterwarnings('ignore:invalid value', 'ignore:overflow')
@pytest.mark.parametrize('topic', templates('odom', 'base_link'))
@pytest.mark.parametrize('odom', FRAMES)
def test_each_message_is_byte_for_byte_what_rclpy_serializes(topic, odom, states):
    for base in ('b', 'manta_1/base_link', odom + '_2'):
        template = templates(odom, base)[topic]
        numbers_of = template._numbers_of
        for state, stamp in zip([*states, *states], STAMPS + STAMPS):
            source = state.twist[:3] if topic == 'velocity' else state
            numbers = numbers_of(source)  # once: the sign of a sum that is not a number is chance
            template._numbers_of = lambda source, numbers=numbers: numbers
            written, message = template.write(stamp, source), template.message(stamp, source)
            expected, padding = cdr(message)
            assert isinstance(written, bytes)  # the numbers were found
            # what is between the values is chance: rclpy does not write it
            assert without(padding, written) == without(padding, serialize_message(message))
            assert without(padding, written) == without(padding, expected)


@pytest.mark.parametrize('odom', FRAMES)
def test_a_transform_is_byte_for_byte_what_the_rules_say(odom, states, monkeypatch):
    monkeypatch.setattr(serialization, 'serialize_message', lambda message: cdr(message)[0])
    template = messages.transform_template(TFMessage, odom, 'base_link')
    for state, stamp in zip([*states, *states], STAMPS + STAMPS):
        assert template.write(stamp, state) == cdr(template.message(stamp, state))[0]
    transform = TransformStamped(child_frame_id=odom)
    expected, padding = cdr(transform)  # the rules are those of rclpy
    assert without(padding, serialize_message(transform)) == without(padding, expected)


def test_what_was_written_stays_when_the_next_is_written(states):
    template = messages.pose_template('odom')
    first = template.write(STAMPS[1], states[0])
    template.write(STAMPS[2], states[1])
    message = deserialize_message(first, type(template.message(STAMPS[1], states[0])))
    assert message.header.stamp == STAMPS[1] and message.pose.position.x == states[0].position[0]


@pytest.mark.parametrize('serialize', [
    lambda message: b'', lambda message: serialize_message(message)[:-8],
    lambda message: 2 * serialize_message(message), lambda message: serialize_message(message)[::-1],
])
def test_where_the_numbers_are_not_found_the_message_itself_is_published(serialize, states, monkeypatch):
    monkeypatch.setattr(serialization, 'serialize_message', serialize)
    template = messages.twist_template('base_link')
    message = template.write(STAMPS[1], states[0])
    assert message.header.stamp == STAMPS[1] and message.header.frame_id == 'base_link'
    assert message.twist.angular.z == states[0].twist[5]


@pytest.mark.parametrize('numbers', [(), (np.zeros(6), 1.0), (np.zeros(5),), (np.zeros((2, 6)),)])
def test_another_number_of_numbers_is_refused(numbers, states):
    template = messages.wrench_template('base_link', lambda state: state.wrench)
    template._numbers_of = lambda state: numbers
    with pytest.raises(ValueError):
        template.write(STAMPS[1], states[0])

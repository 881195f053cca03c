"""The parameters of `sim_node`: what there is, what is refused at the start, and what may be set while it runs."""

import math
import time
from concurrent.futures import ThreadPoolExecutor
from subprocess import TimeoutExpired

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import Parameter, ParameterType
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.parameter import Parameter as RclpyParameter
from rclpy.parameter import parameter_value_to_python
from rosgraph_msgs.msg import Clock

from manta_sim_ros.dynamics import Parameters, Simulator

NAMES = {
    'water': 'density current current_deviation current_correlation_time current_seed surface_height '
             'added_mass_coefficient added_mass_density',
    'body': 'mass inertia drag_area drag_coefficient angular_damping buoyancy_center gravity '
            'added_mass linear_damping quadratic_damping net_buoyancy',
    'rods': 'front_radius rear_radius support_length rear_motor_position command_time_constant '
            'servo_time_constant servo_rate_limit',
    'fin': 'chains links span thickness youngs_modulus joint_damping drag_coefficient density '
           'shear_modulus twist_damping',
    'solver': 'time_step fixed_base coupling',
    'imu': 'rate frame position orientation acceleration_noise acceleration_bias acceleration_bias_walk '
           'angular_velocity_noise angular_velocity_bias angular_velocity_bias_walk orientation_noise seed',
    'velocity': 'rate noise dropout seed',
    'odom_noise': 'position orientation linear_velocity angular_velocity seed',
    'pressure': 'noise bias atmospheric water_density seed',
    '': 'initial_position initial_yaw body_wrench_lifetime joint_state_rate publish_fin_joints marker_rate publish_tf '
        'publish_ned '
        'publish_rate real_time_factor publish_clock start_paused step_duration command_timeout odom_frame base_frame',
}
ALL = {f'{group}.{name}'.lstrip('.') for group, names in NAMES.items() for name in names.split()}
OF_ANY_NODE = {'use_sim_time', 'start_type_description_service'}

INVALID_STARTS = {  # ROS arguments, and what the one line must say
    'out of range': ('-p fin.span:=11.0', ['fin.span', '11.0', 'from 0.001 to 10']),
    'whole number out of range': ('-p fin.chains:=1', ['fin.chains', '1', 'from 2 to 2000']),
    'text for a number': ('-p fin.chains:=many', ['fin.chains', 'many', 'from 2 to 2000']),
    'real number for a whole one': ('-p fin.chains:=30.5', ['fin.chains', '30.5', 'whole number from 2 to 2000']),
    'one number for a vector': ('-p water.current:=1.0', ['water.current', '1.0', '3 numbers']),
    'empty vector': ('-p water.current:=[]', []),  # rclpy's own refusal: an empty list has no type
    'switch for a number': ('-p body.mass:=true', ['body.mass', 'True', 'from 0.001 to 1e+06']),
    'nan': ('-p publish_rate:=.nan', ['publish_rate', 'nan', 'from 0.1 to 1000']),
    'infinite': ('-p body.mass:=.inf', ['body.mass', 'inf', 'from 0.001 to 1e+06']),
    'nan in a vector': ('-p water.current:=[0.0,.nan,0.0]', ['water.current[1]', 'nan', 'from -10 to 10 m/s']),
    'negative noise': ('-p imu.acceleration_noise:=-0.1', ['imu.acceleration_noise', '-0.1', 'from 0 to 100 m/s^2']),
    'negative seed': ('-p pressure.seed:=-1', ['pressure.seed', '-1', 'from 0 to 1e+09']),
    'vector of two': ('-p body.inertia:=[1.0,2.0]', ['body.inertia', '[1.0, 2.0]', '3 numbers']),
    'vector of five': ('-p body.added_mass:=[1.0,2.0,3.0,4.0,5.0]', ['body.added_mass', '5.0]', '6 numbers']),
    'negative in a vector of six': (
        '-p body.quadratic_damping:=[0.0,0.0,0.0,0.0,0.0,-1.0]',
        ['body.quadratic_damping[5]', '-1.0', 'from 0 to 1e+06 N s^2/m^2, N m s^2']),
    'text for a switch': ('-p publish_clock:=often', ['publish_clock', 'often', 'true or false']),
    'rate above one a step': ('-p publish_rate:=501.0', ['publish_rate', '501', 'at most 500', 'time_step']),
    'step of no whole number': ('-p step_duration:=0.0033', ['step_duration', '0.0033', 'whole number', '0.002 s']),
    'step that does not fit the time step': (
        '-p step_duration:=0.01 -p solver.time_step:=0.003', ['step_duration', '0.01', 'whole number', '0.003 s']),
    'support that cannot close': ('-p rods.support_length:=0.04', ['rods.support_length', '0.04', 'greater', '0.05']),
    'equal frames': ('-p odom_frame:=base_link', ['base_frame', 'base_link', 'differ', 'odom_frame']),
    'empty frame': ('-p "odom_frame:=\'\'"', ['odom_frame', "''", 'not empty']),
    'frame with a slash': ('-p base_frame:=/base_link', ['base_frame', '/base_link', 'without']),
    'mounted IMU in the body frame': (
        '-p imu.position:=[0.1,0.0,0.0]', ['imu.frame', 'base_frame', 'another frame', 'imu.position']),
    'IMU in the world frame': ('-p imu.frame:=odom', ['imu.frame', "'odom'", 'differ', 'odom_frame']),
    'IMU frame with a space': ('-p "imu.frame:=my imu"', ['imu.frame', 'my imu', 'without spaces']),
    'no probability': ('-p velocity.dropout:=1.5', ['velocity.dropout', '1.5', 'from 0 to 1']),
    'no such file': ('--params-file /nowhere/manta.yaml', ['/nowhere/manta.yaml']),
    'broken file': ('--params-file {broken}', ['broken.yaml']),
}


@pytest.fixture(scope='module')
def refusals(module_launch, tmp_path_factory):
    """What each invalid start printed: all of them side by side."""
    broken = tmp_path_factory.mktemp('files') / 'broken.yaml'
    broken.write_text('/**:\n  ros__parameters:\n    water: {density: [1.0,\n')

    def start(invalid):
        try:
            return module_launch('sim_node', f'-r __ns:=/invalid {invalid[0].format(broken=broken)}').refusal()
        except (AssertionError, TimeoutExpired) as error:
            return [f'did not end with an error: {error}']

    with ThreadPoolExecutor(2) as pool:
        return dict(zip(INVALID_STARTS, pool.map(start, INVALID_STARTS.values())))


@pytest.mark.parametrize('invalid', INVALID_STARTS)
def test_an_invalid_value_at_the_start_ends_it_with_one_line(refusals, invalid):
    (line,) = refusals[invalid]
    for word in INVALID_STARTS[invalid][1]:
        assert word in line


@pytest.fixture(scope='module')
def robot(module_launch, probe):
    """A robot at rest."""
    node = module_launch('sim_node')
    with probe.record(Clock, '/clock') as clock:
        probe.until(lambda: clock, 'the clock')
    return node


@pytest.fixture
def service(robot, probe):
    def call(service_type, **request):
        name = service_type.__name__
        name = ''.join('_' + letter.lower() if letter.isupper() else letter for letter in name).lstrip('_')
        return probe.call(service_type, f'/manta_sim/{name}', **request)
    return call


@pytest.fixture
def set_parameter(service):
    def set_one(name, value):
        (result,) = service(SetParameters, parameters=[as_message(name, value)]).results
        return result
    return set_one


@pytest.fixture
def get_parameter(service):
    return lambda name: parameter_value_to_python(service(GetParameters, names=[name]).values[0])


def as_message(name, value) -> Parameter:
    return RclpyParameter(name, value=value).to_parameter_msg()


def test_there_are_the_parameters_of_the_interface_and_no_others(service):
    names = {name for name in service(ListParameters).result.names if not name.startswith('qos_overrides.')}
    assert names - OF_ANY_NODE == ALL


def test_each_parameter_has_a_description_and_each_number_a_range(service):
    names = sorted(ALL)
    for name, descriptor in zip(names, service(DescribeParameters, names=names).descriptors):
        assert descriptor.description, name
        assert not descriptor.dynamic_typing
        if descriptor.type == ParameterType.PARAMETER_DOUBLE:
            (bounds,) = descriptor.floating_point_range
            assert bounds.from_value < bounds.to_value and bounds.step == 0.0, name
        elif descriptor.type == ParameterType.PARAMETER_INTEGER:
            (bounds,) = descriptor.integer_range
            assert bounds.from_value < bounds.to_value, name
        elif descriptor.type != ParameterType.PARAMETER_BOOL:
            assert descriptor.additional_constraints, name


def test_a_current_that_is_set_takes_the_robot_along(set_parameter, probe):
    with probe.record(Odometry, 'odom') as odometry:
        probe.until(lambda: odometry, 'odometry')
        assert odometry[-1].pose.pose.position.y == 0.0
        assert set_parameter('water.current', [0.0, 0.5, 0.0]).successful
        probe.until(lambda: odometry[-1].pose.pose.position.y > 0.01, 'drift to the left')
        assert odometry.rising
    assert set_parameter('water.current', [0.0, 0.0, 0.0]).successful


def test_damping_and_buoyancy_of_the_body_are_taken_while_it_runs(set_parameter, get_parameter, probe):
    values = {'linear_damping': [0.0, 0.0, 200.0, 1.0, 2.0, 3.0], 'quadratic_damping': [3.0, 2.0, 9e3, 0.0, 0.0, 0.0],
              'net_buoyancy': 10.0}

    def rise(**changes):  # the speed upward at which it ends [m/s]
        return Simulator(Parameters().replace(body=values | changes)).advance(5.0).twist[2]

    expected = pytest.approx(rise(), rel=0.01)  # it glides forward, slowly, and becomes 0.2 % slower in 20 s
    for name in values:
        assert abs(rise(**{name: getattr(Parameters().body, name)}) - rise()) > 0.1 * rise()
    with probe.record(Odometry, 'odom') as odometry:
        for name, value in values.items():
            assert set_parameter(f'body.{name}', value).successful
            assert np.array_equal(get_parameter(f'body.{name}'), value)
        probe.until(lambda: odometry and odometry[-1].twist.twist.linear.z == expected, f'{expected} m/s upward')
        probe.listen(1.0)
        assert odometry[-1].twist.twist.linear.z == expected
    for name in values:
        rest = getattr(Parameters().body, name)
        assert set_parameter(f'body.{name}', list(rest) if isinstance(rest, tuple) else rest).successful


def test_the_twist_of_the_fins_is_taken_while_it_runs(set_parameter, get_parameter):
    for name, value in (('fin.shear_modulus', 1e5), ('fin.twist_damping', 1e-4)):
        before = get_parameter(name)
        assert set_parameter(name, value).successful and get_parameter(name) == value
        assert set_parameter(name, before).successful


def test_a_pace_that_is_set_is_taken(set_parameter, get_parameter, probe):
    with probe.record(Clock, '/clock') as clock:
        assert set_parameter('real_time_factor', 0.001).successful  # a tick each ten seconds
        assert get_parameter('real_time_factor') == 0.001
        now = time.time_ns()
        probe.listen(2.0)
        assert len(clock) - clock.first_sent_after(now) <= 2
        assert set_parameter('real_time_factor', 0.0).successful
        soon = len(clock) + 300
        probe.until(lambda: len(clock) > soon, 'three seconds of simulated time')
        assert set_parameter('real_time_factor', 1.0).successful
        assert clock.rising


def test_a_rate_that_is_set_is_taken_and_stamps_go_on_rising(set_parameter, probe):
    with probe.record(Clock, '/clock') as clock:
        for rate, spacings in (*2 * ((200.0, {4, 6}), (500.0, {2})), (50.0, {20}), (100.0, {10})):  # [Hz, ms]
            assert set_parameter('publish_rate', rate).successful
            now = time.time_ns()
            probe.until(lambda: len(clock) > clock.first_sent_after(now) + 30, f'the clock at {rate} Hz')  # noqa: B023
            stamps = clock.stamps[clock.first_sent_after(now):]
            assert {(after - before) // 1_000_000 for before, after in zip(stamps, stamps[1:])} >= spacings
            assert clock.rising


REFUSED = {  # a value that may not be set while it runs, and what the reason must say
    'out of range': ('water.density', -1.0, ['water.density', '-1.0', '0']),
    'nan': ('fin.youngs_modulus', math.nan, ['fin.youngs_modulus', 'nan', '0']),
    'whole number for a real one': ('water.density', 1000, ['type']),
    'text for a number': ('body.drag_area', 'large', ['type']),
    'empty vector': ('water.current', [], ['type']),
    'nan in a vector': ('water.current', [0.0, 0.0, math.nan], ['water.current[2]', 'nan', 'from -10 to 10']),
    'vector of four': ('body.drag_area', [1.0, 2.0, 3.0, 4.0], ['body.drag_area', '4.0', '3 numbers']),
    'vector of three for six': ('body.linear_damping', [1.0, 2.0, 3.0], ['body.linear_damping', '3.0]', '6 numbers']),
    'vector of seven for six': ('body.quadratic_damping', 7 * [1.0], ['body.quadratic_damping', '1.0]', '6 numbers']),
    'one number for six': ('body.linear_damping', 1.0, ['type']),
    'negative in a vector of six': (
        'body.linear_damping', [1.0, 1.0, 1.0, 1.0, -0.5, 1.0],
        ['body.linear_damping[4]', '-0.5', 'from 0 to 1e+06 N s/m, N m s']),
    'out of range force': ('body.net_buoyancy', 2e5, ['body.net_buoyancy', '200000', '-100000', '100000']),
    'negative modulus': ('fin.shear_modulus', -1.0, ['fin.shear_modulus', '-1.0', '0', '10000000000000']),
    'infinite twist damping': ('fin.twist_damping', math.inf, ['fin.twist_damping', 'inf', '0', '10000']),
    'read-only vector of six': ('body.added_mass', 6 * [1.0], ['read-only']),
    'rate above one a step': ('publish_rate', 600.0, ['publish_rate', '600', 'at most 500']),
    'read-only number': ('body.mass', 21.0, ['read-only']),
    'read-only vector': ('body.inertia', [1.0, 1.0, 1.0], ['read-only']),
    'read-only whole number': ('fin.chains', 20, ['read-only']),
    'read-only step': ('solver.time_step', 0.001, ['read-only']),
    'read-only switch': ('publish_clock', False, ['read-only']),
    'read-only text': ('odom_frame', 'map', ['read-only']),
}


@pytest.mark.parametrize(('name', 'value', 'words'), REFUSED.values(), ids=REFUSED)
def test_an_invalid_value_is_refused_with_its_reason_and_changes_nothing(
        set_parameter, get_parameter, name, value, words):
    before = get_parameter(name)
    result = set_parameter(name, value)
    assert not result.successful
    for word in words:
        assert word in result.reason
    assert get_parameter(name) == before


def test_one_bad_value_among_good_ones_changes_nothing(service, get_parameter):
    before = get_parameter('water.density'), get_parameter('water.current')
    wanted = [as_message('water.density', 500.0), as_message('water.current', [0.0, 99.0, 0.0])]
    result = service(SetParametersAtomically, parameters=wanted).result
    assert not result.successful and 'water.current[1] is 99.0' in result.reason
    assert (get_parameter('water.density'), get_parameter('water.current')) == before


def test_an_unknown_parameter_cannot_be_set(set_parameter):
    assert not set_parameter('fin.color', 'red').successful

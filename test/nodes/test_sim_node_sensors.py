"""What the robot's sensors say on the topics: that of the library, at their rates, with the noise that is asked for."""

import dataclasses

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, TwistWithCovarianceStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import FluidPressure, Imu, JointState

from evidence.harness.lockstep import LockstepRobot
from manta_sim_ros import sensors
from manta_sim_ros.dynamics import FinCommand, Parameters, Simulator, State
from manta_sim_ros.nodes.messages import joint_names
from manta_sim_ros.nodes.settings import Settings

SWIM = [0.7, 0.4, 0.6, 0.8, 0.7, 0.3]
PARAMETERS = Parameters()


class Sensed(LockstepRobot):
    """A held robot whose sensors are heard."""

    def __init__(self, launch, probe, name, ros_arguments=''):
        super().__init__(launch, probe, name, f'-p start_paused:=true {ros_arguments}')
        self.imu = probe.record(Imu, f'/{name}/imu/data')
        self.pressure = probe.record(FluidPressure, f'/{name}/pressure')
        self.joints = probe.record(JointState, f'/{name}/joint_states')

    def swim(self):
        """Reset it, let it swim, and return its twin's states with their stamps [ns], tick by tick."""
        assert self.set_parameter('step_duration', 0.2).successful
        assert self.trigger('reset').success
        self.command(SWIM)
        began = self.now()
        twin = Simulator(PARAMETERS)
        twin.command(left=FinCommand(*SWIM[::2]), right=FinCommand(*SWIM[1::2]))
        self.step()
        self.probe.until(lambda: self.imu.stamps[-1:] == self.clock.stamps[-1:] == self.pressure.stamps[-1:], 'sensors')
        return {began + 10_000_000 * tick: twin.advance(0.01) for tick in range(1, 21)}


@pytest.fixture(scope='module')
def sensed_robot(module_launch, probe):
    robot = Sensed(module_launch, probe, 'sensed', '-p imu.seed:=5 -p pressure.seed:=6')
    robot.trigger('step')
    probe.until(lambda: robot.odometry and robot.imu and robot.pressure and robot.joints, 'outputs')
    robot.wait_for_repeats()
    return robot


@pytest.fixture
def robot(sensed_robot):
    for name, value in (('imu.acceleration_noise', 0.02), ('imu.acceleration_bias', [0.0, 0.0, 0.0]),
                        ('joint_state_rate', 50.0), ('publish_fin_joints', False), ('pressure.noise', 20.0),
                        ('water.surface_height', 5.0)):
        assert sensed_robot.set_parameter(name, value).successful
    return sensed_robot


def latest(recording, count):
    return dict(zip(recording.stamps[-count:], recording[-count:]))


def xyz(vector):
    return [vector.x, vector.y, vector.z]


def at(state, stamp):
    """Return a twin's state at the time of the robot that it is the twin of."""
    return dataclasses.replace(state, time=stamp * 1e-9)


def test_each_reading_is_that_of_the_library_with_its_noise(robot):
    states = robot.swim()
    imu, pressure = latest(robot.imu, 20), latest(robot.pressure, 20)
    assert imu.keys() == states.keys() == pressure.keys()
    for stamp, state in states.items():
        reading = sensors.read_imu(sensors.Imu(seed=5), PARAMETERS, at(state, stamp))
        turned = imu[stamp].orientation
        assert [*xyz(turned), turned.w] == reading.orientation.tolist()
        assert xyz(imu[stamp].angular_velocity) == reading.angular_velocity.tolist()
        assert xyz(imu[stamp].linear_acceleration) == reading.specific_force.tolist()
        assert pressure[stamp].fluid_pressure == sensors.read_pressure(
            sensors.Pressure(seed=6), PARAMETERS, at(state, stamp))
        assert imu[stamp].header.frame_id == pressure[stamp].header.frame_id == 'base_link'


def test_noise_and_bias_change_live_and_the_covariances_with_them(robot):
    robot.swim()
    assert list(robot.imu[-1].linear_acceleration_covariance)[::4] == [0.02**2] * 3
    assert robot.pressure[-1].variance == 400.0
    for name, value in (('imu.acceleration_noise', 0.0), ('imu.acceleration_bias', [1.0, 0.0, 0.0]),
                        ('pressure.noise', 0.0), ('water.surface_height', 7.0)):
        assert robot.set_parameter(name, value).successful
    states = robot.swim()
    stamp, state = list(states.items())[-1]
    exact = sensors.read_imu(sensors.Imu(acceleration_noise=0.0), PARAMETERS, at(state, stamp)).specific_force
    assert xyz(latest(robot.imu, 20)[stamp].linear_acceleration) == (exact + [1.0, 0.0, 0.0]).tolist()
    np.testing.assert_array_equal(robot.imu[-1].linear_acceleration_covariance, 0.0)
    assert robot.pressure[-1].fluid_pressure == pytest.approx(
        101325.0 + 1000.0 * 9.81 * (7.0 - float(state.position[2])), rel=1e-14)
    assert robot.pressure[-1].variance == 0.0


@pytest.mark.parametrize(('rate', 'ticks'), [(50.0, 2), (100.0, 1), (20.0, 5), (1000.0, 1)])
def test_joint_states_are_those_of_the_library_at_a_rate_of_their_own(robot, rate, ticks):
    assert robot.set_parameter('joint_state_rate', rate).successful
    states = robot.swim()
    due = [stamp for stamp in states if stamp % (ticks * 10_000_000) == 0]
    robot.probe.until(lambda: robot.joints.stamps[-1] == due[-1], 'joint states')
    shown = [(stamp, message) for stamp, message in zip(robot.joints.stamps, robot.joints) if stamp >= min(states)]
    assert [stamp for stamp, _ in shown] == due
    for stamp, message in shown:
        assert message.name == joint_names(PARAMETERS, fins=False)
        assert message.header.frame_id == 'base_link'
        assert list(message.position) == states[stamp].rod_angles.ravel().tolist()
        assert list(message.velocity) == states[stamp].rod_rates.ravel().tolist()
        assert list(message.effort) == states[stamp].rod_torques.ravel().tolist()
    assert all(message.effort)


def test_with_publish_fin_joints_all_chains_are_there(robot):
    assert robot.set_parameter('publish_fin_joints', True).successful
    states = robot.swim()
    stamp, state = list(states.items())[-1]
    robot.probe.until(lambda: robot.joints.stamps[-1] == stamp, 'joint states')
    message = robot.joints[-1]
    assert message.name == joint_names(PARAMETERS, fins=True) and len(message.name) == 4 + 4 + 2 * 30 * 3
    assert list(message.position)[8:] == state.joint_angles.ravel().tolist()
    assert list(message.effort) == state.rod_torques.ravel().tolist() + [0.0] * (4 + 2 * 30 * 3)
    assert any(message.position)


def test_the_truth_has_no_noise(robot):
    states = robot.swim()
    for stamp, message in latest(robot.odometry, 20).items():
        assert xyz(message.twist.twist.linear) == states[stamp].twist[:3].tolist()
        assert not any(message.pose.covariance) and not any(message.twist.covariance)


EQUIPPED = {
    'imu.rate': 20.0, 'imu.frame': 'imu_link', 'imu.position': [0.1, -0.2, 0.05], 'imu.orientation': [0.1, 0.2, 3.0],
    'imu.acceleration_bias_walk': 0.1, 'imu.angular_velocity_bias_walk': 0.01, 'imu.seed': 7,
    'velocity.rate': 10.0, 'velocity.dropout': 0.4, 'velocity.seed': 8,
    'odom_noise.position': 0.1, 'odom_noise.orientation': 0.02, 'odom_noise.linear_velocity': 0.05,
    'odom_noise.angular_velocity': 0.01, 'odom_noise.seed': 9, 'publish_ned': True,
}


def settings():
    return Settings().replace(EQUIPPED.items())


def velocity_readings(states):
    """Return the readings of the velocity, without those that are missing, by stamp."""
    readings = {stamp: sensors.read_velocity(settings().velocity, state) for stamp, state in states.items()
                if stamp % 100_000_000 == 0}
    assert len(readings) == 20
    return {stamp: reading.tolist() for stamp, reading in readings.items() if reading is not None}


@pytest.fixture(scope='module')
def equipped(module_launch, probe):
    """The messages of a robot that swam for two seconds by topic and time, and the states of its twin by time."""
    arguments = ' '.join(f'-p {name}:={str(value).replace(" ", "").lower()}' for name, value in EQUIPPED.items())
    robot = LockstepRobot(module_launch, probe, 'equipped', f'-p start_paused:=true -p step_duration:=2.0 {arguments}')
    heard = {topic: probe.record(kind, f'/equipped/{topic}') for topic, kind in (
        ('imu/data', Imu), ('velocity', TwistWithCovarianceStamped), ('pose', PoseStamped), ('odom', Odometry),
        ('pose_ned', PoseStamped), ('odom_ned', Odometry))}
    probe.until(lambda: all(heard[topic] for topic in heard if topic != 'velocity'), 'the state at the start')
    assert robot.trigger('reset').success
    robot.command(SWIM)
    began, end = robot.now(), robot.step()
    twin = Simulator(PARAMETERS, state=dataclasses.replace(State.at_rest(PARAMETERS), time=began * 1e-9))
    twin.command(left=FinCommand(*SWIM[::2]), right=FinCommand(*SWIM[1::2]))
    states = {began + 10_000_000 * tick: twin.advance(0.01) for tick in range(1, 201)}
    readings = velocity_readings(states)
    probe.until(lambda: heard['velocity'].stamps[-1:] == [max(readings)] and all(
        recording.stamps[-1:] == [end] for topic, recording in heard.items() if topic != 'velocity'), 'the outputs')
    return {topic: {stamp: message for stamp, message in zip(recording.stamps, recording) if stamp > began}
            for topic, recording in heard.items()}, states


def test_a_mounted_imu_reads_at_its_rate_in_its_frame_what_the_library_reads(equipped):
    heard, states = equipped
    assert list(heard['imu/data']) == [stamp for stamp in states if stamp % 50_000_000 == 0]
    for stamp, message in heard['imu/data'].items():
        reading = sensors.read_imu(settings().imu, PARAMETERS, states[stamp])
        assert message.header.frame_id == 'imu_link'
        assert xyz(message.linear_acceleration) == reading.specific_force.tolist()
        assert xyz(message.angular_velocity) == reading.angular_velocity.tolist()
        assert [*xyz(message.orientation), message.orientation.w] == reading.orientation.tolist()


def test_the_velocity_comes_at_its_rate_but_for_missing_readings(equipped):
    heard, states = equipped
    expected = velocity_readings(states)
    assert {stamp: xyz(message.twist.twist.linear) for stamp, message in heard['velocity'].items()} == expected
    assert 0 < len(expected) < 20
    assert {message.header.frame_id for message in heard['velocity'].values()} == {'base_link'}


def test_the_odometry_has_its_noise_and_says_so_and_the_pose_is_the_truth(equipped):
    heard, states = equipped
    assert list(heard['odom']) == list(heard['pose']) == list(states)
    for stamp, state in states.items():
        reading, message = sensors.read_odometry(settings().odom_noise, state), heard['odom'][stamp]
        assert xyz(message.pose.pose.position) == reading.position.tolist()
        twist = message.twist.twist
        assert xyz(twist.linear) + xyz(twist.angular) == reading.twist.tolist()
        assert list(message.pose.covariance)[::7] == [0.1**2] * 3 + [0.02**2] * 3
        assert list(message.twist.covariance)[::7] == [0.05**2] * 3 + [0.01**2] * 3
        assert xyz(heard['pose'][stamp].pose.position) == state.position.tolist()


def test_with_publish_ned_pose_and_odometry_are_there_with_down_as_z(equipped):
    heard, states = equipped
    for stamp in states:
        (x, y, z), ned = xyz(heard['pose'][stamp].pose.position), heard['pose_ned'][stamp]
        assert ned.header.frame_id == 'odom_ned' and xyz(ned.pose.position) == [y, x, -z]
        (x, y, z), ned = xyz(heard['odom'][stamp].twist.twist.linear), heard['odom_ned'][stamp]
        assert ned.child_frame_id == 'base_link_frd' and xyz(ned.twist.twist.linear) == [x, -y, -z]

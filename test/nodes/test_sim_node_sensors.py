"""What the robot's sensors say on the topics: that of the library, at their rates, with the noise that is asked for."""

import dataclasses

import numpy as np
import pytest
from sensor_msgs.msg import FluidPressure, Imu, JointState

from evidence.harness.lockstep import LockstepRobot
from manta_sim_ros import sensors
from manta_sim_ros.dynamics import FinCommand, Parameters, Simulator
from manta_sim_ros.nodes.messages import joint_names

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
    heard = len(robot.joints)
    states = robot.swim()
    due = [stamp for stamp in states if stamp % (ticks * 10_000_000) == 0]
    robot.probe.until(lambda: robot.joints.stamps[-1] == due[-1], 'joint states')
    # the first one is of the reset
    assert robot.joints.stamps[heard + 1:] == due
    for stamp, message in zip(due, robot.joints[heard + 1:]):
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

"""The node says where the robot is with respect to the water, and warns once of what no robot does."""

import re

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import Odometry

from evidence.harness.lockstep import LockstepRobot

TURN = [0.7, 0.35, 0.8, 0.8, 0.7, 0.7]
PAUSED = '-p start_paused:=true -p rods.command_time_constant:=0.0 -r /diagnostics:=/turning/diagnostics'


def water(probe):
    """Return a function that gives level, message and values of the last status of the water, or None."""
    received = probe.record(DiagnosticArray, '/diagnostics')

    def last():
        found = [status for array in received for status in array.status if status.name.endswith(': water')]
        return (found[-1].level, found[-1].message) if found else None

    return last


def test_a_robot_that_is_put_above_the_surface_falls_back_and_diagnostics_say_so(launch, probe):
    launch('sim_node', '-p water.surface_height:=0.0 -p "initial_position:=[0.0, 0.0, 1000.0]"')
    last = water(probe)
    probe.until(lambda: last() is not None, 'diagnostics')
    assert last() == (DiagnosticStatus.WARN, 'in the air: the robot falls')
    odometry = probe.record(Odometry, 'odom')
    probe.until(lambda: odometry and odometry[-1].twist.twist.linear.z < -1.0, 'a fall')


def test_a_robot_whose_body_is_half_above_the_water_is_at_the_surface(launch, probe):
    launch('sim_node', '-p water.surface_height:=0.05 -p start_paused:=true')
    last = water(probe)
    probe.until(lambda: last() is not None, 'diagnostics')
    level, message = last()
    assert level == DiagnosticStatus.OK
    assert re.fullmatch(r'at the surface: (49|50) % of the body and 100 % of the fins are in the water', message)


def test_a_deep_robot_is_under_water(launch, probe):
    launch('sim_node', '')
    last = water(probe)
    probe.until(lambda: last() is not None, 'diagnostics')
    assert last() == (DiagnosticStatus.OK, 'under water')


@pytest.mark.parametrize(('arguments', 'warned'), [
    (PAUSED, True), (f'{PAUSED} -p fin.shear_modulus:=1000.0', False)], ids=['the paper', 'resistance to twist'])
def test_chordwise_instability_in_a_turn_is_warned_of_once(launch, probe, arguments, warned):
    robot = LockstepRobot(launch, probe, 'turning', arguments)
    robot.command(TURN)
    assert robot.set_parameter('step_duration', 25.0).successful
    with probe.record(DiagnosticArray, '/turning/diagnostics') as diagnostics:
        end = robot.step()
        probe.until(lambda: diagnostics.stamps.count(end) > 1, 'diagnostics, which come after such a warning')
    warnings = re.findall(r'\[WARN\] .* chordwise instability .*fin\.shear_modulus', robot.node.output)
    assert len(warnings) == warned
    assert 'ModelWarning' not in robot.node.output  # the library's own is not printed beside it


def test_added_mass_without_damping_in_roll_and_yaw_is_warned_of(launch, probe):
    node = launch('sim_node', '-p "body.added_mass:=[1.4, 2.1, 106.0, 1.15, 2.4, 0.01]"')
    probe.until(lambda: 'no damping in roll and yaw' in node.output, 'the warning')

"""The node warns of a time step that is too large for the gaits that it is commanded, once, with both numbers."""

import re

import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from std_msgs.msg import Float64MultiArray

from manta_sim_ros.dynamics import FinCommand, Parameters, largest_stable_step

SWIM = [0.7, 0.7, 0.6, 0.6, 0.7, 0.7]
FAST = [0.5, 0.5, 5.0, 5.0, 0.35, 0.35]
WARNING = re.compile(
    r'\[WARN\] .* solver\.time_step is (\S+) s, but the largest stable step of this gait is about (\S+) s')


@pytest.fixture
def robot(launch, probe):
    node = launch('sim_node', '-p solver.time_step:=0.004 -r __ns:=/stable -r /clock:=/stable/clock')
    node.commands = probe.node.create_publisher(Float64MultiArray, '/stable/fin_command', 10)
    probe.until(lambda: node.commands.get_subscription_count(), 'the node')
    yield node
    probe.node.destroy_publisher(node.commands)


def warned_of(robot, probe, doing):
    """Return the time step and the largest stable one of the first warning while something is done again and again."""
    probe.until(lambda: WARNING.search(robot.output), 'a warning of the step', doing=doing)
    return [float(number) for number in WARNING.search(robot.output).groups()]


def test_a_gait_beyond_the_largest_stable_step_is_warned_of_once(robot, probe):
    for _ in range(10):
        robot.commands.publish(Float64MultiArray(data=SWIM))
        probe.listen(0.1)
    assert 'solver.time_step' not in robot.output
    step, largest = warned_of(robot, probe, lambda: robot.commands.publish(Float64MultiArray(data=FAST)))
    gait = FinCommand(*FAST[::2])
    assert step == 0.004
    assert largest == pytest.approx(largest_stable_step(Parameters(), gait, gait), rel=0.1)  # two digits
    for _ in range(10):
        robot.commands.publish(Float64MultiArray(data=FAST))
        probe.listen(0.1)
    assert len(WARNING.findall(robot.output)) == 1
    assert 'StabilityWarning' not in robot.output  # the library's own is not printed beside it


def test_a_parameter_that_makes_the_step_too_large_is_warned_of(robot, probe):
    robot.commands.publish(Float64MultiArray(data=SWIM))
    value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=1e9)
    changed = Parameter(name='fin.youngs_modulus', value=value)
    response = probe.call(SetParameters, '/stable/manta_sim/set_parameters', parameters=[changed])
    assert response.results[0].successful
    step, largest = warned_of(robot, probe, None)
    assert step == 0.004
    gait = FinCommand(*SWIM[::2])
    stiff = Parameters().replace(fin={'youngs_modulus': 1e9})
    rest = FinCommand(amplitude=0.0, frequency=0.0, phase=0.0)  # if the parameter comes before the command
    assert any(largest == pytest.approx(largest_stable_step(stiff, known, known), rel=0.1) for known in (gait, rest))

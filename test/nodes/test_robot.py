"""The robot behind the topics, without any: what is put where, what goes on, what ends."""

import dataclasses

import numpy as np
import pytest

from evidence.scenarios import SWIM, assert_same_bits
from manta_sim_ros.dynamics import REST, FinCommand
from manta_sim_ros.nodes.parameters import Settings
from manta_sim_ros.nodes.robot import Robot

LEVEL = (0.0, 0.0, 0.0, 1.0)
TORQUE = (0.0, 0.0, 0.0, 1e6, 0.0, 0.0)
VARYING = [('water.current_deviation', (0.1, 0.1, 0.1))]


@pytest.fixture
def lines():
    return []


def made(lines, *values):
    return Robot(Settings().replace(values), lines.append, lines.append)


def test_a_new_pose_ends_a_wrench_that_would_go_on(lines):
    robot = made(lines, ('body_wrench_lifetime', 0.0))
    robot.set_external_wrench(body_wrench=(0.0, 2.0, 0.0, 0.0, 0.0, 0.0))
    assert robot.tick().twist[1] > 0.0 and robot.has_external_wrench
    robot.put((1.0, 2.0, 3.0), LEVEL)
    assert not robot.has_external_wrench
    state = robot.tick()
    np.testing.assert_array_equal(state.twist, 0.0)
    np.testing.assert_array_equal(state.position, (1.0, 2.0, 3.0))


def test_a_robot_that_is_put_with_a_twist_moves_with_it_at_once(lines):
    twist = np.array([0.5, 0.0, 0.1, 0.0, 0.0, 0.2])
    robot = made(lines)
    robot.tick()
    before = robot.state.time
    np.testing.assert_array_equal(robot.put((1.0, 2.0, 3.0), LEVEL, twist).twist, twist)
    assert robot.state.time == before and robot.tick().position[0] > 1.004
    np.testing.assert_array_equal(robot.put((1.0, 2.0, 3.0), LEVEL).twist, 0.0)


def test_a_robot_whose_base_is_fixed_is_not_put_with_a_twist(lines):
    robot = made(lines, ('solver.fixed_base', True))
    with pytest.raises(ValueError, match='but solver.fixed_base asks for zeros'):
        robot.put((1.0, 0.0, 0.0), LEVEL, np.ones(6))
    np.testing.assert_array_equal(robot.state.position, 0.0)


def test_many_steps_have_the_outputs_of_one_after_the_other(lines):
    robot, twin = made(lines), made(lines)
    for each in (robot, twin):
        each.command(SWIM, SWIM)
    states = list(robot.ticks(0.026, 3))
    single = [state for _ in range(3) for state in twin.ticks(0.026)]
    assert [state.time for state in states] == pytest.approx([
        0.01, 0.02, 0.026, 0.036, 0.046, 0.052, 0.062, 0.072, 0.078])
    for state, same in zip(states, single):
        assert_same_bits(state, same)
    assert len(states) == len(single)


def test_the_water_goes_on_as_it_is_at_a_new_pose_and_begins_again_at_a_reset(lines):
    robot = made(lines, *VARYING)
    for _ in range(5):
        before = robot.tick().current_deviation
    assert np.all(before != 0.0)
    np.testing.assert_array_equal(robot.put((0.0, 0.0, 0.0), LEVEL).current_deviation, before)
    np.testing.assert_array_equal(robot.reset().current_deviation, 0.0)


def test_a_divergence_puts_it_at_rest_in_water_that_goes_on_and_says_that_a_wrench_acted(lines):
    robot = made(lines, *VARYING)
    for _ in range(5):
        before = robot.tick()
    robot.set_external_wrench(body_wrench=TORQUE)
    state = robot.tick()
    assert robot.divergences == 1 and not robot.has_external_wrench
    (line,) = lines
    assert 'A body_wrench acted. The robot is put at rest where it was' in line
    assert state.time == pytest.approx(before.time + 0.01, abs=1e-12)
    np.testing.assert_array_equal(state.twist, 0.0)
    np.testing.assert_array_equal(state.current_deviation, before.current_deviation)


@pytest.mark.parametrize(('lifetime', 'steps'), [(0.154, 77), (0.155, 78), (0.002, 1), (0.0001, 1)])
def test_a_wrench_acts_in_every_step_that_begins_in_its_lifetime(lines, lifetime, steps):
    values = [('body_wrench_lifetime', lifetime), ('publish_rate', 500.0)]
    robot, twin = made(lines, *values), made(lines, *values)
    robot.set_external_wrench(world_wrench=(0.0, 0.0, 1.0, 0.1, 0.0, 0.0))
    for step in range(90):
        twin.end_external_wrench()
        if step < steps:
            twin.set_external_wrench(world_wrench=(0.0, 0.0, 1.0, 0.1, 0.0, 0.0))
        assert robot.has_external_wrench == (step < steps)
        assert_same_bits(robot.tick(), twin.tick())


def test_the_biases_stay_when_the_amplitudes_glide_to_zero(lines):
    robot = made(lines, ('command_timeout', 0.1))
    robot.command(dataclasses.replace(SWIM, front_bias=0.1, rear_bias=-0.05), SWIM)
    for _ in range(15):
        robot.tick()
    assert robot.timed_out
    left, right = robot.commands
    assert (left.amplitude, right.amplitude) == (0.0, 0.0)
    assert (left.front_bias, left.rear_bias, left.frequency) == (0.1, -0.05, SWIM.frequency)
    assert robot.commands != (REST, REST) and isinstance(left, FinCommand)

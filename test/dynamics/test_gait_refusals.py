"""A gait that the rods cannot follow is refused with its reason, and what ran before goes on."""

import dataclasses
import math

import numpy as np
import pytest

from evidence.scenarios import SWIM, TURN, assert_same_bits, sized
from manta_sim_ros.dynamics import FinCommand, Simulator
from manta_sim_ros.dynamics.command import check_gait, closure_angle
from manta_sim_ros.dynamics.parameters import Rods

OTHER = FinCommand(amplitude=0.3, frequency=0.4, phase=-0.2)
IMPOSSIBLE = FinCommand(amplitude=1.5, frequency=0.5, phase=3.0)
CYCLE = np.linspace(0.0, 2.0 * math.pi, 4001)


def refused(rods, side, command):
    try:
        check_gait(rods, side, command)
    except ValueError:
        return True
    return False


def largest_gap(rods, command):
    """Return the largest dy^2 + dz^2 [m^2] of the rod ends in 4000 samples of a cycle."""
    front_amplitude = math.asin(rods.rear_radius * math.sin(command.amplitude) / rods.front_radius)
    rear = command.amplitude * np.sin(CYCLE) + command.rear_bias
    front = front_amplitude * np.sin(CYCLE + command.phase) + command.front_bias
    dy = rods.front_radius * np.cos(front) - rods.rear_radius * np.cos(rear)
    dz = rods.front_radius * np.sin(front) - rods.rear_radius * np.sin(rear)
    return float(np.max(dy**2 + dz**2))


def any_command(random):
    return FinCommand(
        amplitude=random.uniform(0.0, 1.5), frequency=random.uniform(0.0, 2.0),
        phase=random.uniform(-2.0 * math.pi, 2.0 * math.pi),
        front_bias=random.choice([0.0, random.uniform(-1.5, 1.5)]),
        rear_bias=random.choice([0.0, random.uniform(-1.5, 1.5)]))


def small_simulator(**rods):
    """Return a simulator whose fin costs little and takes violent motion."""
    return Simulator(sized(2, 1).replace(
        rods=rods, water={'density': 0.0}, fin={'joint_damping': 10.0}, solver={'fixed_base': True}))


@pytest.mark.parametrize(('front_radius', 'rear_radius', 'support_length'), [
    (0.235, 0.185, 0.315), (0.2, 0.2, 0.1), (0.3, 0.2, 0.45), (0.2, 0.25, 0.3), (0.2, 0.2, 0.5),
])
def test_a_gait_is_refused_if_and_only_if_the_support_does_not_close_somewhere_in_its_cycle(
    front_radius, rear_radius, support_length,
):
    rods = Rods(front_radius=front_radius, rear_radius=rear_radius, support_length=support_length)
    random = np.random.default_rng(1)
    seen = {True: 0, False: 0}
    for _ in range(600):
        command = any_command(random)
        if rear_radius * math.sin(command.amplitude) >= front_radius:
            assert refused(rods, 0, command)
            continue
        gap = largest_gap(rods, command) / support_length**2
        if abs(gap - 1.0) < 1e-5:  # derived: the crest is (2 pi / 4000)^2 / 8 of the swing between two samples
            continue
        assert refused(rods, 0, command) == (gap > 1.0)
        seen[gap > 1.0] += 1
    assert seen[False] > 50
    assert seen[True] > 50 or support_length > front_radius + rear_radius  # a support that long always closes


def test_the_closure_angle_is_where_the_support_is_stretched():
    rods = Rods()
    bound = closure_angle(rods)
    for apart, closes in ((bound - 1e-6, True), (bound + 1e-6, False)):
        command = FinCommand(amplitude=0.0, frequency=0.0, phase=0.0, front_bias=apart / 2, rear_bias=-apart / 2)
        assert (largest_gap(rods, command) < rods.support_length**2) == closes
        assert refused(rods, 0, command) != closes
    assert closure_angle(Rods(front_radius=0.1, rear_radius=0.1, support_length=0.21)) == math.inf


def test_an_amplitude_that_the_front_rod_cannot_match_is_refused():
    rods = Rods(front_radius=0.185, rear_radius=0.2)
    highest = math.asin(0.185 / 0.2)
    check_gait(rods, 0, FinCommand(amplitude=highest - 1e-6, frequency=0.5, phase=0.0))
    with pytest.raises(ValueError, match=r'right amplitude is 1\.18\d* rad.*front_radius, 0\.185 m'):
        check_gait(rods, 1, FinCommand(amplitude=highest + 1e-6, frequency=0.5, phase=0.0))


@pytest.mark.parametrize(('left', 'right', 'invalid'), [
    (IMPOSSIBLE, OTHER, 'left'), (OTHER, IMPOSSIBLE, 'right'), (IMPOSSIBLE, IMPOSSIBLE, 'left'),
])
@pytest.mark.parametrize('time_constant', [0.0, 0.2])
def test_a_refused_command_leaves_both_gaits_running(left, right, invalid, time_constant):
    simulator, undisturbed = (small_simulator(command_time_constant=time_constant) for _ in range(2))
    for one in (simulator, undisturbed):
        one.command(left=SWIM, right=TURN)
        one.advance(0.5)
    with pytest.raises(ValueError) as refusal:
        simulator.command(left=left, right=right)
    message = str(refusal.value)
    assert message.startswith(f'{invalid} amplitude 1.5 rad with phase 3 rad and biases 0, 0 rad')
    assert f'{closure_angle(simulator.parameters.rods):.4g} rad' in message
    assert_same_bits(simulator.state, undisturbed.state)
    assert_same_bits(simulator.advance(0.5), undisturbed.advance(0.5))


@pytest.mark.parametrize('name', ['amplitude', 'frequency', 'phase', 'front_bias', 'rear_bias'])
@pytest.mark.parametrize('invalid', [math.nan, math.inf, -math.inf, 1e3, -1e3, 'fast', None, True, [0.1]])
def test_a_command_with_a_bad_value_is_refused_by_name(name, invalid):
    with pytest.raises(ValueError, match=f'^{name} is .* must be a number|^{name} is .* must be from'):
        FinCommand(**{'amplitude': 0.5, 'frequency': 0.6, 'phase': 0.7, name: invalid})


@pytest.mark.parametrize('invalid', [None, (0.5, 0.6, 0.7), {'amplitude': 0.5}])
def test_a_command_of_another_type_is_refused_with_its_side(invalid):
    with pytest.raises(ValueError, match='the right command is .* must be a FinCommand'):
        small_simulator().command(left=SWIM, right=invalid)


def test_a_gait_that_cannot_be_reached_from_the_present_one_is_refused():
    random = np.random.default_rng(2)
    found = 0
    for _ in range(120):
        one, other = any_command(random), any_command(random)
        simulator = small_simulator()
        if refused(simulator.parameters.rods, 0, one) or refused(simulator.parameters.rods, 0, other):
            continue
        for command in (dataclasses.replace(one, amplitude=0.0), one):
            simulator.command(left=SWIM, right=command)
            simulator.advance(4.0)  # 20 time constants: settled
        try:
            simulator.command(left=SWIM, right=other)
        except ValueError as error:
            found += 1
            assert str(error).startswith(f'right amplitude {other.amplitude:g} rad')
            assert 'cannot be reached from the present gait' in str(error)
            np.testing.assert_array_equal(simulator.state.gait_commands, [SWIM.as_array(), one.as_array()])
            # the way is what is impossible: without smoothing the same command is accepted
            at_once = small_simulator(command_time_constant=0.0)
            at_once.command(left=SWIM, right=one)
            at_once.command(left=SWIM, right=other)
    assert found >= 5


@pytest.mark.parametrize('front_radius', [0.235, 0.182])
def test_no_sequence_of_accepted_commands_opens_the_closure_or_yields_a_nan(front_radius):
    simulator = small_simulator(front_radius=front_radius)
    rods, bound = simulator.parameters.rods, closure_angle(simulator.parameters.rods)
    random = np.random.default_rng(3)
    accepted, largest = 0, 0.0
    for _ in range(3000):
        try:
            simulator.command(left=any_command(random), right=any_command(random))
        except ValueError:
            continue
        accepted += 1
        if accepted > 150:
            break
        for _ in range(random.integers(5, 60)):
            state = simulator.advance(0.01)  # which raises when a value is not finite
            apart = np.abs(state.rod_angles[:, 0] - state.rod_angles[:, 1]).max()
            assert apart < bound
            largest = max(largest, apart)
            gap = rods.front_radius * np.exp(1j * state.rod_angles[:, 0]) - rods.rear_radius * np.exp(
                1j * state.rod_angles[:, 1])
            assert np.all(np.abs(gap) < rods.support_length)
    assert accepted > 150 and largest > 0.9 * bound  # the bound was put to the test


def test_a_state_on_an_accepted_way_near_the_bound_can_be_restored():
    parameters = sized(2, 1)
    simulator = Simulator(parameters)
    at_rest = FinCommand(amplitude=0.0, frequency=0.0, phase=0.0)
    start = FinCommand(amplitude=0.7252553, frequency=0.0, phase=-2.6350949)
    simulator.command(left=start, right=at_rest)
    simulator.advance(4.0)
    simulator.command(
        left=FinCommand(amplitude=0.5396337, frequency=0.0, phase=5.7688464, front_bias=0.898417), right=at_rest)
    for _ in range(20):
        state = simulator.advance(0.002)
        assert Simulator(parameters, state=state).advance(0.002).time > state.time

"""The simulator keeps the promises of its interface, whatever it is asked."""

import copy
import dataclasses
import inspect
import math

import numba
import numpy as np
import pytest

from evidence.scenarios import SWIM, TURN, assert_same_bits, bits, sized
from manta_sim_ros import dynamics
from manta_sim_ros.dynamics import FinCommand, Parameters, Simulator, State, fin_dynamics


def swimming(parameters, time=0.5):
    simulator = Simulator(parameters)
    simulator.command(left=SWIM, right=TURN)
    simulator.advance(time)
    return simulator


def test_the_library_has_the_names_and_arguments_of_the_interface():
    assert {'FinCommand', 'Parameters', 'Simulator', 'State', 'fin_dynamics'} <= set(dynamics.__all__)
    assert list(inspect.signature(FinCommand).parameters) == [
        'amplitude', 'frequency', 'phase', 'front_bias', 'rear_bias']
    assert list(inspect.signature(fin_dynamics).parameters) == [
        'parameters', 'side', 'rod_motion', 'joint_angles', 'joint_rates', 'body_twist', 'body_acceleration']
    assert FinCommand(0.5, 0.6, 0.7) == FinCommand(0.5, 0.6, 0.7, front_bias=0.0, rear_bias=0.0)
    with pytest.raises(TypeError):
        Simulator().command(SWIM, SWIM)  # left and right are said by name


def test_the_default_parameters_and_state_are_the_defaults():
    assert Simulator().parameters == Parameters()
    assert_same_bits(Simulator().state, State.at_rest(Parameters()))


def test_advance_returns_the_state_that_the_simulator_then_has():
    simulator = swimming(sized(4, 2))
    before = simulator.state
    after = simulator.advance(0.1)
    assert after is simulator.state
    assert after.time == pytest.approx(0.6, abs=1e-12) and before.time == pytest.approx(0.5, abs=1e-12)
    assert bits(after)['joint_angles'] != bits(before)['joint_angles']


def test_no_steps_change_nothing():
    simulator = swimming(sized(4, 2))
    before = simulator.state
    assert_same_bits(simulator.advance(0.0), before)


@pytest.mark.parametrize('rods', [False, True])
def test_the_state_after_a_command_is_a_whole_read_only_one_and_that_before_stays(rods):
    simulator = swimming(sized(4, 2).replace(water={'current_deviation': (0.1, 0.1, 0.1)}))
    before = simulator.state
    had = copy.deepcopy(before)
    if rods:
        simulator.command_rods(left=[0.1, 0.1], right=[0.2, 0.2])
    else:
        simulator.command(left=TURN, right=SWIM)
    after = simulator.state
    assert_same_bits(before, had)
    assert_same_bits(dataclasses.replace(after), after)  # its values are valid
    assert bits(after)['gait_commands'] != bits(before)['gait_commands'] and after.servos is rods
    assert not any(array.flags.writeable for array in vars(after).values() if isinstance(array, np.ndarray))
    assert_same_bits(Simulator(simulator.parameters, after).advance(0.1), simulator.advance(0.1))
    assert_same_bits(before, had)


def test_a_command_changes_no_motion_before_the_next_step():
    simulator = swimming(sized(4, 2))
    before = bits(simulator.state)
    simulator.command(left=TURN, right=SWIM)
    changed = {name for name, value in bits(simulator.state).items() if value != before[name]}
    assert changed == {'gait_commands'}


@pytest.mark.parametrize('duration', [
    -0.002, -1e-9, math.nan, math.inf, -math.inf, 0.001, 0.003, 0.0020001, 1.0005, 100.001,
    1e300, 10**400, 'a', None, True,
])
def test_a_duration_that_is_no_whole_number_of_steps_is_refused_and_changes_nothing(duration):
    simulator = swimming(sized(4, 2))
    before = simulator.state
    with pytest.raises(ValueError, match='^duration is'):
        simulator.advance(duration)
    assert simulator.state is before


def test_durations_with_the_rounding_of_decimal_fractions_are_whole():
    simulator = Simulator(sized(4, 2))
    for duration, steps in ((0.1 + 0.2, 150), (0.7, 350), (1.1, 550), (0.002 * 3, 3), (100.0, 50000)):
        before = simulator.state.step_count
        assert simulator.advance(duration).step_count - before == steps


def test_time_has_no_drift():
    parameters = sized(2, 1).replace(solver={'time_step': 0.0011})
    simulator = Simulator(parameters)
    for _ in range(1000):
        simulator.advance(100 * 0.0011)
    assert simulator.state.time == 100_000 * 0.0011
    late = Simulator(parameters, state=dataclasses.replace(State.at_rest(parameters), time=1e6))
    for _ in range(1000):
        late.advance(0.0011)
    assert late.state.time == 1e6 + 1000 * 0.0011


def test_reset_goes_to_rest_or_to_the_given_state():
    simulator = swimming(sized(4, 2))
    before = simulator.state
    assert_same_bits(simulator.reset(), State.at_rest(sized(4, 2)))
    assert_same_bits(simulator.state, State.at_rest(sized(4, 2)))
    assert_same_bits(simulator.reset(before), before)
    assert_same_bits(simulator.state, before)


@pytest.mark.parametrize(('change', 'reason'), [
    ({'joint_angles': np.zeros((2, 4, 3)), 'joint_rates': np.zeros((2, 4, 3))}, 'state.joint_angles has shape'),
    ({'joint_angles': np.zeros((2, 5, 2)), 'joint_rates': np.zeros((2, 5, 2))}, 'state.joint_angles has shape'),
    ({'joint_angles': np.full((2, 4, 2), math.pi)}, 'state.joint_angles reach 3.14159 rad, but must stay below pi'),
    ({'joint_angles': np.full((2, 4, 2), -4.0)}, 'state.joint_angles reach 4 rad'),
    ({'gait_commands': [[0.5, 0.6, 0.7, 0.0, 0.0], [2.0, 0.6, 0.7, 0.0, 0.0]]}, 'amplitude is 2.0'),
    ({'gait_commands': [[0.5, 0.6, 0.7, 0.0, 0.0], [1.5, 0.6, 3.0, 0.0, 0.0]]}, 'right amplitude 1.5 rad'),
    ({'gait': [[1.5, 0.6, 3.0, 0.0, 0.0], [0.5, 0.6, 0.7, 0.0, 0.0]]}, 'left state.gait .* apart in the cycle'),
])
def test_a_state_that_does_not_fit_is_refused_and_the_simulator_stays_where_it_was(change, reason):
    simulator = swimming(sized(4, 2))
    before = simulator.state
    invalid = dataclasses.replace(before, **change)
    with pytest.raises(ValueError, match=reason):
        simulator.reset(invalid)
    assert simulator.state is before
    with pytest.raises(ValueError, match=reason):
        Simulator(sized(4, 2), state=invalid)


@pytest.mark.parametrize('quantity', ['twist', 'acceleration'])
def test_a_fixed_base_refuses_a_state_in_motion(quantity):
    parameters = sized(4, 2, solver={'fixed_base': True})
    moving = dataclasses.replace(State.at_rest(parameters), **{quantity: [0.0, 0.0, 0.5, 0.0, 0.0, 0.0]})
    with pytest.raises(ValueError, match='0.5.*solver.fixed_base'):
        Simulator(parameters, state=moving)


def test_a_fixed_base_stays_where_it_is_while_the_fins_push():
    parameters = sized(5, 3).replace(solver={'fixed_base': True}, water={'current': (0.2, 0.1, 0.0)})
    start = dataclasses.replace(
        State.at_rest(parameters), position=(1.0, 2.0, 3.0), orientation=np.array([1.0, 2.0, 3.0, 4.0]) / 30**0.5)
    simulator = Simulator(parameters, state=start)
    simulator.command(left=SWIM, right=TURN)
    for _ in range(5):
        state = simulator.advance(0.5)
        np.testing.assert_array_equal(state.position, start.position)
        np.testing.assert_array_equal(state.orientation, start.orientation)
        np.testing.assert_array_equal(state.twist, 0.0)
        np.testing.assert_array_equal(state.acceleration, 0.0)
        assert np.linalg.norm(state.wrench) > 1.0


def test_every_parameter_has_an_effect():
    def bits_after_a_swim(parameters):
        # turned, with a current, and moving where it can: then everything acts
        start = dataclasses.replace(
            State.at_rest(parameters), orientation=np.array([0.1, 0.2, 0.3, 0.9]) / 0.95**0.5,
            twist=np.full(6, 0.0 if parameters.solver.fixed_base else 0.1))
        simulator = Simulator(parameters, state=start)
        simulator.command(left=SWIM, right=TURN)
        return bits(simulator.advance(0.24))

    alone = sized(4, 2).replace(water={'current': (0.1, 0.2, 0.3), 'current_deviation': (0.1, 0.2, 0.3)})
    together = alone.replace(solver={'coupling': 'monolithic'})
    assert bits_after_a_swim(alone)['position'] != bits_after_a_swim(together)['position']
    base = together.replace(
        water={'added_mass_coefficient': 0.5}, fin={'shear_modulus': 1e6, 'twist_damping': 1e-3})
    reference = bits_after_a_swim(base)
    for group, values in dataclasses.asdict(base).items():
        for name, value in values.items():
            if name in ('coupling', 'surface_height', 'servo_time_constant', 'servo_rate_limit'):
                # with added mass there is no choice; sensors feel the depth; servos are not at work
                continue
            if isinstance(value, tuple):
                others = [value[:axis] + (1.001 * value[axis] + 1e-4,) + value[axis + 1:]
                          for axis in range(len(value))]
            else:
                changes = {int: lambda v: v + 1, bool: lambda v: not v, float: lambda v: 0.75 * v + 1e-4}
                others = [changes[type(value)](value)]
            for other in others:
                result = bits_after_a_swim(base.replace(**{group: {name: other}}))
                assert any(result[part] != reference[part] for part in ('position', 'orientation', 'twist')), (
                    f'{group}.{name} = {other}')


@pytest.mark.parametrize('coupling', [dynamics.SEQUENTIAL, dynamics.MONOLITHIC])
def test_the_kernel_gets_values_of_the_same_types_in_all_simulators(monkeypatch, coupling):
    """In a call, nothing looks at the types."""
    types, whole = [], Parameters().replace(
        fin={'chains': np.int32(3), 'span': 1, 'joint_damping': 0}, rods={'rear_motor_position': [0, -1, 0]},
        body={'mass': 20, 'inertia': np.array([1, 2, 2])}, water={'current': (0, 0, 0), 'density': np.int64(1000)},
        solver={'coupling': coupling, 'fixed_base': True, 'time_step': np.float32(0.001)})

    def code(*arguments):
        types.append(tuple(map(numba.typeof, arguments)))
        return 1, 0, 0, 0

    monkeypatch.setattr('manta_sim_ros.dynamics.simulator._advance', {coupling: code})
    for parameters in (sized(12, 3, solver={'coupling': coupling}), whole):
        step = parameters.solver.time_step
        for simulator in (Simulator(parameters), copy.deepcopy(Simulator(parameters))):
            simulator.advance(step)
            simulator.advance(np.float64(step), current=np.zeros(3, np.float32), body_wrench=[0, 0, 0, 0, 0, 1])
            simulator.command_rods(left=(0, 0), right=(0, 0))
            simulator.advance(step)
    assert len(types) == 12 and len(set(types)) == 1

"""Each robot of a batch moves as it moves alone, and what goes wrong with one does not touch the others."""

import dataclasses
import re
import signal
import sys
import threading
import time
import warnings

import numba
import numpy as np
import pytest

from evidence.scenarios import OTHER_BODY, SOFT_TWIST, STATE_FIELDS, SWIM, TURN, WATER_OF_BODY, bits, sized
from manta_sim_ros.dynamics import (
    MONOLITHIC,
    REST,
    DivergenceError,
    FinCommand,
    ModelWarning,
    Simulator,
    StabilityWarning,
    State,
    simulate_batch,
)
from manta_sim_ros.dynamics._kernels import packed
from manta_sim_ros.dynamics._kernels.compilation import KERNEL_OPTIONS, kernel

ROUNDING = 1e-12
"""Largest difference of a robot in a batch and alone, relative to the largest entry of a field: interface.md."""

SMALL = sized(4, 2)
STIFF = 1e9
"""Young's modulus [Pa] with which a robot diverges, but not at once."""

UNSTABLE = SMALL.replace(solver={'time_step': 0.016}, fin={'links': 3})


def alone(parameters, state, pair, duration):
    """Return the state of a robot that a `Simulator` advances."""
    simulator = Simulator(parameters, state=state)
    if pair is not None:
        simulator.command(left=pair[0], right=pair[1])
    return simulator.advance(duration)


def assert_close_states(actual, desired, tolerance=ROUNDING):
    """Assert that two states agree, each field relative to its largest entry, or to 1 if that is larger."""
    for name in STATE_FIELDS:
        one, other = np.asarray(getattr(actual, name)), np.asarray(getattr(desired, name))
        scale = max(1.0, np.abs(other).max())
        np.testing.assert_allclose(one, other, rtol=0.0, atol=tolerance * scale, err_msg=name)


def swimming(parameters, left=SWIM, right=TURN, duration=0.4):
    """Return the state of a robot that swam for a while from rest."""
    return alone(parameters, State.at_rest(parameters), (left, right), duration)


MIXED = [
    sized(12, 3),
    sized(12, 3, fin={'span': 0.4}),
    sized(12, 3, fin={'youngs_modulus': 3e6, 'joint_damping': 0.01}, rods={'command_time_constant': 0.1}),
    sized(12, 3, body={'mass': 25.0}),
    sized(12, 3, **OTHER_BODY),
    sized(12, 3, water={'current': (0.2, -0.1, 0.05)}),
    sized(12, 3, rods={'front_radius': 0.2, 'support_length': 0.5}),
    sized(12, 3, solver={'fixed_base': True}),
    sized(12, 3, fin=SOFT_TWIST, body=WATER_OF_BODY, water={'current': (0.1, 0.2, -0.1)}),
    sized(12, 3, fin=SOFT_TWIST, body={**WATER_OF_BODY, 'net_buoyancy': 3.0}),
    sized(12, 3, fin={**SOFT_TWIST, 'shear_modulus': 2e5}),
    sized(12, 3, fin=SOFT_TWIST),
    sized(12, 3, water={'current_deviation': (0.1, 0.1, 0.1), 'current_seed': 3}),
    sized(12, 3, water={'surface_height': 0.05}),
    sized(12, 3, solver={'time_step': 0.001}),
    sized(12, 3, solver={'coupling': MONOLITHIC}, water={'added_mass_coefficient': 1.0}),
    *[sized(*size) for size in [(2, 1)] * 5 + [(7, 4)] * 9 + [(17, 3)]],
]
MIXED += [each for each in MIXED if each.fin.shear_modulus > 0.0]  # enough of a kind to be simulated together
PAIRS = [(SWIM, SWIM), None, (TURN, SWIM), (SWIM, REST), (TURN, TURN)]


def test_each_robot_moves_as_alone():
    rng = np.random.default_rng(7)
    order = rng.permutation(len(MIXED))  # robots of one kind are not side by side
    parameters = [MIXED[index] for index in order]
    states = [swimming(each, duration=0.1 * (1 + index % 4)) for index, each in enumerate(parameters)]
    pairs = [PAIRS[index % len(PAIRS)] for index in range(len(states))]
    results = simulate_batch(parameters, states, pairs, 0.5)
    assert len(results) == len(states)
    for values, state, pair, result in zip(parameters, states, pairs, results):
        assert_close_states(result, alone(values, state, pair, 0.5))


def test_parameters_and_commands_may_be_of_all_robots():
    states = [swimming(SMALL, duration=0.1 * count) for count in range(9)]
    for result, state in zip(simulate_batch(SMALL, states, None, 0.1), states):
        assert_close_states(result, alone(SMALL, state, None, 0.1))
    assert simulate_batch(SMALL, [], None, 0.1) == []
    assert [bits(state) for state in simulate_batch(SMALL, states, None, 0.0)] == [bits(state) for state in states]


def test_states_at_intervals_end_with_the_last_state():
    parameters = [SMALL] * 8 + [SMALL.replace(solver={'time_step': 0.001})]
    states = [swimming(SMALL)] * 9
    at_end = simulate_batch(parameters, states, None, 0.3)
    for values, state, record, last in zip(parameters, states, simulate_batch(
            parameters, states, None, 0.3, every=0.1), at_end):
        assert [one.time for one in record] == pytest.approx([0.5, 0.6, 0.7])
        assert bits(record[-1]) == bits(last)
        assert_close_states(record[0], alone(values, state, None, 0.1))
    assert simulate_batch(SMALL, states[:1], None, 0.0, every=0.1) == [[]]


def test_a_batch_goes_on_from_its_own_states_to_the_last_bit():
    states = [swimming(sized(12, 3), duration=0.1 * count) for count in range(8)]
    halfway = simulate_batch(sized(12, 3), states, None, 0.2)
    for one, other in zip(simulate_batch(sized(12, 3), halfway, None, 0.2),
                          simulate_batch(sized(12, 3), states, None, 0.4)):
        assert bits(one) == bits(other)


def test_a_robot_that_rises_to_the_surface_on_the_way_does_not_touch_the_others():
    states = [swimming(SMALL, duration=0.1 * count) for count in range(8)]
    states[3] = dataclasses.replace(
        states[3], position=np.array([0.0, 0.0, 4.2]), twist=np.array([0.0, 0.0, 2.0, 0.0, 0.0, 0.0]))
    for state, record in zip(states, simulate_batch(SMALL, states, None, 0.8, every=0.1)):
        assert_close_states(record[-1], alone(SMALL, state, None, 0.8))


@pytest.mark.filterwarnings('ignore::manta_sim_ros.dynamics.StabilityWarning')
def test_a_robot_that_diverges_has_its_error_and_does_not_touch_the_others():
    stable = sized(4, 3)
    stiff = stable.replace(fin={'youngs_modulus': 1e10})
    free = stable.replace(fin={'youngs_modulus': 0.0, 'joint_damping': 0.0}, water={'density': 0.0})
    rates = State.at_rest(free).joint_rates.copy()
    rates[1, 2, 0] = 1700.0  # [rad/s], more than pi in a step
    thrown = dataclasses.replace(State.at_rest(free), joint_rates=rates)
    fast = dataclasses.replace(State.at_rest(stable), twist=np.array([1e4, 0.0, 0.0, 0.0, 0.0, 0.0]))
    parameters = [stable, stiff, stable, stable, free, *[stable] * 4]
    states = [State.at_rest(stable)] * 3 + [fast, thrown] + [State.at_rest(stable)] * 4
    commands = [(SWIM, SWIM), (SWIM, REST), (TURN, SWIM), (SWIM, REST), None, *[(REST, SWIM)] * 4]
    results = simulate_batch(parameters, states, commands, 0.8)
    for index, (values, state, pair, result) in enumerate(zip(parameters, states, commands, results)):
        if index in (1, 3, 4):
            with pytest.raises(DivergenceError) as error:
                alone(values, state, pair, 0.8)
            assert type(result) is DivergenceError and str(result) == str(error.value)
        else:
            assert_close_states(result, alone(values, state, pair, 0.8))
    record = simulate_batch(parameters, states, commands, 0.8, every=0.2)
    assert type(record[4]) is DivergenceError and len(record[5]) == 4


@pytest.mark.parametrize('arguments, message', [
    ((SMALL, State.at_rest(SMALL), None, 0.1), r'states is State\(.*, but must be a sequence of States'),
    ((3, [State.at_rest(SMALL)], None, 0.1), 'parameters is 3, but must be a sequence of Parameters'),
    (([SMALL], [State.at_rest(SMALL)] * 2, None, 0.1), 'parameters has 1 entries, but must have one for each of 2'),
    ((SMALL, [State.at_rest(SMALL)] * 3, (SWIM, SWIM), 0.1), 'commands has 2 entries, .* of 3 robots'),
    ((SMALL, [State.at_rest(SMALL)] * 2, (SWIM, SWIM), 0.1), 'robot 0: commands are FinCommand'),
    ((SMALL, [State.at_rest(SMALL), State.at_rest(sized(5, 2))], None, 0.1), r'robot 1: state.joint_angles has shape'),
    ((SMALL, [State.at_rest(SMALL)] * 2, [None, (SWIM, FinCommand(1.5, 1.0, 3.0))], 0.1), 'robot 1: right amplitude'),
    (([SMALL, SMALL.replace(solver={'time_step': 0.003})], [State.at_rest(SMALL)] * 2, None, 0.1),
     r'robot 1: duration is 0.1 s, but must be a whole number of steps of solver.time_step, 0.003 s'),
    ((SMALL, [State.at_rest(SMALL)], None, -0.1), 'robot 0: duration is -0.1, but must be a number from 0 to'),
], ids=range(9))
def test_bad_input_is_refused_by_the_index_of_the_robot(arguments, message):
    with pytest.raises(ValueError, match=message):
        simulate_batch(*arguments)


@pytest.mark.parametrize('every, message', [
    (0.0, 'robot 0: every is 0.0 s, but must be above 0 s'),
    (0.003, 'robot 0: every is 0.003 s, but must be a whole number of steps'),
    (0.04, 'robot 0: duration is 0.1 s, but must be a multiple of every, 0.04 s'),
])
def test_bad_intervals_are_refused(every, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        simulate_batch(SMALL, [State.at_rest(SMALL)], None, 0.1, every=every)


def test_nothing_is_simulated_before_all_is_checked(monkeypatch):
    monkeypatch.setattr(Simulator, 'advance', None)
    with pytest.raises(ValueError, match='robot 30: right amplitude'):
        simulate_batch(
            SMALL, [State.at_rest(SMALL)] * 31, [(SWIM, SWIM)] * 30 + [(SWIM, FinCommand(1.5, 1.0, 3.0))], 0.1)


def test_a_warning_is_given_once_for_all_robots():
    undamped = SMALL.replace(body={'added_mass': (5.0, 20.0, 50.0, 0.2, 0.6, 0.4)})
    parameters = [SMALL, UNSTABLE, undamped, UNSTABLE, UNSTABLE]
    states = [State.at_rest(each) for each in parameters]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter('always')
        simulate_batch(parameters, states, [(SWIM, SWIM)] * 5, 0.016)
    step, body = caught
    assert step.category is StabilityWarning
    assert re.match('robot 1: solver.time_step is .*2 more robots', str(step.message))
    assert body.category is ModelWarning and re.match('robot 2: body.added_mass is', str(body.message))
    assert 'more robots' not in str(body.message)
    assert step.filename == body.filename == __file__


def test_a_warning_of_the_motion_is_given_after_it():
    turning = sized(30, 2, fin={'youngs_modulus': 1e6})
    fast = dataclasses.replace(State.at_rest(turning), twist=np.array([3.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    with pytest.warns(ModelWarning, match='robot 0: the fins have chordwise instability.*and 3 more robots'):
        simulate_batch(turning, [fast] * 4, [(SWIM, REST)] * 4, 0.002)


def test_other_threads_run_meanwhile():
    ticks = []
    done = threading.Event()

    def tick():
        while not done.is_set():
            ticks.append(time.monotonic())
            time.sleep(0.001)

    states = [State.at_rest(SMALL)] * 8
    simulate_batch(SMALL, states, [(SWIM, SWIM)] * 8, 0.1)  # compiled
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-4)
    thread = threading.Thread(target=tick)
    thread.start()
    try:
        simulate_batch(SMALL, states, [(SWIM, SWIM)] * 8, 200.0)  # 8e5 steps
    finally:
        done.set()
        thread.join()
        sys.setswitchinterval(interval)
    assert len(ticks) > 10  # a thread that must wait has one or two


@pytest.mark.parametrize('cores', [1, 3])
def test_the_number_of_cores_does_not_matter(monkeypatch, cores):
    parameters = [sized(12, 3), sized(12, 3, fin={'span': 0.4})] * 5
    states = [State.at_rest(each) for each in parameters]
    commands = [(SWIM, TURN)] * 10
    expected = simulate_batch(parameters, states, commands, 0.1)
    monkeypatch.setattr('manta_sim_ros.dynamics.batch._cores', lambda: cores)
    for one, other in zip(simulate_batch(parameters, states, commands, 0.1), expected):
        assert bits(one) == bits(other)


@pytest.mark.filterwarnings('ignore::manta_sim_ros.dynamics.StabilityWarning')
def test_the_length_of_a_turn_does_not_matter(monkeypatch):
    parameters = [sized(12, 3)] * 7 + [
        sized(12, 3, fin={'youngs_modulus': STIFF}), sized(12, 3, solver={'coupling': MONOLITHIC}),
        sized(12, 3, water={'current_deviation': (0.1, 0.1, 0.1), 'current_seed': 3}), sized(12, 3)]
    states = [State.at_rest(each) for each in parameters]
    servos = Simulator(parameters[-1])
    servos.command_rods(left=(0.3, 0.2), right=(0.1, -0.1))
    states[-1] = servos.state
    commands = [(SWIM, TURN)] * (len(states) - 1) + [None]

    def results():
        return simulate_batch(parameters, states, commands, 0.2, every=0.1)

    expected = results()
    monkeypatch.setattr('manta_sim_ros.dynamics.batch.LINK_STEPS_IN_TURN', 8 * 2 * 12 * 3)  # one step of 8
    for record, before in zip(results(), expected):
        if type(before) is DivergenceError:
            assert str(record) == str(before)
        else:
            assert [bits(state) for state in record] == [bits(state) for state in before]
    assert [type(record) is DivergenceError for record in expected] == [False] * 7 + [True] + [False] * 3
    assert float(str(expected[7]).split()[1]) > 5 * SMALL.solver.time_step  # after some turns


IN_TURN = 10
TURNS_OF = [SMALL.replace(body={'mass': mass}) for mass in (20.0, 21.0, 22.0) for _ in range(8)]
"""Parameters of robots that are simulated in three blocks."""


@pytest.fixture
def one_core(monkeypatch):
    """Let one core advance `TURNS_OF` in turns of `IN_TURN` steps, and return a function that sets what a turn does."""
    monkeypatch.setattr('manta_sim_ros.dynamics.batch._cores', lambda: 1)
    monkeypatch.setattr('manta_sim_ros.dynamics.batch.LINK_STEPS_IN_TURN', IN_TURN * 8 * 2 * 4 * 2)
    return lambda turn: monkeypatch.setattr(packed, 'advance', turn)


def advance_in_blocks(turns):
    """Advance the robots of `TURNS_OF` by so many turns."""
    duration = turns * IN_TURN * SMALL.solver.time_step
    return simulate_batch(TURNS_OF, [State.at_rest(SMALL)] * len(TURNS_OF), None, duration)


def test_blocks_take_turns_so_that_all_cores_end_together(one_core):
    advance, turns = packed.advance, []

    def recorded(pack, steps):
        turns.append((pack.bodies.values[0, 0], steps))  # the mass
        return advance(pack, steps)

    one_core(recorded)
    advance_in_blocks(3)
    assert turns == [(20.0, IN_TURN), (21.0, IN_TURN), (22.0, IN_TURN)] * 3


def test_a_signal_ends_a_batch_after_a_turn(one_core):
    def end(signum, frame):
        raise InterruptedError

    turns, most = [], 10**5

    def interrupted(pack, steps):
        turns.append(steps)
        if len(turns) == 5:
            signal.pthread_kill(threading.main_thread().ident, signal.SIGUSR1)
        time.sleep(1e-4)  # all turns would take more than half a minute
        return -1

    one_core(interrupted)
    before = signal.signal(signal.SIGUSR1, end)
    try:
        with pytest.raises(InterruptedError):
            advance_in_blocks(most)
    finally:
        signal.signal(signal.SIGUSR1, before)
    assert 5 <= len(turns) < 10_000


def test_what_goes_wrong_on_a_core_ends_the_others_and_is_not_lost(monkeypatch, one_core):
    turns, most = [], 10**5

    def failing(pack, steps):
        turns.append(steps)
        if threading.current_thread().name.endswith('_1'):  # not the one that is waited for first
            raise IndexError('broken')
        time.sleep(1e-4)
        return -1

    one_core(failing)
    monkeypatch.setattr('manta_sim_ros.dynamics.batch._cores', lambda: 2)
    with pytest.raises(IndexError, match='broken'):
        advance_in_blocks(most)
    assert len(turns) < 10_000


def test_no_more_than_some_blocks_are_begun_before_others_end(monkeypatch, one_core):
    monkeypatch.setattr('manta_sim_ros.dynamics.batch.BLOCKS_IN_ROTATION', 1)
    advance, masses = packed.advance, []

    def recorded(pack, steps):
        masses.append(pack.bodies.values[0, 0])
        return advance(pack, steps)

    one_core(recorded)
    advance_in_blocks(3)
    assert masses == [20.0, 21.0, 20.0, 21.0, 20.0, 21.0, 22.0, 22.0, 22.0]


@pytest.mark.filterwarnings('error')
def test_no_warning_comes_of_a_motion_within_an_interval(monkeypatch):
    monkeypatch.setattr('manta_sim_ros.dynamics.batch.LINK_STEPS_IN_TURN', 20_000)  # 20 steps of 8 robots, 166 of one
    turning = sized(30, 2, fin={'youngs_modulus': 1e6})
    slow = FinCommand(0.1, 0.2, 0.5), FinCommand(0.05, 0.2, 0.5)
    fast = dataclasses.replace(State.at_rest(turning), twist=np.array([3.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    assert bits(simulate_batch(turning, [fast], [slow], 20.0)[0]) == bits(alone(turning, fast, slow, 20.0))
    assert len(simulate_batch(turning, [fast] * 8, [slow] * 8, 20.0)) == 8


def test_robots_whose_rods_follow_servos_move_as_alone():
    simulator = Simulator(SMALL)
    simulator.command_rods(left=(0.3, 0.2), right=(0.1, -0.1))
    state = simulator.advance(0.02)
    expected = simulator.advance(0.1)
    for result in simulate_batch(SMALL, [state] * 9, None, 0.1):
        assert bits(result) == bits(expected)


def test_robots_of_one_kind_are_simulated_together(monkeypatch):
    monkeypatch.setattr(Simulator, 'advance', None)
    states = [State.at_rest(SMALL)] * 13
    assert all(state.time == 0.1 for state in simulate_batch(SMALL, states, [(SWIM, SWIM)] * 13, 0.1))


def test_a_kernel_keeps_its_bits_when_it_is_first_compiled_for_a_batch():
    @kernel
    def fused(a, b, c):
        return a * b + c

    @numba.njit(**{**KERNEL_OPTIONS, 'fastmath': {'contract'}})
    def caller(a, b, c):
        return fused(a, b, c)

    a = 1.0 + 2.0**-30
    assert caller(a, a, -(a * a)) == 0.0  # 2^-60 if product and sum were contracted

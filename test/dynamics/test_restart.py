"""The same commands give the same bits: in one run or two, after a save, in another process."""

import copy
import pickle

import numpy as np
import pytest

from evidence.scenarios import (
    SOFT_TWIST,
    STATE_FIELDS,
    SWIM,
    TURN,
    WATER_OF_BODY,
    assert_same_bits,
    in_transition,
    run_python,
    sized,
)
from manta_sim_ros.dynamics import Simulator
from manta_sim_ros.dynamics import simulator as simulator_module

PARAMETERS = sized(17, 3, water={'current': (0.1, 0.2, 0.3)})

SWIM_ON = """
import hashlib, pickle, sys
import numpy as np
from manta_sim_ros.dynamics import FinCommand, Simulator

with open(sys.argv[1], 'rb') as file:
    parameters, state, left, right, duration = pickle.load(file)
simulator = Simulator(parameters, state=state)
simulator.command(left=left, right=right)
state = simulator.advance(duration)
digest = hashlib.sha256()
for name in sorted(vars(state)):
    digest.update(name.encode() + np.asarray(getattr(state, name)).tobytes())
print(digest.hexdigest())
"""


@pytest.mark.parametrize('groups', [
    {}, {'solver': {'fixed_base': True}}, {'rods': {'command_time_constant': 0.0}},
    {'fin': SOFT_TWIST, 'body': WATER_OF_BODY}])
def test_one_second_twice_is_two_seconds_to_the_last_bit(groups):
    one, other = in_transition(PARAMETERS.replace(**groups)), in_transition(PARAMETERS.replace(**groups))
    one.advance(1.0)
    assert_same_bits(one.advance(1.0), other.advance(2.0))


def test_step_by_step_is_at_once_to_the_last_bit():
    one, other = in_transition(PARAMETERS), in_transition(PARAMETERS)
    for _ in range(200):
        one.advance(0.002)
    assert_same_bits(one.state, other.advance(0.4))


@pytest.mark.parametrize('way', ['new simulator', 'reset'])
def test_save_restore_and_go_on_is_to_go_on_to_the_last_bit(way):
    simulator = in_transition(PARAMETERS)
    saved = pickle.dumps(simulator.state)
    reference = simulator.advance(1.0)
    if way == 'reset':
        simulator.command(left=TURN, right=TURN)
        simulator.advance(0.3)
        simulator.reset(pickle.loads(saved))
    else:
        simulator = Simulator(PARAMETERS, state=pickle.loads(saved))
    assert_same_bits(simulator.advance(1.0), reference)


@pytest.mark.parametrize('copied', [lambda state: pickle.loads(pickle.dumps(state)), copy.deepcopy, copy.copy])
def test_copies_of_a_state_are_as_read_only_and_checked_as_the_state(copied):
    state = copied(in_transition(PARAMETERS).state)
    assert_same_bits(state, in_transition(PARAMETERS).state)
    for name in STATE_FIELDS:
        if isinstance(getattr(state, name), np.ndarray):
            with pytest.raises(ValueError, match='read-only'):
                getattr(state, name)[...] = 7.0


def test_reset_to_rest_forgets_everything():
    simulator = in_transition(PARAMETERS)
    simulator.reset()
    simulator.command(left=TURN, right=SWIM)
    fresh = Simulator(PARAMETERS)
    fresh.command(left=TURN, right=SWIM)
    assert_same_bits(simulator.advance(0.5), fresh.advance(0.5))


def test_two_simulators_do_not_touch_each_other():
    alone = in_transition(PARAMETERS)
    reference = alone.advance(0.5)
    one, other = in_transition(PARAMETERS), Simulator(sized(4, 2))
    for _ in range(50):
        one.advance(0.01)
        other.advance(0.002)
    assert_same_bits(one.state, reference)


def test_an_earlier_state_is_not_changed_by_going_on():
    simulator = in_transition(PARAMETERS)
    kept = simulator.state
    before = pickle.dumps(kept)
    simulator.advance(0.5)
    assert_same_bits(kept, pickle.loads(before))


def test_another_process_goes_on_from_a_saved_state_with_the_same_bits(tmp_path):
    simulator = in_transition(PARAMETERS)
    saved = tmp_path / 'saved'
    saved.write_bytes(pickle.dumps((PARAMETERS, simulator.state, TURN, SWIM, 1.0)))
    first, second = (run_python(SWIM_ON, tmp_path, saved).stdout for _ in range(2))
    assert first == second and len(first.strip()) == 64

    simulator.command(left=TURN, right=SWIM)
    simulator.advance(1.0)
    here = tmp_path / 'here'
    here.write_bytes(pickle.dumps((PARAMETERS, simulator.state, TURN, SWIM, 0.0)))
    assert run_python(SWIM_ON, tmp_path, here).stdout == first
    assert np.isfinite(simulator.state.joint_angles).all()


def test_a_long_run_in_several_compiled_calls_has_the_bits_of_a_short_one(monkeypatch):
    whole = in_transition(PARAMETERS).advance(1.0)
    monkeypatch.setattr(simulator_module, 'LINK_STEPS_AT_ONCE', 7 * whole.joint_angles.size)
    assert_same_bits(in_transition(PARAMETERS).advance(1.0), whole)

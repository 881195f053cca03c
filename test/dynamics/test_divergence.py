"""A step too large ends in an error that says where, when and what to try, and changes nothing."""

import dataclasses
import re

import pytest

from evidence.scenarios import SWIM, bits, sized
from manta_sim_ros.dynamics import DivergenceError, FinCommand, Simulator, State
from manta_sim_ros.dynamics import simulator as simulator_module

pytestmark = pytest.mark.filterwarnings('ignore::manta_sim_ros.dynamics.StabilityWarning')


def flapping(time_step, gait=SWIM, **groups):
    simulator = Simulator(sized(6, 3).replace(solver={'time_step': time_step}, **groups))
    simulator.command(left=gait, right=FinCommand(amplitude=0.0, frequency=0.0, phase=0.0))
    return simulator


def test_divergence_names_time_fin_chain_and_a_step_and_leaves_the_state():
    simulator = flapping(0.016)
    simulator.advance(0.016)
    before = simulator.state
    kept = bits(before)
    with pytest.raises(DivergenceError) as error:
        simulator.advance(160.0)
    assert isinstance(error.value, ValueError)
    found = re.fullmatch(
        r'at ([\d.e+-]+) s a joint of chain (\d+) of the left fin passed \+-pi or is not finite: '
        r'solver\.time_step is 0\.016 s, too large for this motion; try 0\.0049 s', str(error.value))
    assert found, str(error.value)
    time, chain = float(found[1]), int(found[2])
    assert 0 <= chain < 6
    assert simulator.state is before and bits(before) == kept

    # the time is that of the step that failed: all before it can be taken, and that one fails again
    steps = round(time / 0.016)
    assert time == pytest.approx(steps * 0.016, rel=1e-5) and steps > 2
    simulator.advance((steps - 2) * 0.016)
    before = simulator.state
    with pytest.raises(DivergenceError, match=f'at {time:g} s .* chain {chain} of the left fin'):
        simulator.advance(0.016)
    assert simulator.state is before


def test_the_right_fin_is_named_when_it_is_the_one():
    simulator = Simulator(sized(6, 3).replace(solver={'time_step': 0.016, 'fixed_base': True}))
    simulator.command(left=FinCommand(amplitude=0.0, frequency=0.0, phase=0.0), right=SWIM)
    with pytest.raises(DivergenceError, match='of the right fin'):
        simulator.advance(160.0)


def test_the_chain_that_fails_is_the_one_named():
    parameters = sized(6, 1).replace(fin={'youngs_modulus': 0.0, 'joint_damping': 0.0}, water={'density': 0.0})
    for chain in (0, 3, 5):
        rates = State.at_rest(parameters).joint_rates.copy()
        rates[1, chain, 0] = 1700.0  # [rad/s], 3.4 rad in the first step
        simulator = Simulator(parameters, state=dataclasses.replace(State.at_rest(parameters), joint_rates=rates))
        with pytest.raises(DivergenceError, match=rf'at 0\.002 s a joint of chain {chain} of the right fin'):
            simulator.advance(0.002)


def test_following_the_suggestion_ends_in_a_step_that_works():
    time_step = 0.064
    tried = []
    while True:
        tried.append(time_step)
        try:
            state = flapping(time_step).advance(round(6.4 / time_step) * time_step)
            break
        except DivergenceError as error:
            suggested = float(re.search(r'try ([\d.e+-]+) s$', str(error))[1])
            assert suggested < time_step
            time_step = suggested
    assert len(tried) == 2  # the largest stable step is named at once
    assert state.time == pytest.approx(6.4, abs=time_step)


def test_a_body_that_diverges_is_named():
    """A light body with an enormous drag, pushed along its axis of symmetry: the flat fins feel nothing of it."""
    simulator = Simulator(sized(
        4, 2, water={'current': (10.0, 0.0, 0.0), 'density': 1e5},
        body={'mass': 1e-3, 'drag_area': (1e4, 0.0, 0.0), 'drag_coefficient': (1e3, 0.0, 0.0)}))
    before = simulator.state
    with pytest.raises(DivergenceError, match=r'at 0\.\d+ s the body moves faster than 1000 m/s .* to monolithic'):
        simulator.advance(2.0)
    assert simulator.state is before


def test_divergence_in_a_later_compiled_call_names_the_same_time(monkeypatch):
    with pytest.raises(DivergenceError) as at_once:
        flapping(0.016).advance(160.0)
    monkeypatch.setattr(simulator_module, 'LINK_STEPS_AT_ONCE', 100)  # less than three steps
    with pytest.raises(DivergenceError) as in_parts:
        flapping(0.016).advance(160.0)
    assert str(in_parts.value) == str(at_once.value)

"""No request holds the node for long: a step is cut short after some time, and an output is bounded."""

from types import SimpleNamespace

import pytest
from std_srvs.srv import Trigger

from manta_sim_ros.nodes import time_control
from manta_sim_ros.nodes.robot import Robot
from manta_sim_ros.nodes.settings import Settings


@pytest.fixture
def control(probe):
    """A `TimeControl` of a paused robot with a step of 0.05 s, that robot, and the states that it publishes."""
    settings = Settings().replace([('step_duration', 0.05), ('start_paused', True)])
    robot, published = Robot(settings, print, print), []
    return time_control.TimeControl(
        probe.node, robot, lambda: settings, SimpleNamespace(followed=False, stands_still=False), published.extend,
        lambda: None, lambda: None), robot, published


@pytest.mark.parametrize(('limit', 'outputs'), [(0.0, 1), (float('inf'), 5)])
def test_a_step_that_takes_too_long_ends_with_an_output_and_says_so(control, monkeypatch, limit, outputs):
    monkeypatch.setattr(time_control, 'LONGEST_STEP', limit)
    control, robot, published = control
    answer = control._step(Trigger.Request(), Trigger.Response())
    assert [state.time for state in published] == pytest.approx([0.01 * each for each in range(1, outputs + 1)])
    assert answer.success == (outputs == 5)
    assert ('step again, or set a shorter step_duration' in answer.message) == (not answer.success)
    assert answer.message.startswith(f'stepped to {robot.state.time:.9g} s of simulated time')


def test_many_steps_are_one_after_the_other_and_a_number_beyond_any_time_ends_too(control, monkeypatch):
    control, robot, published = control
    assert control.step(3) == (True, 'stepped to 0.15 s of simulated time')
    assert [state.time for state in published] == pytest.approx([0.01 * each for each in range(1, 16)])
    monkeypatch.setattr(time_control, 'LONGEST_STEP', 0.0)
    done, words = control.step(2**64 - 1)
    assert not done and words.startswith('stepped to 0.16 s of simulated time only, as a step takes at most 0 s')


def test_an_output_that_would_take_too_long_is_refused_with_the_lowest_rate():
    values = {'publish_rate': 0.1, 'solver.time_step': 1e-7}
    with pytest.raises(ValueError, match=r'^publish_rate is 0\.1 Hz, but must be at least 18 Hz with this solver'):
        Settings().replace(values.items())
    assert Settings().replace((values | {'publish_rate': 18.0}).items()).node.publish_rate == 18.0
    largest = {'fin.chains': 2000, 'fin.links': 200}
    with pytest.raises(ValueError, match='at least 4 Hz'):
        Settings().replace((largest | {'publish_rate': 3.9}).items())
    assert Settings().replace({'publish_rate': 0.1}.items()).node.publish_rate == 0.1  # of the defaults

"""The cost of the paper's 0.01 s: both programs simulate the same motion, and their times are those of 0.01 s."""


import numpy as np
import pytest

from evidence.paper import cost
from evidence.references import equations
from manta_sim_ros.dynamics import Simulator
from manta_sim_ros.figures.gaits import STRAIGHT, robot


def test_both_programs_simulate_the_same_motion():
    parameters = robot(fin={'chains': 6})
    simulator = Simulator(parameters)
    simulator.command(left=STRAIGHT, right=STRAIGHT)
    reference = equations.rest_state(parameters)
    for _ in range(5):
        reference = equations.step(parameters, reference, lambda side, at: cost.rod_motion(parameters, at))
    library = simulator.advance(cost.SPAN)
    np.testing.assert_allclose(library.joint_angles, reference.joint_angles, rtol=1e-10)
    np.testing.assert_allclose(library.fin_wrenches, reference.fin_wrenches, rtol=1e-10, atol=1e-10)


def test_both_are_timed_over_the_steps_of_a_hundredth_of_a_second():
    measured = cost.measure(quick=True)
    assert measured.steps == 5
    assert measured.reference > 0.0 and measured.library > 0.0



@pytest.mark.parametrize('quick', [True, False])
def test_the_times_are_those_of_a_hundredth_of_a_second(monkeypatch, quick):
    clock = [0.0]

    def spent(seconds, result):
        clock[0] += seconds
        return result

    monkeypatch.setattr(cost.time, 'process_time', lambda: clock[0])
    monkeypatch.setattr(cost.equations, 'step', lambda parameters, state, motion: spent(0.5, state))
    monkeypatch.setattr(cost.Simulator, 'advance', lambda simulator, duration: spent(0.02 * duration, None))
    measured = cost.measure(quick=quick)
    assert measured.reference == pytest.approx(5 * 0.5)  # five steps of 0.5 s each
    assert measured.library == pytest.approx(0.02 * 0.01)

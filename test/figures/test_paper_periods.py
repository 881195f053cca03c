"""Periods, transients, averages and lags of curves with exact answers, and records against the simulator."""

import itertools
import types

import numpy as np
import pytest

from manta_sim_ros.dynamics import Simulator
from manta_sim_ros.figures.gaits import STRAIGHT, gait, robot
from manta_sim_ros.figures.periodic import fundamental, lag, period_average, recurring, settled
from manta_sim_ros.figures.record import ARRAYS, record

SMALL = robot(fin={'chains': 4})
SAMPLES = 100


def decaying(halving):
    """Yield periods of a sine beside a transient that halves every `halving` periods."""
    for period in itertools.count():
        time = period + np.arange(1, SAMPLES + 1) / SAMPLES
        yield types.SimpleNamespace(curve=np.sin(2.0 * np.pi * time) + 0.5 ** (time / halving), index=period)


@pytest.mark.parametrize('halving', [0.5, 1.0, 3.0])
def test_a_transient_lasts_as_long_as_it_changes_the_curve(halving):
    transient, first = recurring(decaying(halving), lambda period: period.curve, tolerance=1e-3)
    assert first.index == transient

    def change(period):  # of the transient's largest value, from this period to the next
        return 0.5 ** ((period + 0.01) / halving) * (1.0 - 0.5 ** (1.0 / halving))

    assert change(transient) <= 2e-3 < change(transient - 1)  # 2 is the range


def test_a_motion_that_does_not_repeat_is_refused():
    drifting = (types.SimpleNamespace(curve=np.linspace(0.0, 1.0, SAMPLES) * (1.0 + period))
                for period in itertools.count())
    with pytest.raises(ValueError, match=r'not periodic to 0\.001 of its range within 50 periods'):
        recurring(drifting, lambda period: period.curve)


def test_every_curve_must_repeat():
    def both(period):
        return np.stack([np.sin(2.0 * np.pi * np.arange(SAMPLES) / SAMPLES), period.curve], axis=1)

    alone = recurring(decaying(1.0), lambda period: period.curve)[0]
    assert recurring(decaying(1.0), both)[0] == alone > 0


@pytest.mark.parametrize(('means', 'begin'), [
    ([1.0] * 8, 0), ([0.0, 0.5, 0.99, 1.0, 1.0, 1.0, 1.0, 1.0], 2), ([0.0, 1.0, 1.0, 1.2, 1.0, 1.0, 1.0, 1.0], 4),
    ([-0.5, -1.0, -1.0, -1.0], 1), ([1.0] * 6 + [2.0, 1.0], None), ([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0], None),
])
def test_settled_is_from_when_on_nothing_leaves_the_band(means, begin):
    assert settled(np.array(means), 0.05) == begin


def test_the_average_over_a_period_takes_a_periodic_part_away_and_keeps_a_trend():
    time = np.arange(1, 5 * SAMPLES + 1) / SAMPLES
    average = period_average(0.3 * time + np.sin(2.0 * np.pi * time) + np.cos(6.0 * np.pi * time), SAMPLES)
    whole = np.isfinite(average)
    assert whole.sum() == 4 * SAMPLES + 1
    np.testing.assert_allclose(average[whole], 0.3 * (time[whole] - 0.5 / SAMPLES), atol=1e-12)


@pytest.mark.parametrize('behind', [-170.0, -30.0, 0.0, 42.0, 179.0])
def test_a_lag_is_positive_when_the_second_comes_later(behind):
    cycle = 2.0 * np.pi * np.arange(1, SAMPLES + 1) / SAMPLES
    first = 2.0 * np.cos(cycle) + 0.4 * np.cos(3.0 * cycle + 1.0)
    second = 0.1 * np.cos(cycle - np.radians(behind)) + 0.05
    assert abs(fundamental(first)) == pytest.approx(2.0)
    assert lag(fundamental(first), fundamental(second)) == pytest.approx(behind, abs=1e-9)


@pytest.mark.parametrize('frequency', [0.51, 0.6, 0.8])
def test_a_record_has_whole_periods_and_steps_no_longer_than_asked_for(frequency):
    recorded = record(SMALL, gait(30.0, frequency), gait(30.0, frequency), 2)
    assert len(recorded.time) == 2 * SAMPLES and recorded.periods == 2
    np.testing.assert_allclose(np.diff(recorded.time, prepend=0.0), 1.0 / (frequency * SAMPLES), rtol=1e-9)
    step = recorded.parameters.solver.time_step
    assert 0.5 * SMALL.solver.time_step < step <= SMALL.solver.time_step
    assert recorded.rod_angles[-1] == pytest.approx(recorded.rod_angles[SAMPLES - 1], abs=1e-9)


def test_a_record_is_what_the_simulator_does():
    recorded = record(SMALL, STRAIGHT, gait(20.0, 0.6), 1, samples=10)
    simulator = Simulator(recorded.parameters)
    simulator.command(left=STRAIGHT, right=gait(20.0, 0.6))
    state = simulator.advance(recorded.time[3])
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(recorded, name)[3], getattr(state, name))
    np.testing.assert_array_equal(recorded.wrench[3], state.wrench)


@pytest.mark.parametrize(('left', 'right', 'named'), [
    (0.6, 0.8, '0.6 Hz left and 0.8 Hz right'), (0.0, 0.0, '0 Hz left and 0 Hz right')])
def test_fins_without_a_common_period_are_refused(left, right, named):
    with pytest.raises(ValueError, match=named):
        record(SMALL, gait(30.0, left), gait(30.0, right), 1)

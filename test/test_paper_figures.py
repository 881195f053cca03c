"""What the paper's figures show, on small grids: the trends, with margins that were measured on these grids."""

import numpy as np
import pytest

from manta_sim_ros.paper.figure_7 import Figure7
from manta_sim_ros.paper.figure_8 import Figure8, mean_thrust
from manta_sim_ros.paper.figure_9 import Figure9
from manta_sim_ros.paper.figure_10 import Figure10
from manta_sim_ros.paper.figure_11 import Figure11
from manta_sim_ros.paper.gaits import STRAIGHT, gait, robot
from manta_sim_ros.paper.record import record
from manta_sim_ros.paper.style import save_png
from manta_sim_ros.paper.turning import Turning
from scenarios import variant

CHAINS = 6
SMALL = robot(fin={'chains': CHAINS})


@pytest.fixture(scope='module')
def waves():
    return Figure7.measure(SMALL)


@pytest.fixture(scope='module')
def thrust():
    return Figure8.measure(SMALL, frequencies=(0.3, 0.6), amplitudes=(10.0, 30.0, 50.0), phases=(-30.0, 0.0, 30.0))


@pytest.fixture(scope='module')
def straight():
    return Figure9.measure(SMALL)


@pytest.fixture(scope='module')
def turning():
    return Turning.measure(chains=(CHAINS,), periods=8)


@pytest.mark.parametrize(('amplitude', 'frequency', 'phase'), [(40.0, 0.6, 40.0), (30.0, 0.4, 20.0), (20.0, 0.6, 40.0)])
def test_along_the_chord_later_chains_lag_earlier_ones_about_as_the_rods_do(amplitude, frequency, phase):
    figure = Figure7.measure(SMALL, gait(amplitude, frequency, phase))
    between = phase * (CHAINS - 1) / CHAINS  # the chains stand half a spacing inside the rods
    np.testing.assert_allclose(figure.chordwise_lags, between, rtol=0.12)  # measured: 1.02 to 1.11 times


def test_the_wave_runs_from_tail_to_nose_when_the_rear_rod_leads():
    assert np.all(Figure7.measure(SMALL, gait(40.0, 0.6, -40.0)).chordwise_lags < -30.0)  # measured: -35.9


def test_along_the_span_each_later_joint_lags(waves):
    assert np.all(np.diff(waves.spanwise_lags, axis=1) > 5.0)  # measured: 5.7 to 6.8 degrees
    assert np.all(np.diff(waves.direction_lags, axis=1) > 0.6)  # measured: 0.73 to 2.1 degrees


def test_thrust_grows_with_amplitude_frequency_and_phase(thrust):
    of_amplitude, of_phase = thrust.thrust_of_amplitude, thrust.thrust_of_phase
    assert np.all(of_amplitude[:, 1:] > 2.5 * of_amplitude[:, :-1])  # measured: 3.0 to 24 times
    assert np.all(of_amplitude[1] > 2.5 * of_amplitude[0])  # measured: 3.1 to 4.1 times
    assert np.all(np.diff(of_phase, axis=1) > 1.5)  # measured: 1.9 to 6.3 N
    assert np.all(of_phase[:, 0] < -1.5) and np.all(of_phase[:, -1] > 1.5)  # measured: -1.8 and 2.1 N


def test_the_thrust_is_the_same_where_both_plots_meet(thrust):
    np.testing.assert_array_equal(
        thrust.thrust_of_amplitude[:, thrust.amplitudes.index(30.0)], thrust.thrust_of_phase[:, -1])


def test_the_mean_thrust_is_that_of_any_later_period():
    held = robot(SMALL, solver={'fixed_base': True})
    long = record(held, gait(50.0, 0.6), gait(50.0, 0.6), 6)
    transient, thrust = mean_thrust(SMALL, 50.0, 0.6, 40.0)
    assert transient >= 1
    np.testing.assert_allclose(thrust, long.by_period(long.wrench)[-1, :, 0].mean(), rtol=1e-5)  # measured: 4e-7


def test_speed_and_ripple_grow_with_amplitude(straight):
    for swims in (straight.swims, straight.smooth):
        assert np.all(np.diff([swim.mean for swim in swims]) > 0.05)  # measured: 0.076 to 0.106 m/s
        ripples = np.array([swim.ripple for swim in swims])
        assert np.all(ripples[1:] > 1.4 * ripples[:-1])  # measured: 1.5 to 2.7 times


def test_the_speed_rises_and_settles(straight):
    for swim in straight.swims:
        average = swim.average[np.isfinite(swim.average)]
        assert average[0] < 0.5 * average[-1]  # measured: 0.13 to 0.46
        samples = len(swim.time) - len(average) + 1
        assert abs(average[-1] / average[-1 - samples] - 1.0) < 0.03  # over one period; measured: at most 0.023


def test_the_mean_is_that_of_the_window_of_the_paper(straight):
    swim = straight.swims[0]
    inside = swim.speed[(swim.time > 3.999) & (swim.time < 10.001)]
    assert swim.mean == pytest.approx(inside.mean(), rel=1e-12)
    assert len(inside) == 361  # of 100 a period, the first and the last included


def test_both_turning_gaits_turn_right(turning):
    assert [turn.name for turn in turning.turns] == ['set 1', 'set 2']
    for turn in turning.turns:
        assert np.all(turn.yaw_rates < -7.0)  # measured: -8.0 and more
        assert turn.record.position[-1, 1] < -0.1  # to the right of the start


def test_set_1_has_the_larger_first_moment_and_loses_it_while_that_of_set_2_is_steady(turning):
    one, two = (turn.mean_wrenches[:, 5] for turn in turning.turns)
    assert one[0] < 2.5 * two[0] < 0.0  # measured: 3.1 times
    assert np.all(np.diff(one) > 0.0) and one[-1] > 0.4 * one[0]  # measured: 0.24
    np.testing.assert_allclose(two[1:], two[1], rtol=0.15)  # measured: 0.13


def test_a_turning_rate_and_radius_are_those_of_the_path():
    turn = Turning.measure(chains=(CHAINS,), periods=4).turns[1]
    last, before = turn.record.position[-100:].mean(axis=0), turn.record.position[-200:-100].mean(axis=0)
    assert turn.turning_rate == pytest.approx(turn.yaw_rates[-1])
    speed = np.linalg.norm(last - before) / 1.25
    assert turn.turning_radius == pytest.approx(speed / np.radians(abs(turn.turning_rate)))


def test_the_robot_of_the_paper_begins_its_gaits_at_once_and_keeps_what_it_is_given():
    assert robot().rods.command_time_constant == 0.0
    assert robot(SMALL, rods={'front_radius': 0.2}) == variant(
        SMALL, rods={'front_radius': 0.2, 'command_time_constant': 0.0})


def test_every_figure_draws_and_lists_what_it_shows(waves, thrust, straight, turning, tmp_path):
    for figure in (waves, thrust, straight, Figure10(turning), Figure11(turning)):
        columns = figure.columns()
        assert len({len(values) for values in columns.values()}) == 1
        assert all('[' in name or name == 'time / period' for name in columns)
        for path in (tmp_path / 'once.png', tmp_path / 'again.png'):
            save_png(figure.draw, path, figure.height)
        assert (tmp_path / 'once.png').read_bytes() == (tmp_path / 'again.png').read_bytes()


def test_the_columns_hold_what_was_measured(waves, thrust, turning):
    assert list(waves.columns().values())[4].tolist() == waves.angles[:, 1, 0].tolist()
    columns = thrust.columns()
    row = (columns['frequency [Hz]'] == 0.6) & (columns['amplitude [deg]'] == 50.0)
    assert columns['mean thrust [N]'][row].tolist() == [thrust.thrust_of_amplitude[1, 2]]
    wrench = turning.turns[1].record.fin_wrenches.sum(axis=1)
    np.testing.assert_array_equal(Figure11(turning).columns()[f'M_z raw, set 2, {CHAINS} chains [N m]'], wrench[:, 5])
    np.testing.assert_array_equal(
        Figure10(turning).columns()[f'y, set 1, {CHAINS} chains [m]'], turning.turns[0].record.position[:, 1])


def test_the_gait_of_figure_9_is_that_of_the_paper():
    assert np.degrees([STRAIGHT.amplitude, STRAIGHT.phase]).round(9).tolist() == [40.0, 40.0]
    assert STRAIGHT.frequency == 0.6

"""What the paper's figures show, on small grids: the trends, with margins that were measured on these grids."""

import dataclasses
import io
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from manta_sim_ros.dynamics import Parameters
from manta_sim_ros.figures import figure_8, figure_9
from manta_sim_ros.figures.figure_7 import Figure7
from manta_sim_ros.figures.figure_8 import Figure8, mean_thrust
from manta_sim_ros.figures.figure_9 import Figure9, Swim, swim
from manta_sim_ros.figures.figure_10 import Figure10, described
from manta_sim_ros.figures.figure_11 import Figure11
from manta_sim_ros.figures.gaits import FEW_CHAINS, IN_WATER, STRAIGHT, TURNS, gait, robot
from manta_sim_ros.figures.record import record
from manta_sim_ros.figures.style import save_png
from manta_sim_ros.figures.turning import PERIODS, Turn, Turning

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


def test_speed_and_oscillation_grow_with_amplitude(straight):
    for swims in (straight.swims, straight.smooth):
        assert np.all(np.diff([swim.mean for swim in swims]) > 0.05)  # measured: 0.076 to 0.106 m/s
        oscillations = np.array([swim.oscillation for swim in swims])
        assert np.all(oscillations[1:] > 1.4 * oscillations[:-1])  # measured: 1.5 to 2.7 times


def test_the_speed_rises_and_settles(straight):
    for one in straight.swims:
        assert one.means[0] < 0.5 * one.final  # measured: 0.21 to 0.46
        assert 2 <= one.settled_from <= 9  # measured: 3 to 8
        assert one.final == pytest.approx(one.speed[-500:].mean())


def test_swims_have_the_numbers_of_chains_that_they_name(straight):
    assert {swim.chains for swim in straight.swims} == {CHAINS}
    assert {swim.chains for swim in straight.smooth} == {FEW_CHAINS}
    expected = record(robot(SMALL), gait(30.0, 0.6, 40.0), gait(30.0, 0.6, 40.0), 3).twist[:, 0]
    np.testing.assert_array_equal(straight.swims[1].speed[:300], expected)


def test_an_oscillation_is_peak_to_peak_about_the_average_and_within_the_window():
    time = np.arange(1, 1201) / 100.0  # a period is 1 s: what is before 3.5 s is in no average of the window
    speed = 0.1 * time + np.where(time < 3.4, 5.0, 0.03) * np.sin(2.0 * np.pi * time)
    wild = Swim(40.0, 8, time, speed, 100, np.zeros(1200))
    assert wild.oscillation == pytest.approx(0.06, rel=1e-3)
    np.testing.assert_allclose(wild.average[wild.window], 0.1 * time[wild.window], atol=1e-3)


def test_the_angle_of_attack_is_positive_when_the_body_sinks():
    one = swim(SMALL, 40.0, CHAINS)
    twist = record(robot(SMALL), gait(40.0, 0.6, 40.0), gait(40.0, 0.6, 40.0), 2).twist
    sinking = twist[100:, 2] < 0.0
    assert sinking.any() and not sinking.all()
    np.testing.assert_array_equal(one.attack[100:200] > 0.0, sinking)


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


@pytest.mark.parametrize('per_period', [10.0, -146.0])
def test_turning_rate_speed_and_radius_are_those_of_a_circle(turning, per_period):
    radius, samples, periods = 0.7, 100, 8
    made = turning.turns[0].record
    rate = np.radians(per_period) / made.period  # [rad/s]
    time = np.arange(1, samples * periods + 1) * made.period / samples
    flapping = 0.3 * np.sin(2.0 * np.pi * time / made.period)
    twist = np.zeros((len(time), 6))
    twist[:, 0], twist[:, 2] = radius * abs(rate) + 0.1 * flapping, flapping
    pitch = np.radians(20.0) * np.ones_like(time)  # along the path the body points up
    attitude = Rotation.from_euler('ZYX', np.stack([rate * time, -pitch, 0.0 * time], axis=1))
    level = np.stack([twist[:, 0], 0.0 * time, twist[:, 2]], axis=1)
    twist[:, :3] = Rotation.from_euler('Y', -pitch[:, None]).inv().apply(level)
    turn = Turn('made', dataclasses.replace(
        made, time=time, orientation=attitude.as_quat(), twist=twist, fin_wrenches=np.ones((len(time), 2, 6))))
    np.testing.assert_allclose(turn.yaw_rates, per_period / made.period, rtol=1e-9)
    assert turn.turning_rate == pytest.approx(per_period / made.period)
    assert turn.turning_radius == pytest.approx(radius)
    assert turn.steady_from == 0


def test_a_turn_is_steady_when_its_rate_stays_and_its_description_counts_from_one(turning):
    record_ = turning.turns[1].record
    heading = np.concatenate([np.full(100, rate) for rate in (0.5, 0.8, 1.0, 1.0, 1.0, 1.0, 1.04, 0.96)]).cumsum() / 100
    turn = Turn('set 2', dataclasses.replace(
        record_, orientation=Rotation.from_euler('Z', heading[:, None]).as_quat()))
    assert turn.steady_from == 2
    assert described(turn).endswith('steady from period 3')
    assert turn.turning_rate == pytest.approx(np.degrees(1.0) / 1.25)  # the last quarter: two periods of eight
    never = Turn('set 2', dataclasses.replace(
        record_, orientation=Rotation.from_euler('Z', 1.3 ** (np.arange(800) / 100)[:, None]).as_quat()))
    assert never.steady_from is None and described(never).endswith('not steady')


def test_a_mean_wrench_is_that_of_a_whole_period(turning):
    wrench = turning.turns[0].record.fin_wrenches.sum(axis=1)
    np.testing.assert_allclose(turning.turns[0].mean_wrenches[2], wrench[200:300].mean(axis=0), rtol=1e-12)


def test_equal_numbers_of_chains_are_simulated_once():
    assert [turn.name for turn in Turning.measure(chains=(4, 4), periods=4).turns] == ['set 1', 'set 2']


def test_the_third_robot_is_that_of_the_file_for_fresh_water():
    file = Path(__file__).parents[2] / 'config' / 'freshwater.yaml'
    assert Parameters().replace(**IN_WATER) == Parameters.from_yaml(file)


def test_the_columns_are_many_chains_few_chains_and_the_robot_in_water():
    turning = Turning.measure(SMALL, periods=2)
    assert [(name, [turn.name for turn in turns]) for name, turns in turning.by_robot.items()] == [
        (name, ['set 1', 'set 2']) for name in (
            f'{CHAINS} chains', f'{FEW_CHAINS} chains', '12 chains, twist stiffness and body in water')]
    assert list(turning.by_chains) == [CHAINS, FEW_CHAINS]
    assert [turn.name for turn in turning.in_water] == ['set 1', 'set 2']
    for turn in turning.in_water:
        assert turn.record.parameters.rods.command_time_constant == 0.0 and np.all(turn.yaw_rates < 0.0)
    for figure in (Figure10(turning), Figure11(turning)):
        assert sum('body in water' in name for name in figure.columns()) == len(figure.columns()) // 3
        panels = lines_of(figure)
        assert len(panels) in (6, 21)
    plan = lines_of(Figure10(turning))[4]  # plan and space of each column in turn
    np.testing.assert_array_equal(
        plan[described(turning.in_water[1])], turning.in_water[1].record.position[:, :2].T)


def test_the_rod_power_of_a_record_is_that_of_its_states():
    states = record(SMALL, STRAIGHT, STRAIGHT, 2)
    assert states.rod_power.shape == states.time.shape
    assert 3.0 < states.rod_power[100:].mean() < 10.0  # [W]; measured: 6.5 in cruise


def test_the_grids_are_those_of_the_paper():
    assert figure_8.FREQUENCIES[-1] == 0.6 and 0.51 in figure_8.FREQUENCIES
    assert figure_8.AMPLITUDES == (10.0, 20.0, 30.0, 40.0, 50.0)
    assert (figure_8.PHASES[0], figure_8.PHASES[-1]) == (-30.0, 30.0)
    assert figure_9.AMPLITUDES == (20.0, 30.0, 40.0, 50.0) and figure_9.WINDOW == (4.0, 10.0)
    assert PERIODS == 20
    assert np.degrees([[fin.amplitude, fin.phase] for turn in TURNS.values() for fin in turn]).round(9).tolist() == [
        [40.0, 40.0], [40.0, 0.0], [40.0, 40.0], [20.0, 40.0]]
    assert {fin.frequency for turn in TURNS.values() for fin in turn} == {0.8}


def test_the_robot_of_the_paper_begins_its_gaits_at_once_and_keeps_what_it_is_given():
    assert robot().rods.command_time_constant == 0.0
    assert robot(SMALL, rods={'front_radius': 0.2}) == SMALL.replace(
        rods={'front_radius': 0.2, 'command_time_constant': 0.0})


def test_every_figure_draws_and_lists_what_it_shows(waves, thrust, straight, turning, tmp_path):
    for figure in (waves, thrust, straight, Figure10(turning), Figure11(turning)):
        columns = figure.columns()
        assert len({len(values) for values in columns.values()}) == 1
        assert all('[' in name or name == 'time / period' for name in columns)
        for path in (tmp_path / 'once.png', tmp_path / 'again.png'):
            save_png(figure.draw, path, figure.height)
        assert (tmp_path / 'once.png').read_bytes() == (tmp_path / 'again.png').read_bytes()


def test_the_joints_are_those_of_the_left_fins_edges_over_two_cycles(waves):
    held = robot(SMALL, solver={'fixed_base': True})
    angles = np.degrees(record(held, STRAIGHT, STRAIGHT, 2).joint_angles[100:, 0])
    columns = waves.columns()
    np.testing.assert_allclose(columns['time / period'], np.arange(1, 201) / 100.0)
    for end, chain in (('leading', 0), ('trailing', -1)):
        for joint in range(3):
            curve = columns[f'{end} chain q{joint + 1} [deg]']
            np.testing.assert_allclose(curve, np.tile(angles[:, chain, joint], 2), atol=1e-4)  # degrees


def lines_of(figure):
    """Draw, and return of each pair of axes the points of its lines by their labels."""
    drawn = []

    def draw(canvas):
        figure.draw(canvas)
        drawn.extend({line.get_label(): line.get_xydata().T for line in axes.get_lines()} for axes in canvas.axes)

    save_png(draw, io.BytesIO(), figure.height)
    return drawn


def test_figure_7_draws_each_joint_and_labels_its_lag(waves):
    panels = lines_of(waves)
    for joint in range(3):
        for end, name in enumerate(('chain 1, leading edge', f'chain {CHAINS}, trailing edge')):
            np.testing.assert_array_equal(panels[joint][name][1], np.tile(waves.angles[:, end, joint], 2))
    for joint, (_, curve) in enumerate(panels[3].values()):
        trailing = waves.angles[:, 1, joint]
        np.testing.assert_allclose(curve, np.tile(trailing / np.abs(trailing).max(), 2))
    labels = list(panels[3])
    for joint in (1, 2):
        assert labels[joint] == f'$q_{joint + 1}$, lags $q_1$ by {waves.spanwise_lags[1, joint]:.1f}°'


def test_figure_8_draws_each_frequency_over_amplitude_and_phase(thrust):
    left, right = lines_of(thrust)
    for index, frequency in enumerate(thrust.frequencies):
        np.testing.assert_array_equal(
            left[f'{frequency:g} Hz'], [thrust.amplitudes, thrust.thrust_of_amplitude[index]])
        np.testing.assert_array_equal(list(right.values())[index], [thrust.phases, thrust.thrust_of_phase[index]])


def test_the_columns_hold_what_was_measured(thrust, straight, turning):
    columns = thrust.columns()
    for kind, at, values in (('amplitude', thrust.amplitudes, thrust.thrust_of_amplitude),
                             ('phase', thrust.phases, thrust.thrust_of_phase)):
        row = (columns['frequency [Hz]'] == 0.6) & (columns[f'{kind} [deg]'] == at[0])
        assert columns['mean thrust [N]'][row].tolist() == [values[1, 0]]
    speeds = straight.columns()
    assert speeds[f'forward speed, A = 20 deg, {CHAINS} chains [m/s]'].tolist() == straight.swims[0].speed.tolist()
    assert speeds[f'forward speed, A = 50 deg, {FEW_CHAINS} chains [m/s]'].tolist() == straight.smooth[3].speed.tolist()
    wrench = turning.turns[1].record.fin_wrenches.sum(axis=1)
    wrenches = Figure11(turning).columns()
    np.testing.assert_array_equal(wrenches[f'M_z raw, set 2, {CHAINS} chains [N m]'], wrench[:, 5])
    np.testing.assert_allclose(
        wrenches[f'F_y averaged, set 2, {CHAINS} chains [N]'][150], wrench[100:200, 1].mean(), rtol=1e-9)
    np.testing.assert_array_equal(
        Figure10(turning).columns()[f'y, set 1, {CHAINS} chains [m]'], turning.turns[0].record.position[:, 1])


def test_the_gait_of_figure_9_is_that_of_the_paper():
    assert np.degrees([STRAIGHT.amplitude, STRAIGHT.phase]).round(9).tolist() == [40.0, 40.0]
    assert STRAIGHT.frequency == 0.6

"""The model-predictive follower in closed loop with the simulator, without ROS: errors, limits, model, fallback."""

import math
from pathlib import Path

import numpy as np
import pytest

from manta_sim_ros.control.averaged_model import (
    MODELS,
    TWIST,
    VARIABLES,
    AveragedModel,
    read_model,
    terms_of,
    variables,
)
from manta_sim_ros.control.closed_loop import CONTROL_PERIOD, fly
from manta_sim_ros.control.model_fit import SAMPLES, averaged, fit, main, swims
from manta_sim_ros.control.motion_filter import MotionFilter
from manta_sim_ros.control.mpc import MpcFollower
from manta_sim_ros.control.mpc_settings import MpcSettings
from manta_sim_ros.control.plan import NoPlanError
from manta_sim_ros.control.polyline import Polyline
from manta_sim_ros.dynamics import FinCommand, Parameters

CONFIG = Path(__file__).parents[2] / 'config'
FRESHWATER = Parameters.from_yaml(CONFIG / 'freshwater.yaml')
SETTINGS = MpcSettings(time_limit=1e3)  # results must not depend on the load of the machine
GAIT = FinCommand(0.0, 0.6, math.radians(40.0))
LEVEL = np.array([0.0, 0.0, 0.0, 1.0])

STRAIGHT = Polyline([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]])
CORNER = Polyline([[0.0, 0.0, 0.0], [2.5, 0.0, 0.0], [2.5, 2.0, 0.0]])
CURVE = Polyline([[2.0 * math.sin(a), 2.0 - 2.0 * math.cos(a), 0.2 * a] for a in np.linspace(0.0, 0.6 * math.pi, 22)])


@pytest.mark.parametrize(('path', 'current', 'begin', 'bound'), [(CORNER, 0.1, 3.3, 0.2), (CURVE, 0.0, 1.0, 0.15)],
                         ids=['corner in a current', 'climbing curve'])
def test_the_robot_stays_near_the_path_within_its_limits(path, current, begin, bound):
    follower = MpcFollower(path, SETTINGS)
    flight = fly(FRESHWATER.replace(water={'current': (0.0, current, 0.0)}), follower, path, 60.0)
    assert flight.finished
    assert abs(flight.cross_track).max() < 0.6
    assert abs(flight.cross_track[flight.station > begin]).max() < bound
    assert abs(flight.height).max() < 0.1
    np.testing.assert_allclose(follower.current, [0.0, current], atol=0.03)
    angles = flight.commands[:, :, [0, 2, 3, 4]]
    assert not angles[0, :, 0].any()
    assert np.abs(np.diff(angles[:-1], axis=0)).max() < SETTINGS.rate_limit * CONTROL_PERIOD + 1e-9
    assert angles[:, :, 0].max() <= SETTINGS.largest_amplitude + 1e-6
    assert np.abs(angles[:, :, 1] - GAIT.phase).max() <= SETTINGS.largest_steering + 1e-6
    assert np.abs(angles[:, :, 2:]).max() <= SETTINGS.largest_bias + 1e-6


def test_the_model_in_the_package_predicts_other_swims_of_the_simulator():
    motion = swims(FRESHWATER, SETTINGS, GAIT, robots=4, duration=12.0, seed=7)
    means, _ = averaged(motion)
    period, interval, predicted, errors, ways = SAMPLES, 1.0 / (GAIT.frequency * SAMPLES), MotionFilter(
        read_model(MODELS['freshwater'])), [], []
    begin, end = period, 4 * period  # the second to the fifth period
    for mean in means:
        predicted.state[:12] = mean[begin, :12]
        after = predicted.ahead([(interval, 0.5 * (now[12:] + then[12:]))
                                 for now, then in zip(mean[begin:end], mean[begin + 1:end + 1], strict=True)])
        errors.append(after[9:12] - mean[end, 9:12])
        ways.append(mean[end, 9:12] - mean[begin, 9:12])
    assert np.linalg.norm(errors, axis=1).max() < 0.15
    assert np.linalg.norm(ways, axis=1).max() > 0.5


def test_a_fit_finds_the_model_of_motions_that_have_one():
    known = AveragedModel(GAIT.frequency, GAIT.phase, 0.4, {
        rate: {terms[0]: -1.0, terms[-1]: 0.5} for rate in TWIST for terms in [terms_of(rate, 2)]})
    means = np.random.default_rng(3).normal(size=(1000, 15))
    rates = np.zeros_like(means)
    rates[:, :6] = np.transpose(known.twist_rates(variables([*means[:, :8].T, *means[:, 12:].T])))
    found, explained = fit(means, rates / (GAIT.frequency * SAMPLES), GAIT, 0.4)
    for rate in TWIST:
        assert found.rates[rate] == pytest.approx(known.rates[rate], rel=0.02)
        assert explained[rate] > 0.99


def test_the_rate_of_a_moving_mean_is_the_change_over_the_period():
    motion = np.random.default_rng(5).normal(size=(2, 100, 15))
    _, rates = averaged(motion)
    moving = np.array([motion[:, first:first + SAMPLES].mean(axis=1) for first in range(100 - SAMPLES + 1)])
    np.testing.assert_allclose(rates, np.swapaxes(np.diff(moving, axis=0), 0, 1), atol=1e-12)


def test_the_model_is_symmetric():
    model = read_model(MODELS['freshwater'])
    values = dict(zip(VARIABLES, np.random.default_rng(2).normal(size=len(VARIABLES)), strict=True))
    rates = dict(zip(TWIST, model.twist_rates(values), strict=True))
    for flipped in ({'v', 'r', 'p', 'roll', 'steering'}, {'w', 'q', 'p', 'roll', 'pitch', 'bias'}):
        mirrored = model.twist_rates({name: -value if name in flipped else value for name, value in values.items()})
        for rate, value in zip(TWIST, mirrored, strict=True):
            assert value == pytest.approx(-rates[rate] if rate in flipped else rates[rate], rel=1e-12)


def test_averaged_model_prints_a_model_file(capsys, tmp_path):
    main(['--config', str(CONFIG / 'freshwater.yaml'), '--robots', '2', '--duration', '10'])
    file = tmp_path / 'model.yaml'
    file.write_text(capsys.readouterr().out)
    model = read_model(file)
    assert model.rates['r']['amplitude', 'steering'] > 0.0
    assert model.as_yaml() in file.read_text()


@pytest.mark.parametrize(('arguments', 'words'), [
    (['--robots', '0'], 'robots is 0, but must be from 2'), (['--frequency', '9'], 'frequency is 9, but must be from'),
    (['--config', '/none.yaml'], '/none.yaml')])
def test_wrong_input_of_averaged_model_ends_it_with_one_line_and_status_2(arguments, words, capsys):
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line


@pytest.mark.parametrize(('old', 'new', 'words'), [
    ('frequency: 0.6', 'frequency: 9', 'frequency is 9.0, but must be a number from 0.1 to 2'),
    ('  v:\n', '  vv:\n', "'vv'"), ('u*u:', 'u*x:', "depends on 'x'"),
    ('gait_lag: 0.4', 'gait_lag: .nan', 'gait_lag is nan'), ('\nrates:', '\nrate:', 'must have frequency'),
    ('  v:\n', '  v: {\n', 'line')])
def test_a_wrong_model_file_is_refused_by_name_and_value(old, new, words, tmp_path):
    file = tmp_path / 'model.yaml'
    text = MODELS['freshwater'].read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))
    with pytest.raises(ValueError, match='model.yaml') as refused:
        read_model(file)
    assert words in str(refused.value)


class Rig:
    """A follower of a straight path, given the motion of a robot that stands still."""

    def __init__(self, **changes):
        self.warnings = []
        settings = MpcSettings(**{'time_limit': 1e3, 'stages': 8, **changes})
        self.follower = MpcFollower(STRAIGHT, settings, warn=self.warnings.append)
        self.time = 0.0

    def commands(self, count):
        """Return the amplitudes of so many commands."""
        amplitudes = []
        for _ in range(count):
            self.follower.observe(self.time, np.zeros(3), LEVEL, np.zeros(6))
            amplitudes.append(self.follower.command(self.time)[0].amplitude)
            self.time += CONTROL_PERIOD
        return amplitudes


def test_without_a_plan_the_last_one_goes_on_and_then_the_robot_glides_until_there_is_one(monkeypatch):
    rig = Rig(patience=1.0)
    assert rig.commands(5)[-1] > 0.1

    def fail(*_):
        raise NoPlanError('none')

    with monkeypatch.context() as failing:
        failing.setattr(rig.follower._planner, 'plan', fail)
        assert min(rig.commands(10)) > 0.1
        assert rig.warnings == ['no plan (none): the last plan goes on']
        assert rig.commands(10)[-1] == 0.0
        assert rig.warnings[1:] == ['no plan (none): the robot glides to rest']
    assert rig.commands(5)[-1] > 0.1
    assert len(rig.warnings) == 2


def test_a_plan_that_takes_too_long_is_not_used():
    rig = Rig(time_limit=1e-6)
    assert rig.commands(3) == [0.0, 0.0, 0.0]
    assert rig.warnings == ['no plan (Maximum_WallTime_Exceeded): the robot glides to rest']


def test_at_the_end_it_glides_and_another_path_is_followed():
    rig = Rig()
    rig.commands(5)
    for time in (9.0, 9.1):  # it searches the nearest point on a part of the path only
        rig.follower.observe(time, np.array([5.1, 0.0, 0.0]), LEVEL, np.zeros(6))
        left, _ = rig.follower.command(time)
    assert left.amplitude == 0.0 and rig.follower.finished
    rig.follower.follow(STRAIGHT)
    rig.time = 20.0
    assert rig.commands(5)[-1] > 0.1 and not rig.follower.finished


@pytest.mark.parametrize(('end', 'side'), [((0.0, 5.0, 0.0), 1.0), ((0.0, -5.0, 0.0), -1.0), ((-5.0, 1.0, 0.0), 1.0),
                                           ((-5.0, -1.0, 0.0), -1.0)])
def test_it_turns_to_the_side_to_which_the_path_leads(end, side):
    rig = Rig(stages=20)
    rig.commands(3)
    rig.follower.follow(Polyline([[0.0, 0.0, 0.0], end]))
    rig.commands(5)
    left, right = rig.follower.command(rig.time)
    assert side * (right.phase - left.phase) > 0.2
    assert not rig.warnings


def test_it_turns_round_to_a_path_straight_behind_it():
    path = Polyline([[0.0, 0.0, 0.0], [-4.0, 0.0, 0.0]])
    flight = fly(FRESHWATER, MpcFollower(path, SETTINGS), path, 60.0)
    assert flight.finished
    assert abs(flight.cross_track[flight.station > 2.5]).max() < 0.3


@pytest.mark.parametrize(('changes', 'words'), [
    ({'largest_bias': 0.5, 'largest_steering': 1.0}, 'closes only below'),
    ({'least_amplitude': 0.9}, 'least_amplitude is 0.9 rad, but must be below')])
def test_limits_that_the_rods_cannot_follow_are_refused(changes, words):
    with pytest.raises(ValueError, match=words):
        Rig(**changes)

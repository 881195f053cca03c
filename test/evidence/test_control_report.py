"""docs/control_report.md has what is measured now; its verdicts follow from its numbers; a lost bound is noticed."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from evidence.control_report import __main__ as command
from evidence.control_report import courses, page, swims
from evidence.control_report.conditions import CONDITIONS, NOISE, UNCERTAIN, mistaken, stable
from evidence.control_report.courses import COURSES
from evidence.control_report.measure import STEP
from evidence.control_report.robots import CONTROLLERS, ROBOTS
from evidence.control_report.steps import Settling, largest, settling, step
from evidence.control_report.swims import Result, Row, of_draws, swim, verdict
from evidence.report import read_table
from manta_sim_ros.control.closed_loop import CONTROL_PERIOD, fly
from manta_sim_ros.dynamics import REST, Parameters, largest_stable_step

DOCS = Path(__file__).parents[2] / 'docs'
PAGE = (DOCS / 'control_report.md').read_text(encoding='utf-8')
CONTROLLER = 'path_follower'
TOLERANCE = 0.02
"""By which errors may differ on another machine [m]: printed with two digits, and rounding in the feedback."""
RESULT = Result(0.02, 0.1, 0.2, 0.03, 0.05, 0.01, 1.5, 0.04, 60.0, finished=True)


class Resting:
    """A controller that does nothing but remember what it observes."""

    finished = False

    def __init__(self):
        self.observed = []

    def follow(self, path):
        """Take no path."""

    def observe(self, time, position, orientation, twist):
        self.observed.append(position)

    def command(self, time):
        return REST, REST


def done():
    """Take the report of a finished job."""


def tables(name):
    """Return the rows of the three tables of a robot."""
    part = PAGE[PAGE.index(f'## {page.TITLES[name]}\n'):]
    return [read_table(part[part.index(f'### {heading}\n'):])[1:]
            for heading in ('Errors', 'Effort and cost', 'A step to the side')]


@pytest.mark.parametrize('name', ROBOTS)
def test_the_page_has_every_path_condition_and_controller(name):
    errors, costs, steps = tables(name)
    expected = [[course, condition, controller]
                for course in COURSES for condition in CONDITIONS for controller in CONTROLLERS]
    assert [row[:3] for row in errors] == [row[:3] for row in costs] == expected
    assert [row[:2] for row in steps] == [[condition, name] for condition in CONDITIONS for name in CONTROLLERS]
    for kind in ('tracks', 'step'):
        assert f'](control_report/{kind}_{name}.png)' in PAGE
        assert 10_000 < (DOCS / 'control_report' / f'{kind}_{name}.png').stat().st_size < 1_000_000


@pytest.mark.parametrize('name', ROBOTS)
def test_the_verdicts_of_the_page_follow_from_its_numbers_and_from_the_bounds(name):
    ends = {tuple(row[:3]): 'not' not in row[-1] for row in tables(name)[1]}
    for row in tables(name)[0]:
        _, error, largest_error, bound, met, height, _, height_bound, height_met = row[3:]
        course, condition, _ = row[:3]
        error = largest_error if course == 'station_keeping' else error
        widening = {'freshwater': 1.0, 'manta': 2.0}[name]
        legs = 0.35 if condition == 'current' else 0.15
        assert float(bound) == pytest.approx(
            3.0 if course == 'station_keeping' else widening * (0.3 if course in ('circle', 'helix') else legs))
        assert float(height_bound) == pytest.approx(widening * 0.1)
        assert met == page.MET[float(error) <= float(bound) and ends[tuple(row[:3])]]
        assert height_met == page.MET[float(height) <= float(height_bound) and ends[tuple(row[:3])]]


@pytest.mark.parametrize(('name', 'course', 'condition'), [
    ('freshwater', 'helix', 'current'), ('manta', 'straight', 'calm')])
def test_the_numbers_of_the_page_are_those_measured_now(name, course, condition):
    measured = swim(Row(name, course, condition, CONTROLLER), 0, done).result
    key, (errors, costs, _) = [course, condition, CONTROLLER], tables(name)
    errors, costs = (next(row[3:] for row in rows if row[:3] == key) for rows in (errors, costs))
    assert [float(errors[column]) for column in (0, 1, 2, 5, 6)] == pytest.approx(measured[:5], abs=TOLERANCE)
    assert float(costs[0]) == pytest.approx(math.degrees(measured.effort), rel=0.1)
    assert [float(cost) for cost in costs[1:]] == pytest.approx(measured[6:9], rel=0.02)


def test_the_step_of_the_page_is_that_measured_now():
    measured = step(Row('freshwater', STEP, 'calm', CONTROLLER), 0, done)
    written = next(row[2:] for row in tables('freshwater')[2] if row[:2] == ['calm', CONTROLLER])
    apart = abs(np.subtract([float(value) for value in written], measured.result))
    np.testing.assert_array_less(apart, [0.2, 1.0, 0.03])
    assert measured.position[0] == pytest.approx([0.0, -0.5, 0.0], abs=0.05)
    assert 1.0 < measured.result.length < 10.0


def test_a_bound_that_is_no_longer_met_makes_the_command_fail(monkeypatch, tmp_path, capsys):
    (tmp_path / 'control_report.md').write_text(PAGE)
    monkeypatch.setattr(command, 'DOCS', tmp_path)
    monkeypatch.setattr(courses, 'ON_LEGS', -0.01)
    only = ['--robots', 'freshwater', '--paths', 'straight', '--conditions', 'calm', '--controllers', 'path_follower']
    assert command.main(only) == 1
    printed = capsys.readouterr().out
    assert 'was met before: freshwater, straight, calm, path_follower, error\n' in printed
    assert '1 of 2 bounds are met.' in printed
    monkeypatch.undo()
    monkeypatch.setattr(command, 'DOCS', tmp_path)
    assert command.main(only) == 0
    printed = capsys.readouterr().out
    assert '2 of 2 bounds are met.' in printed and 'was met before' not in printed
    assert (tmp_path / 'control_report.md').read_text() == PAGE  # of a part, nothing is written
    with pytest.raises(SystemExit) as ended:
        command.main(['--paths', 'spiral'])
    assert ended.value.code == 2 and "'spiral'" in capsys.readouterr().err


def test_only_what_was_met_can_be_lost():
    row = Row('manta', 'helix', 'current', CONTROLLER)

    def with_error(error):
        return page.text({row: RESULT._replace(most=error)}, {})

    assert page.broken(with_error(0.6), with_error(0.61)) == ['manta, helix, current, path_follower, error']
    assert not page.broken(with_error(0.61), with_error(0.6))
    assert not page.broken(with_error(0.61), with_error(0.7))
    assert not page.broken(with_error(0.6), page.text({}, {})) and not page.broken('', with_error(0.7))


def test_a_controller_that_does_not_reach_the_end_meets_no_bound(monkeypatch):
    monkeypatch.setitem(CONTROLLERS, 'resting', lambda robot, path: Resting())
    monkeypatch.setattr(swims, 'LONGEST', 2.0)
    row = Row('freshwater', 'straight', 'calm', 'resting')
    result = swim(row, 0, done).result
    assert not result.finished and result.most == 0.0
    found = verdict(row, result)
    assert not found.met and not found.height_met
    assert 'not at the end after 2' in page.cost_table({row: result})
    assert '0 of 2 bounds are met.' in page.summary({row: result})


def test_a_controller_observes_the_odometry_with_noise_and_the_errors_are_without():
    controller = Resting()
    flight = fly(Parameters(), controller, COURSES['straight'].path, 10.0, CONDITIONS['noise'].noise(1))
    observed = np.array(controller.observed)
    assert np.std(observed, axis=0) == pytest.approx(NOISE.position, rel=0.1)
    np.testing.assert_array_equal(flight.cross_track, 0.0)
    assert CONDITIONS['noise'].noise(1) != CONDITIONS['noise'].noise(2)
    assert not any(dataclasses.astuple(CONDITIONS['calm'].noise(0)))


@pytest.mark.parametrize('name', ROBOTS)
def test_each_uncertain_value_is_by_a_fifth_too_small_or_too_large(name):
    true, found = ROBOTS[name].parameters, {}
    for seed in range(CONDITIONS['wrong parameters'].draws):
        wrong = mistaken(true, seed)
        assert wrong == mistaken(true, seed)
        factors = [np.atleast_1d(np.divide(getattr(getattr(wrong, group), value), np.where(known, known, 1.0)))
                   for group, values in UNCERTAIN.items() for value in values
                   for known in [np.array(getattr(getattr(true, group), value))] if known.all()]
        assert {round(float(factor), 9) for each in factors for factor in each} == {0.8, 1.2}
        found[seed] = [each[0] for each in factors]
        assert wrong.rods == true.rods and wrong.fin.chains == true.fin.chains
        swimming = CONDITIONS['wrong parameters'].parameters(ROBOTS[name], seed)
        gait = ROBOTS[name].fastest
        assert swimming.solver.time_step <= largest_stable_step(swimming, gait, gait)
    assert len({tuple(each) for each in found.values()}) == len(found)


def test_a_time_step_is_halved_until_it_is_stable():
    parameters, gait = Parameters().replace(fin={'youngs_modulus': 8e8}), ROBOTS['manta'].fastest
    halved = stable(parameters, gait).solver.time_step
    assert halved < Parameters().solver.time_step
    assert halved <= largest_stable_step(parameters, gait, gait) < 2.0 * halved
    assert stable(Parameters(), gait) == Parameters()


def test_errors_count_neither_after_the_start_nor_at_corners_nor_beyond_the_end():
    stations = np.arange(0.25, 34.5, 0.5)
    lawnmower, helix = COURSES['lawnmower'], COURSES['helix']
    assert set(stations[lawnmower.counts(stations)]) == {
        *np.arange(2.25, 6.0, 0.5), *np.arange(11.25, 15.0, 0.5), *np.arange(20.25, 24.0, 0.5),
        *np.arange(29.25, 34.0, 0.5)}
    assert lawnmower.path.length == 34.0
    assert not helix.counts(np.array([0.0, 2.0, helix.path.length])).any() and helix.counts(np.array([2.1, 12.5])).all()


def test_the_error_of_keeping_station_is_the_distance_from_the_point():
    course, position = COURSES['station_keeping'], np.array([[3.0, 2.0, 0.5], [0.0, 0.5, 0.0]])
    np.testing.assert_allclose(course.errors(position, np.zeros(2)), [3.0, 1.5])
    np.testing.assert_allclose(COURSES['circle'].errors(position, np.array([0.1, -0.2])), [0.1, -0.2])
    assert np.linalg.norm(course.path.waypoints[:, :2] - course.kept.center, axis=1).max() < course.kept.radius
    assert course.bound(True, 2.0) == course.bound(False, 1.0) == 3.0


def test_the_robot_has_settled_when_it_remains_within_the_band():
    time = np.arange(0.0, 20.0, 0.1)
    y = -0.5 * np.exp(-0.25 * time) * np.cos(0.5 * time)
    found = settling(time, np.column_stack([0.2 * time, y, np.zeros_like(time)]))
    last = time[np.flatnonzero(abs(y) > 0.1)[-1] + 1]
    assert 5.0 < last < 10.0
    assert found == pytest.approx((0.2 * last, last, np.max(y)))
    assert np.isnan(settling(time, np.column_stack([time, np.full_like(time, 0.3), time]))[:2]).all()
    assert np.isnan(largest([found, Settling(math.nan, math.nan, 0.1)]).length)
    assert largest([found, Settling(1.0, 99.0, 0.0)]) == pytest.approx((found.length, 99.0, found.overshoot))


def test_of_several_draws_the_errors_are_the_largest_and_the_rest_are_means():
    other = Result(0.01, 0.3, 0.4, 0.01, 0.02, 0.03, 2.5, 0.06, 80.0, finished=False)
    assert of_draws([RESULT, other]) == pytest.approx((0.02, 0.3, 0.4, 0.03, 0.05, 0.02, 2.0, 0.05, 70.0, False))


def test_the_effort_is_the_mean_rate_of_the_commands():
    flight = fly(Parameters(), Resting(), COURSES['straight'].path, 1.0)
    commands = np.zeros_like(flight.commands)
    commands[:, 0, 2] = 0.3 * CONTROL_PERIOD * np.arange(len(commands))  # one of eight: the phase of the left fin
    commands[:, :, 1] = np.arange(len(commands))[:, np.newaxis]  # the frequency does not count
    assert swims.effort(flight._replace(commands=commands)) == pytest.approx(0.3 / 8.0)

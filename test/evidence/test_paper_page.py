"""docs/paper.md has the current verdicts, slips and values, and a verdict changes with its results."""

import dataclasses
import importlib
import re
import types
from pathlib import Path

import numpy as np
import pytest

from evidence.paper import page
from evidence.paper.cost import Cost
from evidence.paper.sensitivity import VALUES
from evidence.paper.slips import SLIPS
from evidence.paper.statements import (
    HOLDS,
    IN_PART,
    NOT,
    OPEN,
    Results,
    halved,
    listed,
    statements,
    steady_stretch,
)
from evidence.report import read_table
from manta_sim_ros.dynamics import Parameters
from manta_sim_ros.figures.figure_7 import Figure7
from manta_sim_ros.figures.figure_8 import Figure8
from manta_sim_ros.figures.figure_9 import Figure9
from manta_sim_ros.figures.turning import Turning

ROOT = Path(__file__).parents[2]
COST = Cost(reference=2.5, library=1.4e-4, steps=5)  # s, as on a machine of 2026
PAGE = (ROOT / 'docs' / 'paper.md').read_text(encoding='utf-8')


@pytest.fixture(scope='module')
def results():
    """Return all of the page's results, but without a look at the clock."""
    return Results(Figure7.measure(), Figure8.measure(), Figure9.measure(), Turning.measure(), COST)


def section(title):
    return re.split(rf'^## {re.escape(title)}$', PAGE, flags=re.MULTILINE)[1].split('\n## ')[0]


def rows(text):
    """Return the rows of the first table of a text, without its head, each as its cells."""
    return read_table(text)[1:]


def test_the_page_has_every_statement_with_the_verdict_of_now(results):
    written = [(place, quote, verdict) for place, quote, verdict, _ in rows(section('The statements of the paper'))]
    now = [(one.place, f'"{one.quote}"', f'**{one.verdict}**') for one in statements(results)]
    assert written == now
    assert len(set(now)) == len(now)


NUMBER = re.compile(r'-?\d+(?:\.\d+)?')


def assert_same_text(written, now):
    """Compare texts, and their numbers to one of the last digit: the last bit of a turn differs between machines."""
    assert NUMBER.sub('#', written) == NUMBER.sub('#', now)
    for one, other in zip(NUMBER.findall(written), NUMBER.findall(now)):
        digit = 10.0 ** -len(one.partition('.')[2])
        assert abs(float(one) - float(other)) <= max(1.01 * digit, 0.02 * abs(float(one))), (written, now)


def test_the_answers_of_the_page_are_those_of_now(results):
    written = {quote: answer for _, quote, _, answer in rows(section('The statements of the paper'))}
    for one in statements(results):
        if one.place != 'Section 4':  # the clock of the machine that wrote the page
            assert_same_text(written[f'"{one.quote}"'], one.answer)


def test_the_prose_of_the_figures_is_that_of_now(results):
    figures = section('The figures').strip().split('\n\n')[1:]
    for written, now in zip(figures, page.figure_blocks(results), strict=True):
        assert_same_text(' '.join(written.split()), ' '.join(now.split()))


def test_the_table_of_costs_has_time_step_and_ratios_of_each_program():
    assert rows(page.cost_table(COST)) == [
        ["the paper's Python program, on the authors' machine", '0.18 s', '0.18 s', '0.056', '1'],
        ['the reference implementation in NumPy, with 6 x 6 matrices', '2.5 s', '0.5 s', '0.004', '0.072'],
        ['this library', '0.00014 s', '2.8e-05 s', '71', '1.3e+03'],
    ]


def test_the_page_counts_the_verdicts_right():
    counted = re.search(
        r'(\d+) statements\. The verdict is "holds" for (\d+), "holds in part" for (\d+), '
        r'"does not hold" for (\d+), "cannot be judged" for (\d+)\.',
        ' '.join(section('The statements of the paper').split())).groups()
    written = [verdict.strip('*') for _, _, verdict, _ in rows(section('The statements of the paper'))]
    assert list(map(int, counted)) == [len(written), *map(written.count, (HOLDS, IN_PART, NOT, OPEN))]


def verdict(results, words):
    verdicts = [one.verdict for one in statements(results) if words in one.quote]
    assert len(verdicts) == 1
    return verdicts[0]


def replaced_turns(results, change):
    turns = [change(index, turn) for index, turn in enumerate(results.turning.turns)]
    return dataclasses.replace(results, turning=Turning(tuple(turns)))


def mirrored(_, turn):
    """Turn the other way: left and right change their places."""
    record = turn.record
    return dataclasses.replace(turn, record=dataclasses.replace(
        record, fin_wrenches=record.fin_wrenches * [1.0, -1.0, 1.0, -1.0, 1.0, -1.0],
        orientation=record.orientation * [-1.0, 1.0, -1.0, 1.0], position=record.position * [1.0, -1.0, 1.0]))


def without_set_1(results):
    by_robot = list(results.turning.by_robot.values())
    return replaced_turns(results, lambda index, _: by_robot[index // 2][1 - index % 2])


def with_angles(results, change):
    figure = results.figure_7
    return dataclasses.replace(results, figure_7=dataclasses.replace(figure, angles=change(figure.angles)))


def smoothed(swim):
    """Return the speed without its oscillation, which half a period at each end keeps."""
    return np.where(np.isfinite(swim.average), swim.average, swim.speed)


def with_speeds(results, change):
    figure = results.figure_9
    swims = tuple(dataclasses.replace(swim, speed=change(swim)) for swim in figure.swims)
    return dataclasses.replace(results, figure_9=dataclasses.replace(figure, swims=swims))


@pytest.mark.parametrize(('change', 'words', 'usual', 'then'), [
    (lambda results: with_angles(results, lambda angles: angles[:, ::-1]), '(q_1, q_2, q_3)', HOLDS, NOT),
    (lambda results: with_angles(results, lambda angles: angles[::-1]), 'spanwise wave', IN_PART, NOT),
    (lambda results: with_angles(results, lambda angles: np.stack(
        [np.roll(angles[..., joint], 8 * joint, axis=0) for joint in range(3)], axis=-1)), 'spanwise wave', IN_PART,
     HOLDS),
    (lambda results: replaced_turns(results, mirrored), 'tailoring turning gaits', HOLDS, NOT),
    (lambda results: replaced_turns(results, mirrored), 'can both give rise to the turning gaits', HOLDS, NOT),
    (without_set_1, 'higher rotational acceleration', HOLDS, NOT),
    (without_set_1, 'stable driving moment', IN_PART, NOT),
    (without_set_1, 'circular trajectories', IN_PART, NOT),
    (lambda results: with_speeds(results, smoothed), 'oscillations in forward', HOLDS, NOT),
    (lambda results: with_speeds(
        results, lambda swim: smoothed(swim) + (swim.speed - smoothed(swim)) * 0.01**2 / swim.oscillation**2),
     'oscillation amplitude', HOLDS, NOT),
    (lambda results: with_speeds(results, lambda swim: 2.0 * swim.speed), '0.25–0.47 m/s', HOLDS, NOT),
    (lambda results: with_speeds(results, lambda swim: swim.speed * np.exp(0.05 * swim.time)), 'stabilizes',
     HOLDS, NOT),
    (lambda results: dataclasses.replace(results, cost=dataclasses.replace(results.cost, library=0.02)),
     'possibility of real-time', HOLDS, NOT),
    (lambda results: dataclasses.replace(results, cost=dataclasses.replace(results.cost, reference=20.0)), '0.18 s',
     IN_PART, NOT),
])
def test_a_verdict_follows_its_results(results, change, words, usual, then):
    assert verdict(results, words) == usual
    assert verdict(change(results), words) == then


def test_a_body_that_is_not_heaved_has_a_minor_angle_of_attack(results):
    figure = results.figure_9
    calm = dataclasses.replace(figure, swims=tuple(
        dataclasses.replace(swim, attack=0.1 * swim.attack) for swim in figure.swims))
    assert verdict(results, 'angle of attack') == NOT
    assert verdict(dataclasses.replace(results, figure_9=calm), 'angle of attack') == HOLDS


def with_moments(moments):
    """Return as much of a turn as has the mean M_z of each period."""
    return types.SimpleNamespace(mean_wrenches=np.outer(moments, [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]))


@pytest.mark.parametrize(('moments', 'stretch'), [
    ([-1.0, -0.32, -0.3, -0.29, -0.28, 0.1, 0.0], (1, 4)), ([-1.0, -1.3, -0.3], (0, 1)), ([0.5] * 4, (0, 4)),
    ([1.0, -1.0, 1.0, -1.0], (0, 1)),
])
def test_a_moment_is_stable_where_it_stays_near_its_mean(moments, stretch):
    assert steady_stretch(with_moments(moments)) == stretch


def test_a_moment_is_halved_in_the_first_period_below_half_of_the_first():
    assert halved(with_moments([-1.0, -0.6, -0.4, -0.6])) == 3
    assert halved(with_moments([-1.0, 0.9, -0.4])) == 2


def test_the_last_two_numbers_of_a_list_are_joined_by_and():
    assert listed([1.0]) == '1.0'
    assert listed([1.0, -2.25]) == '1.0 and -2.2'
    assert listed([1.0, 2.0, 3.4], 0) == '1, 2 and 3'


def test_the_page_has_every_slip_of_the_print():
    table = rows(section('Where the print is not followed'))
    assert table == [[slip.where, slip.printed, slip.implemented, slip.code and f'`{slip.code}`'] for slip in SLIPS]


def equations(text):
    """Return the numbers of equations in a text, those within '(a) to (b)' and '(a)-(b)' too."""
    numbers = {int(number) for number in re.findall(r'\((\d+)\)', text)}
    for first, last in re.findall(r'\((\d+)\)(?: to |-)\((\d+)\)', text):
        numbers |= set(range(int(first), int(last) + 1))
    return numbers


@pytest.mark.parametrize('slip', [slip for slip in SLIPS if slip.code], ids=lambda slip: slip.where)
def test_the_code_that_a_slip_points_to_is_that_of_the_equation(slip):
    module, name = slip.code.split('.')
    function = getattr(importlib.import_module(f'manta_sim_ros.dynamics._kernels.{module}'), name)
    if slip.where.startswith('('):
        assert equations(slip.where) & equations(function.__doc__)


def test_the_slips_that_the_issue_of_the_paper_has_are_all_there():
    places = ' '.join(slip.where for slip in SLIPS)
    for place in ('(10)', '(11)', '(12)', '(21)-(24)', '(26)', '(28)', '(38)', 'Figure 9', 'Table 1', 'Section 4'):
        assert place in places


def test_the_tables_have_every_parameter_once_with_its_value():
    printed, assumed = rows(section('Table 1, as used')), rows(section('Assumed values'))
    assert printed == rows(page.parameter_table(printed=True))
    assert assumed == rows(page.parameter_table(printed=False))
    names = [row[0].strip('`') for row in printed + assumed]
    assert sorted(names) == sorted(Parameters.quantities())
    assert ['`body.inertia`', '(1.33, 1.93, 2.73) kg m^2'] == next(
        row[:2] for row in printed if row[0] == '`body.inertia`')


def test_the_page_has_the_sensitivity_to_every_assumed_value():
    for value in VALUES:
        assert f'| `{value}` |' in section('Assumed values').split('![')[1]


def test_the_page_shows_every_picture_and_each_is_there_and_small():
    shown = re.findall(r'!\[.+?\]\((.+?)\)', PAGE)
    assert [Path(name).stem for name in shown if name.endswith('.png')] == list(page.PLOTS)
    for name in shown:
        assert 10_000 < (ROOT / 'docs' / name).stat().st_size < 3_000_000

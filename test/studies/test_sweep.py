"""`sweep`: the cases of a study, their results, refusals, kills, and a cluster."""

import contextlib
import gc
import math
import os
import re
import signal
import subprocess
import sys
import time
import weakref
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from matplotlib.figure import Figure
from PIL import Image

from evidence.harness.processes import LIMIT, command_of
from evidence.validation.measurements import at_end
from manta_sim_ros.dynamics import Parameters, fin_surfaces, simulate_batch
from manta_sim_ros.figures.gaits import gait
from manta_sim_ros.figures.record import record
from manta_sim_ros.figures.turning import Turn
from manta_sim_ros.studies import cases, plot
from manta_sim_ros.studies import sweep as sweeps
from manta_sim_ros.studies.cases import RESULTS, simulate_cases
from manta_sim_ros.studies.study import read_study
from manta_sim_ros.studies.sweep import AddressError, OtherStudyError, main, sweep
from manta_sim_ros.studies.swim import tip_excursion

ROOT = Path(__file__).parents[2]
SMALL = """
duration: 6.0
gait:
  amplitude: 30
  frequency: {from: 0.4, to: 0.6, count: 3}
  phase: {values: [20, 40]}
parameters:
  fin.chains: 4
"""
LONG = """
duration: 20.0
gait:
  amplitude: {from: 20, to: 40, count: 20}
  frequency: 0.5
  phase: {from: 20, to: 60, count: 10}
parameters:
  fin.chains: 8
"""


@pytest.fixture
def study(tmp_path):
    """Return a function that writes a study file, and reads it."""
    def made(text, name='study.yaml'):
        (tmp_path / name).write_text(text, encoding='utf-8')
        return read_study(tmp_path / name)

    return made


def command(*arguments, cwd):
    """Start the command on one core, so that the parts are small on every machine."""
    return subprocess.Popen(
        [*command_of('sweep'), *arguments], cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: os.sched_setaffinity(0, {min(os.sched_getaffinity(0))}))


def wait_for_part(folder, process):
    deadline = time.monotonic() + LIMIT
    while not list(folder.glob('*.parts/part-*.parquet')):
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.02)


def rows_of(path):
    return pq.read_table(path).to_pylist()


def assert_same(rows, others):
    assert [row['case'] for row in rows] == [row['case'] for row in others]
    for row, other in zip(rows, others):
        for name, value in row.items():
            assert value == other[name] or value == pytest.approx(other[name], rel=1e-9, nan_ok=True), name


@pytest.mark.parametrize('right', [40.0, 20.0])
def test_the_results_are_those_of_the_figures_and_of_the_validation(study, right):
    """Reference: recordings with 100 samples a period, whose time step divides the period."""
    periods = 12
    one, = simulate_cases(study(f"""
duration: {periods / 0.8}
gait: {{amplitude: {{values: [40]}}, frequency: 0.8, left_phase: 40, right_phase: {right}}}
parameters: {{fin.chains: 8, solver.time_step: 0.00125}}
"""))
    parameters = Parameters().replace(fin={'chains': 8}, solver={'time_step': 0.00125})
    recorded = record(parameters, gait(40.0, 0.8), gait(40.0, 0.8, right), periods)
    last = recorded.samples
    wrench, twist, power = (getattr(recorded, name)[-last:] for name in ('wrench', 'twist', 'rod_power'))
    assert one['thrust'] == pytest.approx(wrench[:, 0].mean(), rel=0.01, abs=0.02)
    assert one['speed'] == pytest.approx(twist[:, 0].mean(), rel=2e-3)
    assert one['power'] == pytest.approx(power.mean(), rel=2e-3)
    assert one['cost_of_transport'] == pytest.approx(power.mean() / (20.0 * 9.81 * twist[:, 0].mean()), rel=4e-3)
    turn = Turn('', recorded)
    assert one['yaw_rate'] == pytest.approx(turn.yaw_rates[-1], rel=2e-3, abs=1e-6)
    if right == 40.0:
        cruise = at_end(recorded)
        assert one['strouhal'] == pytest.approx(0.8 * cruise.excursion / cruise.speed, rel=0.01)
        assert math.isnan(one['turning_radius'])
    else:
        assert one['turning_radius'] == pytest.approx(
            turn.speeds[-1] / np.radians(abs(turn.yaw_rates[-1])), rel=4e-3)


def test_the_excursion_of_the_tips_is_that_in_the_world():
    few = Parameters().replace(fin={'chains': 2})
    flat = {'rod_angles': np.zeros((2, 2, 2)), 'joint_angles': np.zeros((2, 2, 2, 3))}
    level, rolled = [0.0, 0.0, 0.0, 1.0], [math.sin(0.05), 0.0, 0.0, math.cos(0.05)]
    heights = np.array([[0.0, 0.0, 0.0], [5.0, 0.0, 0.2]])
    assert tip_excursion(few, heights, np.array([level, level]), **flat) == pytest.approx(0.2)
    radius = fin_surfaces(few, flat['rod_angles'][0], flat['joint_angles'][0])[0, :, -1, 1].mean()
    assert tip_excursion(few, np.zeros((2, 3)), np.array([level, rolled]), **flat) == pytest.approx(
        radius * math.sin(0.1))


def test_a_swim_has_converged_when_its_periods_are_alike(study):
    text = 'gait: {{amplitude: {{values: [30]}}, frequency: 0.5, phase: 40}}\nparameters: {{fin.chains: 4}}\n'
    for duration, converged in ((4.0, False), (40.0, True)):
        one, = simulate_cases(study(f'duration: {duration}\n' + text.format()))
        assert one['converged'] is converged


def test_a_fin_without_amplitude_does_not_flap_whatever_its_frequency(study):
    text = """
duration: 10.0
gait: {left_amplitude: 0, left_frequency: {values: [0, 0.1, 0.6]}, right_amplitude: 30, right_frequency: 0.6, phase: 40}
parameters: {fin.chains: 4}
"""
    still, *others = simulate_cases(study(text))
    assert still['error'] is None and abs(still['yaw_rate']) > 1.0
    for row in others:
        for name in RESULTS:
            assert row[name] == pytest.approx(still[name], nan_ok=True), name


def test_means_of_two_frequencies_do_not_depend_on_when_the_swim_ends(study):
    rows = [simulate_cases(study(f"""
duration: {duration}
config: {ROOT / 'config' / 'freshwater.yaml'}
gait: {{amplitude: {{values: [30]}}, left_frequency: 0.3, right_frequency: 0.5, phase: 40}}
parameters: {{fin.chains: 4, fin.links: 2}}
"""))[0] for duration in (60, 61.5, 63)]
    for row in rows:
        assert row['converged']
        for name in ('thrust', 'speed', 'yaw_rate', 'turning_radius', 'power', 'strouhal'):
            assert row[name] == pytest.approx(rows[0][name], rel=0.02), name


@pytest.mark.parametrize(('frequencies', 'longest', 'period'), [
    ((0.5, 0.5), 0.0, 2.0), ((0.5,), 100.0, 2.0), ((0.3, 0.5), 15.0, 10.0), ((0.5, 0.3), 10.0, 10.0),
    ((0.3, 0.6), 1.0, 1.0 / 0.3), ((0.4, 0.7), 12.0, 10.0), ((0.4, 0.7), 9.0, 7.5), ((0.4, 0.7), 1.0, 2.5),
    ((0.5, 0.5 * math.sqrt(2.0)), 30.0, 24.0)])
def test_the_period_is_that_of_both_fins_as_far_as_it_is_short(frequencies, longest, period):
    assert cases.common_period(frequencies, longest) == pytest.approx(period)


def test_the_strouhal_number_is_that_in_the_water_beside_the_climb(study):
    text = """
duration: 30.0
config: {config}
gait: {{amplitude: {{values: [20]}}, frequency: 0.6, phase: 40}}
parameters: {{fin.chains: 4, '{parameter}': {{values: {values}}}}}
"""
    def rows(parameter, values):
        return simulate_cases(study(text.format(
            config=ROOT / 'config' / 'freshwater.yaml', parameter=parameter, values=values)))

    back, still, ahead = rows('water.current[0]', [-0.3, 0.0, 0.3])
    assert back['speed'] < 0.0 < still['speed'] < ahead['speed']
    for row in (back, ahead):
        assert row['strouhal'] == pytest.approx(still['strouhal'], rel=5e-3)
        assert abs(row['speed'] - still['speed']) == pytest.approx(0.3, rel=5e-3)
    up, down = rows('body.net_buoyancy', [5.0, -5.0])
    assert up['strouhal'] == pytest.approx(down['strouhal'], rel=0.01)


def test_the_example_is_a_study_and_stands_in_the_documentation():
    path = ROOT / 'config' / 'studies' / 'amplitude_and_phase.yaml'
    made = read_study(path)
    assert len(made.cases) == 49 and made.parameters == Parameters.from_yaml(ROOT / 'config' / 'freshwater.yaml')
    comment, text = path.read_text(encoding='utf-8').split('\n', 1)
    assert f'```yaml\n{text}```' in (ROOT / 'docs' / 'sweep.md').read_text(encoding='utf-8') and comment[0] == '#'


def test_a_grid_has_each_combination_once(study):
    made = study(SMALL)
    assert made.names == ('frequency', 'phase')
    assert list(made.cases.values()) == [
        pytest.approx((frequency, phase)) for frequency in (0.4, 0.5, 0.6) for phase in (20.0, 40.0)]


@pytest.mark.parametrize('method', ['latin_hypercube', 'sobol'])
def test_samples_fill_the_ranges_and_are_the_same_again(study, method):
    text = f"""
duration: 4.0
gait: {{amplitude: {{from: 10, to: 40}}, frequency: 0.5}}
parameters:
  fin.chains: {{from: 4, to: 12}}
  body.inertia[1]: {{from: 1.0, to: 3.0}}
sampling: {{method: {method}, cases: 16, seed: 3}}
"""
    made, other = study(text), study(text.replace('seed: 3', 'seed: 4'))
    assert made == study(text) and made.cases != other.cases and made.digest != other.digest
    values = np.array(list(made.cases.values()))
    assert values.shape == (16, 3)
    for column, (low, high) in zip(values.T, ((10.0, 40.0), (4.0, 12.0), (1.0, 3.0))):
        assert low <= column.min() < low + 0.2 * (high - low) and high - 0.2 * (high - low) < column.max() <= high
    case = made.parameters_of(5)
    assert (case.fin.chains, case.body.inertia[1]) == made.cases[5][1:] and isinstance(case.fin.chains, int)
    assert case.body.inertia[::2] == Parameters().body.inertia[::2]


def test_a_value_of_one_fin_goes_before_that_of_both(study):
    made = study('duration: 4.0\ngait: {amplitude: 30, frequency: {values: [0.5]}, right_amplitude: 20}')
    left, right = made.gaits_of(0)
    assert [round(math.degrees(fin.amplitude)) for fin in (left, right)] == [30, 20]
    assert left.frequency == right.frequency == 0.5


def test_a_case_that_fails_has_its_error_and_the_others_their_results(study, tmp_path):
    made = study("""
duration: 4.0
gait: {amplitude: {values: [30, 85]}, frequency: {values: [0.1, 0.5]}, phase: {values: [0, 180]}}
parameters: {fin.chains: 4, solver.time_step: {values: [0.002, 0.003, 0.05]}}
""")
    assert sweep(made, tmp_path / 'all.parquet') == 24
    rows = rows_of(tmp_path / 'all.parquet')
    assert [row['case'] for row in rows] == list(range(24))
    for row in rows:
        assert (row['error'] is None) == (row['speed'] is not None) == (row['power'] is not None)
    by_input = {(row['amplitude'], row['frequency'], row['phase'], row['solver.time_step']): row for row in rows}
    assert by_input[30, 0.5, 0, 0.002]['error'] is None and by_input[30, 0.5, 0, 0.002]['step_stable']
    assert 'the lowest frequency of a fin that flaps is 0.1 Hz' in by_input[30, 0.1, 0, 0.002]['error']
    assert 'whole number of steps' in by_input[30, 0.5, 0, 0.003]['error']
    assert 'support closes only below' in by_input[85, 0.5, 180, 0.002]['error']
    diverged = by_input[30, 0.5, 0, 0.05]
    assert 'passed +-pi' in diverged['error'] or 'moves faster' in diverged['error']
    assert diverged['step_stable'] is False


def test_a_model_that_moves_as_no_robot_does_is_told(study):
    one, = simulate_cases(study("""
duration: 10.0
gait: {amplitude: {values: [40]}, frequency: 0.8, phase: 40, right_phase: 0}
"""))
    assert one['warning'].startswith('the fins have chordwise instability') and one['error'] is None


def test_the_results_of_a_case_do_not_depend_on_those_beside_it(study):
    made = study(SMALL)
    assert_same(simulate_cases(made), [row for case in made.cases for row in simulate_cases(made.part([case]))])


def test_a_sweep_that_is_killed_leaves_what_it_has_and_goes_on_there(study, tmp_path):
    made = study(LONG)
    process = command('study.yaml', cwd=tmp_path)
    wait_for_part(tmp_path, process)
    process.kill()
    process.communicate()
    partial = pq.read_table(tmp_path / 'results.parquet.parts').to_pylist()  # as it lies there
    assert 0 < len(partial) < len(made.cases) and not (tmp_path / 'results.parquet').exists()
    counts = []
    left = sweep(made, tmp_path / 'results.parquet', progress=counts.append)
    assert left == len(made.cases) - len(partial)
    assert counts[0] == len(partial) and sum(counts) == len(made.cases)
    rows = rows_of(tmp_path / 'results.parquet')
    assert [row['case'] for row in rows] == list(range(len(made.cases)))
    assert_same([rows[row['case']] for row in partial], partial)
    assert sorted(path.name for path in tmp_path.iterdir()) == ['results.parquet', 'study.yaml']
    assert sweep(made, tmp_path / 'results.parquet') == 0


@pytest.mark.parametrize('ending', [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_is_told_in_a_line(study, tmp_path, ending):
    study(LONG)
    process = command('study.yaml', '-o', 'some.parquet', cwd=tmp_path)
    wait_for_part(tmp_path, process)
    process.send_signal(ending)
    out, err = process.communicate(timeout=LIMIT)
    assert process.returncode == 130 and not out
    assert err.splitlines()[-1] == (
        'sweep: interrupted; the finished parts are in some.parquet.parts: the same command goes on')
    assert 'Traceback' not in err


def test_an_interruption_before_the_first_part_and_after_the_last_one_says_what_there_is(
        study, tmp_path, capsys, monkeypatch):
    study(SMALL)
    monkeypatch.chdir(tmp_path)
    endings = []

    def leave(status):
        raise SystemExit(status)

    monkeypatch.setattr(sweeps, 'on_ending', endings.append)
    monkeypatch.setattr(os, '_exit', leave)
    monkeypatch.setattr(sweeps, 'compile_kernels', lambda *_: endings[0]())
    monkeypatch.setattr(sweeps, 'draw', lambda *_: endings[1]())
    for what in ('no part was finished', 'the results are in results.parquet'):
        with pytest.raises(SystemExit, match='^130$'):
            main(['study.yaml', '--plot', 'plot.png'])
        assert capsys.readouterr().err.splitlines()[-1] == f'sweep: interrupted; {what}'
        monkeypatch.setattr(sweeps, 'compile_kernels', lambda *_: None)


def test_results_of_another_study_are_refused_whether_whole_or_in_parts(study, tmp_path):
    made, other = study(SMALL), study(SMALL.replace('duration: 6.0', 'duration: 6.2'))
    output = tmp_path / 'results.parquet'

    def kill(count):
        if count:
            raise KeyboardInterrupt

    with contextlib.suppress(KeyboardInterrupt):
        sweep(made, output, progress=kill)
    with pytest.raises(OtherStudyError, match=r'results\.parquet\.parts has the results of another study'):
        sweep(other, output)
    assert sweep(made, output) == 0  # all of them were in the one part
    with pytest.raises(OtherStudyError, match=r'results\.parquet has the results of another study'):
        sweep(other, output)
    output.write_text('mine')
    with pytest.raises(OtherStudyError):
        sweep(made, output)
    assert output.read_text() == 'mine'


def test_the_rows_are_in_the_order_of_the_cases_whatever_was_done_first(study, tmp_path, monkeypatch):
    monkeypatch.setattr(sweeps, '_blocks', lambda cases, size: [cases[1::2], cases[::2]])
    sweep(study(SMALL), tmp_path / 'results.parquet')
    assert [row['case'] for row in rows_of(tmp_path / 'results.parquet')] == list(range(6))


def test_two_processes_do_not_write_the_same_results(study, tmp_path):
    made, output = study(SMALL), tmp_path / 'results.parquet'

    def again(count):
        with pytest.raises(BlockingIOError, match='is written by another process'):
            sweep(made, output)

    assert sweep(made, output, progress=again) == 6


@pytest.mark.parametrize(('text', 'line'), [
    ('', 'the study is None, but must be a group of named values'),
    ('gait: {amplitude: 30}', 'the study has no duration, but must have duration, gait'),
    (SMALL + 'runs: 3', "the study has the key 'runs', but takes config, duration, gait, parameters, sampling"),
    (SMALL.replace('6.0', 'long'), "duration is 'long', but must be a finite number"),
    (SMALL.replace('6.0', '6.001'), r'duration is 6\.001 s, but must be .* whole number of steps .*, 0\.002 s'),
    (SMALL.replace('6.0', '-1'), 'duration is -1 s, but must be above 0'),
    (SMALL.replace('6.0', '1e300'), r'duration is 1e\+300 s, but must be at most 1e\+06 s'),
    (SMALL.replace('amplitude: 30', 'amplitude: 500'),
     r'left amplitude 500 degrees: amplitude is 8\.7\d+, but must be from 0 to 1\.57'),
    (SMALL.replace('amplitude: 30', 'amplitude: 30\n  right_frequency: -1'), 'right frequency -1 Hz: frequency is -1'),
    (SMALL.replace('fin.chains: 4', 'fin.chains: .inf'), 'fin.chains is inf, but must be a finite number'),
    (SMALL.replace('fin.chains: 4', 'fin.chains: {values: [4, .nan]}'), 'fin.chains is nan, but must be a finite'),
    (SMALL.replace('  amplitude', '  size'), "gait has the key 'size', but takes amplitude, frequency"),
    (SMALL.replace('amplitude: 30', 'amplitude: {from: 20, to: 120, count: 3}'),
     r'left amplitude 120 degrees: amplitude is 2\.09\d+, but must be from 0 to 1\.57'),
    (SMALL.replace('to: 0.6', 'to: 6'), 'left frequency 6 Hz: frequency is 6.0, but must be from 0 to 5 Hz'),
    (SMALL.replace('to: 0.6', 'to: 0.3'), r'frequency goes from 0\.4 to 0\.3, but must go upward'),
    (SMALL.replace('count: 3', 'count: 1'), 'frequency count is 1, but must be a whole number from 2'),
    (SMALL.replace(', count: 3', ''), 'frequency has no count, but must have from, to, count'),
    (SMALL.replace('[20, 40]', '[]'), 'phase has values .*, but must have a list of at least one'),
    (SMALL.replace('fin.chains: 4', 'fin.chain: 4'), 'parameters: fin.chain is no parameter'),
    (SMALL.replace('fin.chains: 4', 'body.inertia: 4'),
     r'body\.inertia is no parameter: name one value, such as body\.inertia\[0\]'),
    (SMALL.replace('fin.chains: 4', 'body.inertia[3]: 4'), r'parameters: body\.inertia\[3\] is no parameter'),
    (SMALL.replace('fin.chains: 4', 'fin.chains: {from: 1, to: 4, count: 2}'),
     r'fin\.chains is 1, but must be from 2 to 2000'),
    (SMALL.replace('fin.chains: 4', 'fin.span: -1'), r'fin\.span is -1\.0, but must be from 0\.001 to 10 m'),
    (SMALL.replace('{from: 0.4, to: 0.6, count: 3}', '0.5').replace('{values: [20, 40]}', '40'), 'nothing is varied'),
    (SMALL + 'sampling: {method: random}', 'frequency has the key .*, but takes from, to'),
    (SMALL.replace('{from: 0.4, to: 0.6, count: 3}', '0.5').replace('{values: [20, 40]}', '{from: 0, to: 1}')
     + 'sampling: {method: random}', "sampling method is 'random', but must be grid, latin_hypercube, sobol"),
    (SMALL.replace('{from: 0.4, to: 0.6, count: 3}', '0.5').replace('{values: [20, 40]}', '{from: 0, to: 1}')
     + 'sampling: {method: sobol}', 'sampling cases is None, but must be a whole number from 1 to 1000000'),
    (SMALL.replace('count: 3', 'count: 600000'), 'the grid has 1200000 cases, but must have at most 1000000'),
    (SMALL + 'config: none.yaml', "No such file or directory: '.*none.yaml'"),
    (SMALL + 'duration: 7.0', "duration stands twice"),
    (f'gait: {"[" * 5000}', 'is nested too deeply for a study file'),
    (SMALL + 'gait: \ud800', "codec can't decode"),
    (SMALL + '}', 'did not find expected|expected .*block end'),
])
def test_a_wrong_study_is_refused_in_one_line_before_anything_is_done(text, line, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'study.yaml').write_text(text, encoding='utf-8', errors='surrogatepass')
    with pytest.raises(SystemExit) as ended:
        main(['study.yaml'])
    printed = capsys.readouterr()
    assert ended.value.code == 2 and not printed.out
    only, = printed.err.splitlines()
    assert re.search(f'^sweep: .*(?:{line})', only)
    assert [path.name for path in tmp_path.iterdir()] == ['study.yaml']


@pytest.mark.parametrize(('arguments', 'line'), [
    ([], 'the following arguments are required: STUDY.yaml'),
    (['none.yaml'], "No such file or directory: 'none.yaml'"),
    (['study.yaml', '-o', 'no/results.parquet'], '--output is no/results.parquet, but must be a file in a directory'),
    (['study.yaml', '-o', ''], '--output is ., but must be a file in a directory that exists'),
    (['study.yaml', '-o', '..'], '--output is .., but must be a file in a directory that exists'),
    (['study.yaml', '-o', '/'], '--output is /, but must be a file in a directory that exists'),
    (['study.yaml', '-o', 'folder.png'], r'--output is folder\.png, but must be a file in a directory that exists'),
    (['study.yaml', '-o', './study.yaml'], r'--output is study\.yaml, but that is an input: it would be replaced'),
    (['study.yaml', '-o', 'a.png', '--plot', './a.png'], r'--plot is a\.png, but that is --output: it would be'),
    (['study.yaml', '--plot', 'folder.png'], r'--plot is folder\.png, but must be a \.png file in a directory that'),
    (['study.yaml', '--plot', 'plot.svg'], r'--plot is plot\.svg, but must be a \.png file'),
    (['three.yaml', '--plot', 'plot.png'], '--plot takes one or two quantities, but 3 are varied: amplitude'),
    (['text.yaml', '--plot', 'plot.png'], "--plot takes numbers only, but solver.coupling is 'sequential'"),
])
def test_wrong_arguments_are_refused_in_one_line(arguments, line, study, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    made = study(SMALL)
    (tmp_path / 'folder.png').mkdir()
    study(SMALL.replace('amplitude: 30', 'amplitude: {values: [20, 30]}'), 'three.yaml')
    study('duration: 4.0\ngait: {frequency: 0.5}\nparameters: {solver.coupling: {values: [sequential, monolithic]}}',
          'text.yaml')
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    only, = capsys.readouterr().err.splitlines()
    assert ended.value.code == 2 and re.search(f'^sweep: .*{line}', only)
    assert study(SMALL) == made
    assert sorted(path.name for path in tmp_path.iterdir()) == ['folder.png', 'study.yaml', 'text.yaml', 'three.yaml']


@pytest.mark.parametrize(('places', 'kind'), [
    ([(2, 2), (2, 3), (4, 3), (4, 2)], 'QuadMesh'),
    ([(2, 2), (2, 2), (4, 3), (4, 2)], 'PathCollection'),  # as many as a grid would have
    ([(2, 2), (2, 3), (4, 3)], 'PathCollection'),
])
def test_only_cases_that_exist_are_drawn(places, kind, study, tmp_path, monkeypatch):
    figure = Figure()
    monkeypatch.setattr(plot, 'save_png', lambda panels, *_, **__: panels(figure))
    made = study('duration: 4.0\ngait: {frequency: 0.5}\n'
                 'parameters: {fin.chains: {values: [2, 4]}, fin.links: {values: [2, 3]}}')
    results = dict(zip(made.names, zip(*places))) | {
        name: [10.0 * chains + links for chains, links in places] for name in plot.PLOTTED}
    monkeypatch.setattr(plot, 'whole', contextlib.nullcontext)
    plot.draw(made, results, tmp_path / 'plot.png')
    drawn, = figure.axes[0].collections
    assert type(drawn).__name__ == kind
    if kind == 'QuadMesh':
        assert drawn.get_array().tolist() == [[22, 42], [23, 43]]
    else:
        assert drawn.get_offsets().tolist() == [[*place] for place in places]


def test_a_plot_that_cannot_be_written_leaves_the_results_and_one_line(study, tmp_path, monkeypatch):
    study(SMALL)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sweeps, 'on_ending', lambda action: None)

    def fail(*_):
        raise OSError('no space is left')

    monkeypatch.setattr(sweeps, 'draw', fail)
    with pytest.raises(SystemExit) as ended:
        main(['study.yaml', '--plot', 'plot.png'])
    assert ended.value.code == 'sweep: no space is left'
    assert len(rows_of(tmp_path / 'results.parquet')) == 6


def test_files_of_others_are_kept(study, tmp_path):
    made, parts = study(SMALL), tmp_path / 'results.parquet.parts'
    parts.mkdir()
    (parts / 'part-0000000.parquet').write_text('mine')
    with pytest.raises(FileExistsError, match=r'results\.parquet\.parts has other files than parts of a sweep'):
        sweep(made, tmp_path / 'results.parquet')
    (parts / 'part-0000000.parquet').rename(parts / 'notes')
    (parts / '_study').write_text(made.digest)  # begun, and then somebody put a file there
    assert sweep(made, tmp_path / 'results.parquet') == 6
    assert [path.name for path in parts.iterdir()] == ['notes'] and (parts / 'notes').read_text() == 'mine'
    assert sweep(made, tmp_path / 'results.parquet') == 0
    assert (parts / 'notes').exists()


@pytest.mark.parametrize('share', [0.0, 0.5, 0.9])
def test_parts_that_lost_their_end_are_done_again(share, study, tmp_path, monkeypatch):
    made, output = study(SMALL), tmp_path / 'results.parquet'
    monkeypatch.setattr(sweeps, '_blocks', lambda cases, size: [cases[:2], cases[2:]])

    def kill(count):
        if count == 4:
            raise KeyboardInterrupt

    with contextlib.suppress(KeyboardInterrupt):
        sweep(made, output, progress=kill)
    monkeypatch.undo()
    parts = sorted((tmp_path / 'results.parquet.parts').glob('part-*.parquet'))
    assert len(parts) == 2
    for part in parts:
        content = part.read_bytes()
        part.write_bytes(content[:int(share * len(content))])
    assert sweep(made, output) == 6
    assert_same(rows_of(output), simulate_cases(made))


def test_cases_that_keep_many_states_are_simulated_in_turn(study, monkeypatch):
    made, batches = study(SMALL), []
    expected = simulate_cases(made)

    def counted(parameters, *arguments, **options):
        batches.append(len(parameters))
        return simulate_batch(parameters, *arguments, **options)

    monkeypatch.setattr(cases, 'simulate_batch', counted)
    monkeypatch.setattr(cases, 'NUMBERS_AT_ONCE', 1)
    assert_same(simulate_cases(made), expected)
    assert batches == [1] * (2 * 6)


@pytest.mark.parametrize('names', [1, 2])
def test_the_command_writes_results_and_a_plot(names, study, tmp_path):
    study(SMALL.replace('{values: [20, 40]}', '40') if names == 1 else SMALL)
    process = command('study.yaml', '--plot', 'plot.png', cwd=tmp_path)
    out, err = process.communicate(timeout=LIMIT)
    assert process.returncode == 0, err
    assert out == f'results.parquet: {3 * names} cases, {3 * names} of them simulated now, 0 without a result\n'
    schema = pq.read_schema(tmp_path / 'results.parquet')
    assert schema.field('frequency').metadata == {b'unit': b'Hz'} and schema.field('power').metadata == {b'unit': b'W'}
    with Image.open(tmp_path / 'plot.png') as image:
        assert len(image.getcolors(maxcolors=image.width * image.height)) > 50


@contextlib.contextmanager
def started(module, *arguments, folder):
    with (folder / f'{module}.log').open('ab') as log:
        process = subprocess.Popen(
            [sys.executable, '-m', f'distributed.cli.{module}', *map(str, arguments)], cwd=folder, stdout=log,
            stderr=log, env=os.environ | {'DASK_DISTRIBUTED__DASHBOARD__LINK': ''})
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@contextlib.contextmanager
def cluster(folder, workers):
    """Start a scheduler and workers of Dask; return its address, its process, and those of the workers."""
    distributed = pytest.importorskip('distributed')
    address = folder / 'scheduler.json'
    arguments = ('--scheduler-file', address, '--no-dashboard', '--host', '127.0.0.1')
    with contextlib.ExitStack() as stack:
        scheduler = stack.enter_context(started('dask_scheduler', *arguments, '--port', 0, folder=folder))
        processes = [stack.enter_context(started(
            'dask_worker', *arguments, '--no-nanny', '--nthreads', 1, folder=folder)) for _ in range(workers)]
        deadline = time.monotonic() + LIMIT
        while not address.exists():
            assert time.monotonic() < deadline, (folder / 'dask_scheduler.log').read_text()
            time.sleep(0.05)
        with distributed.Client(scheduler_file=address) as client:
            client.wait_for_workers(workers, timeout=LIMIT)
            url = client.scheduler.address
        yield url, scheduler, processes


def test_a_cluster_does_all_cases_although_one_of_its_workers_is_killed(study, tmp_path):
    made = study(LONG)
    with cluster(tmp_path, workers=2) as (url, _, (victim, _)):
        def kill(count):
            if count:
                victim.kill()

        assert sweep(made, tmp_path / 'all.parquet', scheduler=url, progress=kill) == len(made.cases)
        assert victim.wait(LIMIT) == -signal.SIGKILL
    rows = rows_of(tmp_path / 'all.parquet')
    assert [row['case'] for row in rows] == list(range(len(made.cases)))
    assert not any(row['error'] for row in rows)
    assert_same(rows[:8], simulate_cases(made.part(range(8))))


def test_a_scheduler_that_ends_is_told_in_a_line_and_the_finished_parts_are_kept(study, tmp_path):
    made, done = study(LONG), []
    with cluster(tmp_path, workers=1) as (url, scheduler, _):
        def end(count):
            done.append(count)
            if count:
                scheduler.terminate()
                scheduler.wait(LIMIT)

        with pytest.raises(ConnectionError, match=f'^the scheduler at {url} ended: the same command goes on after'):
            sweep(made, tmp_path / 'all.parquet', scheduler=url, progress=end)
    assert 0 < sum(done) < len(made.cases)
    assert sweep(made, tmp_path / 'all.parquet') == len(made.cases) - sum(done)


def test_a_worker_that_fails_is_told_in_a_line(study, tmp_path, monkeypatch):
    def fail(part):
        raise ModuleNotFoundError('No module named manta_sim_ros')

    made = study(SMALL)
    monkeypatch.setattr(sweeps, 'simulate_cases', fail)
    with cluster(tmp_path, workers=1) as (url, *_), pytest.raises(
            ChildProcessError, match='^a worker failed: ModuleNotFoundError: No module named manta_sim_ros'):
        sweep(made, tmp_path / 'all.parquet', scheduler=url)
    assert not list(tmp_path.glob('all.parquet*'))


def test_nothing_is_left_of_the_client_of_a_scheduler_that_is_not_there(study, tmp_path, monkeypatch):
    distributed = pytest.importorskip('distributed')
    made, clients = study(SMALL), []

    class Client(distributed.Client):
        def start(self, **options):
            clients.append(weakref.ref(self))
            super().start(**options)

    monkeypatch.setattr(distributed, 'Client', Client)
    gc.disable()
    try:
        with pytest.raises(AddressError, match='^there cannot be a scheduler at nowhere: missing port'):
            sweep(made, tmp_path / 'all.parquet', scheduler='nowhere')
        assert [client() for client in clients] == [None]
    finally:
        gc.enable()


@pytest.mark.parametrize(('address', 'status', 'problem'), [
    ('tcp://127.0.0.1:1', 1, 'there is no scheduler at'), ('nowhere', 2, 'there cannot be a scheduler at'),
    ('tls://127.0.0.1:1', 2, 'there cannot be a scheduler at'),
    ('ftp://127.0.0.1:1', 2, 'there cannot be a scheduler at'),
])
def test_a_scheduler_that_is_not_there_is_told_in_a_line(address, status, problem, study, tmp_path):
    pytest.importorskip('distributed')
    study(SMALL)
    ended = subprocess.run(
        [*command_of('sweep'), 'study.yaml', '--scheduler', address], cwd=tmp_path, capture_output=True, text=True,
        timeout=LIMIT, env=os.environ | {'DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT': '0.5s'})
    assert ended.returncode == status
    (line,) = (line for line in ended.stderr.splitlines() if 'dynamics' not in line)  # which may be compiled first
    assert re.match(f'sweep: {problem} {address}: ', line)
    assert [path.name for path in tmp_path.iterdir()] == ['study.yaml']


def test_few_samples_of_a_period_are_enough(study, monkeypatch):
    made = study(SMALL)
    few = simulate_cases(made)
    monkeypatch.setattr(cases, 'SAMPLES', 400)
    for row, other in zip(few, simulate_cases(made)):
        for name in ('thrust', 'speed', 'power', 'strouhal'):
            assert row[name] == pytest.approx(other[name], rel=0.01, abs=1e-3), name

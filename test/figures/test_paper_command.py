"""The command `paper_figures`, as it is installed: files, progress, refusals, Ctrl-C."""

import concurrent.futures
import csv
import io
import os
import re
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from evidence.harness.processes import LIMIT, command_of
from manta_sim_ros.figures import command, figure_7, figure_8, figure_9, jobs, turning
from manta_sim_ros.figures.animation import FRAMES
from manta_sim_ros.figures.command import NAMES, figure_jobs
from manta_sim_ros.figures.files import whole, write_csv
from manta_sim_ros.figures.gaits import robot
from manta_sim_ros.figures.jobs import Job, run_jobs

SHOWN = ('figure_7', 'figure_9', 'figure_10')


def run(*arguments, cwd):
    return subprocess.run(
        [*command_of('paper_figures'), *map(str, arguments)], cwd=cwd, capture_output=True, text=True, timeout=LIMIT)


@pytest.fixture(scope='module')
def drawn(tmp_path_factory):
    """Return the finished process that drew some figures below a directory that was not there, and that directory."""
    folder = tmp_path_factory.mktemp('drawn')
    return run(*SHOWN, '--output', 'made/for it', '--processes', 2, cwd=folder), folder / 'made' / 'for it'


def table(path):
    with path.open(newline='', encoding='utf-8') as file:
        names, *rows = csv.reader(file)
    return dict(zip(names, np.array([[float(cell or 'nan') for cell in row] for row in rows]).T, strict=True))


def test_it_writes_just_the_figures_that_were_asked_for(drawn):
    process, directory = drawn
    assert process.returncode == 0, process.stderr
    assert sorted(path.name for path in directory.iterdir()) == sorted(
        f'{name}.{kind}' for name in SHOWN for kind in ('png', 'csv'))
    assert re.search(r'^6 files were written to made/for it in \d+ s$', process.stdout.splitlines()[-1])


def test_it_prints_what_is_done_and_shows_no_bar_where_there_is_no_terminal(drawn):
    lines = drawn[0].stdout.splitlines()
    assert sorted(line.partition(' (')[0] for line in lines[:-1]) == sorted(
        f'{name}.png, {name}.csv' for name in SHOWN)
    assert '%|' not in drawn[0].stderr


@pytest.mark.parametrize('name', SHOWN)
def test_a_figure_is_a_picture_with_something_on_it(drawn, name):
    with Image.open(drawn[1] / f'{name}.png') as image:
        assert image.width == 936  # 7.2 inches
        colors = image.convert('RGB').getcolors(maxcolors=image.width * image.height)
        assert len(colors) > 50
        assert max(colors)[1] == (255, 255, 255) and 0.5 < max(colors)[0] / (image.width * image.height) < 0.99


def test_the_data_are_those_of_the_paper_gaits(drawn):
    waves, speed = table(drawn[1] / 'figure_7.csv'), table(drawn[1] / 'figure_9.csv')
    assert len(waves['time / period']) == 200
    assert np.ptp(waves['leading chain q1 [deg]']) > 10.0
    assert speed['time [s]'][-1] == pytest.approx(20 / 0.6, rel=1e-6)
    means = [speed[f'forward speed, A = {amplitude} deg, 30 chains [m/s]'].mean() for amplitude in (20, 30, 40)]
    assert 0.0 < means[0] < means[1] < means[2] < 0.4
    paths = table(drawn[1] / 'figure_10.csv')
    assert len(paths['time [s]']) == 20 * 100
    assert paths['y, set 2, 30 chains [m]'][-1] < -1.0


@pytest.mark.parametrize(('arguments', 'line'), [
    (['figure_12'], r"argument NAME: 'figure_12' is not one of figure_7, figure_8, figure_9, figure_10, figure_11"),
    (['--processes', '0'], r"--processes: '0' is not a whole number greater than 0"),
    (['--processes', 'two'], r"--processes: 'two' is not a whole number greater than 0"),
    (['--fast'], r'unrecognized arguments: --fast'),
])
def test_wrong_arguments_are_refused_with_a_line_that_names_them(arguments, line, tmp_path):
    process = run(*arguments, cwd=tmp_path)
    assert process.returncode == 2
    assert re.search(line, process.stderr.splitlines()[-1])
    assert list(tmp_path.iterdir()) == []


def test_a_directory_that_cannot_be_made_is_refused_before_anything_is_computed(tmp_path):
    (tmp_path / 'file').write_text('mine')
    process = run('figure_7', '-o', tmp_path / 'file' / 'below', cwd=tmp_path)
    assert process.returncode == 1
    assert len(process.stderr.splitlines()) == 1
    assert re.fullmatch(r"paper_figures: .*Not a directory: '.*/file/below'", process.stderr.strip())
    assert (tmp_path / 'file').read_text() == 'mine'


@pytest.mark.parametrize('ending', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_an_interruption_ends_all_processes_and_leaves_nothing_half_done(ending, tmp_path):
    process = subprocess.Popen(
        [*command_of('paper_figures'), 'figure_7', 'straight', 'turn_set_1', '-o', 'out'], cwd=tmp_path,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    parts = (tmp_path / 'out').glob
    deadline = time.monotonic() + LIMIT
    while not list(parts('.part-*.gif')):
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.02)
    process.send_signal(ending)
    out, err = process.communicate(timeout=LIMIT)  # until no process that it started holds its output
    assert process.returncode == 130
    assert err.splitlines()[-1] == 'paper_figures: interrupted; finished files are kept'
    assert 'Traceback' not in out + err
    assert not list(parts('*.gif'))
    assert not list(parts('.part-*')), 'half a file stayed'


def test_a_signal_does_not_interrupt_what_holds_the_locks_of_futures(monkeypatch):
    wait, waited = concurrent.futures.wait, []

    def interrupted(*arguments, **options):
        signal.raise_signal(signal.SIGINT)  # here its exception could leave a lock taken, and the executor would hang
        waited.append(None)
        return wait(*arguments, **options)

    monkeypatch.setattr(concurrent.futures, 'wait', interrupted)
    handler = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        run_jobs([Job('', 1, Squared(2))], processes=1)
    assert waited == [None] and signal.getsignal(signal.SIGINT) is handler


def test_the_jobs_cover_every_name_once():
    files = [name for job in figure_jobs(None, NAMES) for name in job.name.split(', ')]
    assert sorted(files) == sorted(
        [f'{name}.{kind}' for name in NAMES if name.startswith('figure') for kind in ('png', 'csv')]
        + [f'{name}.gif' for name in NAMES if not name.startswith('figure')])
    assert {'figure_7', 'figure_8', 'figure_9', 'figure_10', 'figure_11', 'straight', 'turn_set_1',
            'turn_set_2'} == set(NAMES)


def test_each_job_calls_done_once_for_each_of_its_parts(monkeypatch, tmp_path):
    fast = robot(fin={'chains': 2})
    for module in (figure_7, figure_8, figure_9, turning):
        monkeypatch.setattr(module, 'robot', lambda base=None, **groups: robot(fast if base is None else base, **{
            name: {key: value for key, value in values.items() if key != 'chains'} for name, values in groups.items()}))
    monkeypatch.setattr(figure_8, 'mean_thrust', lambda *gait: (1, 0.0))
    monkeypatch.setattr(command, 'save_png', lambda draw, path, height: path.write_text(f'{draw.__qualname__}'))
    monkeypatch.setattr(command, 'animate', lambda name, path, done: [path.write_text(name)] + [
        done() for _ in range(FRAMES)])
    for job in figure_jobs(tmp_path, NAMES):
        calls = []
        job.run(lambda: calls.append(None))  # noqa: B023
        assert len(calls) == job.parts, job.name
    for path in tmp_path.glob('*.gif'):
        assert path.read_text() == path.stem
    for path in tmp_path.glob('*.png'):
        assert path.read_text() == f'{path.stem.title().replace("_", "")}.draw'


@pytest.mark.parametrize(('arguments', 'names', 'processes'), [
    ([], list(NAMES), None), (['-j', '3', 'figure_7'], ['figure_7'], 3),
    (['figure_9', '-o', 'elsewhere', 'straight'], ['figure_9', 'straight'], None)])
def test_what_is_asked_for_is_what_is_run(monkeypatch, tmp_path, arguments, names, processes):
    asked = {}
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(command, 'compile_kernels', lambda *_: None)
    monkeypatch.setattr(command.signal, 'signal', lambda *_: None)
    monkeypatch.setattr(command, 'figure_jobs', lambda directory, wanted: asked.update(wanted=list(wanted)) or [])
    monkeypatch.setattr(command, 'run_jobs', lambda jobs, number: asked.update(number=number))
    command.main(arguments)
    assert asked == {'wanted': names, 'number': processes}
    assert [path.name for path in tmp_path.iterdir()] == ['elsewhere' if '-o' in arguments else 'paper_figures']


def test_output_that_nobody_reads_costs_no_figure(tmp_path):
    process = subprocess.Popen(
        [*command_of('paper_figures'), 'figure_7', '-o', 'out'], cwd=tmp_path, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True)
    process.stdout.close()
    assert process.wait(LIMIT) == 0, process.stderr.read()
    assert 'Error' not in process.stderr.read()
    assert sorted(path.name for path in (tmp_path / 'out').iterdir()) == ['figure_7.csv', 'figure_7.png']


def test_a_process_that_is_killed_is_told_in_a_line_and_leaves_nothing(tmp_path):
    process = subprocess.Popen(
        [*command_of('paper_figures'), 'straight', '-o', 'out'], cwd=tmp_path, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + LIMIT
    while not (parts := list((tmp_path / 'out').glob('.part-*.gif'))):
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.02)
    os.kill(int(parts[0].name.split('-')[1]), signal.SIGKILL)  # a part's name tells whose it is
    _, err = process.communicate(timeout=LIMIT)
    assert process.returncode == 1
    assert err.splitlines()[-1].startswith('paper_figures: one of its processes was killed')
    assert 'Traceback' not in err
    assert list((tmp_path / 'out').iterdir()) == []


def test_when_the_first_process_is_killed_the_others_end_too(tmp_path):
    process = subprocess.Popen(
        [*command_of('paper_figures'), 'straight', '-o', 'out'], cwd=tmp_path, stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL, text=True)
    deadline = time.monotonic() + LIMIT
    while not list((tmp_path / 'out').glob('.part-*.gif')):
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.02)
    process.kill()
    process.communicate(timeout=LIMIT)  # until no process holds its output
    assert not (tmp_path / 'out' / 'straight.gif').exists()
    assert run('figure_7', '-o', 'out', cwd=tmp_path).returncode == 0
    assert sorted(path.name for path in (tmp_path / 'out').iterdir()) == ['figure_7.csv', 'figure_7.png']


def test_a_directory_that_cannot_be_written_to_is_refused(monkeypatch, tmp_path):
    def refuse(dir):  # noqa: A002
        raise PermissionError(13, 'Permission denied', str(dir))

    monkeypatch.setattr(command.tempfile, 'TemporaryFile', refuse)
    with pytest.raises(PermissionError, match=f"Permission denied: '{tmp_path}'"):
        command.made_directory(tmp_path)


def test_an_unknown_figure_is_no_job():
    with pytest.raises(ValueError, match="'figure_6' is neither a figure nor an animation; the names are figure_7"):
        figure_jobs(None, ['figure_7', 'figure_6'])


def squared(value, done):
    done()
    return value**2


class Thrice:
    def __init__(self, value):
        self.value = value

    def __call__(self, done):
        for _ in range(3):
            done()
            time.sleep(0.2)
        return self.value


class Pid:
    def __call__(self, done):
        time.sleep(0.1)
        return os.getpid()


def failing(done):
    raise RuntimeError('broken job')


class Squared:
    """A picklable job: `functools.partial` of a function of this module would do as well."""

    def __init__(self, value):
        self.value = value

    def __call__(self, done):
        return squared(self.value, done)


def test_results_come_in_the_order_of_the_jobs_and_each_is_announced(capfd):
    assert run_jobs([Job(f'job {value}', 1, Squared(value)) for value in range(5)], processes=2) == [0, 1, 4, 9, 16]
    assert sorted(line.partition(' (')[0] for line in capfd.readouterr().out.splitlines()) == [
        f'job {value}' for value in range(5)]


def test_the_bar_counts_every_part_once(monkeypatch):
    counted = []

    class Bar(jobs.tqdm):
        def __init__(self, **options):
            super().__init__(**options | {'disable': False, 'file': io.StringIO()})

        def update(self, n=1):
            counted.append(n)
            return super().update(n)

    monkeypatch.setattr(jobs, 'tqdm', Bar)
    bars = [Job('', 3, Thrice(1)), Job('', 3, Thrice(2))]
    assert run_jobs(bars, processes=1) == [1, 2]
    assert sum(counted) == 6
    assert sum(counted[:-1]) > 0  # while they work, not at the end only
    assert run_jobs([], processes=1) == []


def test_no_more_processes_work_than_were_asked_for():
    assert len(set(run_jobs([Job('', 1, Pid()) for _ in range(6)], processes=2))) <= 2


def test_a_job_that_fails_ends_the_others_and_is_raised():
    with pytest.raises(RuntimeError, match='broken job'):
        run_jobs([Job('fails', 1, failing), Job('job 1', 1, Squared(1)), Job('job 2', 1, Squared(2))], processes=1)


def test_a_file_is_there_whole_or_not_at_all(tmp_path):
    path = tmp_path / 'figure.csv'
    path.write_text('old')
    with pytest.raises(RuntimeError), whole(path) as part:
        part.write_text('new')
        raise RuntimeError
    assert path.read_text() == 'old'
    for name in ('.part-1-figure.csv', '.part-1-other.csv'):  # as killed processes leave them
        (tmp_path / name).touch()
    with whole(path) as part:
        part.write_text('new')
    assert path.read_text() == 'new'
    assert sorted(file.name for file in tmp_path.iterdir()) == ['.part-1-other.csv', 'figure.csv']


def test_a_file_is_on_the_disk_before_it_has_its_name(tmp_path, monkeypatch):
    done = []
    monkeypatch.setattr(os, 'fsync', lambda descriptor: done.append(os.fstat(descriptor).st_size))
    with whole(tmp_path / 'figure.csv') as part:
        part.write_text('new')
        monkeypatch.setattr(Path, 'replace', lambda *_: done.append('named'))
    assert done == [3, 'named']


def test_a_table_has_a_row_a_sample_and_nothing_for_what_is_no_number(tmp_path):
    write_csv({'time [s]': np.array([0.0, 0.1]), 'speed, mean [m/s]': np.array([np.nan, 1.0 / 3.0]),
               'what': np.array(['a', 'b'])}, tmp_path / 'table.csv')
    assert (tmp_path / 'table.csv').read_text().splitlines() == [
        'time [s],"speed, mean [m/s]",what', '0,,a', '0.1,0.3333333,b']
    with pytest.raises(ValueError):
        write_csv({'a': np.zeros(2), 'b': np.zeros(3)}, tmp_path / 'uneven.csv')

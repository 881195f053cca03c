"""The examples of the library run as they are and print what they promise; those with ROS are in test/nodes."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from evidence.scenarios import PACKAGE_ROOT
from manta_sim_ros.dynamics import MONOLITHIC, SEQUENTIAL

EXAMPLES = Path(__file__).parents[2] / 'examples'


def run(name, folder):
    """Run an example in another folder; return the lines that it printed."""
    ended = subprocess.run(
        [sys.executable, EXAMPLES / name], cwd=folder, capture_output=True, text=True, timeout=300,
        env={'PYTHONPATH': str(PACKAGE_ROOT), 'PATH': '/usr/bin:/bin', 'HOME': str(folder)})
    assert ended.returncode == 0, ended.stderr
    assert all(line.startswith(('compiling the dynamics', 'the compiled dynamics are kept in'))
               for line in ended.stderr.splitlines()), ended.stderr
    return ended.stdout.splitlines()


@pytest.mark.parametrize('path', sorted(EXAMPLES.iterdir()), ids=lambda path: path.name)
def test_an_example_is_a_short_script_that_says_its_idea(path):
    text = path.read_text(encoding='utf-8')
    assert 20 <= len(text.splitlines()) <= 60
    assert text.startswith('#!/usr/bin/env python3\n"""')


def test_swim_reaches_a_steady_speed_ahead(tmp_path):
    speeds = [float(re.search(r'([\d.]+) m/s$', line)[1]) for line in run('swim.py', tmp_path)]
    assert len(speeds) == 10
    assert all(before <= after for before, after in zip(speeds, speeds[1:]))  # printed with three decimals
    assert speeds[0] < 0.5 * speeds[-1]
    assert speeds[-1] - speeds[-2] <= 0.002  # steady [m/s]


def test_thrust_map_grows_with_amplitude_and_frequency(tmp_path):
    head, *rows = run('thrust_map.py', tmp_path)
    assert len(re.findall(r'[\d.]+ Hz', head)) == 3 and len(rows) == 4
    thrust = [[float(value) for value in row.split('°')[1].split()] for row in rows]
    for line in (*thrust, *zip(*thrust)):
        assert all(0.0 < before < after for before, after in zip(line, line[1:]))


def test_light_body_shows_where_the_staggered_coupling_ends(tmp_path):
    head, *rows = run('light_body.py', tmp_path)
    assert 'staggered' in head and 'monolithic' in head and (SEQUENTIAL, MONOLITHIC) == ('sequential', 'monolithic')
    cells = [row.split() for row in rows]
    staggered, monolithic = [row[1] for row in cells], [float(row[2]) for row in cells]
    assert staggered[-1] == 'diverges'
    for one, other in zip(staggered[:-1], monolithic):
        assert abs(float(one) - other) < 0.005 * other  # the paper's step; measured: 0.2 %
    assert monolithic == sorted(monolithic)  # a lighter robot starts faster


def test_sweep_phase_finds_a_fastest_phase_between_the_ends(tmp_path):
    found = [re.fullmatch(r'phase (\d+)°  +([\d.]+) m/s', line) for line in run('sweep_phase.py', tmp_path)]
    speeds = {int(line[1]): float(line[2]) for line in found}
    assert list(speeds) == list(range(10, 90, 10))
    assert 10 < max(speeds, key=speeds.get) < 80

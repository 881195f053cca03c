"""The command line of the nodes: what is not for ROS 2 is refused, and --help helps."""

import re
import subprocess

import pytest

from evidence.harness.processes import LIMIT, command_of

EXECUTABLES = ['sim_node', 'gait_node', 'monitor_node']
REFUSED = {
    'a value without --ros-args': ['publish_rate:=50'],
    '-p without --ros-args': ['-p', 'publish_rate:=50'],
    'a file without --ros-args': ['--params-file', 'config/manta.yaml'],
    'a word after the ROS 2 arguments': ['--ros-args', '-p', 'publish_rate:=50.0', '--', 'publish_rate:=60'],
    'a long word': ['x' * 100_000],
}


def run(executable, *arguments):
    return subprocess.run([*command_of(executable), *arguments], capture_output=True, text=True, timeout=LIMIT)


@pytest.mark.parametrize('executable', EXECUTABLES)
def test_a_word_that_is_not_for_ros_ends_it_with_one_line(executable):
    done = run(executable, '-p', 'publish_rate:=50')
    (line,) = done.stderr.splitlines()
    assert done.returncode == 2 and "'-p publish_rate:=50' is not taken" in line
    assert '--ros-args -p NAME:=VALUE' in line


@pytest.mark.parametrize('arguments', REFUSED.values(), ids=REFUSED)
def test_whatever_it_is(arguments):
    done = run('monitor_node', *arguments)
    (line,) = done.stderr.splitlines()
    assert done.returncode == 2 and arguments[-1][:100] in line and len(line) < 600


@pytest.mark.parametrize('executable', EXECUTABLES)
@pytest.mark.parametrize('asked', ['-h', '--help'])
def test_help_says_what_it_is_and_how_to_give_parameters(executable, asked):
    done = run(executable, asked)
    assert done.returncode == 0 and done.stderr == ''
    assert re.match(r'usage: \S+ \[--ros-args', done.stdout) and '-p NAME:=VALUE' in done.stdout
    assert 'The node `manta_' in done.stdout

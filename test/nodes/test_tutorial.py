"""The tutorial, step by step: every file of it is saved, and every command is run, in an empty folder."""

import math
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from nav_msgs.msg import Odometry

from evidence import harness
from evidence.harness.processes import LIMIT

pytest.importorskip('rosbags')

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / 'docs' / 'tutorial.md').read_text(encoding='utf-8')
BLOCK = re.compile(r'^```(\w+)\n(.*?)^```$', re.MULTILINE | re.DOTALL)
LASTING = ('ros2 run manta_sim_ros sim_node', 'ros2 run manta_sim_ros path_follower', 'ros2 topic echo',
           'ros2 bag record', 'python3 heading.py')
"""Beginnings of commands that go on until Ctrl-C."""


class Terminal:
    """Runs commands in a folder, one after the other; what goes on runs beside them until it is ended."""

    def __init__(self, folder, environment):
        self.folder, self._environment, self._lasting = folder, environment, {}

    def run(self, command, folder=None):
        """Run a line to its end, and return what it prints."""
        ended = subprocess.run(
            ['bash', '-c', command], cwd=folder or self.folder, env=self._environment, stdin=subprocess.DEVNULL,
            capture_output=True, text=True, timeout=LIMIT)
        assert ended.returncode == 0, f'{command}\n{ended.stdout}{ended.stderr}'
        return ended.stdout + ended.stderr

    def begin(self, command):
        """Run a line that goes on."""
        log = self.folder / f'{len(list(self.folder.glob("*.log")))}.log'
        with log.open('wb') as file:
            process = subprocess.Popen(
                ['bash', '-c', f'exec {command}'], cwd=self.folder, env=self._environment, stdin=subprocess.DEVNULL,
                stdout=file, stderr=subprocess.STDOUT)
        self._lasting[command] = process, log

    @property
    def lasting(self):
        """The lines that go on."""
        return list(self._lasting)

    def output(self, command):
        """Return what a line that goes on has printed."""
        process, log = self._lasting[command]
        assert process.poll() is None, log.read_text()
        return log.read_text()

    def end(self, command):
        """End a line as Ctrl-C does; rclpy may raise an error then, which only the nodes of this package handle."""
        process, _ = self._lasting.pop(command)
        process.send_signal(signal.SIGINT)
        process.wait(LIMIT)

    def close(self):
        for process, _ in self._lasting.values():
            process.terminate()
            process.wait(LIMIT)


@pytest.fixture(scope='module')
def terminal(tmp_path_factory):
    folder = tmp_path_factory.mktemp('tutorial')
    programs = tmp_path_factory.mktemp('programs')
    if shutil.which('ros2') is None:
        command = Path(harness.__file__).with_name('ros2_command.py')
        (programs / 'ros2').write_text(f'#!/bin/sh\nexec {sys.executable} {command} "$@"\n')
        (programs / 'ros2').chmod(0o755)
    (programs / 'python3').write_text(f'#!/bin/sh\nexec {sys.executable} "$@"\n')
    (programs / 'python3').chmod(0o755)
    path = os.pathsep.join([str(programs), os.environ['PATH']])
    made = Terminal(folder, os.environ | {'PATH': path, 'PYTHONUNBUFFERED': '1'})
    yield made
    made.close()


def blocks(terminal, title, folder=None):
    """Do what the blocks of a section say; yield after each the lines, or the last line, and what it printed."""
    text = re.search(rf'^## \d+\. {title}$(.*?)(?=^## |\Z)', PAGE, re.MULTILINE | re.DOTALL)[1]
    for language, block in BLOCK.findall(text):
        if language != 'bash':
            (terminal.folder / re.match(r'# (\S+)\n', block)[1]).write_text(block)
            yield block, ''
        elif block.startswith(LASTING):
            terminal.begin(block.strip())
            yield block.strip(), ''
        else:
            yield block.strip(), ''.join(terminal.run(line, folder) for line in block.splitlines())


def heading(odometry):
    q = odometry.pose.pose.orientation
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))


def test_all_steps_from_the_command_to_the_analysis_do_what_the_page_says(terminal, probe):
    odometry = probe.record(Odometry, '/odom')

    def until(condition, what):
        probe.until(lambda: [terminal.output(line) for line in terminal.lasting] and condition(), what)

    def said(line, text):
        until(lambda: text in terminal.output(line), text)

    def moved(axis):
        """Return the way of the last second along an axis of the world [m]."""
        last, before = (odometry[-index].pose.pose.position for index in (1, min(len(odometry), 101)))
        return getattr(last, axis) - getattr(before, axis)

    def at_the_start():
        at = odometry[-1].pose.pose.position
        return (at.x, at.y, at.z, heading(odometry[-1])) == (0.0, 0.0, 0.0, 0.0)

    command = blocks(terminal, 'Command it yourself')
    simulator, _ = next(command)
    said(simulator, 'publish fin commands on /fin_command')
    next(command)
    until(lambda: odometry and odometry[-1].pose.pose.position.x > 0.2, 'a way ahead')
    assert abs(odometry[-1].pose.pose.position.y) < 1e-6
    echo, _ = next(command)
    said(echo, 'x: ')
    terminal.end(echo)
    terminal.run('ros2 param set /manta_sim real_time_factor 2.0')
    next(command)
    until(lambda: heading(odometry[-1]) < -0.3, 'a turn to the right')
    next(command)
    said(simulator, 'left amplitude 1.5 rad with phase 3 rad')
    assert 'fin_command refused' in terminal.output(simulator) and next(command, None) is None

    ((_, printed),) = blocks(terminal, 'Stop time, and step')
    assert 'paused at' in printed and 'stepped to' in printed and 'running at' in printed

    push = blocks(terminal, 'Push it')
    next(push)
    until(lambda: moved('y') > 0.1, 'a drift to the left')
    _, printed = next(push)
    assert 'at rest where it started' in printed and next(push, None) is None
    until(at_the_start, 'the reset')

    write = blocks(terminal, 'Write a controller')
    next(write)
    count = len(odometry)
    controller, _ = next(write)
    until(lambda: len(odometry) > count + 300 and all(abs(heading(each) - 1.0) < 0.15 for each in odometry[-300:]),
          'the heading, held for 3 s')
    terminal.end(controller)
    next(write)
    assert next(write, None) is None
    until(at_the_start, 'the reset')

    follow = blocks(terminal, 'Follow a path, and record the swim')
    next(follow)
    recorder, _ = next(follow)
    for topic in ('/odom', '/fin_wrench', '/joint_states', '/fin_command', '/clock'):  # before anybody commands
        said(recorder, f"'{topic}'")
    follower, _ = next(follow)
    said(follower, 'the end of the path is reached')
    for line in (follower, recorder):
        terminal.end(line)
    assert next(follow, None) is None

    analyze = blocks(terminal, 'Analyze the swim')
    next(analyze)
    assert (terminal.folder / 'corner.html').stat().st_size > 1_000_000
    next(analyze)
    _, printed = next(analyze)
    way, beside, left = (float(number) for number in re.findall(r'(\d+\.\d+) m', printed))
    assert 6.5 < way < 9.0 and beside < 0.15 and left < 0.5


def test_the_library_works_without_ros(terminal):
    ((_, printed),) = blocks(terminal, 'Simulate without ROS', ROOT)
    assert 'm/s' in printed


def test_the_first_step_is_one_command(terminal):
    assert [block for _, block in BLOCK.findall(PAGE)][0] == 'make sim\n'  # test_sim_script.py is about it

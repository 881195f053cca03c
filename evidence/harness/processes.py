"""Real nodes, each in its own process."""

from __future__ import annotations

import contextlib
import itertools
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

LIMIT = 300.0
"""Longest time to wait for anything [s]: the first start compiles for half a minute, and on a busy machine for two."""
COLOR = re.compile(r'\x1b\[[0-9;]*m')
LINE_OF_OTHERS = re.compile(r'^\[[A-Z]+\] \[[0-9.]+\] \[rcl\b|^\d{4}-\d\d-\d\d .*\[RTPS_')
"""Of rcl, and of Fast DDS where a process that was killed left a file in /dev/shm."""


def own_lines(text):
    """Return the lines of a text without those of rcl and Fast DDS."""
    return [line for line in text.splitlines() if not LINE_OF_OTHERS.match(COLOR.sub('', line))]


def command_of(executable):
    """Return how to start an executable: as it was built, or from the source tree when the package is not built."""
    from ament_index_python.packages import PackageNotFoundError, get_package_prefix

    with contextlib.suppress(PackageNotFoundError):
        path = Path(get_package_prefix('manta_sim_ros'), 'lib', 'manta_sim_ros', executable)
        if path.is_file():
            return [str(path)]
    return [sys.executable, '-c', f'from manta_sim_ros.executables import {executable}; {executable}()']


def shared_memory_of(process):
    """Return the files of Fast DDS in /dev/shm that a process has opened now, by its number or `self`."""
    lines = Path(f'/proc/{process}/maps').read_text().splitlines()
    return {Path(line.split()[5]) for line in lines if '/dev/shm/fast' in line and 'port' not in line}


class NodeProcess:
    """A node in its own process. All its output goes to a file."""

    present = []

    def __init__(self, executable, ros_arguments, log, environment):
        self.name = f'{executable} {ros_arguments}'.strip()
        self._log = log
        self.may_end = False
        with log.open('wb') as file:
            self.process = subprocess.Popen(
                command_of(executable) + ['--ros-args', *shlex.split(ros_arguments)],
                stdin=subprocess.DEVNULL, stdout=file, stderr=subprocess.STDOUT,
                env=os.environ | {'ROS_LOG_DIR': str(log.parent)} | environment,
            )
        NodeProcess.present.append(self)

    @property
    def output(self):
        return self._log.read_text(errors='replace')

    @property
    def shared_memory(self):
        """Files of Fast DDS in /dev/shm that it has opened now."""
        return shared_memory_of(self.process.pid)

    def check_running(self):
        if not self.may_end and self.process.poll() is not None:
            raise AssertionError(f'{self.name} ended with status {self.process.returncode}')

    def wait_for_output(self, text):
        deadline = time.monotonic() + LIMIT
        while text not in self.output:
            self.check_running()
            assert time.monotonic() < deadline, f'{self.name} never printed {text!r}'
            time.sleep(0.02)

    def send(self, signal_number):
        self.may_end = True
        self.process.send_signal(signal_number)

    def exit_status(self):
        self.may_end = True
        return self.process.wait(LIMIT)

    def refusal(self):
        """Return the lines of a node that ended by itself with an error, without those of rcl and Fast DDS."""
        assert self.exit_status() > 0
        print(self.output)
        NodeProcess.present.remove(self)
        return own_lines(self.output)

    def end(self):
        self.send(signal.SIGTERM)
        try:
            self.process.wait(30.0)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        if self in NodeProcess.present:
            NodeProcess.present.remove(self)


def launcher(directory):
    """Yield `launch(executable, 'ROS arguments', environment={})`; end what it started afterwards."""
    started = []
    numbers = itertools.count()

    def launch(executable, ros_arguments='', environment=None):
        log = directory / f'{next(numbers)}_{executable}.log'
        node = NodeProcess(executable, ros_arguments, log, environment or {})
        started.append(node)
        return node

    try:
        yield launch
    finally:
        for node in started:
            node.send(signal.SIGTERM)
        for node in started:
            node.end()

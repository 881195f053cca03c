"""Fixtures of the node tests: real nodes in processes of their own, and a probe that hears and commands them."""

from __future__ import annotations

import bisect
import contextlib
import fcntl
import itertools
import math
import os
import re
import shlex
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

LIMIT = 120.0  # [s] for anything that is awaited: the first start of all compiles for half a minute
RCL_LINE = re.compile(r'^\[[A-Z]+\] \[[0-9.]+\] \[rcl\b')


def pytest_configure(config):
    """Take a ROS domain in which no other test session and no other node of this machine is, before rclpy is there."""
    for domain in range(1, 101):
        with contextlib.suppress(OSError):
            lock = Path(tempfile.gettempdir(), f'manta_sim_ros_test_domain_{domain}.lock').open('w')
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as port:
                port.bind(('', 7410 + 250 * domain))  # that of the domain's first participant
            config.domain_lock = lock  # held until the session ends
            break
    else:
        raise pytest.UsageError('no ROS domain from 1 to 100 is free')
    os.environ |= {'ROS_DOMAIN_ID': str(domain), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
                   'RCUTILS_COLORIZED_OUTPUT': '0'}


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    report = yield
    if report.failed:
        report.sections += [(f'output of {node.name}', node.output[-4_000:]) for node in NodeProcess.present]
    return report


def command_of(executable):
    """Return how to start an executable: as it was built, or from the source tree when the package is not built."""
    from ament_index_python.packages import PackageNotFoundError, get_package_prefix

    with contextlib.suppress(PackageNotFoundError):
        path = Path(get_package_prefix('manta_sim_ros'), 'lib', 'manta_sim_ros', executable)
        if path.is_file():
            return [str(path)]
    return [sys.executable, '-c', f'from manta_sim_ros.executables import {executable}; {executable}()']


class NodeProcess:
    """A node in a process of its own. All that it prints goes to a file."""

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

    def check_running(self):
        if not self.may_end and self.process.poll() is not None:
            pytest.fail(f'{self.name} ended with status {self.process.returncode}')

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
        """Return the lines that a node printed which ended by itself with an error, without those of rcl."""
        assert self.exit_status() > 0
        NodeProcess.present.remove(self)
        return [line for line in self.output.splitlines() if not RCL_LINE.match(line)]

    def end(self):
        self.send(signal.SIGTERM)
        try:
            self.process.wait(30.0)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        if self in NodeProcess.present:
            NodeProcess.present.remove(self)


def _launcher(directory):
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


@pytest.fixture
def launch(tmp_path_factory):
    """`launch(executable, 'ROS arguments', environment={})` starts a node for one test."""
    yield from _launcher(tmp_path_factory.mktemp('nodes'))


@pytest.fixture(scope='module')
def module_launch(tmp_path_factory):
    """As `launch`, for all tests of a module."""
    yield from _launcher(tmp_path_factory.mktemp('nodes'))


class Recording(list):
    """The messages of one topic since the recording began; `sent` holds when each was sent [ns of the system clock]."""

    def __init__(self, node, message_type, topic):
        self.sent = []
        self._node = node
        self._subscription = node.create_subscription(message_type, topic, self._take, 10_000)

    def _take(self, message, info):
        self.append(message)
        self.sent.append(info['source_timestamp'])

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        self._node.destroy_subscription(self._subscription)

    @property
    def stamps(self):
        """Stamp of each message [ns]."""
        stamps = [message.header.stamp if hasattr(message, 'header') else message.clock for message in self]
        return [stamp.sec * 1_000_000_000 + stamp.nanosec for stamp in stamps]

    def first_sent_after(self, moment):
        """Return the index of the first message that was not sent yet at a moment [ns of the system clock]."""
        return bisect.bisect_right(self.sent, moment)

    @property
    def finite(self):
        return all(math.isfinite(value) for message in self for value in _numbers(message))

    @property
    def rising(self):
        stamps = self.stamps
        return all(before < after for before, after in zip(stamps, stamps[1:]))


def _numbers(value):
    if hasattr(value, 'get_fields_and_field_types'):
        for name in value.get_fields_and_field_types():
            yield from _numbers(getattr(value, name))
    elif not isinstance(value, str):
        yield from value if hasattr(value, '__len__') else [value]


class Probe:
    """A node in the test's process. It hears only while it waits for something."""

    def __init__(self):
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        self._context = rclpy.Context()
        rclpy.init(context=self._context, args=[])
        self.node = rclpy.create_node('probe', context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)

    def record(self, message_type, topic):
        return Recording(self.node, message_type, topic)

    def until(self, condition, what, *, doing=None, every=0.1):
        """Wait for a condition; meanwhile call `doing` again and again, `every` so many seconds."""
        deadline = time.monotonic() + LIMIT
        due = 0.0
        while not condition():
            for node in NodeProcess.present:
                node.check_running()
            assert time.monotonic() < deadline, f'waited {LIMIT:g} s in vain: {what}'
            if doing is not None and time.monotonic() >= due:
                doing()
                due = time.monotonic() + every
            self._executor.spin_once(timeout_sec=0.02)

    def listen(self, seconds):
        end = time.monotonic() + seconds
        self.until(lambda: time.monotonic() >= end, f'{seconds:g} s of listening')

    def call(self, service_type, name, **request):
        client = self.node.create_client(service_type, name)
        self.until(client.service_is_ready, f'service {name}')
        asked = []  # again and again: middleware may lose the answer to a client that is new to the node
        self.until(
            lambda: any(future.done() for future in asked), f'answer of {name}',
            doing=lambda: asked.append(client.call_async(service_type.Request(**request))), every=5.0)
        self.node.destroy_client(client)
        return next(future for future in asked if future.done()).result()

    def topics_of(self, node, namespace='/'):
        """Return {topic: type} of what a simulator takes, and of what it publishes, without what any node has."""
        def ask(names_and_types_by_node):
            return {name: types[0] for name, types in names_and_types_by_node(node, namespace)
                    if name not in ('/rosout', '/parameter_events')}

        known, taken = self.node.get_node_names_and_namespaces, self.node.get_subscriber_names_and_types_by_node
        self.until(lambda: (node, namespace) in known(), f'the node {node} in {namespace}')
        self.until(lambda: any(name.endswith('/fin_command') for name in ask(taken)), f'what {node} takes')
        return ask(taken), ask(self.node.get_publisher_names_and_types_by_node)

    def close(self):
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.shutdown()


@pytest.fixture(scope='module')
def probe():
    """A node in this process that records topics, publishes commands and calls services."""
    made = Probe()
    yield made
    made.close()

"""Fixtures of all tests: real nodes, a node that listens to them, and references. Each run has its own ROS domain.

As this file is in the root of the repository, tests can import `evidence`.
"""

import contextlib
import fcntl
import os
import signal
import socket
import tempfile
from pathlib import Path

import pytest

from evidence.harness.processes import NodeProcess, launcher


def pytest_configure(config):
    """Choose a ROS domain that no other test run and no other node of this machine uses, before rclpy is imported.

    Under `nohup`, what the tests start gets SIGHUP all the same: what ignores a signal is inherited, a handler is not.
    """
    if hasattr(config, 'workerinput') or signal.getsignal(signal.SIGHUP) == signal.SIG_IGN:
        signal.signal(signal.SIGHUP, lambda *_: None)
    for domain in range(1, 101):
        with contextlib.suppress(OSError):
            lock = Path(tempfile.gettempdir(), f'manta_sim_ros_test_domain_{domain}.lock').open('w')
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            for participant in range(10):  # bound if one of them still runs, such as a node of a run that was killed
                with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as port:
                    port.bind(('', 7410 + 250 * domain + 2 * participant))
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


@pytest.fixture
def launch(tmp_path_factory):
    """`launch(executable, 'ROS arguments', environment={})` starts a node for one test."""
    yield from launcher(tmp_path_factory.mktemp('nodes'))


@pytest.fixture(scope='module')
def module_launch(tmp_path_factory):
    """As `launch`, for all tests of a module."""
    yield from launcher(tmp_path_factory.mktemp('nodes'))


@pytest.fixture(scope='session')
def pinocchio_tree():
    """The reference that Pinocchio solves; without Pinocchio, a test that asks for it is skipped."""
    return pytest.importorskip('evidence.references.pinocchio_tree')


@pytest.fixture(scope='module')
def probe():
    """A node in this process that records topics, publishes commands and calls services."""
    from evidence.harness.probe import Probe  # not before the domain is chosen

    made = Probe()
    yield made
    made.close()

"""Of all tests: a ROS domain of their own, and fixtures that start real nodes and listen to them.

As this file is here, tests can import `evidence`.
"""

import contextlib
import fcntl
import os
import socket
import tempfile
from pathlib import Path

import pytest

from evidence.harness.processes import NodeProcess, launcher


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


@pytest.fixture
def launch(tmp_path_factory):
    """`launch(executable, 'ROS arguments', environment={})` starts a node for one test."""
    yield from launcher(tmp_path_factory.mktemp('nodes'))


@pytest.fixture(scope='module')
def module_launch(tmp_path_factory):
    """As `launch`, for all tests of a module."""
    yield from launcher(tmp_path_factory.mktemp('nodes'))


@pytest.fixture(scope='module')
def probe():
    """A node in this process that records topics, publishes commands and calls services."""
    from evidence.harness.probe import Probe  # not before the domain is chosen

    made = Probe()
    yield made
    made.close()

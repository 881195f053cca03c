"""The executables end quietly from their first moment on, before any node is there."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from rclpy.context import Context

from evidence.harness.processes import LIMIT, command_of, own_lines
from manta_sim_ros.nodes.process import executor

SIGNALS = ['SIGINT', 'SIGTERM', 'SIGHUP']
OWN_DOMAIN = {'ROS_DOMAIN_ID': str(int(os.environ['ROS_DOMAIN_ID']) + 100)}  # its shared memory belongs to one process

INTERRUPTED_IMPORT = """
import os, signal, sys
from manta_sim_ros import executables

class Interrupter:
    @staticmethod
    def find_spec(name, path=None, target=None):
        if name == '{imported}':
            print('importing', flush=True)
            os.kill(os.getpid(), signal.{ending})

sys.meta_path.insert(0, Interrupter)
executables.{executable}()
print('not ended')
"""


@pytest.mark.parametrize('ending', SIGNALS)
@pytest.mark.parametrize(('executable', 'imported', 'status'), [
    ('sim_node', 'rclpy', 0), ('gait_node', 'rclpy', 0), ('monitor_node', 'rclpy', 0), ('paper_figures', 'tqdm', 130),
    ('path_follower', 'rclpy', 0), ('mpc_follower', 'rclpy', 0), ('track_node', 'rclpy', 0), ('teleop', 'rclpy', 0),
    ('simulate', 'rosbags', 130), ('report', 'rosbags', 130)])
def test_a_signal_in_the_middle_of_an_import_ends_it_with_its_status_and_no_traceback(
        executable, imported, status, ending):
    code = INTERRUPTED_IMPORT.format(executable=executable, imported=imported, ending=ending)
    process = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, timeout=LIMIT)
    assert process.returncode == status
    assert process.stdout == 'importing\n'
    assert process.stderr == ''


INTERRUPTED_PHASE = """
import hashlib, os, signal, time
import rclpy
from rclpy.node import Node
from manta_sim_ros.nodes import process
from manta_sim_ros.nodes.process import run_node

process.END_LIMIT = {limit}  # a process that a busy machine does not end in time leaves shared memory
if not '{phase}'.startswith('computing'):
    process.GRACE = {limit}  # the main thread ends by itself, whenever that is

def compute():
    hashlib.pbkdf2_hmac('sha256', b'', b'', 2**31 - 1)  # minutes in C, as a compilation or many time steps

def reach(phase, then=lambda: None):
    if phase == '{phase}':
        print(*{{name for line in open('/proc/self/maps') for name in line.split()[5:]
                if '/dev/shm/fast' in name and 'port' not in name}}, flush=True)
        os.kill(os.getpid(), signal.{ending})
        then()

class Interrupted(Node):
    def __init__(self):
        reach('before the node')
        super().__init__('interrupted')
        reach('constructor')
        self.create_publisher(rclpy.node.ParameterEvent, 'events', 10)
        self.create_timer(0.01, self.call_back)

    def call_back(self):
        reach('callback')
        reach('computing callback', compute)
        reach('destructor', self.leave)

    def leave(self):
        class Left:
            def __del__(self):
                time.sleep(0.1)
        Left()

def start(node):
    reach('start')
    reach('computing start', compute)

run_node(Interrupted, start, rclpy.spin_until_future_complete, [])
"""

PHASES = ['before the node', 'constructor', 'start', 'computing start', 'callback', 'computing callback', 'destructor']


@pytest.mark.parametrize('ending', SIGNALS)
@pytest.mark.parametrize('phase', PHASES)
def test_a_signal_in_any_phase_ends_a_node_quietly_and_leaves_no_shared_memory(phase, ending):
    before = set(Path('/dev/shm').iterdir())
    code = INTERRUPTED_PHASE.format(phase=phase, ending=ending, limit=LIMIT)
    process = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, timeout=LIMIT, env=os.environ | OWN_DOMAIN)
    assert process.returncode == 0
    assert own_lines(process.stderr) == []
    line = process.stdout.splitlines()[0]  # a callback may be called again
    files = {Path(name) for name in line.split()} - before
    assert bool(files) is (phase != 'before the node')
    assert [file for file in files if file.exists()] == []


ENDED_BY_ITSELF = """
import os, signal, threading
import rclpy
from rclpy.node import Node
from manta_sim_ros.nodes.process import run_node

class Heard(Node):
    def destroy_node(self):
        print('destroyed in', threading.current_thread().name, flush=True)
        super().destroy_node()

def spin(node, ending):
    rclpy.spin_until_future_complete(node, ending)
    print('spun', rclpy.ok(), flush=True)

run_node(lambda: Heard('heard'), lambda node: node.create_timer(0.1, lambda: os.kill(os.getpid(), signal.SIGTERM)),
         spin, [])
"""


def test_the_main_thread_has_spun_before_anything_is_destroyed():
    process = subprocess.run([sys.executable, '-c', ENDED_BY_ITSELF], capture_output=True, text=True, timeout=LIMIT)
    assert (process.returncode, own_lines(process.stderr)) == (0, [])
    assert process.stdout.splitlines()[:2] == ['spun True', 'destroyed in MainThread']


HANGING_END = """
import os, signal, threading
import rclpy
from rclpy.node import Node
from manta_sim_ros.nodes.process import run_node

class Hanging(Node):
    def destroy_node(self):
        threading.Event().wait()

run_node(lambda: Hanging('hanging'), lambda node: os.kill(os.getpid(), signal.SIGTERM),
         rclpy.spin_until_future_complete, [])
"""


def test_a_signal_ends_a_node_that_cannot_be_destroyed():
    process = subprocess.run([sys.executable, '-c', HANGING_END], capture_output=True, text=True, timeout=LIMIT)
    assert (process.returncode, process.stdout, own_lines(process.stderr)) == (0, '', [])


def test_nohup_lets_a_node_live_when_its_terminal_is_closed():
    code = """
import signal, sys
signal.signal(signal.SIGHUP, signal.SIG_IGN)
from manta_sim_ros import executables
executables.monitor_node()
"""
    process = subprocess.Popen([sys.executable, '-c', code], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout.readline() == 'waiting for /odom\n'
        process.send_signal(signal.SIGHUP)
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(2.0)
    finally:
        process.terminate()
        assert process.wait(LIMIT) == 0


@pytest.mark.parametrize('executable', ['monitor_node', 'paper_figures'])
def test_an_output_that_nobody_reads_any_more_ends_it_quietly(executable):
    reads, writes = os.pipe()
    os.close(reads)
    process = subprocess.Popen(
        [*command_of(executable), *(['--help'] if executable == 'paper_figures' else [])],
        stdin=subprocess.DEVNULL, stdout=writes, stderr=subprocess.PIPE, text=True,
        env=os.environ | {'PYTHONUNBUFFERED': ''})  # so that Python writes at the end
    os.close(writes)
    try:
        _, errors = process.communicate(timeout=LIMIT)
    finally:
        process.kill()
    assert (process.returncode, own_lines(errors)) == (0, [])


def test_an_output_that_cannot_be_written_is_told_in_a_line():
    with open('/dev/full', 'w') as full:
        process = subprocess.run(
            [*command_of('paper_figures'), '--help'], stdout=full, stderr=subprocess.PIPE, text=True, timeout=LIMIT,
            env=os.environ | {'PYTHONUNBUFFERED': ''})
    assert process.returncode == 1
    assert own_lines(process.stderr) == ['paper_figures: [Errno 28] No space left on device']


def test_a_closed_output_is_no_error():
    process = subprocess.run(
        ['bash', '-c', '"$@" >&-', 'bash', *command_of('paper_figures'), '--help'], stderr=subprocess.PIPE, text=True,
        timeout=LIMIT)
    assert process.returncode == 0 and 'Traceback' not in process.stderr


@pytest.mark.parametrize(('hidden', 'expected'), [
    ([], 'EventsExecutor'), (['rclpy.experimental.events_executor'], 'SingleThreadedExecutor')])
def test_the_executor_is_the_lightest_that_rclpy_has(hidden, expected, monkeypatch):
    for module in hidden:
        monkeypatch.setitem(sys.modules, module, None)
    context = Context()
    context.init()
    try:
        assert type(executor(context)).__name__ == expected
    finally:
        context.shutdown()


@pytest.mark.parametrize('variables', [{'HOME': '/proc/none'}, {'HOME': None}, {'ROS_LOG_DIR': '/proc/none'}])
@pytest.mark.parametrize('executable', ['sim_node', 'gait_node', 'monitor_node', 'path_follower', 'teleop'])
def test_without_a_folder_for_logs_one_line_names_the_variable_that_cures_it(executable, variables):
    environment = {name: value for name, value in {**os.environ, **variables}.items() if value is not None}
    if 'HOME' in variables:
        environment = {name: value for name, value in environment.items() if name not in ('ROS_LOG_DIR', 'ROS_HOME')}
    code = f'import sys; from manta_sim_ros import executables; sys.argv = [{executable!r}]; executables.{executable}()'
    process = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, timeout=LIMIT, env=environment)
    assert process.returncode == 1 and not process.stdout
    assert 'Traceback' not in process.stderr
    line = process.stderr.splitlines()[-1]  # without a home, rcutils of Jazzy prints lines of its own before it
    assert line.startswith(f'{executable}: ') and line.endswith('; set ROS_LOG_DIR to a folder that can be written to')

"""The executables end quietly from their first moment on, before any node is there."""

import os
import subprocess
import sys

import pytest

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


@pytest.mark.parametrize('ending', ['SIGINT', 'SIGTERM'])
@pytest.mark.parametrize(('executable', 'imported', 'status'), [
    ('sim_node', 'rclpy', 0), ('gait_node', 'rclpy', 0), ('monitor_node', 'rclpy', 0), ('paper_figures', 'tqdm', 130)])
def test_a_signal_in_the_middle_of_an_import_ends_it_with_its_status_and_no_traceback(
        executable, imported, status, ending):
    code = INTERRUPTED_IMPORT.format(executable=executable, imported=imported, ending=ending)
    process = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, timeout=120)
    assert process.returncode == status
    assert process.stdout == 'importing\n'
    assert process.stderr == ''


INTERRUPTED_DESTRUCTOR = """
import os, signal, time
import rclpy
from rclpy.node import Node
from manta_sim_ros.nodes.process import run_node

class Interrupter:
    def __del__(self):
        os.kill(os.getpid(), signal.{ending})
        time.sleep(0.1)
        print('destroyed')

class Interrupted(Node):
    def __init__(self):
        super().__init__('interrupted')
        self.create_timer(0.01, Interrupter)

run_node(Interrupted, lambda node: None, rclpy.spin, [])
print('ended')
"""


@pytest.mark.parametrize('ending', ['SIGINT', 'SIGTERM'])
def test_a_signal_in_the_middle_of_a_destructor_ends_it_quietly(ending):
    """Python reports an exception of a destructor, as the garbage collector of rclpy calls many, and goes on."""
    code = INTERRUPTED_DESTRUCTOR.format(ending=ending)
    process = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, timeout=120)
    assert process.returncode == 0
    assert process.stdout == 'ended\n'  # the destructor was interrupted
    assert process.stderr == ''


@pytest.mark.parametrize('variables', [{'HOME': '/proc/none'}, {'HOME': None}, {'ROS_LOG_DIR': '/proc/none'}])
@pytest.mark.parametrize('executable', ['sim_node', 'gait_node', 'monitor_node'])
def test_without_a_folder_for_logs_one_line_names_the_variable_that_cures_it(executable, variables):
    environment = {name: value for name, value in {**os.environ, **variables}.items() if value is not None}
    if 'HOME' in variables:
        environment = {name: value for name, value in environment.items() if name not in ('ROS_LOG_DIR', 'ROS_HOME')}
    code = f'import sys; from manta_sim_ros import executables; sys.argv = [{executable!r}]; executables.{executable}()'
    process = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, timeout=120, env=environment)
    assert process.returncode == 1 and not process.stdout
    assert 'Traceback' not in process.stderr
    line = process.stderr.splitlines()[-1]  # without a home, rcutils of Jazzy prints lines of its own before it
    assert line.startswith(f'{executable}: ') and line.endswith('; set ROS_LOG_DIR to a folder that can be written to')

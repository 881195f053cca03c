"""The executables end quietly from their first moment on, before any node is there."""

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

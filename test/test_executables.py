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
        if name == 'rclpy':
            print('importing', flush=True)
            os.kill(os.getpid(), signal.{ending})

sys.meta_path.insert(0, Interrupter)
executables.{executable}()
print('not ended')
"""


@pytest.mark.parametrize('ending', ['SIGINT', 'SIGTERM'])
@pytest.mark.parametrize('executable', ['sim_node', 'gait_node', 'monitor_node'])
def test_a_signal_in_the_middle_of_an_import_ends_it_with_status_zero_and_no_traceback(executable, ending):
    code = INTERRUPTED_IMPORT.format(executable=executable, ending=ending)
    process = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, timeout=120)
    assert process.returncode == 0
    assert process.stdout == 'importing\n'
    assert process.stderr == ''

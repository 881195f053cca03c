"""`make swim` swims a mission with real nodes, draws it, and ends with the mission, with Ctrl-C or with one line."""

import os
import signal
import subprocess
from pathlib import Path

import pytest

from evidence.harness.processes import LIMIT

ROOT = Path(__file__).parents[2]
MISSIONS = sorted(path.stem for path in (ROOT / 'config' / 'missions').glob('*.yaml'))
OWN = ('CONFIG', 'MISSION', 'CURRENT', 'OUTPUT')

pytestmark = pytest.mark.skipif('COLCON_PREFIX_PATH' not in os.environ, reason='no built package is sourced')


def start(**environment):
    inherited = {name: value for name, value in os.environ.items() if name not in OWN}
    return subprocess.Popen(
        [ROOT / 'scripts' / 'swim.sh'], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        text=True, env=inherited | environment)


@pytest.mark.parametrize(('environment', 'line'), [
    ({'MISSION': 'spiral'}, f'MISSION is spiral, but must be one of: {" ".join(MISSIONS)}'),
    ({'MISSION': './none.yaml'}, 'MISSION is ./none.yaml, but there is no such file'),
    ({'CONFIG': 'fresh'}, 'CONFIG is fresh, but must be one of: '),
    ({'CURRENT': '0.1'}, 'CURRENT is 0.1, but must be three numbers in m/s, such as 0,0.1,0')])
def test_what_cannot_be_swum_is_refused_with_one_line(environment, line, tmp_path):
    refused = start(OUTPUT=str(tmp_path / 'swim.png'), **environment)
    output, _ = refused.communicate(timeout=LIMIT)
    assert refused.returncode == 1
    assert output.startswith(f'manta_sim_ros: {line}') and output.count('\n') == 1


def test_it_swims_to_the_end_of_the_mission_in_the_current_and_draws_it(tmp_path):
    mission, picture = tmp_path / 'short.yaml', tmp_path / 'swim.png'
    mission.write_text('straight: {end: [1.5, 0, 0]}', encoding='utf-8')
    process = start(MISSION=str(mission), OUTPUT=str(picture), CURRENT='0.1,0,-0.01')
    output, _ = process.communicate(timeout=LIMIT)
    assert process.returncode == 0, output
    assert 'the end of the path is reached' in output
    assert '1.5 m of 1.5 m of the path in ' in output and 'Traceback' not in output
    assert picture.read_bytes().startswith(b'\x89PNG')


def test_ctrl_c_ends_all_of_it_with_status_0(tmp_path):
    process = start(OUTPUT=str(tmp_path / 'swim.png'))
    for line in process.stdout:
        if 'ready and paused' in line:
            break
    process.send_signal(signal.SIGINT)
    output, _ = process.communicate(timeout=LIMIT)  # the pipe is closed when all nodes have ended
    assert process.returncode == 0, output
    assert 'Traceback' not in output

"""`make sim` simulates with the parameters of the file that CONFIG names, and refuses a name that does not exist."""

import os
import subprocess
from pathlib import Path

import pytest
from nav_msgs.msg import Odometry
from rcl_interfaces.srv import GetParameters
from rclpy.parameter import parameter_value_to_python

from evidence.harness.processes import LIMIT
from manta_sim_ros.dynamics import Parameters

ROOT = Path(__file__).parents[2]
NAMES = sorted(path.stem for path in (ROOT / 'config').glob('*.yaml'))

pytestmark = pytest.mark.skipif('COLCON_PREFIX_PATH' not in os.environ, reason='no built package is sourced')


def start(**environment):
    inherited = {name: value for name, value in os.environ.items() if name not in ('CONFIG', 'DURATION')}
    return subprocess.Popen(
        [ROOT / 'scripts' / 'sim.sh'], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, env=inherited | environment)


@pytest.mark.parametrize('name', ['fresh', '../config/manta', 'manta.yaml', 'manta freshwater', '*'])
def test_a_name_that_does_not_exist_is_refused_with_those_that_do(name):
    refused = start(CONFIG=name, DURATION='1')  # it would end
    output, errors = refused.communicate(timeout=LIMIT)
    assert refused.returncode == 1 and output == ''
    assert errors == f'manta_sim_ros: CONFIG is {name}, but must be one of: {" ".join(NAMES)}\n'


@pytest.mark.parametrize(('environment', 'name'), [
    ({}, 'manta'), ({'CONFIG': ''}, 'manta'), ({'CONFIG': 'freshwater'}, 'freshwater')])
def test_it_simulates_with_the_parameters_of_the_file(probe, environment, name):
    process = start(**environment)
    try:
        with probe.record(Odometry, 'odom') as odometry:
            probe.until(lambda: odometry or process.poll() is not None, 'odometry')
        values = probe.call(GetParameters, '/manta_sim/get_parameters', names=['fin.chains', 'water.density']).values
    finally:
        process.terminate()
        output, _ = process.communicate(timeout=LIMIT)
    assert process.returncode == 0
    expected = Parameters.from_yaml(ROOT / 'config' / f'{name}.yaml')
    assert [parameter_value_to_python(value) for value in values] == [expected.fin.chains, expected.water.density]
    assert f'parameters: config/{name}.yaml' in output

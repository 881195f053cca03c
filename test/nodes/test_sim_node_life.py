"""How `sim_node` starts, lives beside others, survives and ends."""

import contextlib
import math
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from geometry_msgs.msg import PoseStamped, WrenchStamped
from nav_msgs.msg import Odometry
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.context import Context
from rclpy.task import Future
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool

from evidence.harness.processes import LIMIT, own_lines, shared_memory_of
from manta_sim_ros.nodes.process import END_LIMIT, executor
from manta_sim_ros.nodes.sim_node import SimNode

ROBOTS = Path(__file__).parents[2] / 'evidence' / 'benchmark' / 'robots.py'
STRAIGHT = [0.7, 0.7, 0.6, 0.6, 0.7, 0.7]
VIOLENT = [0.8, 0.8, 4.0, 4.0, 0.7, 0.7]
COMPILING = 'compiling the dynamics'
OWN_CLOCK = '-r /clock:=/elsewhere/clock'
SIGNALS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]
DOMAIN_OF_NOBODY = int(os.environ['ROS_DOMAIN_ID']) + 100  # where nobody else uses the shared memory of a test


@pytest.fixture(scope='module', autouse=True)
def first_start(module_launch, tmp_path_factory):
    """A node that finds nothing compiled, and where it keeps what it compiles; other tests run meanwhile."""
    kept = {'NUMBA_CACHE_DIR': str(tmp_path_factory.mktemp('kept'))}
    return module_launch('sim_node', f'-r __ns:=/first {OWN_CLOCK}', kept), kept


@pytest.fixture
def commander(probe):
    def command(topic, values):
        publisher = probe.node.create_publisher(Float64MultiArray, topic, 10)
        return lambda: publisher.publish(Float64MultiArray(data=values))
    return command


@pytest.mark.parametrize('ending', SIGNALS)
def test_a_signal_ends_it_while_it_runs(launch, probe, ending):
    node = launch('sim_node')
    with probe.record(Clock, '/clock') as clock:
        probe.until(lambda: clock, 'the clock')
        node.send(ending)
        assert node.exit_status() == 0
    assert not [line for line in own_lines(node.output) if 'Traceback' in line or 'Error' in line]


def test_when_it_has_spun_it_leaves_no_shared_memory_whoever_still_holds_its_executor(monkeypatch):
    held = []
    monkeypatch.setattr('manta_sim_ros.nodes.sim_node.executor', lambda of: held.append(executor(of)) or held[0])
    before, context, ending = shared_memory_of('self'), Context(), Future()
    context.init(['--ros-args', '-r', '__ns:=/spun', *OWN_CLOCK.split()], domain_id=DOMAIN_OF_NOBODY)
    node = SimNode(context)
    node.create_timer(0.05, lambda: ending.set_result(None))
    node.start()
    node.spin(ending)
    made = shared_memory_of('self') - before
    assert context.ok() and made and held
    node.destroy_node()
    assert not any(file.exists() for file in made)
    context.try_shutdown()


@pytest.mark.parametrize('ending', SIGNALS)
def test_a_signal_ends_it_while_it_compiles_and_leaves_no_shared_memory(launch, tmp_path, ending):
    before = set(Path('/dev/shm').iterdir())
    node = launch('sim_node', environment={'NUMBA_CACHE_DIR': str(tmp_path), 'ROS_DOMAIN_ID': str(DOMAIN_OF_NOBODY)})
    node.wait_for_output(COMPILING)
    files, began = node.shared_memory - before, time.monotonic()
    node.send(ending)
    assert node.exit_status() == 0
    slow = time.monotonic() - began > 0.75 * END_LIMIT  # then it was ended, whatever it had still to do
    assert not [line for line in own_lines(node.output) if 'Traceback' in line or 'Error' in line]
    assert files and (slow or not [file for file in files if file.exists()])


@pytest.mark.parametrize('ending', SIGNALS)
def test_a_signal_ends_it_in_the_middle_of_a_long_computation(launch, probe, ending):
    name = f'computing_{ending.name.lower()}'
    node = launch('sim_node', '-p start_paused:=true -p publish_rate:=0.1 -p solver.time_step:=2e-5 '
                  f'-p real_time_factor:=0.0 -r __ns:=/{name} {OWN_CLOCK}')
    pause = probe.node.create_client(SetBool, f'/{name}/manta_sim/pause')
    probe.until(pause.service_is_ready, 'the service')
    pause.call_async(SetBool.Request(data=False))
    probe.listen(3.0)  # half a million steps have begun
    node.send(ending)
    assert node.exit_status() == 0
    assert not [line for line in own_lines(node.output) if 'Traceback' in line or 'Error' in line]


def test_two_robots_beside_each_other_keep_apart(launch, probe, commander):
    launch('sim_node', '-r __ns:=/a')
    launch('sim_node', '-r __ns:=/b -p publish_clock:=false')
    with probe.record(PoseStamped, '/a/pose') as a, probe.record(PoseStamped, '/b/pose') as b:
        probe.until(lambda: a and b, 'both poses')
        probe.until(lambda: a[-1].pose.position.x > 0.05, 'motion of a', doing=commander('/a/fin_command', STRAIGHT))
        assert b[-1].pose.position.x == 0.0
        where = a[-1].pose.position.x
        probe.until(lambda: b[-1].pose.position.x > 0.05, 'motion of b', doing=commander('/b/fin_command', STRAIGHT))
        probe.until(lambda: a[-1].pose.position.x > where, 'more motion of a')


def test_robots_of_one_process_have_a_clock_and_a_command_each(probe, commander):
    names = [f'robot_{number}' for number in range(10)]  # so many that they import at once
    process = subprocess.Popen([sys.executable, ROBOTS, *names])  # the package that is installed
    try:
        with contextlib.ExitStack() as recordings:
            clocks = [recordings.enter_context(probe.record(Clock, f'/{name}/clock')) for name in names]
            first, last = (recordings.enter_context(probe.record(PoseStamped, f'/{names[n]}/pose')) for n in (0, -1))
            probe.until(lambda: all(clocks) and first and last, 'all robots')
            probe.until(lambda: first[-1].pose.position.x > 0.05, 'motion',
                        doing=commander(f'/{names[0]}/fin_command', STRAIGHT))
            assert last[-1].pose.position.x == 0.0
        process.terminate()
        assert process.wait(LIMIT) == 0
    finally:
        process.kill()
        process.wait()


def test_another_name_and_namespace_take_the_same_parameter_file(launch, probe, tmp_path):
    file = tmp_path / 'manta.yaml'
    file.write_text('/**:\n  ros__parameters:\n    odom_frame: map\n    publish_rate: 50.0\n    fin: {chains: 12}\n')
    launch('sim_node', f'--params-file {file} -r __node:=ray -r __ns:=/deep/sea')
    with probe.record(PoseStamped, '/deep/sea/pose') as pose:
        probe.until(lambda: len(pose) > 10, 'poses')
    assert pose[-1].header.frame_id == 'map'
    assert min(after - before for before, after in zip(pose.stamps, pose.stamps[1:])) == 20_000_000
    probe.until(lambda: ('ray', '/deep/sea') in probe.node.get_node_names_and_namespaces(), 'its name')


def test_a_whole_number_is_taken_and_an_unknown_name_is_warned_of(launch, probe):
    node = launch('sim_node', f'-p publish_rate:=50 -p fin.chian:=12 {OWN_CLOCK} -r __ns:=/lenient')
    with probe.record(Odometry, '/lenient/odom') as odometry:
        probe.until(lambda: odometry, 'odometry')
    assert 'fin.chian is no parameter' in node.output and 'fin.chains' in node.output
    described = probe.call(ListParameters, '/lenient/manta_sim/list_parameters').result.names
    assert 'fin.chains' in described and 'fin.chian' not in described


def test_factor_zero_runs_as_fast_as_it_can_and_still_listens(launch, probe, commander):
    launch('sim_node', '-p real_time_factor:=0.0 -p publish_rate:=10.0')
    with probe.record(Clock, '/clock') as clock, probe.record(Odometry, 'odom') as odometry:
        probe.until(lambda: clock and odometry, 'the clock')
        until = clock.stamps[-1] + 5_000_000_000
        probe.until(lambda: clock.stamps[-1] > until, 'five seconds')
        probe.until(
            lambda: odometry[-1].pose.pose.position.x > 0.1, 'motion', doing=commander('fin_command', STRAIGHT))
        assert clock.rising


def test_the_slowest_factor_leaves_it_alive_and_listening(launch, probe):
    node = launch('sim_node', f'-p real_time_factor:=1.0e-12 -r __ns:=/slow {OWN_CLOCK}')
    answer = probe.call(GetParameters, '/slow/manta_sim/get_parameters', names=['real_time_factor'])
    assert answer.values[0].double_value == 1e-12
    node.send(signal.SIGINT)
    assert node.exit_status() == 0


def test_after_a_divergence_it_says_which_step_to_try_and_goes_on(launch, probe, commander):
    node = launch('sim_node', '-p solver.time_step:=0.01')
    with probe.record(Clock, '/clock') as clock, probe.record(Odometry, 'odom') as odometry, \
            probe.record(WrenchStamped, 'fin_wrench') as wrench:
        probe.until(lambda: clock and odometry and wrench, 'a first state')
        probe.until(
            lambda: re.search(r'solver\.time_step is 0\.01 s, too large for this motion; try 0\.00\d+ s', node.output),
            'divergence', doing=commander('fin_command', VIOLENT))
        enough = len(odometry) + 200
        probe.until(lambda: len(odometry) > enough and len(clock) > enough, 'it to go on')
        assert odometry.finite and wrench.finite
        assert odometry.rising and clock.rising
        before = len(odometry)
        commander('fin_command', [0.0] * 6)()
        probe.until(lambda: len(odometry) > before + 20, 'it to go on at rest')


def test_the_first_start_says_once_that_it_compiles_and_the_second_not_at_all(first_start, launch, probe):
    first, kept = first_start
    with probe.record(Odometry, '/first/odom') as odometry:
        probe.until(lambda: odometry, 'odometry of the first')
    assert first.output.count(COMPILING) == 1
    second = launch('sim_node', f'-r __ns:=/second {OWN_CLOCK}', kept)
    with probe.record(Odometry, '/second/odom') as odometry:
        probe.until(lambda: odometry, 'odometry of the second')
    assert COMPILING not in second.output
    for node, name in (first, 'first'), (second, 'second'):
        assert node.output.count(f'ready: publish fin commands on /{name}/fin_command') == 1
    assert first.output.index(COMPILING) < first.output.index('ready')


def test_when_it_is_ready_one_line_names_the_topic_to_command(launch, probe, commander):
    node = launch('sim_node', f'-r fin_command:=/gaits -r __ns:=/named {OWN_CLOCK} -p start_paused:=true')
    node.wait_for_output('ready and paused: publish fin commands on /gaits')
    commands = probe.node.create_publisher(Float64MultiArray, '/gaits', 10)
    probe.until(commands.get_subscription_count, 'its subscription')
    probe.until(lambda: 'refused' in node.output, 'a command', doing=commander('/gaits', [math.nan]))
    probe.node.destroy_publisher(commands)

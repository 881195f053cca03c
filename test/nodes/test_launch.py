"""The launch files: their arguments are those of the docs, and they start what these say.

The second half really launches them, with packages that hold nothing but programs that write down how they are started.
It needs launch_ros, of which there are no wheels.
"""

import ast
import json
import os
import re
import shlex
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
import yaml

from evidence.harness.processes import LIMIT
from evidence.report import read_table
from evidence.tables import launch_arguments, two_mantas
from manta_sim_ros.nodes.interface import TOPICS

ROOT = Path(__file__).parents[2]
SIM, TWO, SWIM = 'sim.launch.py', 'two_mantas.launch.py', 'swim.launch.py'

needs_launch = pytest.mark.skipif(find_spec('launch_ros') is None, reason='launch_ros is not installed')


@pytest.mark.parametrize(('name', 'arguments'), [
    (SIM, launch_arguments(SIM)), (TWO, two_mantas()), (SWIM, launch_arguments(SWIM))])
def test_the_docs_list_the_arguments_of_each_launch_file(name, arguments):
    page = (ROOT / 'docs' / 'ros_interface.md').read_text(encoding='utf-8')
    head, *rows = read_table(page[page.index(f'<!-- table: {name} -->'):])
    assert head == ['argument', 'default', 'meaning'] and arguments
    assert [(argument.strip('`'), (default.strip('`'), meaning)) for argument, default, meaning in rows] == list(
        arguments.items())


@needs_launch
@pytest.mark.parametrize(('name', 'arguments'), [
    (SIM, launch_arguments(SIM)), (TWO, two_mantas()), (SWIM, launch_arguments(SWIM))])
def test_launch_takes_the_arguments_of_the_docs(name, arguments):
    from launch import LaunchContext
    from launch.launch_description_sources import AnyLaunchDescriptionSource

    description = AnyLaunchDescriptionSource(str(ROOT / 'launch' / name)).get_launch_description(LaunchContext())
    taken = {argument.name for argument in description.get_launch_arguments()}
    assert taken >= set(arguments) and (name != SIM or taken == set(arguments))


def test_there_are_no_other_launch_files():
    assert {path.name for path in (ROOT / 'launch').glob('*.launch.*')} == {SIM, TWO, SWIM}


LAUNCHER = """
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import AnyLaunchDescriptionSource

path, *arguments = sys.argv[1:]
service = LaunchService()
service.include_launch_description(LaunchDescription([IncludeLaunchDescription(
    AnyLaunchDescriptionSource(path), launch_arguments=[argument.split(':=', 1) for argument in arguments])]))
sys.exit(service.run())
"""

PROGRAM = f"""#!{sys.executable} -IS
import json, os, signal, sys, time
signal.signal(signal.SIGINT, lambda *_: sys.exit())
files = [word for before, word in zip(sys.argv, sys.argv[1:]) if before == '--params-file']
started = dict(name=os.path.basename(sys.argv[0]), words=sys.argv[1:], files=[open(file).read() for file in files])
path = os.path.join(os.environ['STARTED'], str(os.getpid()))
with open(path + '.part', 'w') as file:
    json.dump(started, file)
os.rename(path + '.part', path)
end = time.monotonic() + {0.5 * LIMIT}
while time.monotonic() < end and (
        started['name'] != 'sim_node'
        or sum(not name.endswith('.part') for name in os.listdir(os.environ['STARTED'])) < int(os.environ['EXPECTED'])):
    time.sleep(0.02)
"""

OPTIONAL = {'robot_state_publisher': 'robot_state_publisher', 'rviz2': 'rviz2', 'ros2bag': None,
            'rosbag2_storage_mcap': None}


class Started:
    """How one program was started."""

    def __init__(self, name, words, files):
        self.name, self.words = name, words
        self.namespace = next((word.removeprefix('__ns:=') for word in words if word.startswith('__ns:=')), None)
        self.parameters = {}
        for content in files:
            for node in yaml.safe_load(content.replace('!!python/tuple', '')).values():  # a list of launch's
                self.parameters |= node['ros__parameters']


@pytest.fixture
def launched(tmp_path):
    """`launched(launch file, arguments, packages, expected)`: the programs, and status and output of the launch."""
    def package(name, *programs):
        for folder, names in ('share/ament_index/resource_index/packages', [name]), (f'lib/{name}', programs):
            (prefix / folder).mkdir(parents=True, exist_ok=True)
            for each in names:
                program(prefix / folder / each)

    def program(path):
        path.parent.mkdir(exist_ok=True)
        path.write_text(PROGRAM, encoding='utf-8')
        path.chmod(0o755)

    def launch(name, arguments='', packages=OPTIONAL, expected=1):
        package('manta_sim_ros', 'sim_node', 'gait_node', 'path_follower', 'track_node')
        (prefix / 'share' / 'manta_sim_ros').symlink_to(ROOT)
        program(prefix / 'bin' / 'ros2')
        for each in packages:
            package(each, *filter(None, [OPTIONAL[each]]))
        started.mkdir()
        finished = subprocess.run(
            [sys.executable, '-c', LAUNCHER, prefix / 'share' / 'manta_sim_ros' / 'launch' / name,
             *shlex.split(arguments)],
            cwd=tmp_path, timeout=LIMIT, text=True, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, env=os.environ | {
                'AMENT_PREFIX_PATH': str(prefix), 'PATH': f'{prefix / "bin"}:{os.environ["PATH"]}',
                'ROS_LOG_DIR': str(tmp_path / 'log'), 'STARTED': str(started), 'EXPECTED': str(expected)})
        programs = [Started(**json.loads(path.read_text(encoding='utf-8'))) for path in started.iterdir()]
        names = re.findall(r'\[(\w+)-\d+\]: process started', finished.stdout)
        assert sorted(names) == sorted(each.name for each in programs), finished.stdout
        programs.sort(key=lambda each: (each.name, each.namespace or ''))
        return programs, finished.returncode, finished.stdout

    prefix, started = tmp_path / 'prefix', tmp_path / 'started'
    return launch


@needs_launch
def test_by_default_simulator_and_controller_start_and_the_simulator_has_the_parameter_file_alone(launched):
    (gait, simulator), status, output = launched(SIM, expected=2)
    assert status == 0 and 'Traceback' not in output
    assert (gait.name, simulator.name) == ('gait_node', 'sim_node')
    assert gait.namespace == simulator.namespace == '/'
    assert gait.parameters == {'use_sim_time': True}
    config = yaml.safe_load((ROOT / 'config' / 'manta.yaml').read_text(encoding='utf-8'))
    assert simulator.parameters == config['/**']['ros__parameters']


@needs_launch
def test_when_the_simulator_ends_all_ends(launched):
    _, status, output = launched(SIM, expected=2)  # it ends when both are there, gait_node when it is told to
    assert status == 0 and "[gait_node-2]: sending signal 'SIGINT'" in output


@needs_launch
def test_arguments_reach_the_simulator_with_the_types_that_it_wants(launched, tmp_path):
    (tmp_path / 'my.yaml').write_text('/**: {ros__parameters: {real_time_factor: 0.5, odom_frame: map}}')
    (simulator,), _, _ = launched(SIM, 'config:=my.yaml gait:=false namespace:=m1 real_time_factor:=2 '
                                       'publish_clock:=false base_frame:=1 initial_position:="[0, 3, -1]" '
                                       'initial_yaw:=1 sensor_seed:=7 current:="[0, 0.1, 0]"')
    assert simulator.namespace == '/m1'
    assert repr(sorted(simulator.parameters.items())) == repr(sorted({
        'real_time_factor': 2.0, 'odom_frame': 'map', 'base_frame': '1', 'publish_clock': False, 'use_sim_time': True,
        'initial_position': [0.0, 3.0, -1.0], 'water.current': [0.0, 0.1, 0.0], 'initial_yaw': 1.0, 'imu.seed': 7,
        'odom_noise.seed': 7, 'pressure.seed': 7, 'velocity.seed': 7,
    }.items()))


@needs_launch
def test_rviz_comes_with_the_frames_of_the_robot_that_the_parameter_file_describes(launched, tmp_path):
    (tmp_path / 'my.yaml').write_text('/**: {ros__parameters: {body: {mass: 33.0}}}')
    programs, _, _ = launched(
        SIM, 'config:=my.yaml gait:=false rviz:=true namespace:=m1 base_frame:=m1/base_link', expected=3)
    publisher, rviz, simulator = programs
    assert simulator.parameters['publish_fin_joints'] is True
    assert publisher.parameters['use_sim_time'] is rviz.parameters['use_sim_time'] is True
    assert '<link name="m1/base_link"/>' in publisher.parameters['robot_description']
    assert '<mass value="33.0"/>' in publisher.parameters['robot_description']
    assert {each.namespace for each in programs} == {'/m1'}
    assert Path(rviz.words[rviz.words.index('-d') + 1]).samefile(ROOT / 'rviz' / 'manta.rviz')


@needs_launch
def test_the_frames_are_those_of_the_parameters_that_the_node_takes(launched, tmp_path):
    (tmp_path / 'my.yaml').write_text(
        '/**: {ros__parameters: {body: {mass: 33.0}, base_frame: base}}\n'
        '/m1/manta_sim: {ros__parameters: {body.mass: 34.0}}\n'
        '/manta_sim: {ros__parameters: {body: {mass: 35.0}}}')
    (publisher, _), _, _ = launched(
        SIM, 'config:=my.yaml gait:=false robot_state_publisher:=true namespace:=m1', expected=2)
    assert '<mass value="34.0"/>' in publisher.parameters['robot_description']
    assert '<link name="base"/>' in publisher.parameters['robot_description']


@needs_launch
def test_a_recording_is_of_all_topics_in_the_namespace_stamped_with_simulated_time(launched, tmp_path):
    (bag, simulator), _, _ = launched(SIM, 'gait:=false record:=true bag:=mine namespace:=m1', expected=2)
    assert simulator.parameters['start_paused'] is True  # until the recorder has subscribed
    assert bag.words[:2] == ['bag', 'record']
    assert {'--use-sim-time', '--include-unpublished-topics'} <= set(bag.words)  # the first command is recorded too
    options = [bag.words[bag.words.index(option) + 1] for option in ('--storage', '--output', '--node-name')]
    assert options == ['mcap', 'mine', 'rosbag2_recorder_m1']
    topics = bag.words[bag.words.index('--topics') + 1:]
    assert set(topics) == {topic if topic.startswith('/') else f'/m1/{topic}'
                           for topic in [*TOPICS, 'robot_description']}


@needs_launch
def test_a_recording_follows_the_namespace_that_the_launch_file_is_included_in(launched):
    (bag, simulator), _, _ = launched(SIM, 'gait:=false record:=true namespace:=m1 ros_namespace:=fleet', expected=2)
    assert simulator.namespace == '/fleet/m1'  # what PushRosNamespace sets
    assert {'/fleet/m1/pose', '/clock'} <= set(bag.words)


@needs_launch
def test_a_recording_without_a_name_has_date_time_and_namespace(launched):
    (bag, _), _, _ = launched(SIM, 'gait:=false record:=true namespace:=m1', expected=2)
    assert re.fullmatch(r'rosbag2_\d{4}_\d\d_\d\d-\d\d_\d\d_\d\d_m1', bag.words[bag.words.index('--output') + 1])


@needs_launch
@pytest.mark.parametrize(('arguments', 'packages', 'parts'), [
    ('config:=/no/such.yaml', OPTIONAL, ["config is '/no/such.yaml', but there is no such file"]),
    ('real_time_factor:=fast', OPTIONAL, ["real_time_factor is 'fast', but must be a number"]),
    ('current:=fast', OPTIONAL, ["current is 'fast', but must be three numbers"]),
    ('initial_position:=3', OPTIONAL, ["initial_position is '3', but must be three numbers"]),
    ('gait:=perhaps', OPTIONAL, ['Argument "gait" provided value "perhaps" is not valid']),
    ('record:=true bag:=prefix', OPTIONAL, ["bag is 'prefix', but that exists already"]),
    ('rviz:=true', ['rviz2'], [': robot_state_publisher cannot be without robot_state_publisher, not installed here']),
    ('rviz:=true', ['robot_state_publisher'], [': rviz cannot be without rviz2, not installed here: apt install ros-']),
    ('rviz:=true', [], [': rviz and robot_state_publisher cannot be without rviz2, robot_state_publisher, not']),
    ('record:=true', ['ros2bag'], [': record cannot be without rosbag2_storage_mcap, not', '-rosbag2-storage-mcap']),
])
def test_what_cannot_be_done_ends_the_launch_with_one_line_before_anything_starts(
        launched, arguments, packages, parts):
    programs, status, output = launched(SIM, arguments, packages)
    assert programs == [] and status != 0
    line, = (line for line in output.splitlines() if 'Caught exception in launch' in line)
    assert all(part in line for part in parts) and 'Traceback' not in output


@needs_launch
def test_two_mantas_share_clock_and_world_and_have_gaits_and_frames_of_their_own(launched):
    programs, status, output = launched(TWO, 'real_time_factor:=0.5', expected=4)
    assert status == 0 and 'Traceback' not in output
    gaits, simulators = ({each.namespace: each.parameters for each in programs if each.name == name}
                         for name in ('gait_node', 'sim_node'))
    assert set(gaits) == set(simulators) == {'/manta_1', '/manta_2'}
    for namespace, parameters in simulators.items():
        assert parameters['odom_frame'] == 'odom'
        assert parameters['base_frame'] == f'{namespace[1:]}/base_link'
        assert parameters['real_time_factor'] == 0.5
        assert parameters['publish_clock'] is (namespace == '/manta_1')
        assert parameters['use_sim_time'] is (namespace == '/manta_2')
    assert gaits['/manta_1'] != gaits['/manta_2'] and all(gait['use_sim_time'] for gait in gaits.values())
    assert simulators['/manta_1']['imu']['seed'] != simulators['/manta_2']['imu.seed']
    assert simulators['/manta_1'].get('initial_position') != simulators['/manta_2']['initial_position']


@needs_launch
def test_arguments_of_one_robot_pass_through_the_launch_file_of_two(launched):
    programs, _, _ = launched(
        TWO, 'gait:=false initial_yaw:=1 sensor_seed:=7 initial_position:="[0, 9, 0]"', expected=2)
    one, two = (each.parameters for each in programs)
    assert [each.namespace for each in programs] == ['/manta_1', '/manta_2']
    assert one['initial_yaw'] == two['initial_yaw'] == 1.0
    assert one['imu.seed'] == 7 != two['imu.seed']
    assert one['initial_position'] == [0.0, 9.0, 0.0] != two['initial_position']


def test_what_two_mantas_sets_for_each_robot_is_what_it_refuses():
    tree = ast.parse((ROOT / 'launch' / TWO).read_text(encoding='utf-8'))
    (refused,) = (ast.literal_eval(node.value) for node in tree.body
                  if isinstance(node, ast.Assign) and node.targets[0].id == 'SET_HERE')
    assert set(refused) == set(launch_arguments(SIM)) - set(two_mantas())


@needs_launch
@pytest.mark.parametrize('argument', ['namespace:=m', 'base_frame:=base', 'publish_clock:=true', 'bag:=mine'])
def test_an_argument_that_two_mantas_sets_for_each_robot_ends_the_launch_with_one_line(launched, argument):
    programs, status, output = launched(TWO, argument)
    assert programs == [] and status != 0
    line, = (line for line in output.splitlines() if 'Caught exception in launch' in line)
    name, value = argument.split(':=')
    assert f"{name} is '{value}', but two_mantas.launch.py sets it for each robot" in line


@needs_launch
def test_two_mantas_are_seen_in_one_rviz_and_recorded_to_a_bag_each(launched):
    programs, _, _ = launched(TWO, 'gait:=false rviz:=true record:=true', expected=7)
    assert [each.name for each in programs] == [
        'robot_state_publisher', 'robot_state_publisher', 'ros2', 'ros2', 'rviz2', 'sim_node', 'sim_node']
    rviz = programs[4]
    assert Path(rviz.words[rviz.words.index('-d') + 1]).samefile(ROOT / 'rviz' / 'two_mantas.rviz')
    for publisher, name in zip(programs, ('manta_1', 'manta_2')):
        assert f'<link name="{name}/base_link"/>' in publisher.parameters['robot_description']
    leader, follower = (each.parameters for each in programs[5:])
    assert leader['start_paused'] is True and follower['start_paused'] is False  # it follows the clock of the other
    bags = {each.words[each.words.index('--output') + 1][-8:] for each in programs[2:4]}
    assert bags == {'_manta_1', '_manta_2'}


@needs_launch
def test_a_swim_has_the_path_follower_as_controller_and_a_recorder_of_the_track(launched, tmp_path):
    gains = ROOT / 'config' / 'path_follower_manta.yaml'
    config = ROOT / 'config' / 'manta.yaml'
    programs, status, output = launched(
        SWIM, f'namespace:=m1 config:={config} gains:={gains} mission:=mine.yaml output:=mine.png '
              'current:="[0, 0.1, 0]"', expected=3)
    assert status == 0 and 'Traceback' not in output
    follower, simulator, track = programs
    assert [each.name for each in programs] == ['path_follower', 'sim_node', 'track_node']
    assert {each.namespace for each in programs} == {'/m1'}
    assert simulator.parameters['water.current'] == [0.0, 0.1, 0.0]
    assert follower.parameters['mission'] == 'mine.yaml' and follower.parameters['robot'] == str(config)
    assert follower.parameters['speed'] == yaml.safe_load(gains.read_text())['/**']['ros__parameters']['speed']
    assert track.parameters == {'use_sim_time': True, 'output': 'mine.png'}
    assert follower.parameters['use_sim_time'] is True


@needs_launch
def test_a_swim_takes_no_gait(launched):
    programs, status, output = launched(SWIM, 'gait:=true')
    assert programs == [] and status != 0
    assert "gait is 'true', but swim.launch.py sets it" in output and 'Traceback' not in output

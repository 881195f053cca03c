"""A swim that `simulate` records is the one that the node publishes in lockstep, and wrong input is refused at once."""

import contextlib
import functools
import itertools
import json
import math
import os
import re
import shutil
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from ament_index_python.packages import get_package_share_directory
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

from evidence.harness.processes import LIMIT, command_of
from manta_sim_ros.dynamics import Parameters
from manta_sim_ros.nodes.interface import TOPICS
from manta_sim_ros.nodes.qos import message_class
from manta_sim_ros.nodes.settings import Settings
from manta_sim_ros.studies.bag import TYPES, BagReader, BagWriter, RecordingWarning
from manta_sim_ros.studies.commands import COLUMNS, Command, constant_gait, read_commands, read_table
from manta_sim_ros.studies.simulate import SimulationWarning, main, simulate

GAIT, OTHER_GAIT = [0.7, 0.4, 0.6, 0.5, 0.7, 0.3], [0.2, 0.2, 1.0, 1.0, 0.0, 0.0, 0.1, 0.1, -0.1, -0.1]
RODS = JointState(
    name=['left_front_rod', 'right_rear_rod'], position=[0.2, -0.3], velocity=[0.0, 0.0], effort=[0.0, 0.0])
STEP = 0.5  # s, a multiple of all periods
COMMANDS = [(0.0, 'fin_command', GAIT), (0.5, 'fin_command', OTHER_GAIT), (1.0, 'rod_command', None)]
DURATION = 1.5  # s
DEGREES = '30,30,0.6,0.6,40,40'
SECOND = 1_000_000_000  # ns
SETTINGS = Settings().replace([('publish_fin_joints', True), ('velocity.rate', 4.0)])


def command(at, topic, values):
    return Command(at, topic, RODS if values is None else Float64MultiArray(data=values), 'test')


def contents(path):
    """Return the serialized messages of each topic of a bag with their times [ns], read by the package mcap."""
    messages = {}
    with next(path.glob('*.mcap')).open('rb') as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            messages.setdefault(channel.topic, []).append((message.log_time, aligned(schema.name, message.data)))
    return messages


def aligned(kind, data):
    """Return a serialized message with zeros where bytes only align others: rclpy writes any value there."""
    return bytes(TYPES.serialize_cdr(TYPES.deserialize_cdr(data, kind), kind))


@pytest.fixture(scope='module')
def run(tmp_path_factory):
    path = tmp_path_factory.mktemp('simulated') / 'run'
    simulate(SETTINGS, [command(*each) for each in COMMANDS], DURATION, path, markers=True)
    return path


@pytest.fixture(scope='module')
def published(module_launch, probe):
    """What the node publishes of the same swim: the serialized messages of each topic, and the QoS that it offers."""
    name = 'in_lockstep'
    node = module_launch('sim_node', f'-p start_paused:=true -p publish_fin_joints:=true -p step_duration:={STEP} '
                                     f'-p velocity.rate:=4.0 -r __ns:=/{name} -r /clock:=/{name}/clock')
    node.wait_for_output('ready')
    inputs, outputs = probe.topics_of('manta_sim', f'/{name}')
    outputs.pop('/diagnostics')
    heard = {topic: [] for topic in outputs}
    commands = {topic: probe.node.create_publisher(message_class(inputs[f'/{name}/{topic}']), f'/{name}/{topic}', 10)
                for topic in ('fin_command', 'rod_command')}
    stepping = probe.node.create_client(Trigger, f'/{name}/manta_sim/step')

    def take(topic, data):
        data = aligned(outputs[topic], data)
        if data not in heard[topic]:  # the state at which time stands still is repeated for who comes late
            heard[topic].append(data)

    def give(publisher, message):
        """Command the node, and wait until the command was taken: it warns of an empty one behind it."""
        publisher.publish(message)
        refusals = node.output.count('refused so far')
        probe.until(lambda: node.output.count('refused so far') > refusals, 'the command',
                    doing=lambda: publisher.publish(type(message)()), every=0.3)

    for topic, kind in outputs.items():
        lasts = topic != f'/{name}/clock'
        probe.node.create_subscription(
            message_class(kind), topic, functools.partial(take, topic), QoSProfile(
                depth=10_000, reliability=ReliabilityPolicy.RELIABLE,
                durability=DurabilityPolicy.TRANSIENT_LOCAL if lasts else DurabilityPolicy.VOLATILE), raw=True)
    probe.until(lambda: all(heard.values()), 'the state at the beginning on each topic')
    probe.until(lambda: stepping.service_is_ready() and all(
        publisher.get_subscription_count() for publisher in commands.values()), 'the inputs of the node')
    for end in np.arange(STEP, DURATION + STEP, STEP):
        for at, topic, values in COMMANDS:
            if at == end - STEP:
                give(commands[topic], command(at, topic, values).message)
        stepping.call_async(Trigger.Request())  # the middleware may lose the first answer, but not the outputs
        probe.until(lambda end=end: all(
            last_stamp(outputs[topic], heard[topic][-1]) == end * SECOND for topic in heard), 'all outputs')
    offered = {topic.removeprefix(f'/{name}'): probe.node.get_publishers_info_by_topic(topic)[0] for topic in outputs}
    return {topic.removeprefix(f'/{name}'): messages for topic, messages in heard.items()}, offered


def last_stamp(kind, data):
    message = deserialize_message(data, message_class(kind))
    message = message.markers[0] if hasattr(message, 'markers') else message
    stamp = message.header.stamp if hasattr(message, 'header') else message.clock
    return stamp.sec * SECOND + stamp.nanosec


def test_each_topic_has_the_messages_of_the_node_in_lockstep_byte_by_byte(run, published):
    recorded = {topic: [data for _, data in messages] for topic, messages in contents(run).items()}
    assert [recorded.pop(f'/{topic}') for topic in ('fin_command', 'rod_command')] == [
        [aligned(TOPICS[topic].type, serialize_message(command(*each).message))
         for each in COMMANDS if each[1] == topic]
        for topic in ('fin_command', 'rod_command')]
    assert recorded.keys() == published[0].keys()
    for topic, messages in published[0].items():
        assert recorded[topic] == messages, topic
    assert len(recorded['/odom']) == 151 and len(recorded['/fin_markers']) == 16


def test_the_bag_has_the_types_and_the_quality_of_service_of_the_node(run, published):
    with Reader(run) as reader:
        connections = {connection.topic: connection for connection in reader.connections}
        assert reader.duration == DURATION * SECOND + 1
    for topic, offered in published[1].items():
        assert connections[topic].msgtype == offered.topic_type
        (qos,) = connections[topic].ext.offered_qos_profiles
        assert [qos.reliability.name, qos.durability.name] == [
            offered.qos_profile.reliability.name, offered.qos_profile.durability.name]
        assert qos.depth == 10
    for connection in connections.values():  # `ros2 bag play` warns of another hash
        package, *_, name = connection.msgtype.split('/')
        described = json.loads(Path(get_package_share_directory(package), 'msg', f'{name}.json').read_text())
        hashes = {each['type_name']: each['hash_string'] for each in described['type_hashes']}
        assert connection.digest == hashes[connection.msgtype]


def test_every_message_is_logged_at_its_simulated_time_and_commands_when_they_act(run):
    messages = contents(run)
    assert [at for at, _ in messages['/clock']] == [k * SECOND // 100 for k in range(151)]
    assert all(last_stamp('rosgraph_msgs/msg/Clock', data) == at for at, data in messages['/clock'])
    assert [at / SECOND for at, _ in messages['/fin_command']] == [0.0, 0.5]
    assert [at / SECOND for at, _ in messages['/rod_command']] == [1.0]


def test_the_parameters_are_in_the_bag(run):
    with BagReader(run) as bag:
        assert bag.settings == SETTINGS


def test_a_bag_gives_the_commands_of_the_same_swim(run, tmp_path):
    simulate(SETTINGS, read_commands(run, Parameters()), DURATION, tmp_path / 'again', markers=True)
    assert contents(tmp_path / 'again') == contents(run)


def test_a_bag_without_a_clock_counts_from_its_first_command(run, tmp_path):
    settings = Settings().replace([('publish_clock', False)])
    late = [Command(at + 0.5, *rest) for at, *rest in read_commands(run, Parameters())]
    simulate(settings, late, 2.0, tmp_path / 'without', progress=lambda time: None)
    assert '/clock' not in contents(tmp_path / 'without')
    assert [each.time for each in read_commands(tmp_path / 'without', Parameters())] == [0.0, 0.5, 1.0]


def write(path, *lines, names=COLUMNS[:6]):
    path.write_text('\n'.join([','.join(['time', *names]), *lines, '']))
    return path


def test_a_command_acts_from_the_first_output_that_is_not_before_its_time(tmp_path):
    table = write(tmp_path / 'gaits.csv', '0.101,0.7,0.7,0.6,0.6,0.7,0.7', '', '0.13,0.1,0.1,0.6,0.6,0.7,0.7',
                  names=['amplitude_l', 'A_r', 'frequency_l', 'f_r', 'phi_l', 'phase_r'])
    simulate(Settings(), read_table(table, Parameters()), 0.2, tmp_path / 'run')
    assert [at / SECOND for at, _ in contents(tmp_path / 'run')['/fin_command']] == [0.11, 0.13]
    with BagReader(tmp_path / 'run') as bag:
        rods = [bag.decode(each).position for each in bag.messages(['joint_states'])]
    assert [any(angles) for angles in rods] == [k * 0.02 > 0.11 for k in range(len(rods))]


def test_a_table_may_have_its_columns_in_any_order_and_biases(tmp_path):
    table = write(tmp_path / 'gaits.csv', ','.join(map(str, [*reversed(OTHER_GAIT), 0.5])),
                  names=[*reversed(COLUMNS)])
    table.write_text(table.read_text().replace('time,', '', 1).replace('A_l\n', 'A_l,time\n'))
    (only,) = read_table(table, Parameters())
    assert (only.time, list(only.message.data)) == (0.5, OTHER_GAIT)


def test_a_gait_is_given_in_degrees_and_hertz():
    (only,) = constant_gait([30, 20, 0.6, 0.5, 40, -40], Parameters())
    assert only.message.data.tolist() == [*map(math.radians, [30, 20]), 0.6, 0.5, *map(math.radians, [40, -40])]


def test_a_refused_command_is_not_logged_and_the_gait_goes_on(tmp_path):
    wrong = Command(0.1, 'fin_command', Float64MultiArray(data=[9.0] * 6), 'a.csv, line 3')
    with pytest.warns(SimulationWarning, match=r'a\.csv, line 3: fin_command refused at 0\.1 s, .* 9'):
        last = simulate(Settings(), [command(0.0, 'fin_command', GAIT), wrong], 0.2, tmp_path / 'run')
    assert len(contents(tmp_path / 'run')['/fin_command']) == 1
    assert last.gait_commands[:, 0].tolist() == GAIT[:2]


def test_a_timeout_of_commands_is_that_of_the_node(tmp_path):
    with pytest.warns(SimulationWarning, match='no fin_command for 0.1 s'):
        last = simulate(Settings().replace([('command_timeout', 0.1)]), constant_gait([30, 30, 0.6, 0.6, 40, 40],
                        Parameters()), 0.3, tmp_path / 'run')
    assert not last.gait_commands[:, 0].any()


@pytest.mark.parametrize('stopped', [RuntimeError('stop'), KeyboardInterrupt()])
def test_a_bag_is_complete_up_to_where_progress_raises(tmp_path, stopped):
    def progress(now):
        if now >= 0.1:
            raise stopped

    with pytest.raises(type(stopped)):
        simulate(Settings(), [], 1.0, tmp_path / 'run', progress=progress)
    assert len(contents(tmp_path / 'run')['/odom']) == 11
    assert (tmp_path / 'run' / 'metadata.yaml').is_file()


def start(*arguments, **options):
    return subprocess.Popen([*command_of('simulate'), *map(str, arguments)], text=True, stdin=subprocess.DEVNULL,
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE, **options)


def finished(*arguments):
    process = start(*arguments)
    out, errors = process.communicate(timeout=LIMIT)
    return process.returncode, out, errors


def lines(errors):
    """Return the lines of standard error without those of a first start."""
    return [line for line in errors.splitlines() if 'dynamics' not in line]


def test_the_command_records_and_says_how_fast(tmp_path):
    status, out, errors = finished('--gait', DEGREES, '--duration', 0.5, '--output', tmp_path / 'run', '--fin-joints')
    assert (status, lines(errors)) == (0, [])
    assert out.startswith(f'{tmp_path / "run"}: 0.5 s of simulated time in ') and 'times real time' in out
    messages = contents(tmp_path / 'run')
    assert len(messages['/odom']) == 51 and '/fin_markers' not in messages
    assert len(deserialize_message(messages['/joint_states'][0][1], JointState).name) == 4 + 4 + 2 * 30 * 3


@pytest.mark.parametrize('ending', ['SIGINT', 'SIGTERM', 'SIGHUP'])
def test_a_signal_leaves_a_complete_bag_up_to_there(tmp_path, ending):
    process = running(tmp_path / 'run')
    process.send_signal(getattr(signal, ending))
    out, errors = process.communicate(timeout=LIMIT)
    assert (process.returncode, out) == (128 + getattr(signal, ending), '')
    (line,) = lines(errors)
    assert line.startswith(f'simulate: {ending} ended this at ')
    clocks = contents(tmp_path / 'run')['/clock']
    assert len(clocks) > 100 and f' {clocks[-1][0] / SECOND:.9g} s' in line
    with Reader(tmp_path / 'run') as reader:
        assert reader.message_count == sum(map(len, contents(tmp_path / 'run').values()))


def running(path):
    """Return a process that simulates, and has written to the disk."""
    process = start('--gait', DEGREES, '--duration', 1e5, '--output', path)
    deadline = time.monotonic() + LIMIT
    while not any(file.stat().st_size > 100_000 for file in path.glob('*.mcap')):
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.02)
    return process


def record_ends(data):
    """Return where the records of a file in the format MCAP end, the last one perhaps beyond the data."""
    ends = [8]
    while ends[-1] < len(data):
        ends.append(ends[-1] + 9 + int.from_bytes(data[ends[-1] + 1:ends[-1] + 9], 'little'))
    return ends


def logged(path):
    """Return the times at which the messages of a bag without an end were logged [ns], by topic, and check the rest."""
    folder = path if path.is_dir() else path.parent
    (file,), before = folder.glob('*.mcap'), sorted(folder.rglob('*'))
    data = file.read_bytes()
    with pytest.warns(RecordingWarning, match=f'^{re.escape(str(file))}: has no end, '), BagReader(path) as bag:
        times = {name: [message.time for message in bag.messages([name])] for name in bag.names}
    assert sorted(folder.rglob('*')) == before and file.read_bytes() == data
    return times


def test_what_a_killed_process_has_written_is_readable(tmp_path):
    process = running(tmp_path / 'run')
    process.kill()
    process.communicate(timeout=LIMIT)
    times = logged(tmp_path / 'run')
    assert len(times['/clock']) > 100
    for name in ('odom', 'fin_wrench'):
        assert abs(len(times[name]) - len(times['/clock'])) <= 1
    clocks = []
    with (tmp_path / 'run' / 'run_0.mcap').open('rb') as file, contextlib.suppress(McapError):
        for *_, message in NonSeekingReader(file).iter_messages(topics=['/clock'], log_time_order=False):
            clocks.append(deserialize_message(message.data, Clock).clock)
    assert [clock.sec * SECOND + clock.nanosec for clock in clocks] == times['/clock']


@pytest.fixture(scope='module')
def long_run(tmp_path_factory):
    """Return a bag of several chunks."""
    path = tmp_path_factory.mktemp('long') / 'run'
    simulate(Settings(), constant_gait([30, 30, 0.6, 0.6, 40, 40], Parameters()), 12.0, path)
    return path


@pytest.mark.parametrize('metadata', [False, True])
def test_a_bag_that_is_cut_anywhere_is_read_up_to_the_last_whole_chunk(long_run, tmp_path, metadata):
    data = (long_run / 'run_0.mcap').read_bytes()
    chunks = [(start, end) for start, end in itertools.pairwise(record_ends(data)) if data[start] == 6]
    assert len(chunks) >= 3
    whole = contents(long_run)
    for (_, first), (start, end) in itertools.pairwise(chunks):
        for cut in (first, start, start + 5, (start + end) // 2, end - 1):
            path = tmp_path / str(cut)
            path.mkdir(exist_ok=True)
            (path / 'run_0.mcap').write_bytes(data[:cut])
            if metadata:
                shutil.copy(long_run / 'metadata.yaml', path)
            times = logged(path)
            assert 0 < times['odom'][-1] < 12 * SECOND
            assert times['odom'] == [time for time, _ in whole['/odom']][:len(times['odom'])]
            assert times == logged(path / 'run_0.mcap')
    assert len(times['odom']) > 0.5 * len(whole['/odom'])


@pytest.mark.parametrize('compression', [CompressionType.NONE, CompressionType.LZ4])
def test_a_cut_bag_of_a_recorder_that_logged_out_of_order_is_read_in_order(long_run, tmp_path, compression):
    path, ids = tmp_path / 'bag.mcap', {}
    with path.open('wb') as file, (long_run / 'run_0.mcap').open('rb') as source:
        writer = McapWriter(file, chunk_size=10_000, compression=compression)
        writer.start('ros2')
        messages = list(make_reader(source).iter_messages(topics=['/odom', '/clock']))[:500]
        for schema, channel, message in messages[::-1]:
            if channel.topic not in ids:
                kind = writer.register_schema(schema.name, schema.encoding, schema.data)
                ids[channel.topic] = writer.register_channel(channel.topic, 'cdr', kind)
            writer.add_message(ids[channel.topic], message.log_time, message.data, message.log_time)
        writer.finish()
    data = path.read_bytes()
    last = [start for start in record_ends(data)[:-1] if data[start] == 6][-1]
    path.write_bytes(data[:last + 100])
    times = logged(path)
    assert 200 < len(times['odom']) < 250 and times['odom'] == sorted(times['odom'])


def test_a_whole_file_without_its_metadata_is_read(long_run, tmp_path):
    shutil.copy(long_run / 'run_0.mcap', tmp_path)
    with BagReader(tmp_path) as bag, BagReader(long_run) as complete:
        assert list(bag.messages(['odom'])) == list(complete.messages(['odom']))


def test_after_each_message_whole_records_are_on_the_disk(tmp_path):
    noise, names = np.random.default_rng(1), [name for name in TOPICS if name != '/tf'][:12]
    with BagWriter(tmp_path / 'run', Settings()) as bag:
        for name in names:
            bag.add_topic(name, 10, keeps_last=False)
        (file,), sizes = (tmp_path / 'run').iterdir(), [0]
        for time, name in enumerate(names * 1000):
            bag.write(name, time, noise.bytes(400))
            if file.stat().st_size != sizes[-1]:
                data = file.read_bytes()
                assert record_ends(data)[-1] == len(data)
                sizes.append(len(data))
    assert len(sizes) >= 4


@pytest.mark.parametrize('length', [0, 4, 8, 100])
def test_what_has_no_whole_message_yet_is_refused(long_run, tmp_path, length):
    (tmp_path / 'run_0.mcap').write_bytes((long_run / 'run_0.mcap').read_bytes()[:length])
    refused = f'^{re.escape(str(tmp_path))}: cannot be read as a bag: '
    with pytest.raises(ValueError, match=refused), BagReader(tmp_path):
        pass


def test_of_several_files_the_error_says_that_each_can_be_read(long_run, tmp_path):
    for name in ('a_0.mcap', 'a_1.mcap'):
        (tmp_path / name).write_bytes((long_run / 'run_0.mcap').read_bytes()[:-1])
    with pytest.raises(ValueError, match='each of its MCAP files can be read alone$'), BagReader(tmp_path):
        pass
    with pytest.warns(RecordingWarning), BagReader(tmp_path / 'a_1.mcap') as bag:
        assert len(list(bag.messages(['odom']))) == len(contents(long_run)['/odom'])


def test_the_file_of_a_bag_has_a_name_that_reindexing_finds(long_run):
    (file,) = long_run.glob('*.mcap')
    assert re.fullmatch(r'.+_(\d+)\.([a-zA-Z0-9])+', file.name)  # what rosbag2_cpp looks for
    with Reader(long_run) as reader:
        assert reader.message_count == sum(map(len, contents(long_run).values()))


WRONG_TABLES = [
    ([''], "line 1: the columns are '', but must be time,A_l,A_r,f_l,f_r,phi_l,phi_r in any order"),
    (['0,0.7,0.7,0.6,0.6,0.7,0.7'], "line 1: the columns are '0,0.7,0.7,0.6,0.6,0.7,0.7', but must be time,A_l,"),
    (['time,A_l,A_r,f_l,f_r,phi_l,phi'], "line 1: the columns are 'time,A_l,A_r,f_l,f_r,phi_l,phi', but must be"),
    (['HEAD'], 'has no line of values below the names of the columns'),
    (['HEAD', '0,0.7,0.7,0.6,0.6,0.7'], 'line 2: there are 6 values, but must be 7, one for each column'),
    (['HEAD', '0,0.7,0.7,0.6,0.6,0.7,', ], "line 2: phi_r is '', but must be a number"),
    (['HEAD', '0,0.7,x,0.6,0.6,0.7,0.7'], "line 2: A_r is 'x', but must be a number"),
    (['HEAD', '1,0.7,0.7,0.6,0.6,0.7,0.7', '', '0.5,0.7,0.7,0.6,0.6,0.7,0.7'],
     'line 4: time is 0.5 s, but must be finite and at least 1 s'),
    (['HEAD', '-1,0.7,0.7,0.6,0.6,0.7,0.7'], 'line 2: time is -1 s, but must be finite and at least 0 s'),
    (['HEAD', 'nan,0.7,0.7,0.6,0.6,0.7,0.7'], 'line 2: time is nan s, but must be finite and at least 0 s'),
    (['HEAD', '0,0.7,0.7,0.6,9,0.7,0.7'], 'line 2: right frequency is 9'),
    (['HEAD', '0,0.7,1.5,0.6,0.6,0.7,3.1'], 'line 2: right amplitude 1.5 rad with phase 3.1 rad'),
    (['HEAD', '0,0.7,0.7,0.6,0.6,0.7,"0.7" '], 'is no table of comma-separated values'),
]


@pytest.mark.parametrize(('lines', 'said'), WRONG_TABLES)
def test_a_wrong_table_is_refused_by_file_line_value_and_bound(tmp_path, lines, said):
    table = tmp_path / 'gaits.csv'
    table.write_text('\n'.join(lines).replace('HEAD', ','.join(['time', *COLUMNS[:6]])))
    with pytest.raises(ValueError) as error:
        read_table(table, Parameters())
    assert str(error.value).startswith(str(table)) and said in str(error.value)


@pytest.mark.parametrize(('arguments', 'said'), [
    (['--gait', DEGREES], 'the following arguments are required: --duration'),
    (['--gait', DEGREES, '--duration', 1], 'the following arguments are required: --output'),
    (['--duration', 1, '--output', 'run'], 'one of the arguments --gait --commands is required'),
    (['--gait', '30,30', '--duration', 1, '--output', 'run'],
     "'30,30' has 2 values, but must have 6 (A_l,A_r,f_l,f_r,phi_l,phi_r) or 10"),
    (['--gait', 'a,b,0,0,0,0', '--duration', 1, '--output', 'run'], "'a' is not a number"),
    (['--gait', '99,30,0.6,0.6,40,40', '--duration', 1, '--output', 'run'],
     'left amplitude 99 degrees: amplitude is 1.7'),
    (['--gait', DEGREES, '--duration', 'nan', '--output', 'run'], 'duration is nan s, but must be finite'),
    (['--gait', DEGREES, '--duration', '1e300', '--output', 'run'],
     'duration is 1e+300 s, but must be finite and more than 0, and at most 1e+06 s'),
    (['--gait', DEGREES, '--duration', 0.0005, '--output', 'run'], 'must be a whole number of time steps'),
    (['--gait', DEGREES, '--duration', 1, '--output', '.'], '. exists, but the output must be new'),
    (['--commands', 'none.csv', '--duration', 1, '--output', 'run'], 'No such file'),
    (['--commands', '.', '--duration', 1, '--output', 'run'], '.: cannot be read as a bag'),
    (['--config', 'none.yaml', '--gait', DEGREES, '--duration', 1, '--output', 'run'], 'No such file'),
    (['--config', 'typo.yaml', '--gait', DEGREES, '--duration', 1, '--output', 'run'],
     'typo.yaml: fin.chain is no parameter; is fin.chains meant?'),
    (['--config', 'other.yaml', '--gait', DEGREES, '--duration', 1, '--output', 'run'],
     'other.yaml: is for /other, but must be for /manta_sim'),
    (['--config', 'bound.yaml', '--gait', DEGREES, '--duration', 1, '--output', 'run'], 'bound.yaml: fin.span is -1'),
])
def test_wrong_input_ends_with_status_2_and_one_line_before_anything_is_written(
        tmp_path, monkeypatch, capsys, arguments, said):
    for name, node, content in (('typo', '/**', 'fin.chain: 3'), ('other', '/other', 'fin.links: 3'),
                                ('bound', '/manta_sim', 'fin.span: -1.0')):
        (tmp_path / f'{name}.yaml').write_text(f'{node}:\n  ros__parameters:\n    {content}\n')
    monkeypatch.chdir(tmp_path)
    before = sorted(os.listdir())
    with pytest.raises(SystemExit, match='^2$'):
        main([*map(str, arguments)])
    out, errors = capsys.readouterr()
    (line,) = errors.splitlines()
    assert out == '' and line.startswith('simulate: ') and said in line
    assert sorted(os.listdir()) == before


def test_the_commands_of_one_of_several_robots_are_chosen_by_its_namespace(tmp_path, run):
    with Reader(run) as reader, Writer(
            tmp_path / 'two', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        (given,) = (each for each in reader.connections if each.topic == '/fin_command')
        messages = [data for *_, data in reader.messages([given])]
        for time, (name, data) in enumerate(zip(('one', 'other'), messages)):
            writer.write(writer.add_connection(f'/{name}/fin_command', given.msgtype, typestore=TYPES), time, data)
    with pytest.raises(ValueError, match=r'two: has robots in the namespaces /one, /other: choose one \(--namespace\)'):
        read_commands(tmp_path / 'two', Parameters())
    (only,) = read_commands(tmp_path / 'two', Parameters(), '/other')
    assert only.message.data.tolist() == OTHER_GAIT


def test_a_bag_that_is_damaged_or_has_no_robot_is_refused_in_one_line(run, tmp_path):
    for count in (0, 1000, 20_000):
        cut = tmp_path / f'{count}.mcap'
        cut.write_bytes(next(run.glob('*.mcap')).read_bytes()[:count])
        with pytest.raises(ValueError, match=f'^{cut}: cannot be read as a bag: .+$'):
            read_commands(cut, Parameters())
    with pytest.raises(ValueError, match='has none of the topics /other/odom, /other/fin_command, /other/rod_command'):
        with BagReader(run, '/other'):
            pass
    simulate(Settings(), [], 0.01, tmp_path / 'still')
    with pytest.raises(ValueError, match='still: has no message on fin_command or rod_command'):
        read_commands(tmp_path / 'still', Parameters())

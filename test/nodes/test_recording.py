"""What a recorder finds on the topics, read back with `rosbags`: every message, in order, as the library has it."""

import asyncio
import re
import shutil
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from rcl_interfaces.srv import GetParameters
from rosgraph_msgs.msg import Clock

from evidence import harness
from evidence.harness.lockstep import LockstepRobot
from evidence.harness.processes import LIMIT
from manta_sim_ros.dynamics import FinCommand, Parameters, Simulator
from manta_sim_ros.nodes import recording
from manta_sim_ros.nodes.qos import message_class
from manta_sim_ros.nodes.recording import run_when_recorded

AnyReader = pytest.importorskip('rosbags.highlevel').AnyReader
pytest.importorskip('mcap')

WRENCHES = ['fin_wrench', 'left_fin/wrench', 'right_fin/wrench']
AT_EACH_TICK = ['pose', 'twist', 'odom', *WRENCHES, 'imu/data', 'pressure', 'clock']
RATES = dict.fromkeys(AT_EACH_TICK, 100) | {'joint_states': 50, 'fin_markers': 10, 'velocity': 4}
"""Of the messages, in simulated time [Hz]."""

VELOCITY_RATE = '-p velocity.rate:=4.0'  # its period divides a step

GAIT = [0.7, 0.4, 0.6, 0.5, 0.7, 0.3]
STEP = 0.5  # [s]: of more messages than a publisher's queue holds
STEPS = 4
DURATION = 2  # s
QUEUE = 1000  # messages: of running time nothing is lost while a recorder stands still for seconds
SECOND = 1_000_000_000  # ns
ROS2_BAG_RECORD = ['ros2', 'bag', 'record']


class Recorder:
    """A recorder in a process of its own, which the end of its context ends. All that it prints goes to a file."""

    def __init__(self, command, bag, heard):
        self.bag, self._log, self._heard = bag, bag.with_suffix('.log'), heard
        with self._log.open('wb') as file:
            self._process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=file, stderr=subprocess.STDOUT)

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        self._process.kill()
        self._process.wait()

    @property
    def output(self):
        return self._log.read_text(errors='replace')

    @property
    def heard(self):
        """What it said last of each topic that it hears."""
        assert self._process.poll() is None, self.output
        return dict(re.findall(self._heard, self.output))

    def end(self):
        self._process.send_signal(signal.SIGINT)
        return self._process.wait(LIMIT)


def mcap_recorder(directory, topics, ros_arguments=()):
    """Start the recorder of the harness, which says of each message when it was sent."""
    bag = directory / 'bag.mcap'
    script = Path(harness.__file__).with_name('recorder.py')
    return Recorder(
        [sys.executable, str(script), str(bag), *topics, '--ros-args', *ros_arguments], bag, r'(/\S+) (\d+)\n')


def ros2_recorder(directory, topics):
    """Start the one of ROS 2, which says what it has subscribed to."""
    bag = directory / 'bag'
    return Recorder([
        *ROS2_BAG_RECORD, '--storage', 'mcap', '--output', str(bag), '--disable-keyboard-controls',
        '--topics', *topics,
    ], bag, r"Subscribed to topic '(\S+)'()")


def there_is_a_ros2_recorder():
    return bool(shutil.which('ros2')) and not subprocess.run(
        [*ROS2_BAG_RECORD, '--help'], stdin=subprocess.DEVNULL, capture_output=True).returncode


def stamp(message):
    """Return the stamp [ns] of a message of any topic; markers have one each, all the same."""
    first = message.markers[0] if hasattr(message, 'markers') else message
    time = first.header.stamp if hasattr(first, 'header') else first.clock
    return time.sec * SECOND + time.nanosec


def read(bag):
    """Return the type of each topic in a bag, and its messages in the order in which they were written."""
    with AnyReader([bag]) as reader:
        types = {connection.topic: connection.msgtype for connection in reader.connections}
        messages = {topic: [] for topic in types}
        for connection, _, data in reader.messages():
            messages[connection.topic].append(reader.deserialize(data, connection.msgtype))
    return types, messages


def types_on_the_graph(probe, topics):
    def offered():
        return {topic: probe.node.get_publishers_info_by_topic(topic) for topic in topics}

    probe.until(lambda: all(offered().values()), 'the publishers')
    return {topic: publishers[0].topic_type for topic, publishers in offered().items()}


@pytest.fixture(scope='module')
def swim(module_launch, probe, tmp_path_factory):
    """What was recorded of a swim from rest, step by step: the messages of each topic, and when it began [ns]."""
    name = 'recorded'
    topics = {topic: f'/{name}/{topic}' for topic in RATES}
    robot = LockstepRobot(module_launch, probe, name, f'-p start_paused:=true {VELOCITY_RATE}')
    while robot.step() % round(STEP * SECOND):  # to a multiple of all periods
        pass
    assert robot.set_parameter('step_duration', STEP).successful
    types = types_on_the_graph(probe, topics.values())
    sent = {topic: probe.record(message_class(kind), topic) for topic, kind in types.items()}
    with mcap_recorder(tmp_path_factory.mktemp('recording'), topics.values()) as recorder:
        def step():
            """Step, and wait until the last message of each topic is in the bag."""
            end = robot.step()
            probe.until(
                lambda: all(messages and stamp(messages[-1]) == end for messages in sent.values()), 'all outputs')
            probe.until(  # also what is repeated for who came late
                lambda: recorder.heard == {topic: str(messages.sent[-1]) for topic, messages in sent.items()},
                f'what is sent until {end} ns in the bag')
            return end

        probe.until(lambda: recorder.heard.keys() == types.keys(), 'a message of each topic', doing=robot.step)
        robot.wait_for_repeats()
        began = step()
        assert robot.trigger('reset').success
        robot.command(GAIT)
        for _ in range(STEPS):
            step()
        assert recorder.end() == 0, recorder.output
    recorded, messages = read(recorder.bag)
    assert recorded == types
    clock = messages[topics['clock']]
    repeated = [k for k in range(1, len(clock)) if stamp(clock[k]) == stamp(clock[k - 1])]
    # Only where simulated time stands still is it repeated, once a second of elapsed time.
    assert [stamp(clock[k]) for k in repeated if stamp(clock[k]) % round(STEP * SECOND)] == []
    messages[topics['clock']] = [message for k, message in enumerate(clock) if k not in repeated]
    return {
        topic: [message for message in messages[name] if stamp(message) > began] for topic, name in topics.items()
    }, began


@pytest.mark.parametrize('topic', RATES)
def test_every_message_of_a_swim_is_in_the_bag_once_and_in_order(swim, topic):
    messages, began = swim
    count, period = round(RATES[topic] * STEPS * STEP), SECOND // RATES[topic]
    assert [stamp(message) for message in messages[topic]] == [began + k * period for k in range(1, count + 1)]


def vector(part):
    return [part.x, part.y, part.z]


def test_the_values_in_the_bag_are_those_of_the_library_bit_for_bit(swim):
    messages, _ = swim
    simulator = Simulator(Parameters())
    simulator.command(left=FinCommand(*GAIT[0::2]), right=FinCommand(*GAIT[1::2]))
    for k in range(len(messages['clock'])):
        tick = {topic: messages[topic][k] for topic in AT_EACH_TICK}
        state = simulator.advance(1.0 / RATES['clock'])
        for pose in (tick['pose'].pose, tick['odom'].pose.pose):
            assert vector(pose.position) == state.position.tolist()
            assert [*vector(pose.orientation), pose.orientation.w] == state.orientation.tolist()
        for twist in (tick['twist'].twist, tick['odom'].twist.twist):
            assert vector(twist.linear) + vector(twist.angular) == state.twist.tolist()
        for topic, wrench in zip(WRENCHES, (state.wrench, *state.fin_wrenches)):
            assert vector(tick[topic].wrench.force) + vector(tick[topic].wrench.torque) == wrench.tolist()
    assert state.time == STEPS * STEP and any(state.twist)


@pytest.mark.parametrize('start', [mcap_recorder, pytest.param(ros2_recorder, marks=pytest.mark.skipif(
    not there_is_a_ros2_recorder(), reason='ros2 bag record is not installed'))])
def test_a_recording_of_running_time_has_no_gap(launch, probe, tmp_path, start):
    name = f'heard_by_{start.__name__}'
    topics = {topic: f'/{name}/{topic}' for topic in [*RATES, 'diagnostics']}
    queues = ' '.join(f'-p qos_overrides.{topic}.publisher.depth:={QUEUE}' for topic in topics.values())
    queues += ' '.join(  # the past, which such a queue keeps, does not fit into the queue of the recorder of ROS 2
        f' -p qos_overrides.{topics[topic]}.publisher.durability:=volatile' for topic in RATES)
    launch('sim_node', f'-r __ns:=/{name} -r /clock:=clock -r /diagnostics:=diagnostics {queues} {VELOCITY_RATE}')
    types = types_on_the_graph(probe, topics.values())
    with probe.record(Clock, topics['clock']) as clock:
        probe.until(lambda: clock, 'the clock')
        with start(tmp_path, topics.values()) as recorder:
            probe.until(lambda: recorder.heard.keys() == types.keys(), 'a recorder that hears')
            end = clock.stamps[-1] + DURATION * SECOND
            probe.until(lambda: clock.stamps[-1] >= end, f'{DURATION} s of simulated time')
            moment = clock.sent[-1]
            probe.until(lambda: all(int(sent or moment) >= moment for sent in recorder.heard.values()),
                        'the same in the bag, of a recorder that says what it has written')
            recorder.end()
    recorded, messages = read(recorder.bag)
    assert recorded == types
    stamps = {topic: [stamp(message) for message in messages[name]] for topic, name in topics.items()}
    for topic, rate in RATES.items():
        first, last = stamps[topic][0], stamps[topic][-1]
        assert len(stamps[topic]) == 1 + (last - first) * rate // SECOND > 1
        assert {after - before for before, after in zip(stamps[topic], stamps[topic][1:])} == {SECOND // rate}
    assert stamps['diagnostics'] == sorted(set(stamps['diagnostics']))


@pytest.mark.parametrize('step_duration', [0.01, 0.5])
def test_a_recording_that_is_awaited_begins_with_the_first_output(launch, probe, tmp_path, monkeypatch, step_duration):
    monkeypatch.setattr(recording, 'PATIENCE', LIMIT)
    name = f'awaited_{step_duration:g}'.replace('.', '_')
    simulator, topics = f'/{name}/manta_sim', {topic: f'/{name}/{topic}' for topic in [*RATES, 'diagnostics']}
    queues = ' '.join(f'-p qos_overrides.{topic}.publisher.depth:={QUEUE}' for topic in topics.values())
    launch('sim_node', f'-r __ns:=/{name} -r /clock:=clock -r /diagnostics:=diagnostics -p start_paused:=true '
                       f'-p publish_tf:=false -p step_duration:={step_duration} {queues} {VELOCITY_RATE}')
    warnings = []
    recorder_name = f'recorder_of_{name}'
    awaiting = threading.Thread(target=lambda: asyncio.run(run_when_recorded(
        simulator, {simulator: recorder_name}, warnings.append)))
    in_simulated_time = [
        '-r', f'__node:={recorder_name}', '-r', f'/clock:={topics["clock"]}', '-p', 'use_sim_time:=true']
    with probe.record(Clock, topics['clock']) as clock, \
            mcap_recorder(tmp_path, topics.values(), in_simulated_time) as recorder:
        probe.until(lambda: recorder_name in probe.node.get_node_names(), 'the recorder')
        awaiting.start()
        probe.until(lambda: not awaiting.is_alive(), 'the simulator to run')
        probe.until(lambda: clock and clock.stamps[-1] > SECOND, 'a second of simulated time')
        moment = clock.sent[-1]
        probe.until(lambda: all(int(sent) >= moment for sent in recorder.heard.values()), 'the same in the bag')
        assert recorder.end() == 0, recorder.output
    _, messages = read(recorder.bag)
    for topic, rate in RATES.items():
        stamps = [stamp(message) for message in messages[topics[topic]]]
        period = SECOND // rate
        first = -(-stamps[0] // period) * period  # a late recorder gets the present state, too
        assert first == 0 if topic not in ('clock', 'fin_markers') else first <= SECOND // 10  # those keep no messages
        assert stamps == sorted(stamps) and stamps[-1] > SECOND // 2
        assert set(range(first, stamps[-1] + 1, period)) <= set(stamps)
    assert warnings == []
    answer = probe.call(GetParameters, f'{simulator}/get_parameters', names=['step_duration'])
    assert answer.values[0].double_value == step_duration

"""The outputs of a node in this process: what is not done for nobody, what is waited for, and when what is due."""

import dataclasses
from types import SimpleNamespace

import pytest
from builtin_interfaces.msg import Time
from rclpy.publisher import Publisher
from visualization_msgs.msg import MarkerArray

from manta_sim_ros.dynamics import Simulator
from manta_sim_ros.nodes.markers import Markers
from manta_sim_ros.nodes.outputs import LATECOMER_DELAY, PATIENCE, Outputs
from manta_sim_ros.nodes.parameters import Settings
from manta_sim_ros.nodes.qos import QUEUE_DEPTH
from manta_sim_ros.nodes.state_messages import StateMessages


@pytest.fixture
def simulator():
    return Simulator()


@pytest.fixture
def outputs(probe):
    settings = Settings()
    return Outputs(probe.node, lambda: settings, lambda: (0.0, 0.0, 0.0), lambda: False)


def test_nothing_is_made_while_nobody_subscribes(outputs, simulator, probe, monkeypatch):
    made, forgotten = [], []
    write, forget = Markers.write, Markers.forget
    monkeypatch.setattr(Markers, 'write', lambda *arguments: made.append(1) or write(*arguments))
    monkeypatch.setattr(Markers, 'forget', lambda markers: forgotten.append(1) or forget(markers))
    for _ in range(50):
        outputs.publish(simulator.advance(0.01))
    assert not made
    with probe.record(MarkerArray, 'fin_markers') as heard:
        def publish():
            outputs.publish(simulator.advance(0.01))
        probe.until(lambda: len(heard) > 2, 'markers', doing=publish, every=0.0)
        assert len(made) >= len(heard)
    markers = [each for each in probe.node.publishers if each.topic_name == '/fin_markers']
    probe.until(lambda: not any(each.get_subscription_count() for each in markers), 'the end of the subscription')
    assert markers
    made.clear()
    forgotten.clear()
    for _ in range(50):
        publish()
    assert not made and len(forgotten) == 5


@pytest.mark.parametrize('all_taken', [True, False])
def test_subscribers_are_waited_for_each_time_that_the_queue_of_their_topic_is_full_unless_they_take_too_long(
        outputs, simulator, monkeypatch, all_taken):
    done, published = [], []
    publish = Outputs.publish

    def wait(publisher, timeout):
        assert 0.0 <= timeout.nanoseconds * 1e-9 <= PATIENCE
        done.append((len(published), publisher.topic_name))
        return all_taken

    monkeypatch.setattr(Publisher, 'wait_for_all_acked', wait)
    monkeypatch.setattr(Outputs, 'publish', lambda self, state: (published.append(state), publish(self, state)))
    outputs.publish_all(simulator.advance(0.01) for _ in range(35))
    assert len(published) == 35
    topics = {'/pose', '/twist', '/odom', '/fin_wrench', '/left_fin/wrench', '/right_fin/wrench', '/imu/data',
              '/pressure', '/clock'}
    if all_taken:
        waited = {number: {topic for at, topic in done if at == number} for number, _ in done}
        # joint_states have half the rate; a queue that is not full is not waited for, which takes Fast DDS 3 s
        assert waited == {
            QUEUE_DEPTH: topics, 2 * QUEUE_DEPTH: topics | {'/joint_states'}, 3 * QUEUE_DEPTH: topics}
    else:
        assert [number for number, _ in done] == [QUEUE_DEPTH]


def test_a_new_subscriber_gets_the_last_state_when_it_knows_its_publisher(outputs, simulator, monkeypatch):
    now, subscribers, sent = [100.0], dict.fromkeys(('/pose', '/twist'), 0), []
    monkeypatch.setattr('manta_sim_ros.nodes.outputs.time', SimpleNamespace(monotonic=lambda: now[0]))
    monkeypatch.setattr(Publisher, 'get_subscription_count', lambda publisher: subscribers.get(publisher.topic_name, 0))
    monkeypatch.setattr(Publisher, 'publish', lambda publisher, message: sent.append(publisher.topic_name))

    def sent_at(time):
        now[0] = time
        sent.clear()
        outputs.publish_to_latecomers()
        return list(sent)

    assert sent_at(100.0) == []  # there is no state yet
    outputs.publish(simulator.advance(0.01))
    subscribers['/pose'] = 1
    assert sent_at(101.0) == []
    subscribers['/twist'] = 1
    assert sent_at(101.3) == []
    assert sent_at(101.0 + LATECOMER_DELAY) == ['/pose']
    assert sent_at(101.3 + LATECOMER_DELAY) == ['/twist']
    assert sent_at(102.5) == []
    subscribers['/pose'] = 2
    assert sent_at(103.0) == []
    now[0] = 103.0 + LATECOMER_DELAY
    outputs.publish(simulator.advance(0.01))  # which it hears
    assert sent_at(104.0) == []


@pytest.mark.parametrize('received', [True, False])
def test_messages_of_an_earlier_step_count_until_they_are_received(outputs, simulator, monkeypatch, received):
    waited = []

    def wait(publisher, timeout):
        if timeout.nanoseconds == 0:  # only asks
            return received
        waited.append(publisher.topic_name)
        return True

    monkeypatch.setattr(Publisher, 'wait_for_all_acked', wait)
    for _ in range(2):
        outputs.publish_all(simulator.advance(0.01) for _ in range(QUEUE_DEPTH - 1))
    assert waited.count('/pose') == (0 if received else 1)


@pytest.mark.parametrize('rate', [10.0, 20.0, 30.0, 50.0, 100.0])
def test_an_output_with_a_rate_of_its_own_is_due_as_often_as_the_rate_says(simulator, rate):
    settings = Settings().replace([('joint_state_rate', rate), ('marker_rate', rate)])
    messages = StateMessages(lambda: settings, lambda: (0.0, 0.0, 0.0), lambda: False, None)
    due, state = 0, simulator.state
    for tick in range(1, 3_001):
        state = dataclasses.replace(state, time=tick * 0.01)
        due += 'joint_states' in dict(messages.of(state, Time()))
    assert due == 30 * rate


def test_the_path_begins_again_wherever_the_robot_is_put_whenever_that_is(outputs, simulator, monkeypatch):
    forgotten = []
    monkeypatch.setattr(Markers, 'forget', lambda markers: forgotten.append(1))
    monkeypatch.setattr(Publisher, 'get_subscription_count', lambda publisher: 1)
    for _ in range(13):
        outputs.publish(simulator.advance(0.01))
    assert not forgotten

    def put(x):
        return simulator.reset(dataclasses.replace(simulator.state, position=[x, 0.0, 0.0], step_count=0,
                                                   start_time=simulator.state.time))
    put(3.0)
    outputs.publish(simulator.advance(0.01))  # as running: between two markers, seen at the next tick only
    assert len(forgotten) == 1
    outputs.publish(simulator.advance(0.01))
    assert len(forgotten) == 1
    for x in (5.0, 7.0):  # as paused: at once, twice at the same time
        outputs.publish(put(x))
    assert len(forgotten) == 3

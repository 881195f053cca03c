"""What RViz, Foxglove and PlotJuggler are told to show is there: topics, types, fields, services and frames."""

import importlib
import json
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml
from sensor_msgs.msg import JointState

from manta_sim_ros.nodes.settings import NodeParameters

ROOT = Path(__file__).parents[2]
OF_ROBOT_STATE_PUBLISHER = {'/robot_description': 'std_msgs/msg/String'}
RVIZ_TYPES = {
    'RobotModel': 'std_msgs/msg/String', 'MarkerArray': 'visualization_msgs/msg/MarkerArray',
    'Odometry': 'nav_msgs/msg/Odometry', 'Wrench': 'geometry_msgs/msg/WrenchStamped',
}
RVIZ_TOOLS = {
    'SetGoal': 'geometry_msgs/msg/PoseStamped', 'SetInitialPose': 'geometry_msgs/msg/PoseWithCovarianceStamped'}
FOXGLOVE_3D_TYPES = {'std_msgs/msg/String', 'visualization_msgs/msg/MarkerArray'}  # URDF and markers
ROLL_PITCH_YAW = {'roll', 'pitch', 'yaw'}  # PlotJuggler's, beside the parts of a quaternion


@pytest.fixture(scope='module')
def node(module_launch, probe):
    """What the running node takes, publishes and offers, each {name: type}, and the names in joint_states."""
    module_launch('sim_node')
    with probe.record(JointState, 'joint_states') as joint_states:
        probe.until(lambda: joint_states, 'joint_states')
    taken, published = probe.topics_of('manta_sim')

    def services():
        return dict(probe.node.get_service_names_and_types_by_node('manta_sim', '/'))

    probe.until(lambda: '/manta_sim/reset' in services(), 'the last of the services that buttons call')
    return taken, published | OF_ROBOT_STATE_PUBLISHER, services(), joint_states[0].name


def message_class(kind):
    package, _, name = kind.split('/')
    return getattr(importlib.import_module(f'{package}.msg'), name)


def split(path, topics, separator):
    """Return the topic that a path begins with, and the names after it."""
    topic = max((topic for topic in topics if path.startswith(topic + separator)), key=len, default=None)
    assert topic is not None, f'{path} begins with no topic of the node'
    return topic, path.removeprefix(topic + separator).split(separator)


def value_at(message, names, path):
    for name in names:
        assert name in getattr(message, '_fields_and_field_types', {}), f'{path}: no {name} in {type(message).__name__}'
        message = getattr(message, name)
    return message


def rviz(name):
    return yaml.safe_load((ROOT / 'rviz' / name).read_text(encoding='utf-8'))['Visualization Manager']


def displays(manager):
    """Yield class, topic and frames of each display and tool that has any."""
    for shown in [*manager['Displays'], *manager['Tools']]:
        kind = shown['Class'].removeprefix('rviz_default_plugins/')
        topic = shown.get('Topic', shown.get('Description Topic', {})).get('Value')
        frames = set(shown.get('Frames', {})) - {'All Enabled'}
        if topic or frames:
            yield kind, topic, frames


@pytest.mark.parametrize(('name', 'namespaces'), [
    ('manta.rviz', {''}), ('two_mantas.rviz', {'/manta_1/', '/manta_2/'})])
def test_every_topic_in_rviz_is_one_of_the_robots_with_its_type(name, namespaces, node):
    taken, published, _, _ = node
    seen = set()
    for kind, topic, _ in displays(rviz(name)):
        if topic:
            namespace = re.match('/manta_./|', topic)[0]
            where, wanted = (taken, RVIZ_TOOLS[kind]) if kind in RVIZ_TOOLS else (published, RVIZ_TYPES[kind])
            assert where['/' + topic.removeprefix(namespace)] == wanted
            seen.add(namespace)
    assert seen == namespaces  # a relative topic follows the namespace that RViz is started in


@pytest.mark.parametrize(('name', 'prefixes'), [('manta.rviz', ['']), ('two_mantas.rviz', ['manta_1/', 'manta_2/'])])
def test_every_frame_in_rviz_is_one_of_the_robots(name, prefixes):
    manager, own = rviz(name), NodeParameters()
    frames = {own.odom_frame, *(prefix + own.base_frame for prefix in prefixes)}
    assert manager['Global Options']['Fixed Frame'] == own.odom_frame
    assert manager['Views']['Current']['Target Frame'] in {'<Fixed Frame>', *frames}
    assert [shown for kind, _, shown in displays(manager) if kind == 'TF'] == [frames]


@pytest.fixture(scope='module')
def foxglove():
    return json.loads((ROOT / 'config' / 'foxglove.json').read_text(encoding='utf-8'))


def panels(foxglove, kind):
    return [config for name, config in foxglove['configById'].items() if name.split('!')[0] == kind]


def test_every_path_that_foxglove_plots_is_a_number_in_a_topic(foxglove, node):
    _, published, _, joints = node
    paths = [path for plot in panels(foxglove, 'Plot') for path in plot['paths']]
    assert paths
    for path in paths:
        topic, names = split(path['value'], published, '.')
        assert 'header' in message_class(published[topic]).get_fields_and_field_types()
        assert path['timestampMethod'] == 'headerStamp'
        if topic == '/joint_states':
            index, = re.fullmatch(r'position\[(\d+)\]', *names).groups()
            assert path['label'] == joints[int(index)]
        else:
            assert isinstance(value_at(message_class(published[topic])(), names, path['value']), float)


def test_every_topic_that_foxglove_shows_or_publishes_is_one_of_the_robot(foxglove, node):
    taken, published, _, _ = node
    scene, = panels(foxglove, '3D')
    assert {published[topic] for topic in scene['topics']} == FOXGLOVE_3D_TYPES
    assert scene['publish']['type'] == 'pose'
    assert taken[scene['publish']['poseTopic']] == 'geometry_msgs/msg/PoseStamped'
    assert scene['followTf'] == NodeParameters().base_frame
    assert scene['layers']['grid']['frameId'] == NodeParameters().odom_frame
    diagnostics, = panels(foxglove, 'DiagnosticSummary')
    assert published[diagnostics['topicToRender']] == 'diagnostic_msgs/msg/DiagnosticArray'


def test_every_button_of_foxglove_calls_a_service_with_a_request_that_fits(foxglove, node):
    _, _, services, _ = node
    buttons = panels(foxglove, 'CallService')
    assert buttons
    for button in buttons:
        package, _, name = services[button['serviceName']][0].split('/')
        request = getattr(importlib.import_module(f'{package}.srv'), name).Request
        values = json.loads(button['requestPayload'])
        assert set(values) == set(request.get_fields_and_field_types()) - {'structure_needs_at_least_one_member'}
        request(**values)


def test_every_panel_of_foxglove_is_placed_once(foxglove):
    def placed(layout):
        if isinstance(layout, str):
            yield layout
        else:
            assert layout['direction'] in ('row', 'column') and 0 < layout['splitPercentage'] < 100
            yield from placed(layout['first'])
            yield from placed(layout['second'])

    tabs = [tab['layout'] for panel in panels(foxglove, 'Tab') for tab in panel['tabs']]
    names = [name for layout in (foxglove['layout'], *tabs) for name in placed(layout)]
    assert sorted(names) == sorted(foxglove['configById'])


@pytest.fixture(scope='module')
def plotjuggler():
    return ElementTree.parse(ROOT / 'config' / 'plotjuggler.xml').getroot()


def test_every_curve_of_plotjuggler_is_a_number_in_a_topic_that_it_subscribes(plotjuggler, node):
    _, published, _, joints = node
    topics = set()
    for curve in plotjuggler.iter('curve'):
        topic, names = split(curve.get('name'), published, '/')
        topics.add(topic)
        if topic == '/joint_states':
            joint, field = names
            assert joint in joints and field == 'position'
        elif names[-1] in ROLL_PITCH_YAW:
            quaternion = value_at(message_class(published[topic])(), names[:-1], curve.get('name'))
            assert type(quaternion).__name__ == 'Quaternion'
        else:
            assert isinstance(value_at(message_class(published[topic])(), names, curve.get('name')), float)
    streamer = plotjuggler.find('previouslyLoaded_Streamer').get('name')
    plugin = plotjuggler.find(f'Plugins/plugin[@ID="{streamer}"]')
    assert set(plugin.find('selected_topics').get('value').split(';')) == topics
    assert plugin.find('use_header_stamp').get('value') == 'true'  # simulated time


def test_every_splitter_of_plotjuggler_holds_as_many_plots_as_it_says(plotjuggler):
    splitters = list(plotjuggler.iter('DockSplitter'))
    assert splitters
    for splitter in splitters:
        sizes = [float(size) for size in splitter.get('sizes').split(';')]
        assert len(splitter) == int(splitter.get('count')) == len(sizes)
        assert sum(sizes) == pytest.approx(1.0, abs=1e-5)

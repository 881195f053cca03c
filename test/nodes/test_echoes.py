"""Texts from outside are cut to 200 characters wherever they come back: in logs, diagnostics, answers and errors."""

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, Vector3Stamped, WrenchStamped
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.parameter import Parameter
from std_msgs.msg import Header

LONG = 'x' * 1_000_000
IN_A_FILE = 'x' * 200_000  # a parameter file has at most a million characters
LONGEST = 600
TOPICS = {'set_pose': PoseStamped, 'current': Vector3Stamped, 'body_wrench': WrenchStamped}


@pytest.fixture(scope='module')
def robot(module_launch, tmp_path_factory):
    """A robot with a long frame, started with a long unknown name and a file for many other nodes."""
    path = tmp_path_factory.mktemp('files') / 'long.yaml'
    path.write_text(f'/**: {{ros__parameters: {{odom_frame: {IN_A_FILE}, ? {IN_A_FILE} : 1}}}}')
    other = path.with_name('other.yaml')
    other.write_text('\n'.join(f'{"x" * 200}{index}: {{ros__parameters: {{}}}}' for index in range(300)))
    node = module_launch('sim_node', f'--params-file {path} --params-file {other} -r __ns:=/long')
    node.wait_for_output('other.yaml has no effect')
    return node


def longest_line(node):
    return max(map(len, node.output.splitlines()))


@pytest.mark.parametrize('topics', [[topic] for topic in TOPICS] + [['current', 'body_wrench']], ids='-'.join)
def test_a_frame(robot, probe, topics):
    messages = {
        probe.node.create_publisher(TOPICS[topic], f'/long/{topic}', 1): TOPICS[topic](header=Header(frame_id=LONG))
        for topic in topics}

    def publish():
        for publisher, message in messages.items():
            publisher.publish(message)

    with probe.record(DiagnosticArray, '/diagnostics') as heard:
        def reported():
            texts = [status.message for array in heard for status in array.status]
            return [text for text in texts if all(f'{topic} refused' in text for topic in topics)]

        probe.until(reported, 'the diagnostics', doing=publish)
        # One message tells of all topics of which something was refused since the last one, also of those before.
        assert max(len(reason) for text in reported() for reason in text.split('; ')) < LONGEST
        assert all(len(pair.value) < LONGEST for array in heard for status in array.status for pair in status.values)
    for publisher in messages:
        probe.node.destroy_publisher(publisher)
    assert longest_line(robot) < LONGEST + 100  # with the logger's prefix
    for topic in topics:
        assert f'{topic} refused' in robot.output


@pytest.mark.parametrize(('name', 'value'), [
    (LONG, 1.0), ('odom_frame', LONG), ('water.density', LONG), ('water.current', [LONG]), (f'water.{LONG}', LONG),
    ('body.drag_area', [1.0] * 100_000), ('qos_overrides./long/odom.publisher.depth', LONG),
], ids=['unknown', 'text', 'text for a number', 'texts for numbers', 'unknown in a group', 'numbers', 'qos'])
def test_the_reason_of_a_refused_parameter(robot, probe, name, value):
    parameters = [Parameter(name, value=value).to_parameter_msg()]
    (single,) = probe.call(SetParameters, '/long/manta_sim/set_parameters', parameters=parameters).results
    together = probe.call(
        SetParametersAtomically, '/long/manta_sim/set_parameters_atomically', parameters=parameters).result
    for result in (single, together):
        assert not result.successful and 0 < len(result.reason) < LONGEST
    assert longest_line(robot) < LONGEST + 100


def test_unknown_names_that_are_set_together(robot, probe):
    result = probe.call(
        SetParametersAtomically, '/long/manta_sim/set_parameters_atomically',
        parameters=[Parameter(name, value=1.0).to_parameter_msg() for name in ('short', LONG, f'y{LONG}')]).result
    assert not result.successful and 'short, xxx' in result.reason and len(result.reason) < LONGEST


@pytest.mark.parametrize(('executable', 'parameters'), [
    ('sim_node', f'base_frame: "{IN_A_FILE} x"'),
    ('sim_node', f'fin: {{chains: {IN_A_FILE}}}'),
    ('sim_node', f'water: {{current: [{IN_A_FILE}]}}'),
    ('sim_node', f'qos_overrides: {{/odom: {{publisher: {{depth: {IN_A_FILE}}}}}}}'),
    ('sim_node', f'qos_overrides: {{/odom: {{publisher: {{reliability: {IN_A_FILE}}}}}}}'),
    ('gait_node', f'publish_rate: {IN_A_FILE}'),
    ('gait_node', f'durations: [{IN_A_FILE}]'),
    ('gait_node', f'durations: [{", ".join(20_000 * ["0.0"])}]'),
    ('monitor_node', f'duration: {IN_A_FILE}'),
], ids=['frame', 'number', 'vector', 'depth', 'reliability', 'rate', 'texts', 'numbers', 'duration'])
def test_a_value_that_ends_a_node(launch, tmp_path, executable, parameters):
    path = tmp_path / 'long.yaml'
    path.write_text(f'/**: {{ros__parameters: {{{parameters}}}}}')
    (line,) = launch(executable, f'--params-file {path}').refusal()
    assert len(line) < LONGEST + 100

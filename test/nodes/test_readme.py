"""The README's tables of topics and parameters are those of the running node."""

import importlib.util
import re
from pathlib import Path

import pytest
import yaml
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters
from rclpy.parameter import parameter_value_to_python
from rosgraph_msgs.msg import Clock

README = Path(__file__).parents[2] / 'README.md'
OF_ANY_NODE = {'use_sim_time', 'start_type_description_service'}


@pytest.fixture(scope='module')
def ask(module_launch, probe):
    module_launch('sim_node')
    with probe.record(Clock, '/clock') as clock:
        probe.until(lambda: clock, 'the clock')
    return lambda service_type, name, **request: probe.call(service_type, f'/manta_sim/{name}', **request)


@pytest.fixture(scope='module')
def live_parameters(ask):
    """Default, unit, bounds, whether live, and meaning, of each parameter by its name."""
    names = [name for name in ask(ListParameters, 'list_parameters').result.names
             if name not in OF_ANY_NODE and not name.startswith('qos_overrides.')]
    values = ask(GetParameters, 'get_parameters', names=names).values
    descriptors = ask(DescribeParameters, 'describe_parameters', names=names).descriptors
    return {name: (default(value), *described(descriptor))
            for name, value, descriptor in zip(names, values, descriptors)}


def default(value):
    value = parameter_value_to_python(value)
    return value if isinstance(value, bool | int | float | str) else list(value)


def described(descriptor):
    meaning, unit = re.fullmatch(r'(.*?)(?: \[([^][,]*)\])? \(.*\)', descriptor.description).groups()
    ranges = [*descriptor.floating_point_range, *descriptor.integer_range]
    bounds = (ranges[0].from_value, ranges[0].to_value) if ranges else None
    each = re.search(r'from (\S+) to (\S+)', descriptor.additional_constraints)  # of a vector's components
    return unit or '', (float(each[1]), float(each[2])) if each else bounds, not descriptor.read_only, meaning


@pytest.fixture(scope='module')
def live_topics(ask, probe):
    """Type and direction of each topic by its name; without the leading / where a namespace goes before it."""
    return {
        name if name in ('/tf', '/clock', '/diagnostics') else name.removeprefix('/'): (kind, direction)
        for direction, topics in zip(('in', 'out'), probe.topics_of('manta_sim')) for name, kind in topics.items()
    }


def table(heading, columns):
    """Return the rows of the first table below a heading of the README, each a dictionary by its columns."""
    section = re.split(rf'^## {heading}$', README.read_text(encoding='utf-8'), flags=re.MULTILINE)[1]
    lines = re.search(r'^\|.*?(?=^[^|]|\Z)', section, flags=re.MULTILINE | re.DOTALL)[0].splitlines()
    rows = [[cell.strip().replace(r'\|', '|') for cell in re.split(r'(?<!\\)\|', line)[1:-1]] for line in lines]
    assert rows[0] == columns
    return [dict(zip(columns, row, strict=True)) for row in rows[2:] if not set(''.join(row)) <= set('-: ')]


def rendered(columns, rows):
    cells = [columns, ['---'] * len(columns), *([cell.replace('|', r'\|') for cell in row] for row in rows)]
    return '\n' + '\n'.join(f'| {" | ".join(line)} |' for line in cells) + '\n'


SERVICE_COLUMNS = ['service', 'type', 'meaning']
TOPIC_COLUMNS = ['topic', 'type', 'in/out', 'meaning']
PARAMETER_COLUMNS = ['parameter', 'default', 'unit', 'bounds', 'live', 'meaning']


def as_table_of_topics(live, meanings):
    return rendered(TOPIC_COLUMNS, [
        [f'`{name}`', f'`{kind}`', direction, meanings.get(name, '')]
        for name, (kind, direction) in live.items()])


def as_table_of_parameters(live):
    return rendered(PARAMETER_COLUMNS, [
        [f'`{name}`', shown(value), unit, f'{bounds[0]:g} to {bounds[1]:g}' if bounds else '-',
         'yes' if live else 'no', meaning]
        for name, (value, unit, bounds, live, meaning) in live.items()])


def shown(value):
    return f'{value:g}' if isinstance(value, float) and abs(value) >= 1e6 else yaml.safe_dump(
        value, default_flow_style=True).removesuffix('\n').removesuffix('\n...')


def read(text):
    """Return a value as YAML has it, where numbers such as 1e+08 are texts to PyYAML."""
    value = yaml.safe_load(text.strip('`'))
    return float(value) if isinstance(value, str) and re.fullmatch(r'[-+.\d]+e[-+]?\d+', value) else value


def test_the_table_of_topics_is_that_of_the_running_node(live_topics):
    rows = table('Topics', TOPIC_COLUMNS)
    written = {row['topic'].strip('`'): (row['type'].strip('`'), row['in/out']) for row in rows}
    if importlib.util.find_spec('tf2_msgs') is None:
        assert written.pop('/tf') == ('tf2_msgs/msg/TFMessage', 'out')
        rows = [row for row in rows if row['topic'] != '`/tf`']
    meanings = {row['topic'].strip('`'): row['meaning'] for row in rows}
    assert len(written) == len(rows)
    assert written == live_topics, as_table_of_topics(live_topics, meanings)
    assert all(meanings.values())


def test_the_table_of_services_is_that_of_the_running_node(ask, probe):
    ask(ListParameters, 'list_parameters')
    listed = probe.node.get_service_names_and_types_by_node('manta_sim', '/')
    live = {name.replace('/manta_sim/', '~/'): types[0] for name, types in listed if 'std_srvs' in types[0]}
    rows = table('Services', SERVICE_COLUMNS)
    assert {row['service'].strip('`'): row['type'].strip('`') for row in rows} == live
    assert len(rows) == len(live) and all(row['meaning'] for row in rows)


def test_the_table_of_parameters_is_that_of_the_running_node(live_parameters):
    rows = table('Parameters', PARAMETER_COLUMNS)
    written = {
        row['parameter'].strip('`'): (
            read(row['default']),
            None if row['bounds'] == '-' else tuple(float(bound) for bound in row['bounds'].split(' to ')),
            {'yes': True, 'no': False}[row['live']],
        ) for row in rows}
    live = {name: (value, bounds, live) for name, (value, _, bounds, live, _) in live_parameters.items()}
    assert len(written) == len(rows)
    assert written == live, as_table_of_parameters(live_parameters)
    assert all(row['meaning'] for row in rows)

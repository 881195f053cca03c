"""Parameter files: the library reads them as ROS 2 does, and a node warns of what has no effect on it."""

import math
import re

import pytest
import rclpy
from rcl_interfaces.srv import GetParameters
from rclpy.parameter import parameter_value_to_python

from manta_sim_ros.dynamics import Parameters, read_sections
from manta_sim_ros.dynamics.parameter_file import values_for

SECTIONS = """
/manta_sim: {ros__parameters: {from: /manta_sim, a: 1}}
/**: {ros__parameters: {from: /**, b: 1}}
/*: {ros__parameters: {c: 1}}
/**/manta_sim: {ros__parameters: {from: /**/manta_sim, d: 1}}
/*/manta_sim: {ros__parameters: {e: 1}}
manta_sim: {ros__parameters: {f: 1}}
/m1: {manta_sim: {ros__parameters: {from: /m1 manta_sim, g: 1}}, ray: {ros__parameters: {h: 1}}}
m1/*: {ros__parameters: {i: 1, group: {j: 1, inner: {k: [1, 2]}}, group.l: 1}}
/*/*: {ros__parameters: {m: 1}}
"""
SCALARS = [
    '1', '-12', '+3', '010', '0x1F', '-0x10', '089', '1_000', '1:30', '9223372036854775807', '9223372036854775808',
    '1.0', '1.', '.5', '-1e8', '1E-3', '1.0e+8', '.inf', '-.inf', '.nan', 'inf', 'nan', '1e', '1.0.0', '2001-01-01',
    'true', 'False', 'yes', 'n', 'ON', 'oN', 'null', '~', 'text', "'1'", '"true"', '!!python/tuple [1, 2]',
    '[0.5, 1e2]', '[true, no]', '[a, b c]', '!!str 1', '<<',
]
ABOUT_PARAMETERS = re.compile(r'\[WARN\].* (no effect|stands twice)')
"""Of all lines of a node: a busy machine may let others come."""


def as_ros_reads(path, name, namespace):
    context = rclpy.Context()
    rclpy.init(context=context, args=['--ros-args', '--params-file', str(path)])
    try:
        node = rclpy.create_node(
            name, namespace=namespace, context=context, automatically_declare_parameters_from_overrides=True)
        values = {key: parameter.value for key, parameter in node.get_parameters_by_prefix('').items()}
        node.destroy_node()
    finally:
        context.shutdown()
    return {key: value.tolist() if hasattr(value, 'tolist') else value for key, value in values.items()
            if key not in ('use_sim_time', 'start_type_description_service')}


@pytest.mark.parametrize(('name', 'namespace'), [
    ('manta_sim', '/'), ('manta_sim', '/m1'), ('ray', '/'), ('ray', '/m1'), ('manta_sim', '/m1/m2'), ('ray', '/m1/m2')])
def test_the_sections_of_a_node_are_those_that_ros_takes_in_its_order(tmp_path, name, namespace):
    path = tmp_path / 'sections.yaml'
    path.write_text(SECTIONS)
    expected = as_ros_reads(path, name, namespace)
    assert expected and values_for(f'{namespace.rstrip("/")}/{name}', read_sections(path)) == expected


def test_values_are_those_that_ros_reads(tmp_path):
    path = tmp_path / 'scalars.yaml'
    lines = [f'    p{index}: {scalar}' for index, scalar in enumerate(SCALARS)]
    path.write_text('\n'.join(['/**:', '  ros__parameters:', *lines]))

    def comparable(values):
        return {name: (type(value), 'nan' if isinstance(value, float) and math.isnan(value) else value)
                for name, value in values.items()}

    expected = comparable(as_ros_reads(path, 'any', '/'))
    assert len(expected) == len(SCALARS)
    assert comparable(values_for('/any', read_sections(path))) == expected


def test_the_library_has_the_values_of_the_node_with_the_same_file(launch, probe, tmp_path):
    path = tmp_path / 'mine.yaml'
    path.write_text('/*: {ros__parameters: {fin: {chains: 14, links: 4}, body.mass: 21.0}}\n'
                    'manta_sim: {ros__parameters: {fin: {chains: 13}, publish_rate: 50.0}}\n'
                    '/**: {ros__parameters: {body: {mass: 22.0}, fin: {youngs_modulus: 2e8}}}\n'
                    '/other: {ros__parameters: {fin: {chains: 12}}}\n')
    node = launch('sim_node', f'--params-file {path} -p start_paused:=true')
    names = list(Parameters.quantities())
    values = probe.call(GetParameters, '/manta_sim/get_parameters', names=names).values
    read = Parameters.from_yaml(path)
    assert (read.fin.chains, read.fin.links, read.body.mass) == (13, 4, 22.0)
    for name, value in zip(names, values, strict=True):
        group, own = name.split('.')
        given = parameter_value_to_python(value)
        expected = getattr(getattr(read, group), own)
        assert (tuple(given) if isinstance(expected, tuple) else given) == expected, name
    assert not ABOUT_PARAMETERS.search(node.output)


WITHOUT_EFFECT = {  # ROS arguments, and what the warning must say
    'file for others': ('--params-file {other}', ['other.yaml has no effect', '/manta_monitor', '/ray, /m1/manta_sim']),
    'file for the root': ('-r __ns:=/m1 --params-file {mine}', ['mine.yaml has no', '/m1/manta_monitor', '/manta_mon']),
    'file that repeats': ('--params-file {twice}', ['twice.yaml', "'duration' stands twice", 'line 1']),
    'value for another': ('-p monitor:duration:=0.0', ['-p monitor:duration:=0.0 has no effect', 'for /monitor']),
    'unknown name': ('-p duratoin:=1.0', ['duratoin is no parameter', 'is duration meant?']),
    'wrong topic': ('-p qos_overrides./odm.subscription.depth:=3', ['./odm.', 'is qos_overrides./odom.', 'meant?']),
    'wrong entity': ('-p qos_overrides./odom.publisher.depth:=3', ['.publisher.', '/odom.subscription.depth meant?']),
    'wrong policy': ('-p qos_overrides./odom.subscription.reliabilty:=reliable', ['reliabilty', '.reliability meant?']),
}


@pytest.mark.parametrize(('arguments', 'words'), WITHOUT_EFFECT.values(), ids=WITHOUT_EFFECT)
def test_what_has_no_effect_is_warned_of_in_one_line(launch, tmp_path, arguments, words):
    files = {'other': '/ray: {ros__parameters: {duration: 0.0}}\n/m1: {manta_sim: {ros__parameters: {}}}',
             'mine': 'manta_monitor: {ros__parameters: {duration: 0.0}}',
             'twice': '/**: {ros__parameters: {duration: 0.0, duration: 0.0}}'}
    paths = {name: tmp_path / f'{name}.yaml' for name in files}
    for name, text in files.items():
        paths[name].write_text(text)
    node = launch('monitor_node', arguments.format(**paths))
    node.wait_for_output('waiting for')
    (line,) = (line for line in node.output.splitlines() if ABOUT_PARAMETERS.search(line))
    assert all(word in line for word in words)


@pytest.mark.parametrize('executable', ['sim_node', 'gait_node', 'monitor_node', 'path_follower', 'track_node'])
def test_every_node_warns_of_unknown_parameters_and_of_files_for_others(launch, tmp_path, executable):
    path = tmp_path / 'other.yaml'
    path.write_text('/ray: {ros__parameters: {color: red}}')
    node = launch(executable, f'-p color:=red --params-file {path} -r __ns:=/every')
    node.wait_for_output('color is no parameter of this node')
    node.wait_for_output(f'{path} has no effect on this node, /every/')


@pytest.mark.parametrize('arguments', [
    '-r __ns:=/deep -r __node:=ray -p qos_overrides./deep/odom.subscription.depth:=3',
    '-r __node:=ray -p ray:duration:=0.0 -p use_sim_time:=true',
])
def test_what_applies_is_not_warned_of(launch, tmp_path, arguments):
    path = tmp_path / 'mine.yaml'
    path.write_text('/other: {ros__parameters: {color: red}}\n/deep: {ray: {ros__parameters: {duration: 0.0}}}\n'
                    'ray: {ros__parameters: {duration: 0.0}}')
    node = launch('monitor_node', f'--params-file {path} {arguments}')
    node.wait_for_output('waiting for')
    assert not ABOUT_PARAMETERS.search(node.output)


def test_of_many_unknown_parameters_ten_have_a_line_each(launch, tmp_path):
    path = tmp_path / 'many.yaml'
    path.write_text('/**: {ros__parameters: {' + ', '.join(f'unknown_{index}: 1' for index in range(500)) + '}}')
    node = launch('monitor_node', f'--params-file {path}')
    node.wait_for_output('waiting for')
    lines = [line for line in node.output.splitlines() if ABOUT_PARAMETERS.search(line)]
    assert len(lines) == 11 and '490 more parameters have no effect' in lines[-1]

"""Parameters come from a ROS 2 parameter file, and an invalid file says what is wrong with it."""

import re

import pytest
import yaml

from manta_sim_ros.dynamics import Parameters


@pytest.fixture
def read(tmp_path):
    def read_text(text):
        path = tmp_path / 'parameters.yaml'
        path.write_text(text, encoding='utf-8')
        return Parameters.from_yaml(path)
    return read_text


def below(*lines):
    return '\n'.join(['/**:', '  ros__parameters:', *(f'    {line}' for line in lines)])


def test_what_a_file_leaves_out_keeps_its_default(read):
    assert read(below('water: {density: 1000.0}', 'fin: {chains: 12, span: 0.25}')) == Parameters().replace(
        water={'density': 1000.0}, fin={'chains': 12, 'span': 0.25})
    assert read(below('{}')) == Parameters()


def test_values_of_every_kind_are_read(read):
    assert read(below(
        'water: {current: [0.1, -0.2, 3e-1]}', 'fin: {links: 5}', 'solver: {fixed_base: true}', 'body: {mass: 7}',
    )) == Parameters().replace(
        water={'current': (0.1, -0.2, 0.3)}, fin={'links': 5}, solver={'fixed_base': True}, body={'mass': 7.0})


@pytest.mark.parametrize('written', ['1e8', '1E8', '1e+8', '1.0e8', '1.0e+8', '+1e8', '.1e9', '100000000'])
def test_a_number_needs_no_decimal_point(read, written):
    assert read(below(f'fin: {{youngs_modulus: {written}}}')) == Parameters()


def test_other_readers_of_yaml_are_left_as_they_are():
    assert yaml.safe_load('1e8') == '1e8'


def test_what_belongs_to_a_node_is_left_to_it(read):
    assert read(below(
        'publish_rate: 50.0', 'odom_frame: map', 'use_sim_time: true', 'imu: {seed: 3}', 'pressure: {noise: 1.0}',
        'qos_overrides: {/odom: {publisher: {depth: 3}}}')) == Parameters()


def test_a_path_may_be_a_text(tmp_path):
    path = tmp_path / 'parameters.yaml'
    path.write_text(below('fin: {chains: 12}'), encoding='utf-8')
    assert Parameters.from_yaml(str(path)).fin.chains == 12


@pytest.mark.parametrize(('text', 'reason'), [
    ('', "no '/\\*\\*:'"),
    ('just a text', "no '/\\*\\*:'"),
    ('water: {density: 1000.0}', "no 'ros__parameters:' above 'density', line 1"),
    ('water: 1000.0', "no '/\\*\\*:' .* but 'water', line 1"),
    ('/other:\n  ros__parameters: {}', "no '/\\*\\*:' or '/manta_sim:' .*; it has only /other"),
    ('/**:', "no '/\\*\\*:'"),
    ('/**: {water: {density: 1000.0}}', "no 'ros__parameters:'"),
    ('/**: {ros__parameters: }', "no 'ros__parameters:'"),
    ('/**: {ros__parameters: [1, 2]}', "no 'ros__parameters:'"),
    ('/**: {ros__parameters: {water: {', 'while parsing a flow'),
    ('/**:\n\tros__parameters:', 'found character'),
    (below('watr: {density: 1000.0}'), 'watr is no group.* water, body, rods, fin, solver'),
    (below('water: {densty: 1000.0}'), 'water.densty is no parameter; water has density, current'),
    (below('water: 1000.0'), 'water is 1000.0, but must be a group'),
    (below('water:'), 'water is None, but must be a group'),
    (below('fin: {chains: 12.0}'), 'fin.chains is 12.0, but must be a whole number'),
    (below('fin: {chains: 1}'), 'fin.chains is 1, but must be from 2'),
    (below('body: {mass: .nan}'), 'body.mass is nan'),
    (below('body: {mass: heavy}'), "body.mass is 'heavy'"),
    (below('body: {inertia: [1.0, 2.0]}'), 'body.inertia is .* list of 3 numbers'),
    (below('solver: {fixed_base: 1}'), 'solver.fixed_base is 1, but must be true or false'),
])
def test_an_invalid_file_is_refused_with_its_path_and_the_reason(tmp_path, text, reason):
    path = tmp_path / 'invalid.yaml'
    path.write_text(text, encoding='utf-8')
    with pytest.raises(ValueError, match=f'(?s)^{re.escape(str(path))}: .*{reason}'):
        Parameters.from_yaml(path)


def test_a_file_that_is_no_text_is_refused_with_its_path(tmp_path):
    path = tmp_path / 'binary.yaml'
    path.write_bytes(b'\xff\xfe\x00')
    with pytest.raises(ValueError, match=f'^{re.escape(str(path))}: '):
        Parameters.from_yaml(path)


def test_a_file_that_is_not_there_is_an_os_error(tmp_path):
    with pytest.raises(FileNotFoundError):
        Parameters.from_yaml(tmp_path / 'nowhere.yaml')


def test_names_with_dots_are_those_of_the_groups(read):
    assert read(below('fin.chains: 12', 'water.current: [0.1, 0.0, 0.0]', 'fin: {links: 2}', 'fin.span: 0.25')) == (
        Parameters().replace(fin={'chains': 12, 'links': 2, 'span': 0.25}, water={'current': (0.1, 0.0, 0.0)}))
    assert read(below('imu.seed: 3', 'qos_overrides./odom.publisher.depth: 3')) == Parameters()


@pytest.mark.parametrize(('text', 'reason'), [
    (below('fin: {chains: 12}', 'fin: {links: 2}'), r"'fin' stands twice.*line 4"),
    (below('fin: {chains: 12, chains: 13}'), r"'chains' stands twice.*line 3"),
    (below('fin: {chains: 12}', 'fin.chains: 13'), r"'fin\.chains' stands twice"),
    (below('fin.densty: 1.0'), 'fin.densty is no parameter; fin has chains'),
    ('/**:\n  ros__parameters: {}\n/**:\n  ros__parameters: {}', r"'/\*\*' stands twice.*line 3"),
    (below('a: &a [x, x, x]', 'b: &b [*a, *a, *a]', 'fin: {chains: *b}'), 'aliases are not allowed.*line 4'),
    (below(f'fin: {"[" * 5000}'), 'nested too deeply|while parsing'),
    (below('water: {? [1, 2] : 3}'), 'a name must be a text, not a list or a group, line 3'),
    (below('water: {current: [{x: 0.1}]}'), 'a list must not have groups in it, line 3'),
    (below(f'water: {"x" * 100_000}'), "water is 'xxx"),
    (below(f'water: {{? {"x" * 100_000} : 1.0}}'), 'water.xxx'),
    (below(*2 * [f'? {"x" * 100_000}\n    : 1.0']), "'xxx.* stands twice.*, line 5"),
    (f'? /{"x" * 100_000}\n: {{ros__parameters: {{}}}}', 'it has only /xxx'),
    (below(f'water: !{"x" * 100_000}!x 1.0'), 'undefined tag'),
    (below('# ' + 'x' * 2_000_000), 'more than 1000000 characters'),
], ids=['a group twice', 'a name twice', 'with and without a dot', 'unknown', 'a node twice', 'aliases', 'deep',
        'a list as a name', 'a group in a list', 'long value', 'long name', 'long name twice', 'long section',
        'long tag', 'large'])
def test_a_file_that_ros_would_read_otherwise_or_that_never_ends_is_refused(read, text, reason):
    with pytest.raises(ValueError) as refusal:
        read(text)
    assert 'parameters.yaml: ' in str(refusal.value)
    assert re.search(reason, str(refusal.value), flags=re.DOTALL) and len(str(refusal.value)) < 1000


@pytest.mark.parametrize(('section', 'applies'), [
    ('/**', True), ('/*', True), ('/manta_sim', True), ('manta_sim', True), ('/**/manta_sim', True),
    ('/*/manta_sim', False), ('/manta', False), ('/manta_simulator', False), ('/m1/manta_sim', False), ('/m1/*', False),
])
def test_a_section_is_taken_if_its_pattern_is_that_of_the_node(read, section, applies):
    text = f'{section}: {{ros__parameters: {{fin: {{chains: 12}}}}}}\n/**: {{ros__parameters: {{fin: {{links: 5}}}}}}'
    assert read(text if section != '/**' else text.partition('\n')[0]).fin.chains == (12 if applies else 30)


def test_of_two_sections_the_later_one_wins(read):
    for_any = '/**: {ros__parameters: {fin: {chains: 12, links: 5}}}'
    for_one = '/manta_sim: {ros__parameters: {fin.chains: 13}}'
    assert read(f'{for_any}\n{for_one}') == Parameters().replace(fin={'chains': 13, 'links': 5})
    assert read(f'{for_one}\n{for_any}') == Parameters().replace(fin={'chains': 12, 'links': 5})

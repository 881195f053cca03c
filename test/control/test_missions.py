"""Mission files: every kind gives its path, those of config/ can be flown, and what is wrong is named in one line."""

import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from manta_sim_ros.control.mission import MISSIONS, path_of, read_mission

ROOT = Path(__file__).parents[2]
FILES = sorted((ROOT / 'config' / 'missions').glob('*.yaml'))


def test_there_is_a_file_of_each_kind_with_every_value():
    assert {file.stem for file in FILES} == {'waypoints', *MISSIONS}
    for file in FILES:
        ((kind, values),) = yaml.safe_load(file.read_text(encoding='utf-8')).items()
        assert kind == file.stem
        assert kind == 'waypoints' or set(values) == set(MISSIONS[kind].quantities())


@pytest.mark.parametrize('file', FILES, ids=lambda file: file.stem)
def test_a_mission_of_the_package_begins_near_the_robot_along_x(file):
    path = read_mission(file)
    np.testing.assert_allclose(path.waypoints[0], 0.0, atol=1e-9)
    assert abs(path.course(0.0, 0.1)) < 0.05


def test_a_straight_line_has_two_ends():
    np.testing.assert_array_equal(
        path_of({'straight': {'start': [1, 2, 3], 'end': [5, 2, 3.5]}}).waypoints, [[1, 2, 3], [5, 2, 3.5]])


def test_a_lawnmower_goes_there_and_back():
    path = path_of({'lawnmower': {'start': [1, 1, -2], 'length': 5, 'spacing': -2, 'legs': 3}})
    np.testing.assert_array_equal(
        path.waypoints, [[1, 1, -2], [6, 1, -2], [6, -1, -2], [1, -1, -2], [1, -3, -2], [6, -3, -2]])


@pytest.mark.parametrize('turns', [0.25, -2.0])
def test_a_helix_has_its_radius_its_climb_and_its_direction(turns):
    path = path_of({'helix': {'center': [1, 2, 3], 'radius': 4, 'turns': turns, 'climb': -1}})
    x, y, z = path.waypoints.T
    np.testing.assert_allclose(np.hypot(x - 1, y - 2), 4.0)
    np.testing.assert_allclose([z[0], z[-1]], [3.0, 3.0 - abs(turns)])
    assert path.length == pytest.approx(2.0 * math.pi * 4.0 * abs(turns), rel=1e-3)
    assert path.course(0.0, 0.1) == pytest.approx(0.0, abs=0.05)
    eighth = path.length / 8.0 / abs(turns)
    assert path.course(eighth, 0.1) == pytest.approx(math.copysign(math.pi / 4.0, turns), abs=0.05)


def test_a_circle_is_a_helix_that_does_not_climb():
    values = {'center': [1, 2, 3], 'radius': 2, 'turns': 3}
    np.testing.assert_array_equal(
        path_of({'circle': values}).waypoints, path_of({'helix': values | {'climb': 0}}).waypoints)


def test_a_robot_that_keeps_station_has_room_on_both_sides_of_its_circle():
    path = path_of({'station_keeping': {'center': [1, 2, 3], 'radius': 6, 'turns': 2}})
    np.testing.assert_allclose(np.linalg.norm(path.waypoints - [1, 2, 3], axis=1), 4.0)


def test_values_that_are_left_out_have_defaults():
    assert path_of({'circle': {}}).length == pytest.approx(4.0 * math.pi, rel=1e-3)


@pytest.mark.parametrize(('content', 'words'), [
    ('', ['None', 'one key: waypoints, straight']),
    ('[1, 2]', ['[1, 2]', 'one key']),
    ('{helix: {}, circle: {}}', ["['helix', 'circle']", 'one key']),
    ('spiral: {}', ["'spiral'", 'waypoints, straight']),
    ('heli: {}', ["'heli' (helix?)"]),
    ('helix:', ['helix is None', 'group of named values']),
    ('helix: {radus: 1}', ["helix has the key 'radus' (radius?)", 'center, radius, turns, climb']),
    ('helix: {radius: 0.1}', ['helix.radius is 0.1', 'from 0.5 to 1000 m']),
    ('helix: {radius: .nan}', ['helix.radius is nan', 'from 0.5']),
    ('helix: {center: [0, 1]}', ['helix.center is [0, 1]', 'list of 3 numbers m']),
    ('helix: {center: [0, 1, up]}', ["helix.center[2] is 'up'"]),
    ('helix: {climb: 3}', ['helix: the leg to waypoint 1', 'slope of', '0.2']),
    ('circle: {turns: 0}', ['circle.turns is 0', 'at least 0.1']),
    ('lawnmower: {legs: 2.5}', ['lawnmower.legs is 2.5', 'whole number from 1 to 1000']),
    ('lawnmower: {spacing: 0}', ['lawnmower.spacing is 0', 'at least 0.1 m']),
    ('station_keeping: {radius: 1}', ['station_keeping.radius is 1', 'from 2.5 to 1000 m']),
    ('waypoints: 3', ['waypoints is 3', 'list of [x, y, z] in m']),
    ('waypoints: [[0, 0, 0], [1, 0, x]]', ['waypoint 1', 'three numbers']),
    ('waypoints: [', ['line 1']),
    ('[' * 5000, ['nested too deeply']),
])
def test_a_file_that_is_no_mission_is_refused_with_its_name(content, words, tmp_path):
    file = tmp_path / 'mine.yaml'
    file.write_text(content, encoding='utf-8')
    with pytest.raises(ValueError) as refused:
        read_mission(file)
    message = str(refused.value)
    assert message.startswith(f'mission {file}: ') and '\n' not in message
    assert all(word in message for word in words)


def test_a_file_that_cannot_be_read_is_refused_with_its_name(tmp_path):
    with pytest.raises(ValueError, match=r'mission /none\.yaml: No such file'):
        read_mission('/none.yaml')
    large = tmp_path / 'large.yaml'
    large.write_text(f'waypoints: [[0, 0, 0], [1, 0, 0]] {"#" * 1_000_000}', encoding='utf-8')
    with pytest.raises(ValueError, match='more than 1000000 characters'):
        read_mission(large)

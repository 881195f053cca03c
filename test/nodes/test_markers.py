"""What RViz is told to draw: fins where they are, in the colors of their loads, and nothing that it complains of."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from visualization_msgs.msg import Marker, MarkerArray

from evidence.scenarios import MIRROR, run_python, sized
from manta_sim_ros.body_shape import SECTIONS
from manta_sim_ros.dynamics import Parameters, State, fin_loads, fin_surfaces
from manta_sim_ros.nodes import markers, messages
from manta_sim_ros.nodes.markers import (
    FORCE_SCALE,
    FULL_LOAD,
    LOAD_COLORS,
    MOMENT_SCALE,
    PATH_BLOCK,
    PATH_SPACING,
    SHORTEST_ARROW,
    Markers,
)
from manta_sim_ros.nodes.serialization import Template

STAMP = messages.time_message(3.25)
SINGLE = 1e-7
"""Rounding of a color, which has single precision."""
FINS = ('left_fin', 'right_fin')
ALL = {('body', 0), ('path', 0), *itertools.product((*FINS, 'force', 'moment'), (0, 1))}
PATH_LENGTH = 3.0  # [m]
MIRROR_Y = np.array([1.0, -1.0, 1.0])


def moving(parameters, seed=0):
    """Return a state in which both fins are bent and move, and push on the body."""
    random = np.random.default_rng(seed)
    joints = (2, parameters.fin.chains, parameters.fin.links)
    return dataclasses.replace(
        State.at_rest(parameters), position=random.uniform(-2.0, 2.0, 3), twist=random.uniform(-0.5, 0.5, 6),
        rod_angles=random.uniform(-0.4, 0.4, (2, 2)), joint_angles=random.uniform(-0.3, 0.3, joints),
        joint_rates=random.uniform(-2.0, 2.0, joints), fin_wrenches=random.uniform(-9.0, 9.0, (2, 6)))


def symmetric(parameters):
    """Return a state that is its own mirror image."""
    state = moving(parameters)
    halves = ('rod_angles', 'joint_angles', 'joint_rates')
    return dataclasses.replace(
        state, twist=state.twist * [1.0, 0.0, 1.0, 0.0, 1.0, 0.0],
        fin_wrenches=np.stack([state.fin_wrenches[0], MIRROR * state.fin_wrenches[0]]),
        **{name: np.repeat(getattr(state, name)[:1], 2, axis=0) for name in halves})


def at(*position):
    return dataclasses.replace(moving(Parameters()), position=position)


def drawn(state, parameters, maker=None, **current):
    """Return {(namespace, id): marker} of one message."""
    maker = Markers(PATH_LENGTH) if maker is None else maker
    data = maker.write(state, parameters, STAMP, 'base_link', 'odom', **current)
    assert isinstance(data, bytes)
    array = deserialize_message(data, MarkerArray)
    found = {(marker.ns, marker.id): marker for marker in array.markers}
    assert len(found) == len(array.markers)
    return found


def corners(marker):
    return np.array([(point.x, point.y, point.z) for point in marker.points])


def path_of(found):
    """Return the points of the path; the last one may be repeated."""
    points = corners(found['path', 0])
    assert len(points) % PATH_BLOCK == 0
    last = 1 + np.flatnonzero((points != points[-1]).any(axis=-1)).max()
    assert len(points) - last <= PATH_BLOCK
    return points[:last + 1]


def faces(marker):
    return corners(marker).reshape(-1, 3, 3)


def normals(triangles):
    """Return the normals (..., 3), as long as twice the area of their triangles."""
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])


def rgba(color):
    return color.r, color.g, color.b, color.a


def given_color(digits):
    return *(int(digits[n:n + 2], 16) / 255.0 for n in (0, 2, 4)), 1.0


def lightness(color):
    """Return L* of CIE 1976 of an sRGB color, 0 black to 100 white, that of equal steps to the eye."""
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in color[:3]]
    return 116.0 * np.dot((0.2126, 0.7152, 0.0722), linear) ** (1.0 / 3.0) - 16.0  # IEC 61966-2-1


def triples(values):
    return zip(*[iter(values)] * 3)


def triangles_of(marker, nodes):
    """Yield link, corners as (chain, node) and colors of each triangle of a fin with `nodes` (n, m + 1, 3)."""
    index = {tuple(nodes[place]): place for place in np.ndindex(nodes.shape[:2])}
    for face, colors in zip(faces(marker), triples(map(rgba, marker.colors))):
        places = [index[tuple(corner)] for corner in face]
        yield min(node for _, node in places), places, colors


def colors_of(marker, nodes):
    """Return {(chain, link): color}, which must be the same wherever the chain's link is a corner."""
    found = {}
    for link, places, colors in triangles_of(marker, nodes):
        for (chain, _), color in zip(places, colors):
            assert found.setdefault((chain, link), color) == color
    return found


@pytest.mark.parametrize(('chains', 'links'), [(2, 1), (5, 2), (30, 3)])
def test_between_neighboring_chains_two_triangles_fill_each_link_from_node_to_node(chains, links):
    parameters = sized(chains, links)
    state = moving(parameters)
    found = drawn(state, parameters)
    nodes = fin_surfaces(parameters, state.rod_angles, state.joint_angles)
    for side, name in enumerate(FINS):
        quadrilaterals = {}
        for link, places, _ in triangles_of(found[name, 0], nodes[side]):
            quadrilaterals.setdefault((min(chain for chain, _ in places), link), []).append(places)
        assert set(quadrilaterals) == set(np.ndindex(chains - 1, links))
        for (k, j), (one, other) in quadrilaterals.items():
            assert set(one) | set(other) == set(itertools.product((k, k + 1), (j, j + 1)))
            diagonal = set(one) & set(other)
            assert len(diagonal) == 2 and np.ptp(list(diagonal), axis=0).tolist() == [1, 1]


def test_the_triangles_have_the_area_of_the_surface():
    parameters = sized(7, 3)
    random = np.random.default_rng(3)
    alike = np.repeat(random.uniform(-0.5, 0.5, (2, 1, 3)), 7, axis=1)  # all chains of a fin: each link is a rectangle
    state = dataclasses.replace(moving(parameters), joint_angles=alike)
    for name in FINS:
        area = 0.5 * np.linalg.norm(normals(faces(drawn(state, parameters)[name, 0])), axis=-1).sum()
        assert area == pytest.approx(0.3 * 0.315 * 6.0 / 7.0, rel=1e-12)  # from the first chain to the last


def test_the_panels_reach_from_the_motors_to_the_first_and_last_root():
    parameters = sized(7, 3, rods={'rear_motor_position': (-0.2, 0.25, 0.05)})
    state = moving(parameters)
    roots = fin_surfaces(parameters, state.rod_angles, state.joint_angles)[:, [0, -1], 0]
    for side, name in enumerate(FINS):
        motors = [(x, (0.25, -0.25)[side], 0.05) for x in roots[side, :, 0]]
        panel = corners(drawn(state, parameters)[name, 1])
        assert {tuple(corner) for corner in panel} == {*motors, *map(tuple, roots[side])}
        assert set(motors) < set(map(tuple, panel[:3])) or set(motors) < set(map(tuple, panel[3:]))


def test_a_symmetric_state_is_drawn_symmetric():
    parameters = sized(7, 3)
    state = symmetric(parameters)
    found = drawn(state, parameters)
    for number in (0, 1):
        left, right = (found[name, number] for name in FINS)
        of_left, of_right = (
            {frozenset(zip(map(tuple, face), of_face))
             for face, of_face in zip(seen, triples(map(rgba, marker.colors or [marker.color] * len(marker.points))))}
            for seen, marker in ((faces(left) * MIRROR_Y, left), (faces(right), right)))
        assert of_left == of_right
    for name in ('force', 'moment'):
        sign = MIRROR_Y if name == 'force' else -MIRROR_Y
        (left_start, left_end), (right_start, right_end) = (corners(found[name, side]) for side in (0, 1))
        np.testing.assert_array_equal(left_start * MIRROR_Y, right_start)
        np.testing.assert_allclose((left_end - left_start) * sign, right_end - right_start, rtol=0.0, atol=1e-15)


def test_rviz_lights_fins_and_panels_from_above_and_the_body_from_outside():
    found = drawn(State.at_rest(Parameters()), Parameters())
    for name, number in itertools.product(FINS, (0, 1)):
        assert np.all(normals(faces(found[name, number]))[:, 2] > 0.0)
    body = faces(found['body', 0])
    outward = body.mean(axis=1) * [0.0, 1.0, 1.0]  # of an ellipse around the x axis
    assert np.all(np.sum(normals(body) * outward, axis=-1) > 0.0)


def test_the_body_is_closed_and_as_large_as_its_sections():
    body = faces(drawn(State.at_rest(Parameters()), Parameters())['body', 0])
    rounded = np.round(body, 12) + 0.0  # and no zero is negative
    edges = [(tuple(face[n]), tuple(face[n - 1])) for face in rounded for n in range(3)]
    assert len(set(edges)) == len(edges)
    assert {(end, start) for start, end in edges} == set(edges)
    lengths = np.ptp(body.reshape(-1, 3), axis=0)
    np.testing.assert_allclose(lengths, [0.92, 2 * SECTIONS[:, 1].max(), 2 * SECTIONS[:, 2].max()], rtol=1e-12)


def test_each_link_has_the_color_of_its_load(monkeypatch):
    parameters = sized(11, 3)
    loads = np.empty((2, 11, 3))
    loads[0] = FULL_LOAD * np.linspace(-1.0, 1.0, 11)[:, None]  # the colors given
    loads[1] = FULL_LOAD * np.random.default_rng(1).uniform(-1.0, 1.0, (11, 3))
    monkeypatch.setattr(markers, 'fin_loads', lambda *_: loads)
    state = State.at_rest(parameters)
    found = drawn(state, parameters)
    nodes = fin_surfaces(parameters, state.rod_angles, state.joint_angles)
    in_order, at_random = (colors_of(found[name, 0], nodes[side]) for side, name in enumerate(FINS))
    assert set(in_order) == set(at_random) == set(np.ndindex(11, 3))
    for (chain, _), color in in_order.items():
        assert color == pytest.approx(given_color(LOAD_COLORS[chain]), rel=0.0, abs=SINGLE)
    given = np.array([given_color(digits) for digits in LOAD_COLORS])
    half_level = 0.5 * np.abs(np.diff(given, axis=0)).max() / 10.0  # 100 levels: ten from one color to the next
    for place, color in at_random.items():
        expected = [np.interp(5.0 + 5.0 * loads[1][place] / FULL_LOAD, np.arange(11.0), part) for part in given.T]
        assert color == pytest.approx(expected, rel=0.0, abs=half_level + SINGLE)


def test_colors_follow_the_load_and_stay_at_the_ends_of_the_scale(monkeypatch):
    parameters = sized(400, 2)
    loads = np.broadcast_to(FULL_LOAD * np.linspace(-1.5, 1.5, 400)[:, None], (2, 400, 2))
    monkeypatch.setattr(markers, 'fin_loads', lambda *_: loads)
    state = State.at_rest(parameters)
    nodes = fin_surfaces(parameters, state.rod_angles, state.joint_angles)
    of_links = colors_of(drawn(state, parameters)['left_fin', 0], nodes[0])
    colors = [of_links[chain, 1] for chain in range(400)]
    runs = [(color, len(list(run))) for color, run in itertools.groupby(colors)]
    assert len({color for color, _ in runs}) == len(runs) > 50  # no color comes back
    for digits, (color, length) in ((LOAD_COLORS[0], runs[0]), (LOAD_COLORS[-1], runs[-1])):
        assert color == pytest.approx(given_color(digits))
        assert length > 400 / 6  # that many are beyond each end


def test_the_scale_is_darker_the_larger_the_load_and_as_dark_for_both_signs(monkeypatch):
    parameters = sized(101, 1)
    loads = np.broadcast_to(FULL_LOAD * np.linspace(-1.0, 1.0, 101)[:, None], (2, 101, 1))
    monkeypatch.setattr(markers, 'fin_loads', lambda *_: loads)
    state = State.at_rest(parameters)
    nodes = fin_surfaces(parameters, state.rod_angles, state.joint_angles)
    of_links = colors_of(drawn(state, parameters)['left_fin', 0], nodes[0])
    lights = np.array([lightness(of_links[chain, 0]) for chain in range(101)])
    assert np.all(np.diff(lights[:51]) > 0.0) and np.all(np.diff(lights[50:]) < 0.0)
    assert lights.max() - lights.min() > 50.0
    np.testing.assert_allclose(lights, lights[::-1], rtol=0.0, atol=2.0)  # measured: below 1; an eye tells about 2
    up, down = of_links[100, 0], of_links[0, 0]
    assert up[0] > 2.0 * up[2] and down[2] > 2.0 * down[0]  # red against blue, which all kinds of color vision tell


def test_colors_are_of_the_loads_in_the_current_that_is_given():
    parameters = sized(3, 1)
    state = State.at_rest(parameters)
    assert np.abs(fin_loads(parameters, state, (0.0, 0.0, 3.0))).min() > FULL_LOAD
    for speed, digits in ((0.0, LOAD_COLORS[5]), (3.0, LOAD_COLORS[-1]), (-3.0, LOAD_COLORS[0])):
        found = drawn(state, parameters, current=(0.0, 0.0, speed))
        for name in FINS:
            color, = set(map(rgba, found[name, 0].colors))
            assert color == pytest.approx(given_color(digits))


def test_arrows_are_along_force_and_moment_and_as_long_as_they_are_large():
    parameters = sized(7, 3)
    state = moving(parameters)
    found = drawn(state, parameters)
    roots = fin_surfaces(parameters, state.rod_angles, state.joint_angles)[:, :, 0]
    for side, wrench in enumerate(state.fin_wrenches):
        for name, vector in (('force', FORCE_SCALE * wrench[:3]), ('moment', MOMENT_SCALE * wrench[3:])):
            start, end = corners(found[name, side])
            np.testing.assert_allclose(start, 0.5 * (roots[side, 0] + roots[side, -1]), rtol=0.0, atol=1e-15)
            np.testing.assert_allclose(end - start, vector, rtol=0.0, atol=1e-15)


def test_an_arrow_or_a_path_of_no_length_is_deleted_and_comes_back():
    maker, parameters = Markers(PATH_LENGTH), Parameters()
    rest = State.at_rest(parameters)
    of_no_length = ALL - {('body', 0), *itertools.product(FINS, (0, 1))}
    for state, deleted in (
        (rest, of_no_length), (dataclasses.replace(moving(parameters), position=(0.0, 0.3, 0.0)), set()),
        (dataclasses.replace(rest, position=(0.0, 0.4, 0.0), fin_wrenches=np.full((2, 6), 1e-9)),
         of_no_length - {('path', 0)}),
    ):
        found = drawn(state, parameters, maker)
        assert set(found) == ALL
        assert {key for key, marker in found.items() if marker.action == Marker.DELETE} == deleted


@pytest.mark.parametrize('state', [State.at_rest(sized(7, 3)), moving(sized(7, 3)), symmetric(sized(7, 3))])
def test_every_marker_is_one_that_rviz_draws_without_a_complaint(state):
    """The rules of visualization_msgs/msg/Marker and of the marker display of rviz_default_plugins."""
    maker, parameters = Markers(PATH_LENGTH), sized(7, 3)
    drawn(dataclasses.replace(state, position=(9.0, 0.0, 0.0)), parameters, maker)
    for (ns, _), marker in drawn(dataclasses.replace(state, position=(9.0, 1.0, 0.0)), parameters, maker).items():
        assert (marker.header.stamp, marker.header.frame_id) == (STAMP, 'odom' if ns == 'path' else 'base_link')
        if marker.action == Marker.DELETE:
            continue
        turned, origin, scale = marker.pose.orientation, marker.pose.position, marker.scale
        assert marker.action == Marker.ADD
        assert (turned.x, turned.y, turned.z, turned.w) == (0.0, 0.0, 0.0, 1.0)
        assert (origin.x, origin.y, origin.z) == (0.0, 0.0, 0.0)
        assert marker.color.a == 1.0 and all(color.a == 1.0 for color in marker.colors)
        assert all(0.0 <= part <= 1.0 for color in (marker.color, *marker.colors) for part in rgba(color))
        assert len(marker.colors) in (0, len(marker.points))
        assert np.isfinite(corners(marker)).all()
        assert marker.frame_locked
        assert 1 <= marker.lifetime.sec <= 5 and marker.lifetime.nanosec == 0  # it outlasts some messages at 10 Hz
        if marker.type == Marker.TRIANGLE_LIST:
            assert (scale.x, scale.y, scale.z) == (1.0, 1.0, 1.0)
            assert len(marker.points) >= 3 and len(marker.points) % 3 == 0
            assert np.linalg.norm(normals(faces(marker)), axis=-1).min() > 1e-9
        elif marker.type == Marker.ARROW:
            assert min(scale.x, scale.y, scale.z) > 0.0
            assert len(marker.points) == 2
            assert np.linalg.norm(np.diff(corners(marker), axis=0)) >= SHORTEST_ARROW
        else:
            assert marker.type == Marker.LINE_STRIP
            assert scale.x > 0.0 and (scale.y, scale.z) == (0.0, 0.0)
            assert len(marker.points) >= 2


def test_the_path_is_where_the_robot_was_up_to_where_it_is():
    maker, parameters = Markers(PATH_LENGTH), Parameters()
    way = [(0.03 * n, math.sin(0.03 * n), 0.2) for n in range(40)]
    for position in way:
        found = drawn(at(*position), parameters, maker)
    points = path_of(found)
    assert {tuple(point) for point in points} <= set(way)
    assert (tuple(points[0]), tuple(points[-1])) == (way[0], way[-1])
    gaps = np.linalg.norm(np.diff(points, axis=0), axis=-1)
    assert gaps[:-1].min() >= PATH_SPACING and gaps.max() < PATH_SPACING + 0.05  # a message is less than 0.05 m apart


@pytest.mark.parametrize('distance', [0.013, 0.17, 1.1])
def test_the_path_is_never_longer_than_it_may_be(distance):
    maker, parameters = Markers(PATH_LENGTH), sized(2, 1)
    state = moving(parameters)
    longest = 0.0
    for n in range(round(3.0 * PATH_LENGTH / distance)):
        found = drawn(dataclasses.replace(state, position=(1.0, distance * n, 0.0)), parameters, maker)
        points = path_of(found) if found['path', 0].points else np.zeros((1, 3))
        length = np.linalg.norm(np.diff(points, axis=0), axis=-1).sum()
        longest = max(longest, length)
        assert length < PATH_LENGTH + 1e-12
        assert len(points) <= PATH_LENGTH / PATH_SPACING + 2
    assert longest > PATH_LENGTH - max(PATH_SPACING + distance, distance)


def test_a_forgotten_path_begins_again():
    maker, parameters = Markers(PATH_LENGTH), Parameters()
    drawn(at(0.0, 0.0, 0.0), parameters, maker)
    assert len(path_of(drawn(at(0.5, 0.0, 0.0), parameters, maker))) == 2
    maker.forget()
    assert drawn(at(1.0, 0.0, 0.0), parameters, maker)['path', 0].action == Marker.DELETE
    np.testing.assert_array_equal(
        path_of(drawn(at(1.5, 0.0, 0.0), parameters, maker)), [(1.0, 0.0, 0.0), (1.5, 0.0, 0.0)])


def test_a_robot_that_waits_adds_nothing_to_its_path():
    maker, parameters = Markers(PATH_LENGTH), Parameters()
    for _ in range(5):
        assert drawn(at(0.5, 0.0, 0.0), parameters, maker)['path', 0].action == Marker.DELETE
    for _ in range(5):
        assert len(path_of(drawn(at(0.51, 0.0, 0.0), parameters, maker))) == 2


def test_a_message_is_what_rclpy_serializes_and_stays_when_the_next_is_made(monkeypatch):
    maker, other, parameters = Markers(PATH_LENGTH), Markers(PATH_LENGTH), Parameters()
    states = [at(0.0, 0.0, 0.0), at(0.5, 0.0, 0.0), dataclasses.replace(State.at_rest(parameters), position=(1, 0, 0)),
              *(at(1.0 + 0.1 * n, 0.0, 0.0) for n in range(2 * PATH_BLOCK))]
    written = [maker.write(state, parameters, STAMP, 'base_link', 'odom') for state in states]
    monkeypatch.setattr(Template, 'write', Template.message)
    for state, data in zip(states, written, strict=True):
        message = other.write(state, parameters, STAMP, 'base_link', 'odom')
        assert deserialize_message(data, MarkerArray) == deserialize_message(serialize_message(message), MarkerArray)
        assert len(data) == len(serialize_message(message))


def test_every_field_is_of_the_type_that_its_message_asks_for(tmp_path):
    code = """
import dataclasses
import numpy as np
from manta_sim_ros.nodes import messages
from manta_sim_ros.dynamics import Parameters, State
from manta_sim_ros.nodes.markers import Markers
maker, rest = Markers(3.0), State.at_rest(Parameters())
for x in (0.0, 1.0):
    state = dataclasses.replace(rest, position=(x, 0.0, 0.0), fin_wrenches=np.ones((2, 6)))
    maker.write(state, Parameters(), messages.time_message(0.0), 'base_link', 'odom')
    made = maker._template._example.markers
print(made[0]._check_fields, len(made))
"""
    assert run_python(code, tmp_path, ROS_PYTHON_CHECK_FIELDS='1').stdout.split() == ['True', '10']

"""The robot is found by its name and by where it is, and no expression takes long."""

import math
import re

import numpy as np
import pytest

from manta_sim_ros.nodes.entity_filters import LONGEST_EXPRESSION, matches, within_sphere

NAME = '/manta_1/manta_sim'


@pytest.mark.parametrize('expression', [
    '', 'manta', NAME, f'^{NAME}$', '.*', '^/manta_[0-9]+/', 'other|sim', '[^a-z]', 'm.nta_1', 's?im', '[a-z_/]sim'])
def test_a_name_is_found_by_any_part_of_it(expression):
    assert matches(expression, NAME)


@pytest.mark.parametrize('expression', ['other', '^manta', 'sim_', '^.$', '/manta_[2-9]', 'MANTA'])
def test_another_name_is_not(expression):
    assert not matches(expression, NAME)


@pytest.mark.parametrize('expression', [
    '(a+)+$', '(.?){60}x', 'a{1,1000}', r'\w', '[[:alpha:]]', 'a*b*c?', 'x' * (LONGEST_EXPRESSION + 1), 'é', '\n',
    '[a--z]', '*', '[z-a]', '[', 'a**'])
def test_an_expression_that_is_invalid_or_could_take_long_is_refused_in_a_line(expression):
    with pytest.raises(ValueError, match=r'^filters\.filter is .+, but must be a regular expression') as error:
        matches(expression, NAME)
    assert len(str(error.value)) < 500 and '\n' not in str(error.value)


@pytest.mark.parametrize(('center', 'radius', 'inside'), [
    ((1.0, 2.0, 3.0), 0.0, True), ((1.0, 2.0, 4.0), 1.0, True), ((1.0, 2.0, 4.1), 1.0, False)])
def test_a_position_is_in_a_sphere_or_not(center, radius, inside):
    assert within_sphere([center, (radius, 9.0, 9.0)], np.array([1.0, 2.0, 3.0])) == inside


@pytest.mark.parametrize(('points', 'reason'), [
    ([(0.0, 0.0, 0.0)], 'has 1 points, but must have 2'),
    ([(0.0, math.nan, 0.0), (1.0, 0.0, 0.0)], '[0.0, nan, 0.0] m with the radius 1.0 m, but must be finite'),
    ([(0.0, 0.0, 0.0), (math.inf, 0.0, 0.0)], 'the radius inf m'),
    ([(0.0, 0.0, 0.0), (-1.0, 0.0, 0.0)], 'the radius -1.0 m'),
])
def test_a_sphere_that_is_none_is_refused(points, reason):
    with pytest.raises(ValueError, match=re.escape(reason)):
        within_sphere(points, np.zeros(3))

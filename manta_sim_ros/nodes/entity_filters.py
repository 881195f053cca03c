"""Which entity a query asks for: by its name, and by where it is. Free of ROS."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from manta_sim_ros.dynamics import FloatArray, shown

MOST_REPETITIONS = 2
"""Most of `*`, `+` and `?` in an expression: without groups, no search of a name takes long then."""

LONGEST_EXPRESSION = 200

_SUPPORTED = re.compile(r'(?:[\w/.^$|*+?]|\[\^?(?:\w(?:-\w)?|/)+\])*', re.ASCII)


def matches(expression: str, name: str) -> bool:
    """Return whether a part of a name matches a regular expression; an empty one matches.

    Raises
    ------
    ValueError
        The expression is not valid, too long, repeats too often, or has other characters than letters, digits and
        `_ / . ^ $ | * + ? [ ]`; names it and the bounds.

    """
    repetitions = sum(map(expression.count, '*+?'))
    within = len(expression) <= LONGEST_EXPRESSION and repetitions <= MOST_REPETITIONS
    if not (within and _SUPPORTED.fullmatch(expression)):
        raise ValueError(
            f'filters.filter is {shown(expression)}, but must be a regular expression of at most {LONGEST_EXPRESSION} '
            f'letters, digits and _ / . ^ $ | * + ? [ ], with at most {MOST_REPETITIONS} of * + ?')
    try:
        return re.search(expression, name) is not None
    except re.error as error:
        raise ValueError(f'filters.filter is {shown(expression)}, but must be a regular expression: {error}') from error


def within_sphere(points: Sequence[Sequence[float]], position: FloatArray) -> bool:
    """Return whether a position (3,) is in a sphere; its first point is the center, and x of the second the radius [m].

    Raises
    ------
    ValueError
        There are not two points, or a value of the sphere is not finite or its radius negative.

    """
    if len(points) != 2:
        raise ValueError(f'filters.bounds.points has {len(points)} points, but must have 2: the center and the radius')
    center, radius = points[0], points[1][0]
    if not all(map(math.isfinite, (*center, radius))) or radius < 0.0:
        raise ValueError(
            f'filters.bounds is the sphere about {list(center)} m with the radius {radius} m, but must be finite, with '
            'a radius of at least 0')
    return math.dist(center, position) <= radius

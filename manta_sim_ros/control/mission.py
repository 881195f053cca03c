"""Mission files: one YAML file with one key, the kind of the mission, and below it what the mission needs."""

from __future__ import annotations

import dataclasses
import difflib
import math
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import yaml

from manta_sim_ros.control.polyline import FARTHEST, Polyline
from manta_sim_ros.dynamics import FloatArray, ParameterGroup, Vector, cut, quantity, shown, shown_name

LARGEST_MISSION = 1_000_000
"""Largest size of a mission file [characters]."""

LONGEST_REASON = 400
"""Largest number of characters of what is wrong with a file."""

POINTS_PER_TURN = 72
"""Waypoints of a circle: its legs are within a thousandth of the radius of it."""

CIRCLE_OF_STATION = 2.0 / 3.0
"""Radius of the circle on which a robot keeps station, over the radius that it must not leave."""

WAYPOINTS = 'waypoints'


def place(default: Vector, description: str) -> Any:
    """Return a field for a position [m]."""
    return quantity(default, unit='m', low=-FARTHEST, high=FARTHEST, description=description, source='chosen')


def number(default: float, unit: str, low: float, high: float, description: str) -> Any:
    """Return a field for a number with its bounds."""
    return quantity(default, unit=unit, low=low, high=high, description=description, source='chosen')


@dataclasses.dataclass(frozen=True)
class Straight(ParameterGroup):
    """A straight line."""

    prefix: ClassVar[str] = 'straight.'

    start: Vector = place((0.0, 0.0, 0.0), 'where it begins [x, y, z]')
    end: Vector = place((10.0, 0.0, 0.0), 'where it ends [x, y, z]')

    def waypoints(self) -> FloatArray:
        """Return the waypoints (2, 3) [m], world frame."""
        return np.array([self.start, self.end])


@dataclasses.dataclass(frozen=True)
class Lawnmower(ParameterGroup):
    """Parallel legs along x, there and back, at one depth: a survey of an area."""

    prefix: ClassVar[str] = 'lawnmower.'

    start: Vector = place((0.0, 0.0, 0.0), 'where the first leg begins, toward +x [x, y, z]')
    length: float = number(7.0, 'm', 1.0, 1000.0, 'length of the legs')
    spacing: float = number(2.0, 'm', -100.0, 100.0, 'distance from a leg to the next one: positive toward +y')
    legs: int = quantity(4, low=1, high=1000, description='number of legs', source='chosen')

    def __post_init__(self) -> None:
        """Check every field, and that the legs are apart."""
        super().__post_init__()
        if abs(self.spacing) < 0.1:
            raise ValueError(f'lawnmower.spacing is {self.spacing:g}, but must be at least 0.1 m to either side')

    def waypoints(self) -> FloatArray:
        """Return the waypoints (2 `legs`, 3) [m], world frame."""
        corners = [(self.length * ((index + 1) // 2 % 2), self.spacing * (index // 2), 0.0)
                   for index in range(2 * self.legs)]
        return np.array(self.start) + np.array(corners)


@dataclasses.dataclass(frozen=True)
class Circle(ParameterGroup):
    """A circle at one depth, which begins along x and turns to the left, or with negative turns to the right."""

    prefix: ClassVar[str] = 'circle.'

    center: Vector = place((0.0, 2.0, 0.0), 'center [x, y, z]')
    radius: float = number(2.0, 'm', 0.5, 1000.0, 'radius')
    turns: float = number(1.0, '', -1000.0, 1000.0, 'number of turns: positive to the left')

    def __post_init__(self) -> None:
        """Check every field, and that the turns are a part of a circle at least."""
        super().__post_init__()
        if abs(self.turns) < 0.1:
            raise ValueError(f'{self.prefix}turns is {self.turns:g}, but must be at least 0.1 to either side')

    def waypoints(self) -> FloatArray:
        """Return the waypoints (n, 3) [m], world frame."""
        return around(self.center, self.radius, self.turns, 0.0)


@dataclasses.dataclass(frozen=True)
class Helix(Circle):
    """A circle that climbs or dives, and begins at the height of its center."""

    prefix: ClassVar[str] = 'helix.'

    climb: float = number(1.2, 'm', -100.0, 100.0, 'height that is gained in a turn; negative to dive')

    def waypoints(self) -> FloatArray:
        """Return the waypoints (n, 3) [m], world frame."""
        return around(self.center, self.radius, self.turns, self.climb)


@dataclasses.dataclass(frozen=True)
class StationKeeping(ParameterGroup):
    """Remain near a point: on a circle about it, as the robot does not steer without speed."""

    prefix: ClassVar[str] = 'station_keeping.'

    center: Vector = place((0.0, 0.0, 0.0), 'point near which to remain [x, y, z]')
    radius: float = number(3.0, 'm', 2.5, 1000.0, 'horizontal distance from it that the robot must not exceed')
    turns: float = number(10.0, '', 1.0, 1000.0, 'number of turns until the mission ends')

    def waypoints(self) -> FloatArray:
        """Return the waypoints (n, 3) [m], world frame."""
        return around(self.center, CIRCLE_OF_STATION * self.radius, self.turns, 0.0)


Mission = Straight | Lawnmower | Circle | Helix | StationKeeping

MISSIONS: dict[str, type[Mission]] = {
    kind.prefix.removesuffix('.'): kind for kind in (Straight, Lawnmower, Circle, Helix, StationKeeping)}
"""The kinds that have values by name; `waypoints` is a list instead."""


def around(center: Vector, radius: float, turns: float, climb: float) -> FloatArray:
    """Return the waypoints (n, 3) [m] of turns about a vertical line, which begin along x at the height of the center.

    `climb` [m] is the height that is gained in a turn.
    """
    count = math.ceil(abs(turns) * POINTS_PER_TURN) + 1
    angle = 2.0 * math.pi * np.linspace(0.0, abs(turns), count)
    offsets = [radius * np.sin(angle), -math.copysign(radius, turns) * np.cos(angle), climb * angle / (2.0 * math.pi)]
    return np.array(center) + np.column_stack(offsets)


def read_mission(file: str | Path) -> Polyline:
    """Return the path of a mission file.

    Raises
    ------
    ValueError
        The file cannot be read, or is no mission: names the file, the key, the value and the bound.

    """
    try:
        with Path(file).open(encoding='utf-8') as opened:
            text = opened.read(LARGEST_MISSION + 1)
        if len(text) > LARGEST_MISSION:
            raise ValueError(f'has more than {LARGEST_MISSION} characters, the largest size of a mission file')
        return path_of(yaml.safe_load(text))
    except RecursionError as error:
        raise ValueError(f'mission {shown_name(file)}: is nested too deeply for a mission file') from error
    except (OSError, ValueError, yaml.YAMLError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise ValueError(f'mission {shown_name(file)}: {cut(" ".join(str(reason).split()), LONGEST_REASON)}') from error


def path_of(content: object) -> Polyline:
    """Return the path of a mission, given as the content of its file.

    Raises
    ------
    ValueError
        It is no mission: names the key, the value and the bound.

    """
    kinds = (WAYPOINTS, *MISSIONS)
    if not isinstance(content, dict) or len(content) != 1:
        given = shown(list(content)) if isinstance(content, dict) else shown(content)
        raise ValueError(f'has {given}, but must have one key: {", ".join(kinds)}')
    (kind, values), = content.items()
    if kind == WAYPOINTS:
        if not isinstance(values, list):
            raise ValueError(f'{WAYPOINTS} is {shown(values)}, but must be a list of [x, y, z] in m')
        return Polyline(values)
    if kind not in MISSIONS:
        raise ValueError(f'the kind is {shown(kind)}{meant(kind, kinds)}, but must be {", ".join(kinds)}')
    if not isinstance(values, dict):
        raise ValueError(f'{kind} is {shown(values)}, but must be a group of named values, which may be empty: {{}}')
    names = tuple(MISSIONS[kind].quantities())
    for name in values:
        if name not in names:
            raise ValueError(f'{kind} has the key {shown(name)}{meant(name, names)}, but takes {", ".join(names)}')
    mission = MISSIONS[kind](**values)
    try:
        return Polyline(mission.waypoints())
    except ValueError as error:
        raise ValueError(f'{kind}: {error}') from error


def meant(name: object, names: tuple[str, ...]) -> str:
    """Return a question for the nearest of the names, or nothing."""
    near = difflib.get_close_matches(str(name), names, n=1)
    return f' ({near[0]}?)' if near else ''

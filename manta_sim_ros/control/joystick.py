"""What the axes and buttons of a joystick mean, as `sensor_msgs/msg/Joy` has them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

from manta_sim_ros.control.manual import Demand
from manta_sim_ros.dynamics import ParameterGroup, quantity

MOST_AXES, MOST_BUTTONS = 32, 64
"""Bounds of the indices: more than any game pad has."""

GAME_PAD = 'a game pad of the Xbox kind, with joy_node'


def _index(default: int, most: int, description: str) -> Any:
    return quantity(default, low=0, high=most - 1, description=description, source=GAME_PAD)


def _scale(description: str) -> Any:
    return quantity(1.0, low=-1.0, high=1.0, description=description, source='left and up are positive')


@dataclasses.dataclass(frozen=True)
class JoystickSettings(ParameterGroup):
    """Which axis and which button is for what.

    Raises
    ------
    ValueError
        A value is of another kind or out of its bounds; names it and the bound.

    """

    prefix = 'joy.'

    throttle_axis: int = _index(1, MOST_AXES, 'axis of the throttle: left stick, up and down')
    steer_axis: int = _index(0, MOST_AXES, 'axis of steering: left stick, left and right')
    climb_axis: int = _index(4, MOST_AXES, 'axis of climbing: right stick, up and down')
    throttle_scale: float = _scale('throttle at the end of its axis; negative turns the axis round')
    steer_scale: float = _scale('steering at the end of its axis; negative turns the axis round')
    climb_scale: float = _scale('climbing at the end of its axis; negative turns the axis round')
    dead_man_button: int = _index(
        4, MOST_BUTTONS, 'button that must be held, or the fins stop: left shoulder button')
    dead_zone: float = quantity(
        0.05, low=0.0, high=0.9, description='deflection of an axis that counts as none', source='as of joy_node')
    timeout: float = quantity(
        0.5, unit='s', low=0.1, high=10.0, description='time without joy after which the fins stop',
        source='ten times the time between two messages of joy_node')


def demand_of(settings: JoystickSettings, axes: Sequence[float], buttons: Sequence[int]) -> Demand | None:
    """Return what a joystick asks for, None while its dead-man button is not held.

    Parameters
    ----------
    settings
        Which axis and which button is for what.
    axes
        Deflections from -1 to 1, left and up positive; what is beyond counts as the end.
    buttons
        0, or 1 where pressed.

    Raises
    ------
    ValueError
        There are too few axes or buttons, or a deflection is not finite; names it.

    """
    if not settings.dead_man_button < len(buttons):
        raise ValueError(
            f'there are {len(buttons)} buttons, but joy.dead_man_button is {settings.dead_man_button}, counted from 0')
    parts = []
    for name in Demand._fields:
        axis, scale = getattr(settings, f'{name}_axis'), getattr(settings, f'{name}_scale')
        if not axis < len(axes):
            raise ValueError(f'there are {len(axes)} axes, but joy.{name}_axis is {axis}, counted from 0')
        if not math.isfinite(axes[axis]):
            raise ValueError(f'axis {axis} is {axes[axis]}, but must be from -1 to 1')
        parts.append(scale * _without_dead_zone(min(max(axes[axis], -1.0), 1.0), settings.dead_zone))
    return Demand(*parts) if buttons[settings.dead_man_button] else None


def _without_dead_zone(deflection: float, zone: float) -> float:
    """Return the deflection, which begins with 0 at the end of the dead zone and ends with 1."""
    return math.copysign(max(abs(deflection) - zone, 0.0) / (1.0 - zone), deflection)

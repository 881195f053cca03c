"""The settings as ROS 2 parameters: declared from the dataclasses, and checked by them."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter

from manta_sim_ros.dynamics import Quantity, shown
from manta_sim_ros.nodes.settings import Settings

OTHERS = ('use_sim_time', 'start_type_description_service')
"""Parameters that rclpy declares; those that begin with `qos_overrides.` are of rclpy, too."""


def declare(node: Node) -> Settings:
    """Declare every parameter of the simulator on `node`, and return the settings with which it was started.

    `node` must have been made with `automatically_declare_parameters_from_overrides`. The given values are checked
    first, whole numbers are accepted for decimal ones, and a warning is logged for each unknown name.

    Raises
    ------
    ValueError
        A given value is invalid; names it and the bound.

    """
    known = Settings.quantities()
    given = {name: parameter.value for name, parameter in node.get_parameters_by_prefix('').items()}
    for name in given:
        if name in OTHERS or name.startswith('qos_overrides.'):
            continue
        node.undeclare_parameter(name)
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            node.get_logger().warning(
                f'{name} is no parameter of this node and has no effect{f"; is {near[0]} meant?" if near else ""}')
    settings = Settings().replace((name, value) for name, value in given.items() if name in known)
    for name, about in known.items():
        value = settings.value(name)
        node.declare_parameter(
            name, list(value) if isinstance(value, tuple) else value, descriptor(about), ignore_override=True)
    return settings


def declare_value(node: Node, name: str, default: Any, description: str) -> Any:
    """Declare one read-only parameter of a node that was made as for `declare`, and return its value.

    Whole numbers are accepted for decimal ones, and a number for a list of one.

    Raises
    ------
    ValueError
        The given value is of another type; names it.

    """
    value = default
    if node.has_parameter(name):
        value = node.get_parameter(name).value
        node.undeclare_parameter(name)
    if isinstance(default, list):
        parts = value.tolist() if hasattr(value, 'tolist') else value
        value = [_decimal(part) for part in (parts if isinstance(parts, list) else [parts])]
        fits = all(type(part) is float for part in value)
    else:
        value = _decimal(value) if isinstance(default, float) else value
        fits = type(value) is type(default)
    if not fits:
        raise ValueError(f'{name} is {shown(value)}, but must be of the type of {default!r}')
    node.declare_parameter(
        name, value, ParameterDescriptor(description=description, read_only=True), ignore_override=True)
    return value


def _decimal(value: Any) -> Any:
    return float(value) if type(value) is int else value


def descriptor(about: Quantity) -> ParameterDescriptor:
    """Return the ROS 2 descriptor of a parameter: description with unit and source, bounds, read-only or not."""
    unit = f' [{about.unit}]' if about.unit else ''
    described = ParameterDescriptor(
        description=f'{about.description}{unit} ({about.source})', read_only=not about.live)
    if about.kind is float:
        described.floating_point_range = [FloatingPointRange(from_value=float(about.low), to_value=float(about.high))]
    elif about.kind is int:
        described.integer_range = [IntegerRange(from_value=int(about.low), to_value=int(about.high), step=1)]
    elif about.kind is tuple:
        described.additional_constraints = f'{about.size} numbers, each {about.bounds}'
    elif about.kind is str:
        described.additional_constraints = ' or '.join(about.choices) or 'a text that is not empty'
    return described


def set_values(settings: Settings, parameters: Iterable[Parameter[Any]]) -> Settings:
    """Return the settings with these parameters set; parameters of rclpy are ignored.

    Raises
    ------
    ValueError
        A value is invalid; names it and the bound.

    """
    known = Settings.quantities()
    return settings.replace((parameter.name, parameter.value) for parameter in parameters if parameter.name in known)


"""The parameters of the nodes: declared from dataclasses or one by one, checked, and warned of if unknown."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.context import Context
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.node import Node
from rclpy.parameter import Parameter

from manta_sim_ros.dynamics import ParameterGroup, Quantity, shown, shown_name, shown_names
from manta_sim_ros.nodes.settings import Settings

OTHERS = ('use_sim_time', 'start_type_description_service')
"""Parameters that rclpy declares for every node."""

MOST_WARNINGS = 10
"""Most warnings of unknown parameters, one each."""


Group = TypeVar('Group', bound=ParameterGroup)


class ParameterNode(Node):
    """A node that knows with which parameters it was started, and declares them itself.

    Parameters
    ----------
    name
        Its name.
    context
        The context in which it runs; by default that of `rclpy.init()`.

    """

    def __init__(self, name: str, context: Context | None = None) -> None:
        super().__init__(name, context=context, automatically_declare_parameters_from_overrides=True)
        self.given: dict[str, Any] = {
            name: parameter.value for name, parameter in self.get_parameters_by_prefix('').items()
            if name not in OTHERS}
        """The values with which the node was started, by name; whether they are declared is not known yet."""
        for given in self.given:  # rclpy declares again what belongs to it, the qos_overrides
            self.undeclare_parameter(given)

    def warn_of_unknown_parameters(self) -> None:
        """Log a warning for each given parameter that was not declared; to be called when all topics are made."""
        known = list(self.get_parameters_by_prefix(''))
        unknown = [name for name in self.given if not self.has_parameter(name)]
        for name in unknown[:MOST_WARNINGS]:
            near = difflib.get_close_matches(name, known, n=1)
            self.get_logger().warning(
                f'{shown_name(name)} is no parameter of this node and has no effect'
                f'{f"; is {near[0]} meant?" if near else ""}')
        if len(unknown) > MOST_WARNINGS:
            self.get_logger().warning(
                f'{len(unknown) - MOST_WARNINGS} more parameters have no effect: '
                f'{shown_names(unknown[MOST_WARNINGS:])}')

    def set_parameters_atomically(self, parameter_list: list[Parameter[Any]]) -> SetParametersResult:
        """Set parameters as any node does; an error names all that are unknown, but not the whole of long names."""
        try:
            return super().set_parameters_atomically(parameter_list)
        except ParameterNotDeclaredException:
            unknown = [parameter.name for parameter in parameter_list if not self.has_parameter(parameter.name)]
            raise ParameterNotDeclaredException(shown_names(unknown)) from None


def declare(node: ParameterNode) -> Settings:
    """Declare every parameter of the simulator on `node`, and return the settings with which it was started.

    The given values are checked first, and whole numbers are accepted for decimal ones.

    Raises
    ------
    ValueError
        A given value is invalid; names it and the bound.

    """
    known = Settings.quantities()
    settings = Settings().replace((name, value) for name, value in node.given.items() if name in known)
    for name, about in known.items():
        value = settings.value(name)
        node.declare_parameter(
            name, list(value) if isinstance(value, tuple) else value, descriptor(about), ignore_override=True)
    return settings


def declare_group(node: ParameterNode, kind: type[Group]) -> Group:
    """Declare the parameters of a group on `node`, read-only, and return the group with the given values.

    Raises
    ------
    ValueError
        A given value is invalid; names it and the bound.

    """
    names = {kind.prefix + name: name for name in kind.quantities()}
    group = kind(**{names[name]: value for name, value in node.given.items() if name in names})
    for full_name, name in names.items():
        value = getattr(group, name)
        node.declare_parameter(
            full_name, list(value) if isinstance(value, tuple) else value, descriptor(kind.quantities()[name]),
            ignore_override=True)
    return group


def declare_value(node: ParameterNode, name: str, default: Any, description: str) -> Any:
    """Declare one read-only parameter of a node, and return its value.

    Whole numbers are accepted for decimal ones, and a number for a list of one.

    Raises
    ------
    ValueError
        The given value is of another type; names it.

    """
    value = node.given.get(name, default)
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


"""The parameters of the model and of the node as ROS 2 parameters: declared from their one home, checked by it."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Iterable, Iterator
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter

from manta_sim_ros.dynamics.parameters import (
    GROUPS,
    Group,
    Parameters,
    Quantity,
    Vector,
    quantities,
    quantity,
)
from manta_sim_ros.sensors import Imu, Pressure

FARTHEST = 1e6
"""Bound of a coordinate that the robot is put at [m]: a double still tells tenths of a nanometre there."""

OTHERS = ('use_sim_time', 'start_type_description_service')
"""What else a node may be started with: parameters of rclpy's, and those that begin with `qos_overrides.`."""


@dataclasses.dataclass(frozen=True)
class NodeParameters(Group):
    """The node's own parameters."""

    publish_rate: float = quantity(
        100.0, 'Hz', 0.1, 1000.0, 'rate of all outputs in simulated time, at most one a time step', 'chosen',
    )
    real_time_factor: float = quantity(
        1.0, '', 0.0, 1000.0, 'simulated time over elapsed time; 0 runs as fast as it can', 'chosen',
    )
    publish_clock: bool = quantity(
        True, '', 0, 1, "publish /clock and stamp with simulated time; else stamp with the node's own clock", 'chosen',
    )
    start_paused: bool = quantity(
        False, '', 0, 1, 'start with simulated time standing still, until ~/pause says otherwise', 'chosen',
    )
    initial_position: Vector = quantity(
        (0.0, 0.0, 0.0), 'm', -FARTHEST, FARTHEST,
        'where the robot starts and goes at a reset, world frame [x, y, z]', 'chosen',
    )
    initial_yaw: float = quantity(
        0.0, 'rad', -7.0, 7.0, 'heading there about the vertical, level otherwise; positive to the left',
        'chosen',
    )
    step_duration: float = quantity(
        0.01, 's', 1e-7, 3600.0, 'simulated time of a ~/step, a whole number of time steps', 'chosen',
    )
    command_timeout: float = quantity(
        0.0, 's', 0.0, 3600.0,
        'simulated time after the last fin_command at which the amplitudes glide to zero; 0 waits for ever', 'chosen',
    )
    body_wrench_lifetime: float = quantity(
        0.5, 's', 0.0, 3600.0, 'simulated time for which a body_wrench acts; 0 until the next one', 'chosen',
    )
    joint_state_rate: float = quantity(
        50.0, 'Hz', 0.1, 1000.0, 'rate of joint_states in simulated time, at most one an output', 'chosen',
    )
    publish_fin_joints: bool = quantity(
        False, '', 0, 1, 'whether joint_states holds supports and chains beside the four rods', 'chosen',
    )
    marker_rate: float = quantity(
        10.0, 'Hz', 1.0, 1000.0,
        'rate of fin_markers in simulated time, at most one an output; none while nobody subscribes', 'chosen',
    )
    publish_tf: bool = quantity(
        True, '', 0, 1, 'publish the transform from odom_frame to base_frame, if tf2_msgs is installed', 'chosen',
    )
    odom_frame: str = quantity('odom', '', 0, 0, 'name of the world frame', 'REP 105')
    base_frame: str = quantity('base_link', '', 0, 0, 'name of the body frame', 'REP 105')

    @property
    def pace(self) -> float:
        """Outputs per elapsed second [1/s]; 0 is as many as it can."""
        return self.publish_rate * self.real_time_factor

    def __post_init__(self) -> None:
        """Check each field, then that the frames are different names that tf2 takes."""
        super().__post_init__()
        for name in ('odom_frame', 'base_frame'):
            frame = getattr(self, name)
            if frame.startswith('/') or frame != ''.join(frame.split()):
                raise ValueError(f'{name} is {frame!r}, but must be a name without a leading / and without blanks')
        if self.odom_frame == self.base_frame:
            raise ValueError(f'base_frame is {self.base_frame!r}, but must differ from odom_frame')


SENSORS: dict[str, type[Any]] = {'imu': Imu, 'pressure': Pressure}

LIVE = frozenset({
    'water.density', 'water.current', 'water.current_deviation', 'water.current_correlation_time',
    'water.current_seed', 'water.surface_height',
    'body.drag_area', 'body.drag_coefficient', 'body.angular_damping',
    'fin.youngs_modulus', 'fin.joint_damping', 'fin.drag_coefficient',
    *(f'imu.{name}' for name, _ in quantities(Imu)), *(f'pressure.{name}' for name, _ in quantities(Pressure)),
    'publish_rate', 'real_time_factor', 'step_duration', 'command_timeout', 'body_wrench_lifetime',
    'joint_state_rate', 'publish_fin_joints', 'marker_rate',
})
"""What may be set while the node runs; the rest is read-only."""


@dataclasses.dataclass(frozen=True)
class Settings:
    """All parameters of the node.

    Raises
    ------
    ValueError
        The publish rate asks for more than one output a time step.

    """

    model: Parameters = Parameters()
    imu: Imu = Imu()
    pressure: Pressure = Pressure()
    node: NodeParameters = NodeParameters()

    def __post_init__(self) -> None:
        """Check what concerns both."""
        highest = 1.0 / self.model.solver.time_step
        if self.node.publish_rate > highest * (1.0 + 1e-9):
            raise ValueError(
                f'publish_rate is {self.node.publish_rate:g} Hz, but must be at most {highest:g} Hz, '
                'one output each solver.time_step'
            )

    def value(self, full_name: str) -> Any:
        """Return the value of a parameter by its full name, such as `fin.span`."""
        group, _, name = full_name.rpartition('.')
        return getattr(self._group(group), name)

    def replaced(self, values: Iterable[tuple[str, Any]]) -> Settings:
        """Return settings with other values, given by full names such as `fin.span`.

        Raises
        ------
        ValueError
            A value is bad; names it and the bound.

        """
        changes: dict[str, dict[str, Any]] = {}
        for full_name, value in values:
            group, _, name = full_name.rpartition('.')
            changes.setdefault(group, {})[name] = value
        changed = {group: dataclasses.replace(self._group(group), **new) for group, new in changes.items()}
        own = {group or 'node': changed.pop(group) for group in (*SENSORS, '') if group in changed}
        return dataclasses.replace(self, model=dataclasses.replace(self.model, **changed), **own)

    def _group(self, name: str) -> Any:
        """Return a group by its name, '' for the node's own parameters."""
        return getattr(self.model if name in GROUPS else self, name or 'node')


def all_quantities() -> Iterator[tuple[str, Any, Quantity]]:
    """Yield full name, default and `Quantity` of every parameter of the node."""
    for group_name, group in (GROUPS | SENSORS).items():
        for name, known in quantities(group):
            yield f'{group_name}.{name}', getattr(group(), name), known
    for name, known in quantities(NodeParameters):
        yield name, getattr(NodeParameters(), name), known


def declare(node: Node) -> Settings:
    """Declare every parameter of the simulator on `node` and return the settings that it was started with.

    `node` must have been made with `automatically_declare_parameters_from_overrides`: what it was started with is
    checked here first, whole numbers are taken where decimal ones are wanted, and unknown names are warned of.

    Raises
    ------
    ValueError
        A value that the node was started with is bad; names it and the bound.

    """
    known = {name: about for name, _, about in all_quantities()}
    given = {name: parameter.value for name, parameter in node.get_parameters_by_prefix('').items()}
    for name in given:
        if name in OTHERS or name.startswith('qos_overrides.'):
            continue
        node.undeclare_parameter(name)
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            node.get_logger().warning(
                f'{name} is no parameter of this node and is left out{f"; is {near[0]} meant?" if near else ""}')
    settings = Settings().replaced((name, value) for name, value in given.items() if name in known)
    for name, about in known.items():
        value = settings.value(name)
        node.declare_parameter(
            name, list(value) if isinstance(value, tuple) else value, descriptor(name, about), ignore_override=True)
    return settings


def declare_value(node: Node, name: str, default: Any, description: str) -> Any:
    """Declare one read-only parameter of a node that is made as `declare` wants it, and return its value.

    Whole numbers are taken where decimal ones are wanted, and one number where a list is.

    Raises
    ------
    ValueError
        What the node was started with is of another type; names it.

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
        raise ValueError(f'{name} is {value!r}, but must be of the type of {default!r}')
    node.declare_parameter(
        name, value, ParameterDescriptor(description=description, read_only=True), ignore_override=True)
    return value


def _decimal(value: Any) -> Any:
    return float(value) if type(value) is int else value


def descriptor(name: str, known: Quantity) -> ParameterDescriptor:
    """Return description, unit, bounds and whether it is read-only, as ROS 2 wants them."""
    unit = f' [{known.unit}]' if known.unit else ''
    described = ParameterDescriptor(
        description=f'{known.description}{unit} ({known.source})', read_only=name not in LIVE,
    )
    if known.kind is float:
        described.floating_point_range = [FloatingPointRange(from_value=float(known.low), to_value=float(known.high))]
    elif known.kind is int:
        described.integer_range = [IntegerRange(from_value=int(known.low), to_value=int(known.high), step=1)]
    elif known.kind is tuple:
        described.additional_constraints = f'3 numbers, each {_bounds(known)}'
    elif known.kind is str:
        described.additional_constraints = ' or '.join(known.choices) or 'a text that is not empty'
    return described


def set_values(settings: Settings, parameters: Iterable[Parameter[Any]]) -> Settings:
    """Return the settings after `ros2 param set` of these; parameters that are not the simulator's are left out.

    Raises
    ------
    ValueError
        A value is bad; names it and the bound.

    """
    known = {name for name, _, _ in all_quantities()}
    return settings.replaced((parameter.name, parameter.value) for parameter in parameters if parameter.name in known)


def _bounds(known: Quantity) -> str:
    return f'from {known.low:g} to {known.high:g} {known.unit}'.rstrip()

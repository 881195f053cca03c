"""Every value of the model: its default, unit, bounds and source, validated when made."""

from __future__ import annotations

import dataclasses
import math
import numbers
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import yaml

Vector = tuple[float, float, float]

SEQUENTIAL, MONOLITHIC = 'sequential', 'monolithic'
"""What `solver.coupling` may be."""

LARGEST_SEED = 10**9
"""Bound of the seeds of random numbers."""


@dataclasses.dataclass(frozen=True)
class Quantity:
    """What is known about one parameter, whatever its present value.

    `kind` is bool, int, float, str, or tuple for a vector of three numbers. `low` and `high` are the bounds, both
    included; for a vector they hold for each component. A text has `choices`, or none when any will do.
    """

    kind: type
    unit: str
    low: float
    high: float
    description: str
    source: str
    choices: tuple[str, ...] = ()


def quantity(
    default: Any, unit: str, low: float, high: float, description: str, source: str, choices: tuple[str, ...] = (),
) -> Any:
    """Return a dataclass field that carries its `Quantity`; `default` is the value, or float for one to be given."""
    kind = default if isinstance(default, type) else type(default)
    known = Quantity(kind, unit, low, high, description, source, choices)
    if default is kind:
        return dataclasses.field(metadata={'quantity': known})
    return dataclasses.field(default=default, metadata={'quantity': known})


def quantities(group: type[Group] | Group) -> Iterator[tuple[str, Quantity]]:
    """Yield name and `Quantity` of each field of a group."""
    for field in dataclasses.fields(group):  # type: ignore[arg-type]
        yield field.name, field.metadata['quantity']


class Group:
    """A group of parameters: each field is checked against its `Quantity` when the group is made.

    Raises
    ------
    ValueError
        Names the parameter, its value and the bound.

    """

    prefix: ClassVar[str] = ''

    def __post_init__(self) -> None:
        """Check and convert every field."""
        for name, known in quantities(self):
            object.__setattr__(self, name, checked(self.prefix + name, getattr(self, name), known))


def checked(name: str, value: Any, known: Quantity) -> Any:
    """Return `value` as its kind, or raise a ValueError that names it and its bound."""
    if known.kind is bool:
        if not isinstance(value, bool):
            raise ValueError(f'{name} is {value!r}, but must be true or false')
        return value
    if known.kind is str:
        if not isinstance(value, str) or not value:
            raise ValueError(f'{name} is {value!r}, but must be a text that is not empty')
        if known.choices and value not in known.choices:
            raise ValueError(f'{name} is {value!r}, but must be {" or ".join(known.choices)}')
        return value
    if known.kind is tuple:
        parts = value.tolist() if hasattr(value, 'tolist') else value
        if isinstance(parts, str) or not isinstance(parts, Sequence) or len(parts) != 3:
            raise ValueError(f'{name} is {parts!r}, but must be a list of 3 numbers {known.unit}'.rstrip())
        return tuple(_number(f'{name}[{axis}]', part, float, known) for axis, part in enumerate(parts))
    return _number(name, value, known.kind, known)


def _number(name: str, value: Any, kind: type, known: Quantity) -> Any:
    bound = f'from {known.low:g} to {known.high:g} {known.unit}'.rstrip()
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise ValueError(f'{name} is {value!r}, but must be a number {bound}')
    if kind is int and not isinstance(value, numbers.Integral):
        raise ValueError(f'{name} is {value!r}, but must be a whole number {bound}')
    try:
        number = kind(value)
    except OverflowError:  # a whole number that no float holds
        number = math.inf
    if not known.low <= number <= known.high:  # also refuses nan
        raise ValueError(f'{name} is {number!r}, but must be {bound}')
    return number


@dataclasses.dataclass(frozen=True)
class Water(Group):
    """The water around the robot."""

    prefix: ClassVar[str] = 'water.'

    density: float = quantity(
        9800.0, 'kg/m^3', 0.0, 1e5,
        'effective density of the drag of fins (12) and body (34); 0 takes the water away',
        'Table 1 as printed: ten times water, it gives the thrust that the prototype shows',
    )
    current: Vector = quantity(
        (0.0, 0.0, 0.0), 'm/s', -10.0, 10.0, 'mean velocity of the water, world frame [x, y, z]',
        'still water in the paper',
    )
    current_deviation: Vector = quantity(
        (0.0, 0.0, 0.0), 'm/s', 0.0, 10.0,
        'standard deviation of the current about its mean, a Gauss-Markov process, world frame [x, y, z]',
        'a steady current in the paper',
    )
    current_correlation_time: float = quantity(
        10.0, 's', 0.01, 1e6, 'time in which the deviation of the current forgets all but 1/e of itself',
        'a steady current in the paper',
    )
    current_seed: int = quantity(
        0, '', 0, LARGEST_SEED, 'seed of the deviation of the current', 'a steady current in the paper',
    )
    surface_height: float = quantity(
        5.0, 'm', -1e5, 1e5, 'height of the surface of the water, world frame; depth is measured from it',
        'no surface in the paper; the origin is in the water',
    )
    added_mass_coefficient: float = quantity(
        0.0, '', 0.0, 10.0,
        "added mass C_a of the fins in Morison's equation, 1 for a thin plate; needs solver.coupling monolithic",
        'none in the paper',
    )
    added_mass_density: float = quantity(
        1000.0, 'kg/m^3', 0.0, 1e5, 'density rho_a of the water that the fins set in motion, for their added mass',
        'fresh water',
    )


@dataclasses.dataclass(frozen=True)
class Body(Group):
    """The rigid body, (34) to (37); vectors are components in the body frame."""

    prefix: ClassVar[str] = 'body.'

    mass: float = quantity(20.0, 'kg', 1e-3, 1e6, 'mass m_b', 'Table 1')
    inertia: Vector = quantity(
        (1.33, 1.93, 2.73), 'kg m^2', 1e-6, 1e6, 'principal moments of inertia J_b about x, y, z', 'Table 1',
    )
    drag_area: Vector = quantity(
        (0.32, 0.4, 0.8), 'm^2', 0.0, 1e4, 'areas S_B that drag acts on along x, y, z', 'Table 1',
    )
    drag_coefficient: Vector = quantity(
        (0.02, 0.04, 0.1), '', 0.0, 1e3, 'drag coefficients C_B along x, y, z', 'Table 1',
    )
    angular_damping: Vector = quantity(
        (0.015, 0.01, 0.02), 'N m s', 0.0, 1e5, 'angular damping C_M about x, y, z', 'Table 1, unit supplied',
    )
    buoyancy_center: Vector = quantity(
        (0.0, 0.0, 0.05), 'm', -10.0, 10.0, 'centre of buoyancy r_b from the centre of mass', 'Table 1',
    )
    gravity: float = quantity(
        9.81, 'm/s^2', 0.0, 100.0, 'gravity g; the body is neutrally buoyant, so it enters the buoyancy moment only',
        'standard',
    )


@dataclasses.dataclass(frozen=True)
class Rods(Group):
    """The two rods and the support of each fin, (6) to (10) and (38); the right fin is the mirror of the left."""

    prefix: ClassVar[str] = 'rods.'

    front_radius: float = quantity(0.235, 'm', 1e-3, 10.0, 'radius r_1 of the front rod', 'assumed')
    rear_radius: float = quantity(0.185, 'm', 1e-3, 10.0, 'radius r_2 of the rear rod', 'Table 1')
    support_length: float = quantity(0.315, 'm', 1e-3, 10.0, 'length L of the support between the rods', 'Table 1')
    rear_motor_position: Vector = quantity(
        (-0.16, 0.3, 0.0), 'm', -10.0, 10.0,
        'position bP_l of the left rear motor from the centre of mass, body frame', 'Table 1',
    )
    command_time_constant: float = quantity(
        0.2, 's', 0.0, 60.0,
        'time constant of the command smoothing; 0 takes commands at once, as in the paper', 'chosen',
    )

    def __post_init__(self) -> None:
        """Check each field, then that the support can reach from rod to rod with the fin flat."""
        super().__post_init__()
        gap = abs(self.front_radius - self.rear_radius)
        if not self.support_length > gap * (1.0 + 1e-9):  # an equal length, rounded, does not close either
            raise ValueError(
                f'rods.support_length is {self.support_length!r}, but must be greater than the difference of '
                f'rods.front_radius and rods.rear_radius, {gap:g} m, or the support cannot close'
            )


@dataclasses.dataclass(frozen=True)
class Fin(Group):
    """One flexible fin, (11) to (33)."""

    prefix: ClassVar[str] = 'fin.'

    chains: int = quantity(30, '', 2, 2000, 'number n of chains of links along the support', 'Table 1')
    links: int = quantity(3, '', 1, 200, 'number m of links of each chain', 'Table 1')
    span: float = quantity(0.30, 'm', 1e-3, 10.0, 'length of a chain from support to tip', 'assumed')
    thickness: float = quantity(0.012, 'm', 1e-5, 1.0, 'thickness h of the fin', 'assumed')
    youngs_modulus: float = quantity(1e8, 'Pa', 0.0, 1e13, "Young's modulus E of the fin", 'Table 1')
    joint_damping: float = quantity(
        0.1, 'N s', 0.0, 1e4,
        'damping c of each joint, torque per angular rate and unit chord', 'Table 1, unit supplied',
    )
    drag_coefficient: float = quantity(1.2, '', 0.0, 1e3, 'drag coefficient C_D normal to the fin', 'assumed')
    density: float = quantity(1000.0, 'kg/m^3', 1.0, 1e5, "density rho_f of the fin's material", 'that of fresh water')


@dataclasses.dataclass(frozen=True)
class Solver(Group):
    """How the model is integrated, Section 4."""

    prefix: ClassVar[str] = 'solver.'

    time_step: float = quantity(
        0.002, 's', 1e-7, 0.1, 'time step', "chosen: the paper's 0.01 s is past the stability limit with these values",
    )
    fixed_base: bool = quantity(
        False, '', 0, 1, 'hold the body still, as in a tank test', 'Section 5.1',
    )
    coupling: str = quantity(
        SEQUENTIAL, '', 0, 0,
        'how fins and body are coupled: one after the other in each step, or solved together at every stage',
        "Section 4; monolithic is not the paper's", choices=(SEQUENTIAL, MONOLITHIC),
    )


class _ParameterLoader(yaml.SafeLoader):
    """Reads numbers as ROS 2 does: 1e8 is one (YAML 1.1, PyYAML's, wants 1.0e+8)."""


_ParameterLoader.add_implicit_resolver(
    'tag:yaml.org,2002:float', re.compile(r'[-+]?(\d+(\.\d*)?|\.\d+)[eE][-+]?\d+$'), list('-+.0123456789'),
)


@dataclasses.dataclass(frozen=True)
class Parameters:
    """All values of the model, in the groups and with the names of the parameter file.

    Immutable; `dataclasses.replace` on a group and on the whole makes a variant. SI units and radians.

    Raises
    ------
    ValueError
        A value is not of its type or out of its bounds; names the parameter, the value and the bound.

    """

    water: Water = Water()
    body: Body = Body()
    rods: Rods = Rods()
    fin: Fin = Fin()
    solver: Solver = Solver()

    def __post_init__(self) -> None:
        """Check that each group is of its class."""
        for name, kind in GROUPS.items():
            if not isinstance(getattr(self, name), kind):
                raise ValueError(f'{name} is {getattr(self, name)!r}, but must be a {kind.__name__}')
        if self.water.added_mass_coefficient > 0.0 and self.solver.coupling != MONOLITHIC:
            raise ValueError(
                f'water.added_mass_coefficient is {self.water.added_mass_coefficient:g}, but must be 0 with '
                f'solver.coupling {self.solver.coupling}: the fins are then heavy against the body, and one after the '
                f'other they diverge; set solver.coupling to {MONOLITHIC}'
            )

    @classmethod
    def from_groups(cls, groups: Mapping[str, Mapping[str, Any]]) -> Parameters:
        """Make parameters from `{group: {name: value}}`; what is left out keeps its default.

        Raises
        ------
        ValueError
            A group or name is unknown, or a value is bad.

        """
        made = {}
        for name, values in groups.items():
            if name not in GROUPS:
                raise ValueError(f'{name} is no group of parameters; the groups are {", ".join(GROUPS)}')
            if not isinstance(values, Mapping):
                raise ValueError(f'{name} is {values!r}, but must be a group of named values')
            known = [field.name for field in dataclasses.fields(GROUPS[name])]
            for key in values:
                if key not in known:
                    raise ValueError(f'{name}.{key} is no parameter; {name} has {", ".join(known)}')
            made[name] = GROUPS[name](**values)
        return cls(**made)

    @classmethod
    def from_yaml(cls, path: str | Path) -> Parameters:
        """Read a ROS 2 parameter file: the groups below `/**: ros__parameters:`.

        The groups `imu`, `pressure` and `qos_overrides`, and single values beside the groups, are the node's own (its
        sensors, its rate, its frames) and are left to it.

        Raises
        ------
        ValueError
            The file is no such file, a group or name is unknown, or a value is bad. Begins with the path.
        OSError
            The file cannot be read.

        """
        try:
            content = yaml.load(Path(path).read_text(encoding='utf-8'), Loader=_ParameterLoader)
            if not isinstance(content, Mapping) or not isinstance(content.get('/**'), Mapping):
                raise ValueError("has no '/**:' with 'ros__parameters:' below it")
            listed = content['/**'].get('ros__parameters')
            if not isinstance(listed, Mapping):
                raise ValueError("has no 'ros__parameters:' below '/**:'")
            return cls.from_groups({
                name: value for name, value in listed.items()
                if name in GROUPS or isinstance(value, Mapping) and name not in NODE_GROUPS
            })
        except (ValueError, yaml.YAMLError) as error:
            raise ValueError(f'{path}: {error}') from error


NODE_GROUPS = ('imu', 'pressure', 'qos_overrides')
"""Groups of the parameter file that are the node's."""

GROUPS: dict[str, type[Any]] = {'water': Water, 'body': Body, 'rods': Rods, 'fin': Fin, 'solver': Solver}

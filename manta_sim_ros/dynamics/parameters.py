"""Every value of the model: its default, unit, bounds and source, validated when made."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

from manta_sim_ros.dynamics.parameter_file import read_sections, values_for
from manta_sim_ros.dynamics.quantity import (
    LARGEST_SEED,
    ParameterGroup,
    Quantity,
    SixVector,
    Vector,
    quantity,
    shown,
    shown_name,
    shown_names,
)

SEQUENTIAL, MONOLITHIC = 'sequential', 'monolithic'
"""The values of `solver.coupling`."""

NODE = '/manta_sim'
"""Full name of the node whose parameters are read from a file."""

NO_WATER: SixVector = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""Added mass or damping of a body on which the water has no effect."""


@dataclasses.dataclass(frozen=True)
class Water(ParameterGroup):
    """The water around the robot."""

    prefix: ClassVar[str] = 'water.'

    density: float = quantity(
        9800.0, unit='kg/m^3', low=0.0, high=1e5, live=True,
        description='effective density for the drag of fins (12) and body (34); 0 removes the drag',
        source='Table 1 as printed: ten times the density of water, it gives the thrust of the prototype',
    )
    current: Vector = quantity(
        (0.0, 0.0, 0.0), unit='m/s', low=-10.0, high=10.0, live=True,
        description='mean velocity of the water, world frame [x, y, z]', source='the water is still in the paper',
    )
    current_deviation: Vector = quantity(
        (0.0, 0.0, 0.0), unit='m/s', low=0.0, high=10.0, live=True,
        description='standard deviation of the current about its mean, a Gauss-Markov process, world frame [x, y, z]',
        source='a steady current in the paper',
    )
    current_correlation_time: float = quantity(
        10.0, unit='s', low=0.01, high=1e6, live=True,
        description='time in which the autocorrelation of the deviation of the current falls to 1/e',
        source='a steady current in the paper',
    )
    current_seed: int = quantity(
        0, low=0, high=LARGEST_SEED, live=True,
        description='seed of the deviation of the current', source='a steady current in the paper',
    )
    surface_height: float = quantity(
        5.0, unit='m', low=-1e5, high=1e5, live=True,
        description='height of the surface of the water, world frame; what is above it is in the air',
        source='the paper has no surface; the origin is in the water',
    )
    added_mass_coefficient: float = quantity(
        0.0, low=0.0, high=10.0,
        description="added mass C_a of the fins in Morison's equation, 1 for a thin plate; needs solver.coupling "
                    'monolithic',
        source='none in the paper',
    )
    added_mass_density: float = quantity(
        1000.0, unit='kg/m^3', low=0.0, high=1e5,
        description='density rho_a of the water in the added mass of the fins',
        source='fresh water',
    )


@dataclasses.dataclass(frozen=True)
class Body(ParameterGroup):
    """The rigid body, (34) to (37); vectors are components in the body frame."""

    prefix: ClassVar[str] = 'body.'

    mass: float = quantity(
        20.0, unit='kg', low=1e-3, high=1e6,
        description='mass m_b', source='Table 1',
    )
    inertia: Vector = quantity(
        (1.33, 1.93, 2.73), unit='kg m^2', low=1e-6, high=1e6,
        description='principal moments of inertia J_b about x, y, z', source='Table 1',
    )
    drag_area: Vector = quantity(
        (0.32, 0.4, 0.8), unit='m^2', low=0.0, high=1e4, live=True,
        description='areas S_B that drag acts on along x, y, z', source='Table 1',
    )
    drag_coefficient: Vector = quantity(
        (0.02, 0.04, 0.1), low=0.0, high=1e3, live=True,
        description='drag coefficients C_B along x, y, z', source='Table 1',
    )
    angular_damping: Vector = quantity(
        (0.015, 0.01, 0.02), unit='N m s', low=0.0, high=1e5, live=True,
        description='angular damping C_M about x, y, z', source='Table 1, unit supplied',
    )
    buoyancy_center: Vector = quantity(
        (0.0, 0.0, 0.05), unit='m', low=-10.0, high=10.0,
        description='center of buoyancy r_b from the center of mass', source='Table 1',
    )
    gravity: float = quantity(
        9.81, unit='m/s^2', low=0.0, high=100.0,
        description='gravity g; under water only the righting moment of the buoyancy is left of it',
        source='standard',
    )
    added_mass: SixVector = quantity(
        NO_WATER, unit='kg, kg m^2', low=0.0, high=1e6,
        description='added mass of the body along and about x, y, z; needs damping in roll and yaw to be stable',
        source='none in the paper',
    )
    linear_damping: SixVector = quantity(
        NO_WATER, unit='N s/m, N m s', low=0.0, high=1e6, live=True,
        description='linear damping D_l of the body along and about x, y, z, beside angular_damping',
        source='none in the paper',
    )
    quadratic_damping: SixVector = quantity(
        NO_WATER, unit='N s^2/m^2, N m s^2', low=0.0, high=1e6, live=True,
        description='quadratic damping D_q of the body along and about x, y, z, beside drag (34)',
        source='none in the paper',
    )
    net_buoyancy: float = quantity(
        0.0, unit='N', low=-1e5, high=1e5, live=True,
        description='buoyancy less weight of the body, at its center of buoyancy',
        source='the body is neutrally buoyant in the paper',
    )


@dataclasses.dataclass(frozen=True)
class Rods(ParameterGroup):
    """The two rods and the support of each fin, (6) to (10) and (38); the right fin is the mirror of the left."""

    prefix: ClassVar[str] = 'rods.'

    front_radius: float = quantity(
        0.235, unit='m', low=1e-3, high=10.0,
        description='radius r_1 of the front rod', source='assumed',
    )
    rear_radius: float = quantity(
        0.185, unit='m', low=1e-3, high=10.0,
        description='radius r_2 of the rear rod', source='Table 1',
    )
    support_length: float = quantity(
        0.315, unit='m', low=1e-3, high=10.0,
        description='length L of the support between the rods', source='Table 1',
    )
    rear_motor_position: Vector = quantity(
        (-0.16, 0.3, 0.0), unit='m', low=-10.0, high=10.0,
        description='position bP_l of the left rear motor from the center of mass, body frame', source='Table 1',
    )
    command_time_constant: float = quantity(
        0.2, unit='s', low=0.0, high=60.0,
        description='time constant of the smoothing of commands; 0 applies commands at once, as in the paper',
        source='chosen',
    )
    servo_time_constant: float = quantity(
        0.05, unit='s', low=1e-3, high=60.0,
        description='time constant of the servos that turn the rods to commanded angles, critically damped',
        source='none in the paper',
    )
    servo_rate_limit: float = quantity(
        6.0, unit='rad/s', low=1e-2, high=100.0,
        description='largest rate at which these servos turn the rods', source='none in the paper',
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
class Fin(ParameterGroup):
    """One flexible fin, (11) to (33)."""

    prefix: ClassVar[str] = 'fin.'

    chains: int = quantity(
        30, low=2, high=2000,
        description='number n of chains of links along the support', source='Table 1',
    )
    links: int = quantity(
        3, low=1, high=200,
        description='number m of links of each chain', source='Table 1',
    )
    span: float = quantity(
        0.30, unit='m', low=1e-3, high=10.0,
        description='length of a chain from support to tip', source='assumed',
    )
    thickness: float = quantity(
        0.012, unit='m', low=1e-5, high=1.0,
        description='thickness h of the fin', source='assumed',
    )
    youngs_modulus: float = quantity(
        1e8, unit='Pa', low=0.0, high=1e13, live=True,
        description="Young's modulus E of the fin", source='Table 1',
    )
    joint_damping: float = quantity(
        0.1, unit='N s', low=0.0, high=1e4, live=True,
        description='damping c of each joint: torque per joint rate and unit chord', source='Table 1, unit supplied',
    )
    drag_coefficient: float = quantity(
        1.2, low=0.0, high=1e3, live=True,
        description='drag coefficient C_D normal to the fin', source='assumed',
    )
    density: float = quantity(
        1000.0, unit='kg/m^3', low=1.0, high=1e5,
        description="density rho_f of the fin's material", source='the density of fresh water',
    )
    shear_modulus: float = quantity(
        0.0, unit='Pa', low=0.0, high=1e13, live=True,
        description='shear modulus G of the fin, which resists twist along the chord; 0 lets chains move independently',
        source='none in the paper, which mentions a twisting energy',
    )
    twist_damping: float = quantity(
        0.0, unit='N m s', low=0.0, high=1e4, live=True,
        description='damping c_t of the twist of the fin along the chord, in the place of G h^3 / 3 of its stiffness',
        source='none in the paper',
    )


@dataclasses.dataclass(frozen=True)
class Solver(ParameterGroup):
    """How the model is integrated, Section 4."""

    prefix: ClassVar[str] = 'solver.'

    time_step: float = quantity(
        0.002, unit='s', low=1e-7, high=0.1,
        description='time step', source="chosen: the paper's 0.01 s is above the stability limit of these values",
    )
    fixed_base: bool = quantity(
        False,
        description='hold the body still, as in a tank test', source='Section 5.1',
    )
    coupling: str = quantity(
        SEQUENTIAL, choices=(SEQUENTIAL, MONOLITHIC),
        description='coupling of fins and body: one after the other in each step (staggered), or solved together',
        source="Section 4; monolithic is not the paper's",
    )


@dataclasses.dataclass(frozen=True)
class Parameters:
    """All values of the model, in the groups and with the names of the parameter file. SI units and radians.

    Immutable: `replace` makes a variant.

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
        """Check that each group is of its class, and what concerns several groups."""
        for name, kind in self.groups().items():
            if not isinstance(getattr(self, name), kind):
                raise ValueError(f'{name} is {shown(getattr(self, name))}, but must be a {kind.__name__}')
        if self.water.added_mass_coefficient > 0.0 and self.solver.coupling != MONOLITHIC:
            raise ValueError(
                f'water.added_mass_coefficient is {self.water.added_mass_coefficient:g}, but must be 0 with '
                f'solver.coupling {self.solver.coupling}: the fins are then heavy against the body, and one after the '
                f'other they diverge; set solver.coupling to {MONOLITHIC}'
            )

    @classmethod
    def groups(cls) -> dict[str, type[ParameterGroup]]:
        """Return the class of each group by its name."""
        kinds: dict[str, Any] = {field.name: type(field.default) for field in dataclasses.fields(cls)}
        return kinds

    @classmethod
    def quantities(cls) -> dict[str, Quantity]:
        """Return what is known about each parameter by its full name, such as `fin.span`."""
        return {
            f'{group}.{name}': about for group, kind in cls.groups().items()
            for name, about in kind.quantities().items()}

    def replace(self, **groups: Mapping[str, Any]) -> Parameters:
        """Return parameters with some values replaced, such as `replace(fin={'chains': 8}, water={'density': 1000.0})`.

        Raises
        ------
        ValueError
            A group or name is unknown, or a value is invalid.

        """
        known, replaced = self.groups(), {}
        for name, values in groups.items():
            if name not in known:
                raise ValueError(f'{shown_name(name)} is no group of parameters; the groups are {", ".join(known)}')
            if not isinstance(values, Mapping):
                raise ValueError(f'{name} is {shown(values)}, but must be a group of named values')
            for key in values:
                if key not in known[name].quantities():
                    raise ValueError(
                        f'{name}.{shown_name(key)} is no parameter; '
                        f'{name} has {", ".join(known[name].quantities())}')
            replaced[name] = dataclasses.replace(getattr(self, name), **values)
        return dataclasses.replace(self, **replaced)

    @classmethod
    def from_yaml(cls, path: str | Path) -> Parameters:
        """Read the parameters that a ROS 2 parameter file has for the node `/manta_sim`.

        Those are the groups below `/**: ros__parameters:` or below the name of the node; of two sections, the later one
        wins, as in ROS 2. What is left out keeps its default. Groups with other names, and single values beside the
        groups, belong to a node and are left to it.

        Raises
        ------
        ValueError
            The file is not such a file or has nothing for this node, a name is unknown or stands twice, a group's name
            is nearly that of one of these groups, or a value is invalid. Begins with the path.
        OSError
            The file cannot be read.

        """
        sections = read_sections(path)
        if not any(section.applies_to(NODE) for section in sections):
            others = f'; it has only {shown_names(section.node for section in sections)}' if sections else ''
            raise ValueError(f"{path}: has no '/**:' or '{NODE}:' with 'ros__parameters:' below it{others}")
        groups: dict[str, dict[str, Any]] = {}
        try:
            for full_name, value in values_for(NODE, sections).items():
                group, dot, name = full_name.partition('.')
                if group in cls.groups() and not dot:
                    raise ValueError(f'{group} is {shown(value)}, but must be a group of named values')
                if dot and (group in cls.groups() or _is_misspelled(group, cls.groups())):
                    groups.setdefault(group, {})[name] = value
            return cls().replace(**groups)
        except ValueError as error:
            raise ValueError(f'{path}: {error}') from error


def check_parameters(parameters: Parameters) -> None:
    """Raise a ValueError if these are no parameters."""
    if not isinstance(parameters, Parameters):
        raise ValueError(f'parameters is {shown(parameters)}, but must be Parameters')


def _is_misspelled(name: str, groups: Mapping[str, object]) -> bool:
    return bool(difflib.get_close_matches(name, groups, n=1))

"""The options of the environment, and the robot that it has by default."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from manta_sim_ros.dynamics import MONOLITHIC, ParameterGroup, Parameters, quantity, shown, shown_name

ROBOT = Parameters().replace(
    water={'density': 1000.0, 'added_mass_coefficient': 0.6},
    body={
        'drag_coefficient': (0.1, 0.4, 1.0), 'added_mass': (1.4, 2.1, 106.0, 1.15, 2.4, 0.01),
        'quadratic_damping': (0.0, 0.0, 0.0, 2.7, 6.4, 1.28)},
    fin={'chains': 4, 'drag_coefficient': 6.0, 'shear_modulus': 3.8e7},
    solver={'time_step': 0.0025, 'coupling': MONOLITHIC},
)
"""The robot of config/freshwater.yaml with 4 chains for each fin in place of 12, which allows a larger time step.

Its fins resist twist, so that the number of chains hardly matters: a test compares its speed and yaw rate.
"""

GAIT, RODS = 'gait', 'rods'
"""What an action is."""


@dataclasses.dataclass(frozen=True)
class SwimSettings(ParameterGroup):
    """The options of the environment Swim, beside the parameters of the robot.

    Raises
    ------
    ValueError
        A value is of another kind or out of its bounds; names it and the bound.

    """

    action: str = quantity(
        GAIT, choices=(GAIT, RODS), description='what an action is: gaits of the fins, or angles of their rods',
        source='chosen')
    control_period: float = quantity(
        0.2, unit='s', low=0.01, high=5.0, description='simulated time of a step of the environment',
        source='the time constant of the smoothing of gaits; for rods take 0.1 s or less')
    nearest_target: float = quantity(
        2.0, unit='m', low=0.01, high=50.0, description='smallest horizontal distance of the target at the start',
        source='chosen')
    farthest_target: float = quantity(
        4.0, unit='m', low=0.01, high=50.0, description='largest horizontal distance of the target at the start',
        source='chosen')
    largest_bearing: float = quantity(
        1.5, unit='rad', low=0.0, high=3.2, description='largest bearing of the target at the start, left or right',
        source='chosen')
    largest_height: float = quantity(
        0.3, unit='m', low=0.0, high=4.0, description='largest height of the target above or below the start',
        source='the robot climbs slowly')
    reach: float = quantity(
        0.2, unit='m', low=0.01, high=10.0, description='distance of the center of mass at which a target is reached',
        source='chosen')
    effort_weight: float = quantity(
        0.002, unit='1/J', low=0.0, high=10.0, description='reward that is lost for each joule of the motors',
        source='chosen: a tenth of the progress at cruise')
    randomization: float = quantity(
        0.0, low=0.0, high=0.5,
        description='largest relative change of each of the randomized parameters of body and water',
        source='chosen')
    largest_current: float = quantity(
        0.0, unit='m/s', low=0.0, high=5.0,
        description='largest speed of the current, which is steady and horizontal, in any direction', source='chosen')
    position_noise: float = quantity(
        0.0, unit='m', low=0.0, high=100.0,
        description='standard deviation of the noise of the position along each axis', source='chosen')
    orientation_noise: float = quantity(
        0.0, unit='rad', low=0.0, high=1.0,
        description='standard deviation of the error of the orientation about each axis', source='chosen')
    linear_velocity_noise: float = quantity(
        0.0, unit='m/s', low=0.0, high=100.0,
        description='standard deviation of the noise of the velocity along each axis', source='chosen')
    angular_velocity_noise: float = quantity(
        0.0, unit='rad/s', low=0.0, high=10.0,
        description='standard deviation of the noise of the angular velocity about each axis', source='chosen')

    def __post_init__(self) -> None:
        """Check every field, and that there is a place for the target."""
        super().__post_init__()
        if not self.nearest_target <= self.farthest_target:
            raise ValueError(
                f'nearest_target is {self.nearest_target:g} m, but must be at most farthest_target, '
                f'{self.farthest_target:g} m')
        if not self.reach < self.nearest_target:
            raise ValueError(
                f'reach is {self.reach:g} m, but must be less than nearest_target, {self.nearest_target:g} m')

    @classmethod
    def of(cls, options: Mapping[str, Any]) -> SwimSettings:
        """Return the settings of options by name; raise a ValueError for an unknown one."""
        for name in options:
            if name not in cls.quantities():
                raise ValueError(f'{shown_name(name)} is no option; the options are {", ".join(cls.quantities())}')
        return cls(**options)


def parameters_of(robot: Parameters | str | Path | None) -> Parameters:
    """Return the parameters of a robot: as given, of a parameter file, or by default of ROBOT.

    Raises
    ------
    ValueError
        It is something else, or the file is not a valid one.
    OSError
        The file cannot be read.

    """
    if robot is None:
        return ROBOT
    if isinstance(robot, Parameters):
        return robot
    if isinstance(robot, str | Path):
        return Parameters.from_yaml(robot)
    raise ValueError(f'parameters is {shown(robot)}, but must be Parameters or the path of a parameter file')

"""The conditions under which paths are followed: current, noise, and a robot that is not the one of the design."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from evidence.control_report.robots import Robot
from manta_sim_ros.dynamics import FinCommand, Parameters, largest_stable_step
from manta_sim_ros.sensors import Imu, OdometryNoise, Velocity

CURRENT = 0.1
"""Velocity of the water along y, across the beginning of each path to the left [m/s]."""

NOISE = OdometryNoise(
    position=0.02, orientation=math.radians(0.5), linear_velocity=Velocity().noise,
    angular_velocity=Imu().angular_velocity_noise)
"""Of the position as of an acoustic positioning, of the orientation as of a compass; the others are the defaults."""

WRONG = 0.2
"""Relative error of each uncertain value."""

UNCERTAIN = {
    'body': ('mass', 'inertia', 'drag_coefficient', 'angular_damping', 'linear_damping', 'quadratic_damping',
             'added_mass', 'buoyancy_center'),
    'fin': ('youngs_modulus', 'shear_modulus', 'joint_damping', 'drag_coefficient', 'density'),
    'water': ('added_mass_coefficient',),
}
"""Values by their group that are identified or computed; lengths of the mechanism can be measured."""


class Condition(NamedTuple):
    """Under which a path is followed."""

    current: float = 0.0
    """Along y [m/s]."""
    noisy: bool = False
    """Whether the odometry has noise."""
    wrong: bool = False
    """Whether the robot that swims has other parameters than the one that the controller was designed for."""
    draws: int = 1
    """Number of swims, each with a seed of its own."""

    def parameters(self, robot: Robot, seed: int) -> Parameters:
        """Return the parameters of the robot that swims."""
        made = robot.parameters.replace(water={'current': (0.0, self.current, 0.0)})
        return stable(mistaken(made, seed), robot.fastest) if self.wrong else made

    def noise(self, seed: int) -> OdometryNoise:
        """Return the noise of the odometry."""
        return OdometryNoise(
            NOISE.position, NOISE.orientation, NOISE.linear_velocity, NOISE.angular_velocity, seed,
        ) if self.noisy else OdometryNoise()


CONDITIONS = {
    'calm': Condition(),
    'current': Condition(current=CURRENT),
    'noise': Condition(noisy=True, draws=3),
    'wrong parameters': Condition(wrong=True, draws=4),
}
"""By name."""


def mistaken(parameters: Parameters, seed: int) -> Parameters:
    """Return parameters of which each uncertain value is by WRONG too small or too large, by chance.

    The components of a vector have the same error, so that moments of inertia stay those of a body.
    """
    signs = np.random.default_rng(seed)
    groups: dict[str, dict[str, Any]] = {}
    for group, names in UNCERTAIN.items():
        for name in names:
            value, factor = getattr(getattr(parameters, group), name), 1.0 + WRONG * signs.choice((-1.0, 1.0))
            groups.setdefault(group, {})[name] = (
                tuple(factor * part for part in value) if isinstance(value, tuple) else factor * value)
    return parameters.replace(**groups)


def stable(parameters: Parameters, gait: FinCommand) -> Parameters:
    """Return parameters with a time step that is stable with a gait of both fins: halved as often as necessary."""
    step = parameters.solver.time_step
    while step > largest_stable_step(parameters, gait, gait):
        step *= 0.5
    return parameters.replace(solver={'time_step': step})

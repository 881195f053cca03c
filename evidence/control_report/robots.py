"""The robots that swim, and the controllers that let them follow paths."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from manta_sim_ros.control.averaged_model import MODELS, AveragedModel, read_model
from manta_sim_ros.control.closed_loop import Follower
from manta_sim_ros.control.follower import PathFollower
from manta_sim_ros.control.mpc import MpcFollower
from manta_sim_ros.control.mpc_settings import MpcSettings
from manta_sim_ros.control.polyline import Polyline
from manta_sim_ros.control.settings import FollowerSettings
from manta_sim_ros.dynamics import FinCommand, Parameters, read_sections, values_for

CONFIG = Path(__file__).parents[2] / 'config'
FOR_PAPER = values_for('/manta_path_follower', read_sections(CONFIG / 'path_follower_manta.yaml'))
"""Parameters of the path follower for the robot of the paper."""


UNLIMITED = 1e3
"""Longest time for a plan [s]: results do not depend on the speed of the machine."""


class Robot(NamedTuple):
    """A robot and the settings of its controllers."""

    parameters: Parameters
    settings: FollowerSettings
    model: AveragedModel
    widening: float
    """Factor of the bounds of its errors."""

    @property
    def fastest(self) -> FinCommand:
        """The gait of the largest amplitude of a controller."""
        return FinCommand(self.settings.largest_amplitude, self.settings.frequency, self.settings.phase)


ROBOTS = {
    'freshwater': Robot(Parameters.from_yaml(CONFIG / 'freshwater.yaml'), FollowerSettings(),
                        read_model(MODELS['freshwater']), widening=1.0),
    'manta': Robot(Parameters.from_yaml(CONFIG / 'manta.yaml'), FollowerSettings(**FOR_PAPER),
                   read_model(MODELS['manta']), widening=2.0),
}
"""By the name of the configuration."""

CONTROLLERS: dict[str, Callable[[Robot, Polyline], Follower]] = {
    'path_follower': lambda robot, path: PathFollower(path, robot.settings, robot.parameters),
    'mpc_follower': lambda robot, path: MpcFollower(
        path, MpcSettings(speed=robot.settings.speed, time_limit=UNLIMITED), robot.model, robot.parameters),
}
"""Makes a controller that is designed for a robot and begins with a path, by name."""

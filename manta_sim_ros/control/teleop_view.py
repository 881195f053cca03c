"""What an operator sees of the robot."""

from __future__ import annotations

from typing import NamedTuple

from manta_sim_ros.control.gaits import Gaits
from manta_sim_ros.control.manual import Demand
from manta_sim_ros.dynamics import FloatArray


class View(NamedTuple):
    """What there is to see; NaN stands for what is not known."""

    topic: str
    """Where the commands go."""
    time: float
    """Simulated time [s]."""
    speed: float
    """Forward speed, mean of a flapping period [m/s]."""
    depth: float
    """Mean of a flapping period [m]."""
    attitude: FloatArray
    """(3,) roll, pitch and heading, means of a flapping period [rad]."""
    demand: Demand
    joystick: bool
    """Whether the joystick commands."""
    gaits: Gaits
    """What was commanded last."""
    rods: FloatArray
    """(2, 2) angles by fin and rod (front, rear) [rad]."""
    pace: str
    """What the simulator says of its pace; empty where it says nothing, or where that is one of the troubles."""
    troubles: tuple[str, ...]
    """What is wrong, in lines."""

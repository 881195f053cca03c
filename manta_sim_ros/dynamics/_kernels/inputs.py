"""What acts on the robot from outside during a call, as the kernels take it."""

from __future__ import annotations

from typing import NamedTuple

from manta_sim_ros.dynamics._kernels.geometry import Wrench
from manta_sim_ros.dynamics.quantity import FloatArray, Vector


class Inputs(NamedTuple):
    """The current, and external wrenches on the body about its center of mass."""

    current: Vector  # velocity of the water, world frame [m/s]
    body_wrench: Wrench  # components in F_b
    world_wrench: Wrench  # components in the world frame


NO_WRENCH = Wrench((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def wrench_of(values: FloatArray) -> Wrench:
    """Return the wrench of an array (6,)."""
    return Wrench(tuple(values[:3].tolist()), tuple(values[3:].tolist()))

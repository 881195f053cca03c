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


def inputs(current: FloatArray, body_wrench: FloatArray, world_wrench: FloatArray) -> Inputs:
    """Return the inputs of a call: the current (3,) and the wrenches (6,)."""
    return Inputs(tuple(current.tolist()), _wrench(body_wrench), _wrench(world_wrench))


def _wrench(values: FloatArray) -> Wrench:
    return Wrench(tuple(values[:3].tolist()), tuple(values[3:].tolist()))

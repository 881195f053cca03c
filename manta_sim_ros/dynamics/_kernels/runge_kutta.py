"""The classical Runge-Kutta scheme, of fourth order, stage by stage. Its tableau stands here alone."""

from __future__ import annotations

from manta_sim_ros.dynamics._kernels.compilation import kernel
from manta_sim_ros.dynamics._kernels.layout import Links
from manta_sim_ros.dynamics.quantity import FloatArray

STAGES = 4

NODES = (0.0, 0.5, 0.5, 1.0, 1.0)
"""When each stage is, in steps, and after the last one the step's end."""

_WEIGHTS = (1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0)
_AHEAD = (0.5, 0.5, 1.0, 0.0)
"""How far the slope of each stage is followed to the next one, in steps."""


@kernel
def begin(value: FloatArray, start: FloatArray, total: FloatArray) -> None:
    """Begin a step of a value; all are (a, b)."""
    for j in range(value.shape[0]):
        for k in range(value.shape[1]):
            start[j, k] = total[j, k] = value[j, k]


@kernel
def next_stage(
    value: FloatArray, slope: FloatArray, start: FloatArray, total: FloatArray, stage: int, time_step: float,
) -> None:
    """Add the slope of a stage to the total, and follow it from the start to the next stage; all are (a, b)."""
    weight, ahead = _WEIGHTS[stage] * time_step, _AHEAD[stage] * time_step
    for j in range(value.shape[0]):
        for k in range(value.shape[1]):
            total[j, k] += weight * slope[j, k]
            value[j, k] = start[j, k] + ahead * slope[j, k]


@kernel
def end(value: FloatArray, total: FloatArray) -> None:
    """End a step: the value is the total of its stages; both are (a, b)."""
    for j in range(value.shape[0]):
        for k in range(value.shape[1]):
            value[j, k] = total[j, k]


@kernel
def begin_joints(links: Links) -> None:
    """Begin a step of the joints of one fin."""
    begin(links.q, links.start_q, links.total_q)
    begin(links.q_dot, links.start_q_dot, links.total_q_dot)


@kernel
def next_stage_of_joints(links: Links, stage: int, time_step: float) -> None:
    """Move the joints of one fin from a stage, whose accelerations are known, to the next one."""
    next_stage(links.q, links.q_dot, links.start_q, links.total_q, stage, time_step)
    next_stage(links.q_dot, links.q_ddot, links.start_q_dot, links.total_q_dot, stage, time_step)


@kernel
def end_joints(links: Links) -> None:
    """End a step of the joints of one fin."""
    end(links.q, links.total_q)
    end(links.q_dot, links.total_q_dot)

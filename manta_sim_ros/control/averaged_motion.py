"""The averaged model with kinematics, current and disturbances, as symbols of CasADi."""

from __future__ import annotations

from typing import Any

import casadi

from manta_sim_ros.control.averaged_model import GAIT, TWIST, AveragedModel, variables

STATES = (*TWIST, 'roll', 'pitch', 'heading', 'x', 'y', 'z')
"""The averaged motion: twist through the water in the body frame, attitude [rad], position in the world frame [m]."""

DISTURBANCES = ('current_x', 'current_y', 'current_z', 'surge', 'yaw')
"""What the model does not know: the current [m/s], world frame, and accelerations [m/s^2, rad/s^2], body frame.

`current_z` stands for all that lets the height drift.
"""


def rotation(roll: Any, pitch: Any, heading: Any) -> Any:
    """Return the rotation matrix (3, 3) from the body frame to the world frame."""
    cos_roll, sin_roll, cos_pitch, sin_pitch, cos_heading, sin_heading = (
        function(angle) for angle in (roll, pitch, heading) for function in (casadi.cos, casadi.sin))
    return casadi.vertcat(
        casadi.horzcat(cos_heading * cos_pitch, cos_heading * sin_pitch * sin_roll - sin_heading * cos_roll,
                       cos_heading * sin_pitch * cos_roll + sin_heading * sin_roll),
        casadi.horzcat(sin_heading * cos_pitch, sin_heading * sin_pitch * sin_roll + cos_heading * cos_roll,
                       sin_heading * sin_pitch * cos_roll - cos_heading * sin_roll),
        casadi.horzcat(-sin_pitch, cos_pitch * sin_roll, cos_pitch * cos_roll))


def velocity(state: Any, disturbances: Any) -> Any:
    """Return the velocity over ground (3,) in the world frame [m/s]."""
    return rotation(state[6], state[7], state[8]) @ state[:3] + disturbances[:3]


def rates(model: AveragedModel, state: Any, gait: Any, disturbances: Any) -> Any:
    """Return the rates (12,) of STATES with a gait (3,) of GAIT in force and DISTURBANCES (5,)."""
    twist = model.twist_rates(variables([*(state[index] for index in range(8)),
                                         *(gait[index] for index in range(len(GAIT)))]))
    twist[0] += disturbances[3]
    twist[5] += disturbances[4]
    p, q, r, roll, pitch = (state[index] for index in range(3, 8))
    turning = casadi.sin(roll) * q + casadi.cos(roll) * r
    return casadi.vertcat(
        *twist, p + turning * casadi.tan(pitch), casadi.cos(roll) * q - casadi.sin(roll) * r,
        turning / casadi.cos(pitch), velocity(state, disturbances))


def moved(model: AveragedModel, state: Any, gaits: tuple[Any, Any], disturbances: Any, duration: Any) -> Any:
    """Return STATES (12,) after a duration [s], by one step of the midpoint method, which is of second order.

    `gaits` are those in force at the beginning and in the middle.
    """
    middle = state + 0.5 * duration * rates(model, state, gaits[0], disturbances)
    return state + duration * rates(model, middle, gaits[1], disturbances)

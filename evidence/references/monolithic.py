"""Body and fins solved together, literally: a slow reference for the monolithic coupling, in plain NumPy and SciPy.

A fin's wrench on the body and its joint accelerations are affine in the body's acceleration, as the mechanics of any
tree are. So seven evaluations of a fin's dynamics, at no acceleration and at a unit one along each axis, say all of
them; the body's equation (36) is then one linear system. The whole state is integrated at once, by the classical
Runge-Kutta rule or by DOP853 to a tolerance near rounding.

The fins' dynamics are an argument: those of `equations` unless said otherwise, or `pinocchio_tree.fin_dynamics`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from evidence.references import equations
from evidence.references.equations import (
    LEFT,
    RIGHT,
    ReferenceState,
    RodMotion,
    body_acceleration,
    orientation_matrix,
    quaternion_rate,
)
from manta_sim_ros.dynamics import Parameters

FinDynamics = Callable[..., tuple[np.ndarray, np.ndarray]]
"""Takes what `equations.fin_dynamics` takes, in that order, and returns what that returns."""


class Accelerations(NamedTuple):
    """What the equations of motion give at one time, shapes and frames as in `ReferenceState`."""

    body: np.ndarray  # (6,) [m/s^2, rad/s^2]
    joints: np.ndarray  # (2, n, m) [rad/s^2]
    fin_wrenches: np.ndarray  # (2, 6) [N, N m]


def accelerations(
    parameters: Parameters, state: ReferenceState, rod_motion: RodMotion, fin_dynamics: FinDynamics | None = None,
) -> Accelerations:
    """Return what satisfies (6) to (37) at the state's time; its own acceleration and wrenches are not looked at.

    `rod_motion(side, time)` gives each fin's rods (2, 3). The state's orientation need not be a unit quaternion. With
    `solver.fixed_base` the body's acceleration is zero.
    """
    fin_dynamics = equations.fin_dynamics if fin_dynamics is None else fin_dynamics
    orientation = state.orientation / np.linalg.norm(state.orientation)
    water_velocity = orientation_matrix(orientation).T @ np.array(parameters.water.current)

    def evaluate(side: int, acceleration: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return fin_dynamics(
            parameters, side, rod_motion(side, state.time), state.joint_angles[side], state.joint_rates[side],
            state.twist, acceleration, water_velocity)

    of_fins = [evaluate(side, np.zeros(6)) for side in (LEFT, RIGHT)]
    joints, wrenches = (np.stack(parts) for parts in zip(*of_fins, strict=True))
    if parameters.solver.fixed_base:
        return Accelerations(np.zeros(6), joints, wrenches)

    # the last axis is that of the body's acceleration
    joint_slopes, wrench_slopes = np.empty((*joints.shape, 6)), np.empty((*wrenches.shape, 6))
    for side in (LEFT, RIGHT):
        for axis, unit in enumerate(np.eye(6)):
            joints_at_unit, wrench_at_unit = evaluate(side, unit)
            joint_slopes[side, ..., axis] = joints_at_unit - joints[side]
            wrench_slopes[side, :, axis] = wrench_at_unit - wrenches[side]

    # (36): each newton and newton meter of the fins adds its part
    body = parameters.body
    per_wrench = np.diag(1.0 / np.hstack([np.full(3, body.mass), body.inertia]))
    held = body_acceleration(parameters, orientation, state.twist, wrenches.sum(axis=0))
    acceleration = np.linalg.solve(np.eye(6) - per_wrench @ wrench_slopes.sum(axis=0), held)
    return Accelerations(acceleration, joints + joint_slopes @ acceleration, wrenches + wrench_slopes @ acceleration)


def _packed(state: ReferenceState) -> np.ndarray:
    """Return position, orientation, twist, joint angles and joint rates of a state as one vector."""
    return np.hstack([
        state.position, state.orientation, state.twist, state.joint_angles.ravel(), state.joint_rates.ravel()])


def _unpacked(parameters: Parameters, time: float, vector: np.ndarray) -> ReferenceState:
    """Return the state of a `_packed` vector; its acceleration and wrenches are not known yet."""
    position, orientation, twist, joints = np.split(vector, [3, 7, 13])
    angles, rates = joints.reshape(2, 2, parameters.fin.chains, parameters.fin.links)
    unknown = np.full(6, np.nan)
    return ReferenceState(time, position, orientation, twist, unknown, angles, rates, np.tile(unknown, (2, 1)))


def derivative(
    parameters: Parameters, time: float, vector: np.ndarray, rod_motion: RodMotion,
    fin_dynamics: FinDynamics | None = None,
) -> np.ndarray:
    """Return the time derivative of position, orientation, twist, joint angles and joint rates, one after the other.

    The orientation's is half the product of the quaternion and (Omega, 0). Rotations are those of the normalized one.
    """
    state = _unpacked(parameters, time, vector)
    found = accelerations(parameters, state, rod_motion, fin_dynamics)
    if parameters.solver.fixed_base:
        velocity, turning = np.zeros(3), np.zeros(4)
    else:
        turning = quaternion_rate(state.orientation, state.twist[3:])
        unit = state.orientation / np.linalg.norm(state.orientation)
        velocity = orientation_matrix(unit) @ state.twist[:3]
    return np.hstack([velocity, turning, found.body, state.joint_rates.ravel(), found.joints.ravel()])


def _completed(
    parameters: Parameters, time: float, vector: np.ndarray, rod_motion: RodMotion, fin_dynamics: FinDynamics | None,
) -> ReferenceState:
    """Return the state of a vector, its quaternion normalized, with acceleration and wrenches at its time."""
    state = _unpacked(parameters, time, vector)
    state = dataclasses.replace(state, orientation=state.orientation / np.linalg.norm(state.orientation))
    found = accelerations(parameters, state, rod_motion, fin_dynamics)
    return dataclasses.replace(state, acceleration=found.body, fin_wrenches=found.fin_wrenches)


def step(
    parameters: Parameters, state: ReferenceState, rod_motion: RodMotion, fin_dynamics: FinDynamics | None = None,
) -> ReferenceState:
    """Return the state one `solver.time_step` later: the classical fourth-order Runge-Kutta rule for all at once."""
    dt, t, start = parameters.solver.time_step, state.time, _packed(state)

    def slope(time: float, vector: np.ndarray) -> np.ndarray:
        return derivative(parameters, time, vector, rod_motion, fin_dynamics)

    k_1 = slope(t, start)
    k_2 = slope(t + dt / 2.0, start + dt / 2.0 * k_1)
    k_3 = slope(t + dt / 2.0, start + dt / 2.0 * k_2)
    k_4 = slope(t + dt, start + dt * k_3)
    end = start + dt / 6.0 * (k_1 + 2.0 * k_2 + 2.0 * k_3 + k_4)
    return _completed(parameters, t + dt, end, rod_motion, fin_dynamics)


def trajectory(
    parameters: Parameters, state: ReferenceState, rod_motion: RodMotion, duration: float,
    fin_dynamics: FinDynamics | None = None,
) -> ReferenceState:
    """Return the state `duration` [s] later, by DOP853 with absolute and relative tolerance 1e-12."""
    solution = solve_ivp(
        lambda time, vector: derivative(parameters, time, vector, rod_motion, fin_dynamics),
        (state.time, state.time + duration), _packed(state), method='DOP853', rtol=1e-12, atol=1e-12)
    if not solution.success:
        raise RuntimeError(solution.message)
    return _completed(parameters, state.time + duration, solution.y[:, -1], rod_motion, fin_dynamics)

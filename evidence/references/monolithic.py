"""The reference implementation of the monolithic coupling: body and fins solved together, in plain NumPy and SciPy.

A fin's wrench on the body and its joint accelerations are affine in the body's acceleration, as in the mechanics of any
tree. So seven evaluations of a fin's dynamics determine them: one without acceleration, and one with a unit
acceleration along each of the six axes. The body's equation (36), with its added mass on the left, is then one linear
system. The whole state is integrated at once, by the classical Runge-Kutta method or by DOP853 with a tolerance near
rounding.

The fins' dynamics are an argument: `equations.fin_dynamics`, the default, or `pinocchio_tree.fin_dynamics`.
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
    body_inertia,
    orientation_matrix,
    quaternion_dot,
)
from manta_sim_ros.dynamics import FloatArray, Parameters

FinDynamics = Callable[..., tuple[FloatArray, FloatArray]]
"""A function with the arguments, in their order, and the results of `equations.fin_dynamics`."""


class Accelerations(NamedTuple):
    """Accelerations and wrenches at one time, with shapes and frames as in `ReferenceState`."""

    body: FloatArray  # (6,) [m/s^2, rad/s^2]
    joints: FloatArray  # (2, n, m) [rad/s^2]
    fin_wrenches: FloatArray  # (2, 6) [N, N m]


def accelerations(
    parameters: Parameters, state: ReferenceState, rod_motion: RodMotion, fin_dynamics: FinDynamics | None = None,
) -> Accelerations:
    """Return the accelerations and wrenches that satisfy (6) to (37) at the state's time.

    `rod_motion(side, time)` gives each fin's rods (2, 3). The acceleration and the wrenches of `state` are not used,
    and its orientation need not be a unit quaternion. With `solver.fixed_base` the body's acceleration is zero.
    """
    fin_dynamics = equations.fin_dynamics if fin_dynamics is None else fin_dynamics
    orientation = state.orientation / np.linalg.norm(state.orientation)
    water_velocity = orientation_matrix(orientation).T @ np.array(parameters.water.current)

    def evaluate(side: int, acceleration: FloatArray) -> tuple[FloatArray, FloatArray]:
        return fin_dynamics(
            parameters, side, rod_motion(side, state.time), state.joint_angles[side], state.joint_rates[side],
            state.twist, acceleration, water_velocity)

    of_fins = [evaluate(side, np.zeros(6)) for side in (LEFT, RIGHT)]
    joints, wrenches = (np.stack(parts) for parts in zip(*of_fins, strict=True))
    if parameters.solver.fixed_base:
        return Accelerations(np.zeros(6), joints, wrenches)

    # the last axis of the slopes is the component of the body's acceleration
    joint_slopes, wrench_slopes = np.empty((*joints.shape, 6)), np.empty((*wrenches.shape, 6))
    for side in (LEFT, RIGHT):
        for axis, unit in enumerate(np.eye(6)):
            joints_at_unit, wrench_at_unit = evaluate(side, unit)
            joint_slopes[side, ..., axis] = joints_at_unit - joints[side]
            wrench_slopes[side, :, axis] = wrench_at_unit - wrenches[side]

    # (36), solved for the acceleration on which the wrenches depend
    per_wrench = np.linalg.inv(sum(body_inertia(parameters)))
    held = body_acceleration(parameters, orientation, state.twist, wrenches.sum(axis=0))
    acceleration = np.linalg.solve(np.eye(6) - per_wrench @ wrench_slopes.sum(axis=0), held)
    return Accelerations(acceleration, joints + joint_slopes @ acceleration, wrenches + wrench_slopes @ acceleration)


def _packed(state: ReferenceState) -> FloatArray:
    """Return position, orientation, twist, joint angles and joint rates of a state as one vector."""
    return np.hstack([
        state.position, state.orientation, state.twist, state.joint_angles.ravel(), state.joint_rates.ravel()])


def _unpacked(parameters: Parameters, time: float, vector: FloatArray) -> ReferenceState:
    """Return the state of a `_packed` vector; its acceleration and wrenches are NaN."""
    position, orientation, twist, joints = np.split(vector, [3, 7, 13])
    angles, rates = joints.reshape(2, 2, parameters.fin.chains, parameters.fin.links)
    undefined = np.full(6, np.nan)
    return ReferenceState(time, position, orientation, twist, undefined, angles, rates, np.tile(undefined, (2, 1)))


def derivative(
    parameters: Parameters, time: float, vector: FloatArray, rod_motion: RodMotion,
    fin_dynamics: FinDynamics | None = None,
) -> FloatArray:
    """Return the time derivative of a `_packed` vector of position, orientation, twist, joint angles and joint rates.

    The derivative of the orientation is half the product of the quaternion and (Omega, 0). Rotations are those of the
    normalized quaternion.
    """
    state = _unpacked(parameters, time, vector)
    result = accelerations(parameters, state, rod_motion, fin_dynamics)
    if parameters.solver.fixed_base:
        position_dot, orientation_dot = np.zeros(3), np.zeros(4)
    else:
        orientation_dot = quaternion_dot(state.orientation, state.twist[3:])
        unit = state.orientation / np.linalg.norm(state.orientation)
        position_dot = orientation_matrix(unit) @ state.twist[:3]
    return np.hstack([
        position_dot, orientation_dot, result.body, state.joint_rates.ravel(), result.joints.ravel()])


def _completed(
    parameters: Parameters, time: float, vector: FloatArray, rod_motion: RodMotion, fin_dynamics: FinDynamics | None,
) -> ReferenceState:
    """Return the state of a `_packed` vector with a normalized quaternion, and with its acceleration and wrenches."""
    state = _unpacked(parameters, time, vector)
    state = dataclasses.replace(state, orientation=state.orientation / np.linalg.norm(state.orientation))
    result = accelerations(parameters, state, rod_motion, fin_dynamics)
    return dataclasses.replace(state, acceleration=result.body, fin_wrenches=result.fin_wrenches)


def step(
    parameters: Parameters, state: ReferenceState, rod_motion: RodMotion, fin_dynamics: FinDynamics | None = None,
) -> ReferenceState:
    """Return the state one `solver.time_step` later, by the classical fourth-order Runge-Kutta method."""
    dt, t, start = parameters.solver.time_step, state.time, _packed(state)

    def slope(time: float, vector: FloatArray) -> FloatArray:
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
    """Return the state `duration` [s] later, by DOP853 with an absolute and a relative tolerance of 1e-12.

    Raises RuntimeError when the integration fails.
    """
    solution = solve_ivp(
        lambda time, vector: derivative(parameters, time, vector, rod_motion, fin_dynamics),
        (state.time, state.time + duration), _packed(state), method='DOP853', rtol=1e-12, atol=1e-12)
    if not solution.success:
        raise RuntimeError(solution.message)
    return _completed(parameters, state.time + duration, solution.y[:, -1], rod_motion, fin_dynamics)

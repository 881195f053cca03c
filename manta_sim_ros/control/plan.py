"""The optimal control problem of the model-predictive path follower, solved by IPOPT through CasADi."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import casadi
import numpy as np

from manta_sim_ros.control.averaged_model import GAIT, AveragedModel
from manta_sim_ros.control.averaged_motion import DISTURBANCES, STATES, moved, velocity
from manta_sim_ros.control.mpc_settings import MpcSettings
from manta_sim_ros.dynamics import FloatArray

SIZE = len(STATES) + len(GAIT)
"""Size of a state of the plan: STATES and the GAIT in force."""

POINT = 6
"""Size of a point of the path: its position (3,), the horizontal direction (2,) of the leg, and its slope."""

SOLVER: dict[str, Any] = {'print_level': 0, 'sb': 'yes', 'max_iter': 30, 'tol': 1e-2, 'mu_init': 1e-2}
"""Options of IPOPT. The tolerance, of the gradient of the cost, moves the gait by less than 0.01 degrees."""


MOST_ITERATIONS = 'Maximum_Iterations_Exceeded'
LARGEST_GAP = 1e-3
"""When the solver has used all iterations, its plan is used if the motion is that of the model to this error [SI units,
rad]: it need not be the best one."""

FAR = 2.0
"""Deviation from the path, over the one that costs 1, beyond which the cost grows in proportion: far from the path, the
robot would otherwise rather stand still than turn."""

SHORTEST_LAG = 1e-3
"""Least time by which the gait is behind the command in a plan [s]."""


class NoPlanError(RuntimeError):
    """The solver found no plan; says why."""


class Plan(NamedTuple):
    """Where the robot is going to be, and with which gaits."""

    states: FloatArray
    """(stages + 1, 15) STATES and the GAIT in force, at the ends of the stages."""
    commands: FloatArray
    """(stages, 3) GAIT."""

    def later(self, stages: float) -> Plan:
        """Return the plan from a time on, given in stages; behind its end the robot goes on as in the last stage."""
        index = np.arange(len(self.states)) + stages
        last = len(self.commands)
        states, commands = (
            np.column_stack([np.interp(index[:len(rows)], np.arange(len(rows)), column) for column in rows.T])
            for rows in self)
        beyond = np.maximum(index - last, 0.0)[:, np.newaxis]
        states[:, 9:12] += beyond * (self.states[-1, 9:12] - self.states[-2, 9:12])
        return Plan(states, commands)


class Planner:
    """Finds the gaits that follow a path best in the time ahead.

    The problem has the states and the commands of all stages as unknowns (multiple shooting). The commands are bounded.
    All else is a cost, so that there is always a solution.

    Parameters
    ----------
    model
        The averaged model.
    settings
        Limits, horizon and weights.

    """

    def __init__(self, model: AveragedModel, settings: MpcSettings) -> None:
        self._stages = stages = settings.stages
        start, disturbances = casadi.SX.sym('start', SIZE), casadi.SX.sym('disturbances', len(DISTURBANCES))
        points = casadi.SX.sym('points', POINT, stages + 1)
        states, commands = casadi.SX.sym('states', SIZE, stages + 1), casadi.SX.sym('commands', len(GAIT), stages)
        gaps, from_path, others = [states[:, 0] - start], [], []
        half, whole = (math.exp(-part * settings.interval / max(model.gait_lag, SHORTEST_LAG)) for part in (0.5, 1.0))
        for stage in range(stages):
            before, after, command = states[:, stage], states[:, stage + 1], commands[:, stage]
            gait = before[len(STATES):]
            middle, end = (command + remaining * (gait - command) for remaining in (half, whole))
            motion = moved(model, before[:len(STATES)], (gait, middle), disturbances, settings.interval)
            gaps.append(after - casadi.vertcat(motion, end))
            change = command - gait
            far, near = _deviations(settings, after, command, change, points[:, stage + 1], disturbances)
            from_path.append(far)
            others.append(near)
        errors, rest = casadi.vertcat(*from_path), casadi.vertcat(*others)
        cost = casadi.sumsqr(rest) + casadi.sum1(2.0 * FAR ** 2 * (casadi.sqrt(1.0 + (errors / FAR) ** 2) - 1.0))
        problem: dict[str, Any] = {
            'x': casadi.veccat(states, commands), 'f': cost, 'g': casadi.vertcat(*gaps),
            'p': casadi.veccat(start, disturbances, points)}
        high = np.array([settings.largest_amplitude, settings.largest_steering, settings.largest_bias])
        low = np.array([settings.least_amplitude, *-high[1:]])
        free = np.full(states.numel(), np.inf)
        self._bounds: dict[str, Any] = {
            'lbx': np.concatenate([-free, np.tile(low, stages)]),
            'ubx': np.concatenate([free, np.tile(high, stages)]), 'lbg': 0.0, 'ubg': 0.0}
        self._solver = casadi.nlpsol('plan', 'ipopt', problem, {
            'print_time': False, 'error_on_fail': False, 'hess_lag': _gauss_newton(problem, errors, rest),
            'ipopt': {**SOLVER, 'max_wall_time': settings.time_limit}})

    def plan(self, start: FloatArray, disturbances: FloatArray, points: FloatArray, guess: Plan) -> Plan:
        """Return the best plan.

        Parameters
        ----------
        start
            (15,) STATES and the GAIT in force.
        disturbances
            (5,) DISTURBANCES, constant in the time ahead.
        points
            (stages + 1, 6) points of the path, near where the robot is going to be.
        guess
            From where the search begins.

        Raises
        ------
        NoPlanError
            The solver did not find a motion of the model, or not in time.

        """
        found = self._solver(x0=np.concatenate([rows.ravel() for rows in guess]),
                             p=np.concatenate([start, disturbances, points.ravel()]), **self._bounds)
        result = self._solver.stats()
        enough = result['return_status'] == MOST_ITERATIONS and np.abs(found['g'].full()).max() < LARGEST_GAP
        if not (result['success'] or enough):
            raise NoPlanError(result['return_status'])
        values = found['x'].full().ravel()
        commands = SIZE * (self._stages + 1)
        return Plan(values[:commands].reshape(-1, SIZE), values[commands:].reshape(-1, len(GAIT)))


def _deviations(settings: MpcSettings, state: Any, command: Any, change: Any, point: Any, disturbances: Any,
                ) -> tuple[Any, Any]:
    """Return the deviations of a stage over those that cost 1: of its end from the path, and all others."""
    motion, direction, slope = velocity(state, disturbances), point[3:5], point[5]
    left = casadi.vertcat(-direction[1], direction[0])
    offset = state[9:12] - point[:3]
    return casadi.vertcat(
        casadi.dot(left, offset[:2]) / settings.cross_track,
        (offset[2] - slope * casadi.dot(direction, offset[:2])) / settings.height,
    ), casadi.vertcat(
        casadi.dot(left, motion[:2]) / settings.cross_track_rate,
        (motion[2] - slope * casadi.dot(direction, motion[:2])) / settings.height_rate,
        (state[0] - settings.speed) / settings.speed_error,
        (casadi.dot(direction, motion[:2] - disturbances[:2]) - settings.speed) / settings.progress,
        change / settings.gait_change, command[1] / settings.steering_effort, command[2] / settings.bias_effort)


def _gauss_newton(problem: dict[str, Any], from_path: Any, others: Any) -> casadi.Function:
    """Return the Hessian that the solver uses: without the curvature of the motion, so that it is positive."""
    weights = casadi.vertcat(1.0 / casadi.sqrt(1.0 + (from_path / FAR) ** 2), casadi.SX.ones(others.numel()))
    jacobian = casadi.jacobian(casadi.vertcat(from_path, others), problem['x'])
    factor, multipliers = casadi.SX.sym('factor'), casadi.SX.sym('multipliers', problem['g'].numel())
    hessian = 2.0 * factor * jacobian.T @ (weights * jacobian)
    return casadi.Function('hessian', [problem['x'], problem['p'], factor, multipliers], [casadi.triu(hessian)])

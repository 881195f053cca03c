"""An extended Kalman filter of the averaged motion, the current and the disturbances."""

from __future__ import annotations

import math
from collections.abc import Sequence

import casadi
import numpy as np

from manta_sim_ros.control.averaged_model import GAIT, AveragedModel
from manta_sim_ros.control.averaged_motion import DISTURBANCES, STATES, moved, rotation
from manta_sim_ros.control.averaging import Motion
from manta_sim_ros.dynamics import FloatArray

DRIFT = np.array([
    0.02, 0.02, 0.02, 0.03, 0.03, 0.03, 0.02, 0.02, 0.01, 0.005, 0.005, 0.005, 0.008, 0.008, 0.005, 0.001, 0.003])
"""Standard deviations of what the model does not foresee in a second, of STATES and DISTURBANCES [SI units, rad]."""

NOISE = np.array([0.03, 0.03, 0.03, 0.05, 0.05, 0.03, 0.03, 0.03, 0.02, 0.02, 0.02, 0.02])
"""Standard deviations of the measured means, of velocity over ground, angular velocity, attitude and position."""

FIRST = np.array([0.05] * 12 + [0.1, 0.1, 0.01, 0.005, 0.01])
"""Standard deviations at the beginning."""

SIZE = len(STATES)


class MotionFilter:
    """Estimates STATES and DISTURBANCES from means over a period.

    Parameters
    ----------
    model
        The averaged model.

    """

    def __init__(self, model: AveragedModel) -> None:
        state, gait, elapsed = casadi.SX.sym('state', SIZE + len(DISTURBANCES)), casadi.SX.sym('gait', len(GAIT)), (
            casadi.SX.sym('elapsed'))
        after = casadi.vertcat(moved(model, state[:SIZE], (gait, gait), state[SIZE:], elapsed), state[SIZE:])
        over_ground = state[:3] + rotation(state[6], state[7], state[8]).T @ state[SIZE:SIZE + 3]
        seen = casadi.vertcat(over_ground, state[3:SIZE])
        self._step = casadi.Function('step', [state, gait, elapsed], [after, casadi.jacobian(after, state)])
        self._seen = casadi.Function('seen', [state], [seen, casadi.jacobian(seen, state)])
        self.state = np.zeros(SIZE + len(DISTURBANCES))
        """(17,) STATES and DISTURBANCES."""
        self._covariance = np.diag(FIRST ** 2)

    def begin(self, motion: Motion) -> None:
        """Begin with a measured motion; the disturbances are kept."""
        current = self.state[SIZE:SIZE + 3]
        self.state[:SIZE] = [*motion.twist, *motion.attitude, *motion.position]
        turn = rotation(*motion.attitude.tolist()).full()
        self.state[:3] -= turn.T @ current
        self._covariance = np.diag(FIRST ** 2)

    def update(self, motion: Motion, gait: FloatArray, elapsed: float) -> None:
        """Take the measured motion at a time `elapsed` [s] after the last one, while this gait (3,) was in force."""
        after, jacobian = (value.full() for value in self._step(self.state, gait, elapsed))
        covariance = jacobian @ self._covariance @ jacobian.T + elapsed * np.diag(DRIFT ** 2)
        seen, of_state = (value.full() for value in self._seen(after))
        error = np.array([*motion.twist, *motion.attitude, *motion.position]) - seen[:, 0]
        error[8] = math.remainder(error[8], 2.0 * math.pi)
        noise = np.diag(NOISE ** 2) / elapsed
        gain = np.linalg.solve(of_state @ covariance @ of_state.T + noise, of_state @ covariance).T
        self.state = after[:, 0] + gain @ error
        kept = np.eye(len(self.state)) - gain @ of_state
        self._covariance = kept @ covariance @ kept.T + gain @ noise @ gain.T

    def moved(self, state: FloatArray, gait: FloatArray, elapsed: float) -> FloatArray:
        """Return STATES and DISTURBANCES (17,) after a time `elapsed` [s] in which a gait (3,) is in force."""
        return self._step(state, gait, elapsed)[0].full().ravel()

    def ahead(self, gaits: Sequence[tuple[float, FloatArray]]) -> FloatArray:
        """Return the state (17,) after gaits (3,), each with the time [s] in which it is in force."""
        state = self.state
        for elapsed, gait in gaits:
            state = self.moved(state, gait, elapsed)
        return state

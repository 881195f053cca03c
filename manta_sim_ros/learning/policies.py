"""Policies: linear ones that are symmetric in left and right, a random one, and one that rests."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from manta_sim_ros.dynamics import FloatArray, shown
from manta_sim_ros.learning.actions import OF_A_GAIT
from manta_sim_ros.learning.observations import OBSERVATION, mirrored

Policy = Callable[[FloatArray], FloatArray]
"""Takes observations (n, 21), and returns actions (n, 8)."""

FEATURES = {
    'direction_x': 1.0, 'direction_y': 1.0, 'direction_z': 0.2, 'up_x': 0.2, 'up_y': 0.2, 'velocity_x': 0.4,
    'angular_velocity_y': 0.5, 'angular_velocity_z': 0.5,
}
"""Numbers of the observation that a linear policy uses, and what it divides them by: about their sizes in a swim."""

OUTPUTS = tuple(number.name for number in OF_A_GAIT)
SHAPE = (len(OUTPUTS), len(FEATURES) + 1)
"""Shape of the weights: one row for each number of the gait of a fin, the last column is constant."""

_NAMES = [number.name for number in OBSERVATION]
_COLUMNS = [_NAMES.index(name) for name in FEATURES]
_SCALES = np.array(list(FEATURES.values()))


class LinearPolicy:
    """The gait of each fin is linear in FEATURES: the right fin sees the mirrored observation, with the same weights.

    Parameters
    ----------
    weights
        Of SHAPE.

    Raises
    ------
    ValueError
        The weights have another shape or are not finite.

    """

    def __init__(self, weights: FloatArray) -> None:
        self.weights = np.array(weights, dtype=np.float64)
        if self.weights.shape != SHAPE or not np.isfinite(self.weights).all():
            raise ValueError(f'weights is {shown(weights)}, but must be finite numbers of shape {SHAPE}')

    def __call__(self, observations: FloatArray) -> FloatArray:
        """Return the actions (n, 8) for observations (n, 21)."""
        return np.hstack([self._of_a_fin(observations), self._of_a_fin(mirrored(observations))])

    def _of_a_fin(self, observations: FloatArray) -> FloatArray:
        return observations[:, _COLUMNS] / _SCALES @ self.weights[:, :-1].T + self.weights[:, -1]

    def save(self, path: Path) -> None:
        """Write the policy to a file of JSON, with the names of what its numbers mean."""
        rows = {name: dict(zip((*FEATURES, 'constant'), row, strict=True))
                for name, row in zip(OUTPUTS, self.weights.tolist(), strict=True)}
        path.write_text(json.dumps(rows, indent=2) + '\n', encoding='utf-8')

    @classmethod
    def load(cls, path: Path) -> LinearPolicy:
        """Read a policy that was written by `save`.

        Raises
        ------
        ValueError
            The file is not such a file.
        OSError
            The file cannot be read.

        """
        try:
            rows = json.loads(path.read_text(encoding='utf-8'))
            return cls(np.array([[rows[name][feature] for feature in (*FEATURES, 'constant')] for name in OUTPUTS]))
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f'{path}: is not a policy as train_policy writes it') from error


def resting(observations: FloatArray) -> FloatArray:
    """Return actions (n, 8) with the smallest amplitude, 0, and the mean of the other limits."""
    of_a_fin = np.array([-1.0 if name == 'amplitude' else 0.0 for name in OUTPUTS])
    return np.tile(of_a_fin, (len(observations), 2))


class RandomPolicy:
    """Draws each number of each action evenly between its limits, with a seed."""

    def __init__(self, seed: int) -> None:
        self._random = np.random.default_rng(seed)

    def __call__(self, observations: FloatArray) -> FloatArray:
        """Return actions (n, 8)."""
        return self._random.uniform(-1.0, 1.0, (len(observations), 2 * len(OUTPUTS)))

"""The environment Swim: one robot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from manta_sim_ros.dynamics import FloatArray, Parameters
from manta_sim_ros.learning.actions import action_numbers
from manta_sim_ros.learning.episode import Episode
from manta_sim_ros.learning.observations import HIGH, LOW
from manta_sim_ros.learning.settings import SwimSettings, parameters_of

Action = NDArray[np.floating[Any]]


def observation_space() -> gymnasium.spaces.Box[np.float64]:
    """Return the space of the observations of one robot."""
    return gymnasium.spaces.Box(LOW, HIGH, dtype=np.float64)


def action_space(kind: str) -> gymnasium.spaces.Box[np.float32]:
    """Return the space of the actions of one robot."""
    return gymnasium.spaces.Box(-1.0, 1.0, (len(action_numbers(kind)),), dtype=np.float32)


class SwimEnv(gymnasium.Env[FloatArray, Action]):
    """A robot swims to a target in space, as the page "Learning" of the documentation describes.

    Parameters
    ----------
    parameters
        The robot: Parameters, or the path of a parameter file; by default ROBOT.
    options
        The fields of SwimSettings.

    Raises
    ------
    ValueError
        An option is unknown or invalid, the mechanism cannot follow all actions, or the control period is not a whole
        number of time steps; names the value and the bound.
    OSError
        The file cannot be read.

    """

    metadata: dict[str, Any] = {'render_modes': []}

    def __init__(
        self, parameters: Parameters | str | Path | None = None, *, render_mode: None = None, **options: Any,
    ) -> None:
        settings = SwimSettings.of(options)
        self._episode = Episode(parameters_of(parameters), settings)
        self.render_mode = render_mode
        self.observation_space = observation_space()
        self.action_space = action_space(settings.action)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None,
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Begin an episode; `options` may have `target`, its position (3,) [m], world frame."""
        super().reset(seed=seed)
        info = self._episode.begin(self.np_random, options)
        return self._episode.observation(), info

    def step(self, action: Action) -> tuple[FloatArray, float, bool, bool, dict[str, Any]]:
        """Swim for a control period; the wrapper TimeLimit of the registered environment truncates episodes."""
        self._episode.command(action)
        self._episode.advance()
        reward, terminated, info = self._episode.outcome()
        return self._episode.observation(), reward, terminated, False, info

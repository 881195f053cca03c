"""The vector environment Swim: many robots on all cores."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from manta_sim_ros.dynamics import FloatArray, Parameters, shown
from manta_sim_ros.learning.environment import Action, action_space, observation_space
from manta_sim_ros.learning.episode import Episode
from manta_sim_ros.learning.observations import OBSERVATION
from manta_sim_ros.learning.settings import SwimSettings, parameters_of

Flags = NDArray[np.bool_]


class SwimVectorEnv(gymnasium.vector.VectorEnv[FloatArray, Action, NDArray[Any]]):
    """Robots that swim to targets, each as in SwimEnv and to the last bit the same, on all cores of this process.

    The simulators of the robots are kept from step to step, and advance in threads while they do not need the
    interpreter. That takes less time than `simulate_batch`, which makes new ones and knows no angles of rods. A robot
    whose episode ended is reset in the next step (`AutoresetMode.NEXT_STEP`).

    Parameters
    ----------
    num_envs
        Number of robots.
    max_episode_steps
        Steps after which an episode is truncated.
    parameters, options
        As of SwimEnv.

    Raises
    ------
    ValueError
        As of SwimEnv, or a number is not positive.

    """

    metadata: dict[str, Any] = {
        'render_modes': [], 'autoreset_mode': gymnasium.vector.AutoresetMode.NEXT_STEP}

    def __init__(
        self, num_envs: int = 1, max_episode_steps: int = 300, parameters: Parameters | str | Path | None = None, *,
        render_mode: None = None, **options: Any,
    ) -> None:
        for name, value in (('num_envs', num_envs), ('max_episode_steps', max_episode_steps)):
            if not value >= 1:
                raise ValueError(f'{name} is {shown(value)}, but must be at least 1')
        settings, robot = SwimSettings.of(options), parameters_of(parameters)
        self.num_envs, self.render_mode = num_envs, render_mode
        self._most_steps = max_episode_steps
        self._episodes = [Episode(robot, settings) for _ in range(num_envs)]
        self._random = [seeding.np_random()[0] for _ in range(num_envs)]
        self._pool = ThreadPoolExecutor(min(num_envs, _cores()))
        self._steps = np.zeros(num_envs, dtype=np.int64)
        self._ended = np.zeros(num_envs, dtype=np.bool_)
        self.single_observation_space = observation_space()
        self.single_action_space = action_space(settings.action)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None,
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Begin an episode of each robot, with `seed`, `seed` + 1, ... or with a seed of each.

        Raises
        ------
        ValueError
            There is another number of seeds, or as of SwimEnv.

        """
        seeds = [seed + index for index in range(self.num_envs)] if isinstance(seed, int) else seed
        if seeds is not None:
            if len(seeds) != self.num_envs:
                raise ValueError(f'seed has {len(seeds)} entries, but must have one for each of {self.num_envs} robots')
            for index, one in enumerate(seeds):
                if one is not None:
                    self._random[index] = seeding.np_random(one)[0]
        infos: dict[str, Any] = {}
        for index in range(self.num_envs):
            infos = self._begin(index, options, infos)
        return self._observations(), infos

    def step(self, actions: Action) -> tuple[FloatArray, FloatArray, Flags, Flags, dict[str, Any]]:
        """Let each robot swim for a control period, or begin its next episode if the last one has ended.

        Raises
        ------
        ValueError
            The actions (num_envs, k) have another shape, or a number is not finite.

        """
        if np.shape(actions) != self.action_space.shape:
            raise ValueError(
                f'actions has shape {np.shape(actions)}, but must have {self.action_space.shape}: one row for each '
                'robot')
        rewards, terminated = np.zeros(self.num_envs), np.zeros(self.num_envs, dtype=np.bool_)
        infos: dict[str, Any] = {}
        swimming = np.flatnonzero(~self._ended).tolist()
        for index in np.flatnonzero(self._ended).tolist():
            infos = self._begin(index, None, infos)
        for index in swimming:
            self._episodes[index].command(actions[index])
        list(self._pool.map(lambda index: self._episodes[index].advance(), swimming))
        for index in swimming:
            rewards[index], terminated[index], info = self._episodes[index].outcome()
            infos = self._add_info(infos, info, index)
        self._steps[swimming] += 1
        truncated = self._steps >= self._most_steps
        self._ended = terminated | truncated
        return self._observations(), rewards, terminated, truncated, infos

    def close_extras(self, **kwargs: Any) -> None:
        """End the threads."""
        self._pool.shutdown()

    def _begin(self, index: int, options: dict[str, Any] | None, infos: dict[str, Any]) -> dict[str, Any]:
        self._steps[index], self._ended[index] = 0, False
        return self._add_info(infos, self._episodes[index].begin(self._random[index], options), index)

    def _observations(self) -> FloatArray:
        return np.array([episode.observation() for episode in self._episodes]).reshape(-1, len(OBSERVATION))


def _cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, 'sched_getaffinity'):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1

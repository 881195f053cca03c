"""Training a linear policy by evolution (CMA-ES), and what a policy achieves."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import closing
from typing import NamedTuple

import numpy as np

from manta_sim_ros.dynamics import FloatArray
from manta_sim_ros.learning.policies import SHAPE, LinearPolicy, Policy
from manta_sim_ros.learning.vector_environment import SwimVectorEnv

SPREAD = 0.4
"""Standard deviation of the weights of the first generation, about zero."""

STEPS = 150
"""Steps of a trial: the reward that a policy collects in them, over several episodes if it is fast, is maximized."""


class Evaluation(NamedTuple):
    """What a policy achieved in one episode for each seed."""

    returns: FloatArray
    """(n,) sum of the rewards."""
    successes: FloatArray
    """(n,) 1 where the target was reached, else 0."""

    @property
    def standard_error(self) -> float:
        """Standard error of the mean of the returns."""
        return float(self.returns.std(ddof=1) / math.sqrt(self.returns.size))


def evaluate(policy: Policy, seeds: Sequence[int], **options: object) -> Evaluation:
    """Return what a policy achieves in one episode for each of at least two seeds.

    The options are those of SwimVectorEnv.
    """
    returns, successes = np.zeros((2, len(seeds)))
    going = np.ones(len(seeds), dtype=np.bool_)
    with closing(SwimVectorEnv(len(seeds), **options)) as environment:  # type: ignore[arg-type]
        observations, _ = environment.reset(seed=list(seeds))
        while going.any():
            observations, rewards, terminated, truncated, infos = environment.step(policy(observations))
            returns[going] += rewards[going]
            successes[going] = infos['is_success'][going]
            going &= ~(terminated | truncated)
    return Evaluation(returns, successes)


class Generation(NamedTuple):
    """What one generation of the evolution achieved."""

    number: int
    best: float
    """Mean reward of the best trial of the generation."""
    mean: float
    """Mean reward of all of its trials."""
    policy: LinearPolicy
    """The mean of the policies, from which the next generation is drawn."""


def train(
    generations: int, *, seed: int = 0, candidates: int = 14, robots: int = 4, steps: int = STEPS,
    progress: Callable[[Generation], object] = lambda generation: None, **options: object,
) -> LinearPolicy:
    """Return a policy that was trained by CMA-ES: the mean of the last generation.

    In each generation, each candidate swims with the same targets. The result depends on the arguments only.

    Parameters
    ----------
    generations
        How many generations, at least one.
    seed
        Of the candidates and of the targets.
    candidates
        Policies of a generation.
    robots
        Robots that try each candidate.
    steps
        Steps of the environment of a trial.
    progress
        Is called after each generation.
    options
        Those of SwimVectorEnv.

    """
    import cma

    random = np.random.default_rng(seed)
    strategy = cma.CMAEvolutionStrategy(np.zeros(SHAPE).ravel(), SPREAD, {
        'popsize': candidates, 'seed': math.nan, 'randn': lambda *shape: random.standard_normal(shape), 'verbose': -9,
        'maxiter': math.inf})
    with closing(SwimVectorEnv(candidates * robots, **options)) as environment:  # type: ignore[arg-type]
        for number in range(1, generations + 1):
            weights = strategy.ask()
            seeds = random.integers(2**31, size=robots).tolist()
            rewards = _rewards(environment, [LinearPolicy(each.reshape(SHAPE)) for each in weights], seeds, steps)
            strategy.tell(weights, (-rewards).tolist())
            policy = LinearPolicy(strategy.result.xfavorite.reshape(SHAPE))
            progress(Generation(number, float(rewards.max()), float(rewards.mean()), policy))
    return policy


def _rewards(
    environment: SwimVectorEnv, policies: Sequence[Policy], seeds: Sequence[int], steps: int,
) -> FloatArray:
    """Return the mean reward of each policy in a trial, with robots of these seeds."""
    observations, _ = environment.reset(seed=list(seeds) * len(policies))
    collected = np.zeros(environment.num_envs)
    for _ in range(steps):
        actions = [policy(part) for policy, part in zip(policies, np.split(observations, len(policies)), strict=True)]
        observations, rewards, *_ = environment.step(np.concatenate(actions))
        collected += rewards
    return collected.reshape(len(policies), -1).mean(axis=1)

"""The environment Swim beside Swimmer of Gymnasium, which MuJoCo simulates: steps per second with random actions.

`python -m evidence.benchmark.environments` measures and prints this section of the benchmark alone.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import gymnasium
import numpy as np

from evidence.report import prose, table
from manta_sim_ros.learning import ENVIRONMENT

OTHER = 'Swimmer-v5'
ROBOTS = 32
"""Robots of a vector environment."""

NAMES = {'swim': 'Swim', 'swimmer': 'Swimmer'}


def environments(quick: bool) -> dict[str, float]:
    """Return steps of one robot per elapsed second, simulated seconds per second, and ratios of Swim to Swimmer.

    The figures are medians over rounds, in each of which all programs run one after the other.
    """
    single, steps = (50, 10) if quick else (1000, 50)
    other = gymnasium.make(OTHER)
    periods = {'swim': 0.2, 'swimmer': float(other.unwrapped.dt)}  # type: ignore[attr-defined]
    programs = {
        'swim, single': _of_one(gymnasium.make(ENVIRONMENT), single),
        'swimmer, single': _of_one(other, single),
        'swim, vector': _of_many(gymnasium.make_vec(ENVIRONMENT, num_envs=ROBOTS), steps),
        'swimmer, vector': _of_many(gymnasium.make_vec(OTHER, num_envs=ROBOTS, vectorization_mode='sync'), steps),
    }
    rates: dict[str, list[float]] = {name: [] for name in programs}
    for _ in range(3 if quick else 9):
        for name, run in programs.items():
            began = time.monotonic()
            count = run()
            rates[name].append(count / (time.monotonic() - began))
    of = {name: np.array(values[1:]) for name, values in rates.items()}  # the first round is not counted
    figures = dict(of)
    for kind in ('single', 'vector'):
        figures[f'swim / swimmer, {kind}'] = of[f'swim, {kind}'] / of[f'swimmer, {kind}']
        for name, period in periods.items():
            figures[f'{name}, {kind} [s/s]'] = period * of[f'{name}, {kind}']
    figures['vector / single'] = of['swim, vector'] / of['swim, single']
    return {name: float(np.median(values)) for name, values in figures.items()}


def _of_one(environment: gymnasium.Env, steps: int) -> Callable[[], int]:
    """Return a program that takes so many steps, and returns their number."""
    environment.reset(seed=0)
    environment.action_space.seed(0)

    def run() -> int:
        for _ in range(steps):
            *_, terminated, truncated, _ = environment.step(environment.action_space.sample())
            if terminated or truncated:
                environment.reset()
        return steps

    return run


def _of_many(environment: gymnasium.vector.VectorEnv, steps: int) -> Callable[[], int]:
    """Return a program that takes so many steps of each robot, and returns the number of all of them."""
    environment.reset(seed=0)
    environment.action_space.seed(0)

    def run() -> int:
        for _ in range(steps):
            environment.step(environment.action_space.sample())
        return steps * environment.num_envs

    return run


def section(figures: dict[str, float]) -> str:
    """Return the section of the page."""
    return '\n\n'.join([
        '## Environments for learning',
        prose(f"""
[Swim](learning.md) beside {OTHER} of Gymnasium, which MuJoCo simulates: steps of single robots per elapsed second, with
random actions, and how many times faster than real time that is. A step of Swim takes 0.2 s of simulated time, one of
Swimmer 0.04 s, and Swimmer has three rigid links. The vector environments have {ROBOTS} robots: that of Swim uses all
cores, that of Swimmer is the synchronous one of Gymnasium."""),
        table(('environment', 'robots', 'steps per second', 'times real time'), (
            (title, robots, f'{figures[f"{name}, {kind}"]:.0f}', f'{figures[f"{name}, {kind} [s/s]"]:.0f}')
            for kind, robots in (('single', '1'), ('vector', str(ROBOTS))) for name, title in NAMES.items())),
        table(('ratio', 'value'), (
            ('steps of Swim / Swimmer, one robot', f'{figures["swim / swimmer, single"]:.3f}'),
            (f'steps of Swim / Swimmer, {ROBOTS} robots', f'{figures["swim / swimmer, vector"]:.3f}'),
            (f'Swim, {ROBOTS} robots / one robot', f'{figures["vector / single"]:.2f}'))),
    ])


if __name__ == '__main__':
    print(section(environments(quick=False)))

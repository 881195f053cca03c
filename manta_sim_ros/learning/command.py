"""The command `train_policy`: train a policy for Swim, and compare it with a random and a resting one."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path

from manta_sim_ros.dynamics import Parameters, compile_kernels
from manta_sim_ros.learning.policies import LinearPolicy, RandomPolicy, resting
from manta_sim_ros.learning.settings import ROBOT
from manta_sim_ros.learning.training import STEPS, Generation, evaluate, train
from manta_sim_ros.signals import on_ending
from manta_sim_ros.studies.arguments import Parser, check_output

FIRST_SEED = 1_000_000
"""First seed of the episodes of an evaluation."""


def main(args: Sequence[str] | None = None) -> None:
    """Run the command; the exit status is 0, 1 after a failure, 2 for wrong input, or 130 when it is interrupted."""
    parser = _parser()
    options = parser.parse_args(args)
    try:
        for name, least in (('generations', 1), ('episodes', 2), ('steps', 1), ('seed', 0)):
            if getattr(options, name) < least:
                raise ValueError(f'--{name} is {getattr(options, name)}, but must be at least {least}')
        check_output('--output', options.output, inputs=[options.config])
        robot = ROBOT if options.config is None else Parameters.from_yaml(options.config)
        policy = None if options.evaluate is None else LinearPolicy.load(options.evaluate)
    except (OSError, ValueError) as error:
        parser.error(str(error))
    on_ending(lambda: os._exit(130))
    compile_kernels(robot, lambda line: print(line, file=sys.stderr, flush=True))
    try:
        if policy is None:
            def progress(generation: Generation) -> None:
                generation.policy.save(options.output)
                print(f'generation {generation.number} of {options.generations}: reward of a trial '
                      f'{generation.mean:.3f} in the mean, {generation.best:.3f} of the best policy', flush=True)

            policy = train(
                options.generations, seed=options.seed, steps=options.steps, progress=progress, parameters=robot)
            print(f'written: {options.output}', flush=True)
    except OSError as error:
        sys.exit(f'{parser.prog}: {error}')
    seeds = range(FIRST_SEED, FIRST_SEED + options.episodes)
    print(f'{options.episodes} episodes, the same for each policy:', flush=True)
    for name, each in (('trained', policy), ('random', RandomPolicy(0)), ('resting', resting)):
        result = evaluate(each, seeds, max_episode_steps=2 * options.steps, parameters=robot)
        print(f'{name:8} return {result.returns.mean():6.3f} +- {result.standard_error:.3f}, '
              f'target reached in {100.0 * result.successes.mean():.0f} %', flush=True)


def _parser() -> Parser:
    parser = Parser(
        prog='train_policy',
        description='Train a linear policy for the environment manta_sim_ros/Swim-v0 by evolution (CMA-ES), and print '
                    'its mean return, with the standard error, beside those of a random and a resting policy. The file '
                    'is written after each generation.')
    parser.add_argument('-o', '--output', type=Path, default=Path('policy.json'), metavar='FILE.json',
                        help='the file to write (default: %(default)s)')
    parser.add_argument('--generations', type=int, default=42, metavar='N', help='(default: %(default)s)')
    parser.add_argument('--seed', type=int, default=0, metavar='N', help='of the training (default: %(default)s)')
    parser.add_argument('--config', type=Path, metavar='FILE.yaml',
                        help='parameter file of the robot (default: config/freshwater.yaml with 4 chains)')
    parser.add_argument('--episodes', type=int, default=64, metavar='N',
                        help='for the evaluation (default: %(default)s)')
    parser.add_argument('--steps', type=int, default=STEPS, metavar='N',
                        help='of the environment in a trial, and twice as many at most in an episode of the evaluation '
                             '(default: %(default)s)')
    parser.add_argument('--evaluate', type=Path, metavar='FILE.json',
                        help='train nothing, evaluate the policy of this file')
    return parser

"""A short training beats a random policy, repeats itself, and its file can be read; the command that does it."""

import json
import re
from contextlib import closing

import numpy as np
import pytest

pytest.importorskip('gymnasium')
pytest.importorskip('cma')
command = pytest.importorskip('manta_sim_ros.learning.command')
from manta_sim_ros.learning.policies import FEATURES, OUTPUTS, SHAPE, LinearPolicy, RandomPolicy, resting  # noqa: E402
from manta_sim_ros.learning.training import evaluate, train  # noqa: E402
from manta_sim_ros.learning.vector_environment import SwimVectorEnv  # noqa: E402

AHEAD = {'largest_bearing': 0.2, 'largest_height': 0.1}
"""Options with which a target can be reached soon."""

MARGIN = 0.5
"""Least difference of the mean returns of a policy that was trained shortly and a random one [m]."""


def test_a_short_training_beats_a_random_policy():
    policy = train(8, candidates=8, robots=2, steps=40, **AHEAD)
    seeds = range(100, 116)
    trained, drawn, still = (
        evaluate(each, seeds, max_episode_steps=60, **AHEAD) for each in (policy, RandomPolicy(0), resting))
    assert trained.returns.mean() > drawn.returns.mean() + MARGIN
    assert trained.returns.mean() > still.returns.mean() + MARGIN


def test_a_training_depends_on_its_seed_only():
    generations = []
    one, same = (train(2, seed=3, candidates=4, robots=1, steps=2, progress=generations.append) for _ in range(2))
    other = train(2, seed=4, candidates=4, robots=1, steps=2)
    np.testing.assert_array_equal(one.weights, same.weights)
    assert not np.allclose(one.weights, other.weights)
    assert [generation.number for generation in generations] == [1, 2, 1, 2]
    assert all(generation.best >= generation.mean for generation in generations)
    np.testing.assert_array_equal(generations[-1].policy.weights, same.weights)


def test_an_evaluation_counts_each_episode_once():
    def ahead(observations):
        return np.tile([1.0, 0.6, 0.8, 0.0], (len(observations), 2))

    options = {'nearest_target': 0.3, 'farthest_target': 1.2, 'largest_bearing': 0.0, 'largest_height': 0.0,
               'effort_weight': 0.0}
    seeds = [1, 2, 3, 4]
    with closing(SwimVectorEnv(len(seeds), **options)) as environment:
        starts = np.linalg.norm(environment.reset(seed=seeds)[1]['target'], axis=1)
    assert np.ptp(starts) > 0.3  # the first one goes on to other targets while the last one is on its way
    reached = evaluate(ahead, seeds, max_episode_steps=60, **options)
    assert reached.successes.tolist() == [1.0] * len(seeds)
    left = starts - reached.returns  # the distance when it ends
    assert 0.0 <= left.min() and left.max() <= 0.2
    away = evaluate(ahead, [1, 2], max_episode_steps=5, **options | {'nearest_target': 3.0, 'farthest_target': 3.0})
    assert not away.successes.any()


def test_a_linear_policy_is_symmetric_and_is_read_as_it_was_written(tmp_path):
    from manta_sim_ros.learning import mirrored

    random = np.random.default_rng(1)
    policy, observations = LinearPolicy(random.normal(size=SHAPE)), random.normal(size=(5, 21))
    actions = policy(observations)
    np.testing.assert_array_equal(policy(mirrored(observations)), np.roll(actions, len(OUTPUTS), axis=1))
    assert not np.allclose(actions[:, :4], actions[:, 4:])
    policy.save(tmp_path / 'policy.json')
    np.testing.assert_array_equal(LinearPolicy.load(tmp_path / 'policy.json').weights, policy.weights)
    rows = json.loads((tmp_path / 'policy.json').read_text())
    assert list(rows) == list(OUTPUTS) and list(rows['phase']) == [*FEATURES, 'constant']


def test_a_constant_weight_is_a_constant_gait_of_both_fins():
    weights = np.zeros(SHAPE)
    weights[:, -1] = [1.0, 0.5, 0.2, -0.1]
    np.testing.assert_array_equal(LinearPolicy(weights)(np.ones((2, 21))), np.tile([1.0, 0.5, 0.2, -0.1], (2, 2)))


def test_the_command_trains_writes_and_compares(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(command, 'on_ending', lambda action: None)  # which is for a process of its own
    path = tmp_path / 'policy.json'
    command.main(['--output', str(path), '--generations', '1', '--episodes', '2', '--steps', '2'])
    printed = capsys.readouterr().out
    assert f'written: {path}' in printed and 'generation 1 of 1' in printed
    line = r'{} +return +-?\d+\.\d+ \+- \d+\.\d+, target reached in \d+ %'
    assert all(re.search(line.format(name), printed) for name in ('trained', 'random', 'resting'))
    command.main(['--evaluate', str(path), '--episodes', '2', '--steps', '2'])
    again = capsys.readouterr().out
    assert printed.splitlines()[-4:] == again.splitlines()


@pytest.mark.parametrize(('arguments', 'words'), [
    (['--generations', '0'], '--generations is 0, but must be at least 1'),
    (['--episodes', '1'], '--episodes is 1, but must be at least 2'),
    (['--steps', '0'], '--steps is 0, but must be at least 1'),
    (['--output', 'nowhere/policy.json'], 'but must be a file in a directory that exists'),
    (['--config', 'nowhere.yaml'], 'nowhere.yaml'),
    (['--evaluate', 'pyproject.toml'], 'pyproject.toml: is not a policy as train_policy writes it'),
])
def test_a_wrong_argument_is_refused_in_one_line(arguments, words, capsys):
    with pytest.raises(SystemExit) as ended:
        command.main(arguments)
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith('train_policy: ') and words in line

"""The environment Swim: the interface of Gymnasium, episodes that repeat, what their numbers mean, and how they end."""

import math
import warnings
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from manta_sim_ros.dynamics import FinCommand, Parameters, Simulator

gymnasium = pytest.importorskip('gymnasium')
learning = pytest.importorskip('manta_sim_ros.learning')

CONFIG = Path(__file__).parents[2] / 'config'
RANDOM = {'randomization': 0.2, 'largest_current': 0.1, 'position_noise': 0.05, 'orientation_noise': 0.02,
          'linear_velocity_noise': 0.02, 'angular_velocity_noise': 0.02}
UNSTABLE = learning.ROBOT.replace(solver={'time_step': 0.025})
GAIT = [1.0, 0.6, 0.8, 0.0]  # of one fin: swims ahead


@pytest.fixture(autouse=True)
def no_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        yield


def made(**options):
    return gymnasium.make(learning.ENVIRONMENT, **options)


def vector(count, **options):
    return gymnasium.make_vec(
        learning.ENVIRONMENT, num_envs=count, vectorization_mode='vector_entry_point', **options)


def actions_of(environment, steps, seed=0):
    """Return random actions, which differ much from step to step."""
    random = np.random.default_rng(seed)
    return random.uniform(-1.0, 1.0, (steps, *environment.action_space.shape)).astype(np.float32)


def episode(environment, seed, steps=8):
    """Return observations, rewards and distances of random actions."""
    observation, _ = environment.reset(seed=seed)
    rows = [(observation, 0.0, 0.0)]
    for action in actions_of(environment, steps):
        observation, reward, _, _, info = environment.step(action)
        rows.append((observation, reward, info['distance']))
    return [np.array(column) for column in zip(*rows)]


@pytest.mark.parametrize('action', ['gait', 'rods'])
def test_the_checker_of_gymnasium_finds_nothing(action):
    from gymnasium.utils.env_checker import check_env

    check_env(made(action=action).unwrapped)


@pytest.mark.parametrize('action', ['gait', 'rods'])
def test_the_checker_of_stable_baselines_finds_nothing(action):
    checker = pytest.importorskip(
        'stable_baselines3.common.env_checker', reason='Stable-Baselines3 is not installed')
    checker.check_env(made(action=action))


def test_the_environment_is_made_with_the_import_in_its_name():
    assert isinstance(gymnasium.make('manta_sim_ros.learning:manta_sim_ros/Swim-v0').unwrapped, learning.SwimEnv)


@pytest.mark.parametrize('options', [{}, RANDOM, {'action': 'rods', **RANDOM, 'control_period': 0.1}])
def test_the_same_seed_gives_the_same_episode_to_the_last_bit(options):
    one, same, other = (episode(made(**options), seed) for seed in (5, 5, 6))
    assert [column.tobytes() for column in one] == [column.tobytes() for column in same]
    assert not np.allclose(one[0], other[0])


@pytest.mark.parametrize('options', [
    RANDOM, {'action': 'rods', **RANDOM, 'control_period': 0.1},
    {'parameters': Parameters().replace(fin={'chains': 4}), **RANDOM}], ids=['gait', 'rods', 'manta'])
def test_robots_of_the_vector_environment_swim_as_single_ones(options):
    count, steps = 3, 12
    single = gymnasium.make_vec(
        learning.ENVIRONMENT, num_envs=count, vectorization_mode='sync', max_episode_steps=5, **options)
    together = vector(count, max_episode_steps=5, **options)
    assert together.single_observation_space == single.single_observation_space
    assert together.action_space == single.action_space
    for one, other in zip(single.reset(seed=3), together.reset(seed=3)):
        assert_same(one, other)
    for action in actions_of(together, steps):  # over two ends of episodes
        for one, other in zip(single.step(action), together.step(action)):
            assert_same(one, other)
    single.close()
    together.close()


def assert_same(one, other):
    """Assert that two arrays, or the arrays of two infos, agree within 1e-12."""
    if isinstance(one, dict):
        assert one.keys() == other.keys()
        for name in one:
            assert_same(one[name], other[name])
    else:
        np.testing.assert_allclose(np.asarray(one, float), np.asarray(other, float), rtol=0.0, atol=1e-12)


def test_one_robot_in_the_vector_environment_swims_as_the_single_one():
    environment, together = made(**RANDOM), vector(1, **RANDOM)
    np.testing.assert_allclose(together.reset(seed=9)[0][0], environment.reset(seed=9)[0], rtol=0.0, atol=1e-12)
    for action in actions_of(environment, 10):
        one, other = environment.step(action), together.step(action[np.newaxis])
        np.testing.assert_allclose(other[0][0], one[0], rtol=0.0, atol=1e-12)
        assert other[1][0] == pytest.approx(one[1], rel=0.0, abs=1e-12)
    together.close()


def test_a_vector_environment_declares_that_it_resets_in_the_next_step():
    together = vector(2, max_episode_steps=2)
    assert together.metadata['autoreset_mode'] is gymnasium.vector.AutoresetMode.NEXT_STEP
    together.reset(seed=1)
    still = np.zeros(together.action_space.shape, dtype=np.float32)
    assert not together.step(still)[3].any()
    assert together.step(still)[3].all()
    observations, rewards, terminated, truncated, infos = together.step(still)
    assert not rewards.any() and not terminated.any() and not truncated.any()
    np.testing.assert_array_equal(observations[:, 0], np.linalg.norm(infos['target'], axis=1))
    together.close()


def test_the_observation_says_where_the_target_is_and_how_the_robot_moves():
    parameters, target = learning.ROBOT, [1.0, 2.0, -0.5]
    environment, simulator = made(), Simulator(parameters)
    environment.reset(seed=0, options={'target': target})
    left, right = FinCommand(0.7, 0.68, 0.72, 0.05, -0.05), FinCommand(0.35, 0.5, 0.0)
    action = np.array([1.0, 0.6, 0.8, 0.25, 0.0, 0.0, 0.0, 0.0])
    simulator.command(left=left, right=right)
    for _ in range(10):
        observation = environment.step(action)[0]
        state = simulator.advance(0.2)
    names = [number.name for number in learning.OBSERVATION]
    values = dict(zip(names, observation))
    offset = np.array(target) - state.position
    assert values['distance'] == pytest.approx(np.linalg.norm(offset))
    rotation = Rotation.from_quat(state.orientation)
    direction = rotation.inv().apply(offset / np.linalg.norm(offset))
    np.testing.assert_allclose([values[f'direction_{axis}'] for axis in 'xyz'], direction, atol=1e-7)
    np.testing.assert_allclose([values[f'up_{axis}'] for axis in 'xyz'], state.up, atol=1e-7)
    np.testing.assert_allclose([values[f'velocity_{axis}'] for axis in 'xyz'], state.twist[:3], atol=1e-7)
    np.testing.assert_allclose([values[f'angular_velocity_{axis}'] for axis in 'xyz'], state.twist[3:], atol=1e-7)
    for index, (side, rod) in enumerate((s, r) for s in ('left', 'right') for r in ('front', 'rear')):
        assert values[f'{side}_{rod}_rod_angle'] == pytest.approx(state.rod_angles.flat[index], abs=1e-7)
        assert values[f'{side}_{rod}_rod_rate'] == pytest.approx(state.rod_rates.flat[index], abs=1e-6)
    assert abs(direction[1]) > 0.5 and abs(state.twist[5]) > 0.01  # the robot turned meanwhile


def test_a_mirrored_observation_is_that_of_the_mirrored_swim():
    one, other = made(), made()
    one.reset(options={'target': [2.0, 1.0, 0.2]})
    other.reset(options={'target': [2.0, -1.0, 0.2]})
    for action in actions_of(one, 10):
        observation = one.step(action)[0]
        opposite = other.step(np.roll(action, 4))[0]
    np.testing.assert_allclose(learning.mirrored(opposite), observation, rtol=0.0, atol=1e-9)
    assert not np.allclose(opposite, observation)


def test_the_rods_follow_every_sequence_of_actions():
    """No action is refused: a smoothed gait stays between those that were commanded, whose corners are checked."""
    random = np.random.default_rng(1)
    for action in ('gait', 'rods'):
        environment = made(action=action)
        environment.reset(seed=0)
        for _ in range(60):
            corner = random.choice([-1.0, 1.0], environment.action_space.shape).astype(np.float32)
            *_, info = environment.step(corner)
            assert 'divergence' not in info


def test_the_reward_is_progress_less_effort():
    environment = made(effort_weight=0.01)
    _, info = environment.reset(seed=2)
    distance, simulator = np.linalg.norm(info['target']), Simulator(learning.ROBOT)
    gait = FinCommand(0.7, 0.68, 0.72)
    simulator.command(left=gait, right=gait)
    for _ in range(10):
        powers = []
        for _ in range(4):
            state = simulator.advance(0.05)
            powers.append(np.maximum(state.rod_torques * state.rod_rates, 0.0).sum())
        _, reward, terminated, truncated, info = environment.step(np.array(2 * GAIT))
        assert info['work'] == pytest.approx(0.2 * np.mean(powers), rel=1e-5)  # actions are of 32 bits
        assert reward == pytest.approx(distance - info['distance'] - 0.01 * info['work'])
        distance = info['distance']
        assert not terminated and not truncated and not info['is_success']


def test_a_robot_that_reaches_its_target_ends_the_episode():
    environment = made()
    environment.reset(options={'target': [0.5, 0.0, 0.0]})
    for _ in range(30):
        observation, _, terminated, truncated, info = environment.step(np.array(2 * GAIT))
        assert terminated == info['is_success'] == (info['distance'] <= 0.2)
        if terminated:
            break
    assert terminated and not truncated and observation[0] <= 0.2


def test_an_episode_is_truncated_after_the_time_limit():
    environment = made(max_episode_steps=3)
    environment.reset(seed=0)
    rest = np.array(2 * [-1.0, 0.0, 0.0, 0.0])
    assert [environment.step(rest)[2:4] for _ in range(3)] == [(False, False), (False, False), (False, True)]
    assert gymnasium.spec(learning.ENVIRONMENT).max_episode_steps == 300


def test_a_divergence_ends_the_episode_and_says_why():
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # of the time step
        environment, together = made(parameters=UNSTABLE), vector(2, parameters=UNSTABLE)
        environment.reset(seed=0)
        together.reset(seed=0)
        for _ in range(20):
            observation, reward, terminated, truncated, info = environment.step(np.array(2 * GAIT))
            ended, infos = together.step(np.array(2 * [2 * GAIT], dtype=np.float32))[2::2]
            assert terminated == ended[0]
            if terminated:
                break
    assert terminated and not truncated and not info['is_success']
    assert 'solver.time_step is 0.025 s' in info['divergence'] == infos['divergence'][0]
    assert np.isfinite(observation).all() and observation in environment.observation_space and math.isfinite(reward)
    together.close()


def test_the_target_of_a_seed_does_not_depend_on_the_options():
    one, other = (made(**options).reset(seed=4)[1]['target'] for options in ({}, RANDOM))
    np.testing.assert_array_equal(one, other)


def test_targets_lie_where_the_options_say():
    environment = made(nearest_target=1.0, farthest_target=1.5, largest_bearing=0.5, largest_height=0.2)
    environment.reset(seed=0)
    x, y, z = np.array([environment.reset()[1]['target'] for _ in range(200)]).T
    away, bearing = np.hypot(x, y), np.arctan2(y, x)
    assert 1.0 <= away.min() < 1.1 and 1.4 < away.max() <= 1.5
    assert -0.5 <= bearing.min() < -0.4 and 0.4 < bearing.max() <= 0.5
    assert -0.2 <= z.min() < -0.15 and 0.15 < z.max() <= 0.2


def test_randomized_robots_differ_and_noise_disturbs_only_what_is_observed():
    plain, noisy, randomized, drifting = (
        episode(made(**options), 3) for options in (
            {}, {name: value for name, value in RANDOM.items() if 'noise' in name}, {'randomization': 0.2},
            {'largest_current': 0.3}))
    np.testing.assert_array_equal(noisy[2], plain[2])  # the true distances
    assert np.abs(noisy[0] - plain[0])[:, :13].max(axis=0).min() > 0.0
    np.testing.assert_array_equal(noisy[0][:, 13:], plain[0][:, 13:])
    assert not np.array_equal(randomized[2], plain[2]) and not np.array_equal(drifting[2], plain[2])
    assert np.abs(drifting[2] - plain[2]).max() > 0.01  # m


def test_both_configurations_are_robots_of_the_environment():
    for parameters in (str(CONFIG / 'manta.yaml'), CONFIG / 'freshwater.yaml', Parameters()):
        environment = made(parameters=parameters)
        environment.reset(seed=0)
        for _ in range(10):
            *_, info = environment.step(np.array(2 * GAIT))
        assert info['work'] > 0.0 and 'divergence' not in info


def test_the_robot_is_that_of_fresh_water_with_fewer_chains():
    fresh = Parameters.from_yaml(CONFIG / 'freshwater.yaml')
    robot = learning.ROBOT
    assert robot.fin.chains < fresh.fin.chains and robot.solver.time_step > fresh.solver.time_step
    assert robot.replace(fin={'chains': fresh.fin.chains}, solver={'time_step': fresh.solver.time_step}) == fresh
    swum = []
    for parameters in (robot, fresh):
        simulator = Simulator(parameters)
        gait = FinCommand(0.7, 0.6, 0.7)
        simulator.command(left=gait, right=gait)
        ahead = simulator.advance(8.0).position[0]
        simulator.command(left=gait, right=FinCommand(0.7, 0.6, 0.35))
        turned = yaw_of(simulator.advance(4.0))
        swum.append((ahead, turned))
    np.testing.assert_allclose(*swum, rtol=0.01)  # measured: 0.3 %


def yaw_of(state):
    x, y, z, w = state.orientation
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


@pytest.mark.parametrize(('options', 'words'), [
    ({'parameters': 3}, 'parameters is 3, but must be Parameters or the path'),
    ({'action': 'thrust'}, "action is 'thrust', but must be gait or rods"),
    ({'control_period': 0.013}, 'control_period is 0.013 s, but must be a multiple of 4 steps'),
    ({'randomization': 0.9}, 'randomization is 0.9, but must be from 0 to 0.5'),
    ({'noise': 0.1}, 'noise is no option; the options are action, control_period'),
    ({'nearest_target': 5.0}, 'nearest_target is 5 m, but must be at most farthest_target, 4 m'),
    ({'reach': 2.0}, 'reach is 2 m, but must be less than nearest_target, 2 m'),
    ({'parameters': Parameters().replace(rods={'support_length': 0.1})}, 'but the support closes only below'),
])
def test_a_bad_option_is_refused_by_name(options, words):
    for environment in (learning.SwimEnv, learning.SwimVectorEnv):
        with pytest.raises(ValueError, match=words.replace('(', r'\(')):
            environment(**options)


def test_bad_actions_seeds_and_targets_are_refused():
    environment, together = learning.SwimEnv(), learning.SwimVectorEnv(2)
    environment.reset()
    for action in (np.zeros(3), np.full(8, math.nan)):
        with pytest.raises(ValueError, match='must be 8 finite numbers'):
            environment.step(action)
    with pytest.raises(ValueError, match='target is .*must be three finite numbers'):
        environment.reset(options={'target': [1.0, math.inf, 0.0]})
    with pytest.raises(ValueError, match="options has 'goal', but can have target only"):
        environment.reset(options={'goal': [1.0, 0.0, 0.0]})
    with pytest.raises(ValueError, match='seed has 3 entries, but must have one for each of 2 robots'):
        together.reset(seed=[1, 2, 3])
    together.reset(seed=0)
    with pytest.raises(ValueError, match=r'actions has shape \(8,\), but must have \(2, 8\)'):
        together.step(np.zeros(8, dtype=np.float32))
    with pytest.raises(ValueError, match='num_envs is 0, but must be at least 1'):
        learning.SwimVectorEnv(0)
    together.close()


def test_the_first_step_before_a_reset_is_refused():
    with pytest.raises(gymnasium.error.ResetNeeded):
        made().step(np.zeros(8, dtype=np.float32))

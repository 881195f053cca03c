"""Servos turn the rods to commanded angles: second order, with a limit of the rate, and the support always closes."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from manta_sim_ros.dynamics import FinCommand, Parameters, Simulator, State
from manta_sim_ros.dynamics.command import closure_angle

PARAMETERS = Parameters().replace(fin={'chains': 4, 'links': 2})
COUPLINGS = {name: PARAMETERS.replace(solver={'coupling': name}) for name in ('sequential', 'monolithic')}
SWIM = FinCommand(amplitude=0.7, frequency=0.6, phase=0.7)
T, LIMIT = PARAMETERS.rods.servo_time_constant, PARAMETERS.rods.servo_rate_limit
LEVEL = (0.0, 0.0)


@pytest.mark.parametrize('parameters', COUPLINGS.values(), ids=COUPLINGS)
def test_a_small_command_is_followed_with_critical_damping(parameters):
    simulator = Simulator(parameters)
    simulator.command_rods(left=(0.1, 0.05), right=(-0.1, 0.0))
    for tick in range(1, 30):
        state, t = simulator.advance(0.01), 0.01 * tick
        share = 1.0 - (1.0 + t / T) * math.exp(-t / T)
        rate = t / T**2 * math.exp(-t / T)
        expected = np.array([[0.1, 0.05], [-0.1, 0.0]])
        np.testing.assert_allclose(state.rod_angles, share * expected, atol=1e-13)
        np.testing.assert_allclose(state.rod_rates, rate * expected, atol=1e-11)


def test_a_large_command_is_followed_at_the_limit_of_the_rate():
    simulator = Simulator(PARAMETERS.replace(solver={'time_step': 1e-4}))
    simulator.command_rods(left=(1.2, 1.2), right=(-1.5, -1.5))
    targets = np.array([1.2, -1.5])

    def derivative(_, y):
        wanted = np.clip((targets - y[:2]) / (2.0 * T), -LIMIT, LIMIT)
        return np.concatenate([y[2:], 2.0 / T * (wanted - y[2:])])

    times = np.arange(1, 40) * 0.02
    exact = solve_ivp(derivative, (0.0, 1.0), np.zeros(4), t_eval=times, rtol=1e-9, atol=1e-11, max_step=1e-3).y
    states = [simulator.advance(0.02) for _ in times]
    rates = np.array([state.rod_rates for state in states])
    assert np.abs(rates).max() <= LIMIT
    assert rates[:, 0].max() == pytest.approx(LIMIT, rel=1e-2) and rates[:, 1].min() == pytest.approx(-LIMIT, rel=1e-2)
    for rod in range(2):
        np.testing.assert_allclose([state.rod_angles[:, rod] for state in states], exact[:2].T, atol=2e-4)
        np.testing.assert_allclose(rates[:, :, rod], exact[2:].T, atol=2e-2)


@pytest.mark.parametrize('seed', range(6))
def test_the_support_closes_on_every_way_and_the_rate_keeps_its_limit(seed):
    random = np.random.default_rng(seed)
    parameters = PARAMETERS.replace(rods={
        'servo_time_constant': random.uniform(0.01, 0.1), 'servo_rate_limit': random.uniform(3.0, 10.0)})
    simulator = Simulator(parameters)
    bound, limit = closure_angle(parameters.rods), parameters.rods.servo_rate_limit
    apart, fastest = [], []
    for _ in range(60):
        left, right = random.uniform(-math.pi / 2, math.pi / 2, (2, 2))
        simulator.command_rods(left=random.choice([left, np.sign(left) * (1.5, -1.5)]), right=right)
        for _ in range(random.integers(1, 20)):
            state = simulator.advance(0.02)
            apart.append(np.abs(state.rod_angles[:, 0] - state.rod_angles[:, 1]).max())
            fastest.append(np.abs(state.rod_rates).max())
    assert 0.9 * bound < max(apart) < bound
    assert max(fastest) <= limit * (1.0 + 1e-12)


def test_a_command_too_far_apart_is_held_at_the_bound():
    simulator = Simulator(PARAMETERS)
    simulator.command_rods(left=(1.5, -1.0), right=(-1.0, 1.0))
    bound = 0.95 * closure_angle(PARAMETERS.rods)
    np.testing.assert_allclose(
        simulator.state.rod_command, [[0.25 + bound / 2, 0.25 - bound / 2], [-bound / 2, bound / 2]])
    np.testing.assert_allclose(simulator.advance(3.0).rod_angles, simulator.state.rod_command, atol=1e-6)
    simulator.command_rods(left=(0.5, -0.5), right=LEVEL)
    assert simulator.state.rod_command.tolist() == [[0.5, -0.5], [0.0, 0.0]]


@pytest.mark.parametrize('parameters', COUPLINGS.values(), ids=COUPLINGS)
def test_angles_and_rates_do_not_jump_from_a_gait_to_servos_and_back(parameters):
    simulator = Simulator(parameters.replace(solver={'time_step': 1e-3}))

    def changes(steps=40):
        states = [simulator.state, *(simulator.advance(0.001) for _ in range(steps))]
        return [max(np.abs(getattr(after, name) - getattr(before, name)).max()
                    for before, after in itertools.pairwise(states)) for name in ('rod_angles', 'rod_rates')]

    simulator.command(left=SWIM, right=SWIM)
    simulator.advance(2.3)
    assert simulator.state.rod_command is None and np.abs(simulator.state.rod_rates).max() > 1.0
    for change in (
            lambda: simulator.command_rods(left=(0.3, -0.2), right=(0.1, 0.4)),
            lambda: simulator.command_rods(left=LEVEL, right=(-0.3, 0.3)),
            lambda: simulator.command(left=SWIM, right=SWIM)):
        change()
        angle, rate = changes()
        assert angle < 0.001 * LIMIT and rate < 0.001 * 4.0 * LIMIT / T
    simulator.advance(5.0)
    assert simulator.state.rod_command is None
    swimming = Simulator(simulator.parameters)
    swimming.command(left=SWIM, right=SWIM)
    np.testing.assert_allclose(simulator.state.gait, swimming.advance(8.0).gait, atol=1e-8)


@pytest.mark.parametrize('parameters', COUPLINGS.values(), ids=COUPLINGS)
def test_steps_and_restarts_give_the_same_bits(parameters):
    once, parts = Simulator(parameters), Simulator(parameters)
    for simulator in (once, parts):
        simulator.command_rods(left=(0.9, 0.7), right=(-0.4, 0.8))
    whole = once.advance(0.6)
    parts.advance(0.2)
    parts = Simulator(parameters, state=dataclasses.replace(parts.state))
    parts.advance(0.4)
    for field in dataclasses.fields(State):
        assert np.array_equal(getattr(whole, field.name), getattr(parts.state, field.name)), field.name
    assert np.linalg.norm(whole.twist) > 1e-3


def test_the_motors_do_the_work_that_the_fins_take():
    simulator = Simulator(COUPLINGS['monolithic'])
    simulator.command_rods(left=(0.6, 0.6), right=(0.6, 0.6))
    state = simulator.advance(0.1)
    np.testing.assert_allclose(state.rod_power, np.sum(state.rod_torques * state.rod_rates))
    assert state.rod_power > 0.5 and state.twist[2] < -1e-3  # fins up, body down


@pytest.mark.parametrize(('angles', 'words'), [
    ((0.1,), r'the left command has shape \(1,\), but must have \(2,\)'),
    ((math.nan, 0.0), 'the left command must be finite, but has nan'),
    ((0.0, 1.6), r'left rear rod is commanded to 1\.6 rad, but must be within \+-1\.571'),
    ((-2.0, 0.0), r'left front rod is commanded to -2 rad'),
    ('no', 'the left command is .*no'),
    (None, 'the left command is None'),
])
def test_invalid_angles_are_refused_and_nothing_changes(angles, words):
    simulator = Simulator(PARAMETERS)
    before = simulator.state
    with pytest.raises(ValueError, match=words):
        simulator.command_rods(left=angles, right=LEVEL)
    assert simulator.state is before


def test_servos_refuse_what_they_could_not_hold():
    simulator = Simulator(PARAMETERS.replace(rods={'servo_time_constant': 0.001}))
    with pytest.raises(ValueError, match=r'rods.servo_time_constant is 0.001 s, but must be at least solver.time_step'):
        simulator.command_rods(left=LEVEL, right=LEVEL)
    wide = FinCommand(amplitude=0.9, frequency=0.3, phase=2.0)  # the rods come 1.6 rad apart
    simulator = Simulator(PARAMETERS.replace(
        rods={'servo_time_constant': 1.0, 'command_time_constant': 0.0}, solver={'time_step': 5e-4}))
    simulator.command(left=wide, right=wide)
    refused = 0
    for _ in range(40):
        before = simulator.advance(0.025)
        try:
            simulator.command_rods(left=LEVEL, right=LEVEL)
        except ValueError as error:
            assert 'the left rods cannot be taken over from the present gait: they come' in str(error)
            refused += 1
            assert simulator.state is before
        else:
            largest = np.abs(np.diff([simulator.advance(0.02).rod_angles for _ in range(40)], axis=-1)).max()
            assert largest < closure_angle(PARAMETERS.rods)
        simulator.reset(before)
        simulator.command(left=wide, right=wide)
    assert 0 < refused < 40


def test_a_state_with_servos_and_a_gait_is_refused():
    simulator = Simulator(PARAMETERS)
    simulator.command(left=SWIM, right=SWIM)
    with pytest.raises(ValueError, match='state.gait_commands has .* but must have zeros with servos'):
        dataclasses.replace(simulator.state, servos=True)
    with pytest.raises(ValueError, match=r"state.servos is 'yes', but must be true or false"):
        dataclasses.replace(simulator.state, servos='yes')

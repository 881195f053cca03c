"""`linearize`: the periodic motion is one, and the linear model predicts what the simulator does."""

import dataclasses
import math
import os
import re
import subprocess

import numpy as np
import pytest
import scipy.linalg

from evidence.harness.processes import LIMIT, command_of
from evidence.scenarios import assert_close
from manta_sim_ros.dynamics import FinCommand, Parameters, Simulator, simulate_batch
from manta_sim_ros.figures.gaits import IN_WATER
from manta_sim_ros.studies import poincare
from manta_sim_ros.studies.gaits import gaits_of
from manta_sim_ros.studies.linearize import INPUTS, linearize, main
from manta_sim_ros.studies.poincare import NoEquilibriumError, PeriodMap

FEW = Parameters().replace(**IN_WATER).replace(fin={'chains': 4})
CRUISE, TURN = gaits_of('30,30,0.5,0.5,40,40'), gaits_of('30,20,0.5,0.5,40,40')
GAITS = {'cruise': CRUISE, 'turn': TURN}
PERIODS = 6
CHANGE = 1e-3  # of an input [rad, Hz]
PREDICTED = 0.05
"""Largest error of a prediction over PERIODS periods, as a share of the largest response: measured, up to 0.03."""


@pytest.fixture(scope='module')
def models():
    return {name: linearize(FEW, *gaits) for name, gaits in GAITS.items()}


@pytest.fixture(params=GAITS)
def model(models, request):
    return models[request.param]


def swim(model, start, gaits, periods=PERIODS):
    """Return the coordinates of the body (periods, n) after each period, from a simulator of one robot."""
    period_map = PeriodMap(FEW, *model.gaits)
    simulator = Simulator(period_map.parameters, start)
    simulator.command(left=gaits[0], right=gaits[1])
    return np.array([period_map.coordinates(simulator.advance(period_map.period)) for _ in range(periods)])


def predicted(model, x, u):
    """Return the states of the body (PERIODS, n) that the model predicts."""
    states = []
    for _ in range(PERIODS):
        x = model.A @ x + model.B @ u
        states.append(x[:model.size])
    return np.array(states)


def test_the_equilibrium_repeats_itself_but_for_place_and_heading(model):
    after = Simulator(PeriodMap(FEW, *model.gaits).parameters, model.equilibrium).advance(model.period)
    np.testing.assert_allclose(after.twist, model.equilibrium.twist, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(after.joint_angles, model.equilibrium.joint_angles, rtol=0.0, atol=1e-8)
    z, w = after.orientation[2:]
    assert 2.0 * np.arctan2(z, w) == pytest.approx(model.heading_rate * model.period, abs=1e-3)
    assert model.means[0] > 0.05
    assert (model.heading_rate == 0.0) == (model.gaits == CRUISE)


@pytest.mark.parametrize('index', range(len(INPUTS)), ids=INPUTS)
def test_a_small_step_of_each_input_is_predicted(model, index):
    values = np.array([gait.as_array() for gait in model.gaits])
    step = CHANGE * np.eye(len(INPUTS))[index]
    up, down = (
        swim(model, model.equilibrium, [FinCommand(*fin) for fin in values + sign * step.reshape(2, 5)])
        for sign in (1.0, -1.0))
    assert_close(predicted(model, np.zeros(len(model.states)), step), 0.5 * (up - down), PREDICTED)


@pytest.mark.parametrize('index', [0, 2, 3, 8])  # of the frequency, the cycle angles are a part
def test_a_gait_that_is_in_force_acts_on_the_body_as_body_B_says(model, index):
    step = CHANGE * np.eye(len(INPUTS))[index].reshape(2, 5)
    after = []
    for sign in (1.0, -1.0):
        gait = model.equilibrium.gait + sign * step
        start = dataclasses.replace(model.equilibrium, gait=gait, gait_commands=gait)
        after.append(swim(model, start, [FinCommand(*fin) for fin in gait], periods=1)[0])
    assert_close(model.body_B[:, index], (after[0] - after[1]) / (2.0 * CHANGE), 1e-3)


def test_a_small_disturbance_of_the_body_is_predicted(model):
    period_map = PeriodMap(FEW, *model.gaits)
    for index in range(model.size):
        step = CHANGE * np.eye(len(model.states))[index]
        up, down = (
            swim(model, period_map.moved(
                model.equilibrium, period_map.coordinates(model.equilibrium) + sign * step[:model.size]), model.gaits)
            for sign in (1.0, -1.0))
        assert_close(predicted(model, step, np.zeros(len(INPUTS))), 0.5 * (up - down), PREDICTED)


def test_the_outputs_are_the_means_over_the_period(model):
    period_map = PeriodMap(FEW, *model.gaits)
    gaits = [dataclasses.replace(gait, amplitude=gait.amplitude + 1e-4) for gait in model.gaits]
    record, = simulate_batch(
        period_map.parameters, [model.equilibrium], [gaits], period_map.period, every=period_map.period / 50)
    mean = np.mean([0.5 * (before.twist + after.twist)
                    for before, after in zip([model.equilibrium, *record], record)], axis=0)
    change = model.D @ [1e-4 * name.endswith('amplitude') for name in INPUTS]
    assert_close(change[:6], mean - model.means[:6], 1e-2)


def test_the_slow_modes_are_those_of_the_body_with_all_its_joints(models):
    """Reference: the derivatives of the whole map, joints included, which no projection to the body touches."""
    model = models['cruise']
    period_map = PeriodMap(FEW, *CRUISE)
    state, size = model.equilibrium, model.equilibrium.joint_angles.size

    def vector(one):
        return np.concatenate([period_map.coordinates(one), one.joint_angles.ravel(), one.joint_rates.ravel()])

    def with_vector(values):
        angles, rates = values[8:].reshape(2, *state.joint_angles.shape)
        return dataclasses.replace(period_map.moved(state, values[:8]), joint_angles=angles, joint_rates=rates)

    steps = 1e-5 * np.eye(8 + 2 * size)
    after = simulate_batch(
        period_map.parameters, [with_vector(vector(state) + sign * step) for step in steps for sign in (1, -1)], None,
        period_map.period)
    values = np.array([vector(one) for one in after])
    whole = np.linalg.eigvals((values[::2] - values[1::2]).T / 2e-5)
    slow = sorted(whole, key=abs, reverse=True)[:6]
    for value in slow:
        assert np.abs(model.eigenvalues - value).min() < 0.02  # measured: 0.01
    assert abs(slow[-1]) > 0.1 and sorted(np.abs(whole))[-7] < 0.1  # the other two are as fast as the fins


def test_a_cruise_is_symmetric(models):
    model = models['cruise']
    along, across = [0, 2, 4, 7], [1, 3, 5, 6]
    assert not model.body_A[np.ix_(along, across)].round(8).any()
    assert not model.body_A[np.ix_(across, along)].round(8).any()
    mirror = np.array([1, -1, 1, -1, 1, -1, -1, 1])
    np.testing.assert_allclose(model.B[:8, :5], mirror[:, None] * model.B[:8, 5:], atol=1e-7)


def test_the_gait_and_its_cycle_are_states_of_their_own(model):
    psi = model.states.index('psi_left')
    frequency = INPUTS.index('left_frequency')
    gait = model.states.index('left_frequency')
    whole_turns = model.B[psi, frequency] + model.A[psi, gait]
    assert whole_turns == pytest.approx(2.0 * np.pi * model.period, rel=1e-6)
    assert model.A[psi, psi] == pytest.approx(1.0, abs=1e-8)
    decay = model.period / FEW.rods.command_time_constant
    assert model.A[gait, gait] == pytest.approx((1.0 + decay) * np.exp(-decay), abs=1e-8)


def test_commands_that_act_at_once_leave_no_gait_among_the_states():
    model = linearize(FEW.replace(rods={'command_time_constant': 0.0}), *CRUISE)
    assert model.states[-1] == 'psi_right' and model.A.shape == (10, 10) and model.B.shape == (10, 10)
    assert np.array_equal(model.body_B, model.B[:8])


def test_the_continuous_equivalent_gives_the_same_states_after_a_period(model):
    A, B = model.continuous()
    n = model.size
    held = scipy.linalg.expm(model.period * np.block([[A, B], [np.zeros((len(INPUTS), n + len(INPUTS)))]]))
    np.testing.assert_allclose(held[:n, :n], model.body_A, atol=2e-3)  # an eigenvalue below the limit is raised to it
    np.testing.assert_allclose(held[:n, n:], model.body_B, atol=2e-3)


def test_a_mode_that_changes_its_sign_has_no_continuous_equivalent(model):
    A = model.A.copy()
    A[:model.size, :model.size] = np.diag([0.9, 0.5, -0.25, 0.1, 0.1, 0.1, 0.1, 0.1])
    with pytest.raises(ValueError, match=r'an eigenvalue is -0\.25 per period'):
        dataclasses.replace(model, A=A).continuous()


def test_the_model_is_one_of_python_control(model):
    control = pytest.importorskip('control')
    system = model.state_space()
    assert system.dt == model.period and system.input_labels == list(INPUTS)
    response = control.forced_response(system, U=np.outer(np.eye(10)[0], np.ones(3)), T=model.period * np.arange(3))
    expected = model.C @ model.B[:, 0] + model.D[:, 0]
    np.testing.assert_allclose(response.outputs[:, 1], expected, atol=1e-12)


@pytest.mark.parametrize(('gait', 'groups', 'words'), [
    ('30,30,0.5,0.6,40,40', {}, r'0\.5 Hz left and 0\.6 Hz right'),
    ('30,0,0.5,0.5,40,40', {}, 'the right amplitude is 0 rad, but must be above'),
    ('30,30,0,0,40,40', {}, 'the left frequency is 0 Hz, but must be above'),
    ('30,30,0.5,0.5,40,40', {'water': {'current': (0.1, 0.0, 0.0)}}, r'water\.current is \[0\.1, 0\.0, 0\.0\]'),
    ('30,30,0.5,0.5,40,40', {'solver': {'fixed_base': True}}, r'solver\.fixed_base is true, but must be false'),
    ('30,30,0.5,0.5,40,40', {'solver': {'time_step': 0.02}}, r'solver\.time_step is 0\.02 s, but the largest stable'),
])
def test_what_has_no_periodic_motion_is_refused(gait, groups, words):
    with pytest.raises(ValueError, match=words):
        linearize(FEW.replace(**groups), *gaits_of(gait))


def test_in_fresh_water_the_turn_is_stable_and_the_straight_cruise_is_not():
    fresh = Parameters().replace(**IN_WATER)
    assert linearize(fresh, *TURN).stable
    cruise = linearize(fresh, *CRUISE)
    assert not cruise.stable and cruise.time_constants[0] < -20.0  # it leaves its heading slowly
    assert cruise.means[0] > 0.2


def test_a_robot_that_tumbles_has_no_equilibrium():
    low = FEW.replace(body={'buoyancy_center': (0.0, 0.0, -0.05)})
    with pytest.raises(NoEquilibriumError, match=r'^no equilibrium: the robot tumbles, roll is .* within 80$'):
        linearize(low, *TURN)


def test_a_robot_that_floats_has_a_depth():
    floating = FEW.replace(water={'surface_height': 0.05}, body={'net_buoyancy': 20.0})
    model = linearize(floating, *gaits_of('15,15,0.5,0.5,40,40'))
    assert model.states[8] == 'z' and model.size == 9
    assert abs(model.body_A[8, 8]) < 0.5  # it comes back to its depth
    assert abs(model.climb_rate) < 1e-8


@pytest.mark.parametrize(('step', 'problem'), [
    (None, 'after 30 iterations'), (math.inf, 'the robot leaves the surface')])
def test_no_equilibrium_is_found_far_below_the_surface(step, problem, monkeypatch):
    if step is not None:
        monkeypatch.setattr(poincare, 'DEEPEST_STEP', step)
    bobbing = FEW.replace(
        fin={'chains': 6, 'links': 2}, water={'surface_height': 0.02}, body={'net_buoyancy': 1.0})
    with pytest.raises(NoEquilibriumError, match=f'^no equilibrium: {problem}'):
        linearize(bobbing, *gaits_of('10,10,0.5,0.5,40,40'))


def test_the_heading_rate_is_that_of_a_turn_of_more_than_half_a_circle_in_a_period():
    nimble = FEW.replace(fin={'chains': 6, 'links': 2}, body={'quadratic_damping': (0.0, 0.0, 0.0, 2.7, 6.4, 0.2)})
    model = linearize(nimble, *gaits_of('40,40,0.5,0.5,40,0'))
    assert abs(model.heading_rate * model.period) > math.pi
    assert model.heading_rate == pytest.approx(model.means[5], rel=0.02)


def test_the_command_prints_and_writes_the_model(tmp_path):
    ended = subprocess.run(
        [*command_of('linearize'), '--gait', '30,30,0.5,0.5,40,40', '--output', 'model.npz'], cwd=tmp_path,
        capture_output=True, text=True, timeout=LIMIT)
    assert ended.returncode == 0, ended.stderr
    assert 'equilibrium over a period of 2 s: straight' in ended.stdout
    assert [path.name for path in tmp_path.iterdir()] == ['model.npz']
    with np.load(tmp_path / 'model.npz') as saved:
        assert saved['A'].shape == (20, 20) and saved['B'].shape == (20, 10) and saved['C'].shape == (8, 20)
        assert saved['equilibrium_joint_angles'].shape == (2, 30, 3)
        first = re.search(r'largest parts\n +(\S+) ', ended.stdout)[1]
        assert float(first) == pytest.approx(saved['eigenvalues'][0].real, abs=1e-4)


@pytest.mark.parametrize(('output', 'status', 'line'), [
    ('closed pipe', 0, ''), ('/dev/full', 1, 'linearize: [Errno 28] No space left on device\n')])
def test_the_model_is_written_although_it_cannot_be_printed(output, status, line, tmp_path):
    if output == '/dev/full':
        writes = os.open(output, os.O_WRONLY)
    else:
        reads, writes = os.pipe()
        os.close(reads)
    ended = subprocess.run(
        [*command_of('linearize'), '--gait', '30,30,0.5,0.5,40,40', '--output', 'model.npz'], cwd=tmp_path,
        stdout=writes, stderr=subprocess.PIPE, text=True, timeout=LIMIT, env=os.environ | {'PYTHONUNBUFFERED': '1'})
    os.close(writes)
    assert (ended.returncode, ended.stderr) == (status, line)
    assert [path.name for path in tmp_path.iterdir()] == ['model.npz']


@pytest.mark.parametrize(('arguments', 'status', 'line'), [
    ([], 2, 'the following arguments are required: --gait'),
    (['--gait', '30,30,0.5,0.5,40'], 2, r"'30,30,0.5,0.5,40' has 5 values, but must have 6 \(A_l,.*\) or 10"),
    (['--gait', '30,30,0.5,much,40,40'], 2, "'much' is not a number"),
    (['--gait', '30,120,0.5,0.5,40,40'], 2,
     r'right amplitude 120 degrees: amplitude is 2\.09.*, but must be from 0 to 1\.57'),
    (['--gait', '30,30,0.5,0.6,40,40'], 2, 'the frequencies are 0.5 Hz left and 0.6 Hz right'),
    (['--gait', '30,30,0.5,0.5,40,40', '--config', 'none.yaml'], 2, "No such file or directory: 'none.yaml'"),
    (['--gait', '30,30,0.5,0.5,40,40', '--output', 'no/model.npz'], 2, '--output is no/model.npz, but must be a .npz'),
    (['--gait', '30,30,0.5,0.5,40,40', '--output', 'thesis.tex'], 2, '--output is thesis.tex, but must be a .npz file'),
    (['--gait', '-30,30,0.5,0.5,40,40'], 2, r'left amplitude -30 degrees: amplitude is -0\.52.*, but must be from 0'),
    (['--gait', '30,30,0.5,0.5,40,360'], 2, r'the right phase is 6\.28319, but must be 1e-05 away from its bounds'),
    (['--gait', '30,20,0.5,0.5,40,40'], 1, 'no equilibrium: after 30 iterations'),  # chordwise instability
])
def test_the_command_refuses_in_one_line(arguments, status, line, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr('sys.argv', ['linearize', *arguments])
    with pytest.raises(SystemExit) as ended:
        main()
    printed = capsys.readouterr()
    text = printed.err if status == 2 else f'{ended.value.code}\n'
    assert (ended.value.code == 2) == (status == 2) and not printed.out and not list(tmp_path.iterdir())
    only, = text.splitlines()
    assert re.search(f'^linearize: .*{line}', only)

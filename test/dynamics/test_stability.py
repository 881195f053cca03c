"""The largest stable step: against steps at which simulations diverge, against exact formulas, and in warnings."""

import dataclasses
import math
import re
import warnings

import numpy as np
import pytest

from evidence.references import equations
from evidence.scenarios import SWIM, WATER_OF_BODY, largest_rate, sized
from manta_sim_ros.dynamics import (
    FinCommand,
    ModelWarning,
    Parameters,
    Simulator,
    StabilityWarning,
    body_warning,
    fin_dynamics,
    largest_stable_step,
    turn_warning,
)
from manta_sim_ros.dynamics.harmonic import straight_fins
from manta_sim_ros.dynamics.stability import SAFETY, STEPS_PER_PERIOD, step_warning

REST = FinCommand(amplitude=0.0, frequency=0.0, phase=0.0)
FAST = FinCommand(amplitude=0.5, frequency=5.0, phase=0.35)
HELD = {'fixed_base': True}
MONOLITHIC = {'coupling': 'monolithic'}
LIGHT = {'mass': 3.0, 'inertia': (0.3, 0.3, 0.5)}
STILL = {'solver': HELD, 'water': {'density': 0.0}}

CASES = {
    'defaults': (SWIM, SWIM, {}),
    'turn': (SWIM, FinCommand(amplitude=0.35, frequency=0.6, phase=0.7), {}),
    'fast, held': (FinCommand(amplitude=0.35, frequency=5.0, phase=0.35), REST, {'solver': HELD}),
    'stiff': (SWIM, SWIM, {'fin': {'youngs_modulus': 1e9}}),
    'soft': (SWIM, SWIM, {'fin': {'youngs_modulus': 1e6}}),
    'without stiffness': (SWIM, SWIM, {'fin': {'youngs_modulus': 0.0}}),
    'damped': (SWIM, SWIM, {'fin': {'joint_damping': 1.0}}),
    'thin': (SWIM, SWIM, {'fin': {'thickness': 0.004}}),
    'two links, thin, held': (SWIM, SWIM, {'fin': {'links': 2, 'thickness': 0.004}, 'solver': HELD}),
    'one link': (SWIM, SWIM, {'fin': {'links': 1}}),
    'eight links': (SWIM, SWIM, {'fin': {'links': 8}}),
    'no water': (SWIM, SWIM, {'water': {'density': 0.0}}),
    'vertical current, held': (REST, REST, {'water': {'current': (0.0, 0.0, 1.0)}, 'solver': HELD}),
    'monolithic': (SWIM, SWIM, {'solver': MONOLITHIC}),
    'light body, added mass': (SWIM, SWIM, {
        'water': {'added_mass_coefficient': 1.0, 'density': 1000.0}, 'body': LIGHT, 'solver': MONOLITHIC}),
    'twist': (SWIM, SWIM, {'fin': {'shear_modulus': 3.8e7}}),
    'twist and body in water': (SWIM, SWIM, {
        'fin': {'shear_modulus': 4e6, 'twist_damping': 0.01}, 'body': WATER_OF_BODY, 'solver': MONOLITHIC}),
}


@pytest.mark.parametrize(('left', 'right', 'groups'), CASES.values(), ids=CASES)
def test_simulations_are_sound_at_the_largest_stable_step_and_diverge_at_one_and_a_half_of_it(left, right, groups):
    """Diverging means: an error, or joints twice as fast as they should be."""
    parameters = Parameters().replace(fin={'chains': 8}).replace(**groups)
    estimate = largest_stable_step(parameters, left, right)
    expected = largest_rate(parameters, estimate / 8.0, left, right)
    assert largest_rate(parameters, estimate, left, right) < 2.0 * expected
    assert largest_rate(parameters, 1.5 * estimate, left, right) > 2.0 * expected


def one_link(**fin):
    """Return parameters of one link a chain, held in no water, and its inertia [kg m] and stiffness [N]."""
    parameters = sized(4, 1, **STILL).replace(fin=fin)
    fin = parameters.fin
    inertia = fin.density * fin.thickness * fin.span**3 / 3.0
    return parameters, inertia, fin.youngs_modulus * fin.thickness**3 / 12.0 / fin.span


def test_an_undamped_link_has_the_limit_of_runge_and_kutta_on_the_imaginary_axis():
    parameters, inertia, stiffness = one_link(joint_damping=0.0)
    expected = SAFETY * math.sqrt(8.0) / math.sqrt(stiffness / inertia)
    assert largest_stable_step(parameters, REST, REST) == pytest.approx(expected, rel=1e-3)  # measured: 2e-4


@pytest.mark.parametrize('chains', [2, 4, 9])
def test_the_shortest_wave_along_the_chord_decides_the_step_of_a_fin_with_twist(chains):
    parameters, inertia, stiffness = one_link(joint_damping=0.0)
    parameters = parameters.replace(fin={'chains': chains, 'shear_modulus': 1e8})
    fin, ds = parameters.fin, parameters.rods.support_length / chains
    twist = fin.shear_modulus * fin.thickness**3 / 3.0 * fin.span / ds**2
    stiffest = stiffness + (2.0 + 2.0 * math.cos(math.pi / chains)) * twist
    expected = SAFETY * math.sqrt(8.0) / math.sqrt(stiffest / inertia)
    assert largest_stable_step(parameters, REST, REST) == pytest.approx(expected, rel=1e-3)  # as above


def test_a_damped_link_without_stiffness_has_the_limit_on_the_real_axis():
    parameters, inertia, _ = one_link(joint_damping=0.3, youngs_modulus=0.0)
    limit = -min(np.roots([1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0]).real)  # R(z) = 1: z (1 + z/2 + z^2/6 + z^3/24) = 0
    assert largest_stable_step(parameters, REST, REST) == pytest.approx(SAFETY * limit * inertia / 0.3, rel=1e-6)


def test_nothing_bounds_the_step_of_free_joints_without_damping_and_water():
    parameters, _, _ = one_link(joint_damping=0.0, youngs_modulus=0.0)
    assert largest_stable_step(parameters, REST, REST) == math.inf
    assert largest_stable_step(parameters, SWIM, SWIM) == pytest.approx(1.0 / (STEPS_PER_PERIOD * SWIM.frequency))


@pytest.mark.parametrize('links', [1, 3, 7])
def test_the_inertia_of_a_straight_chain_is_that_of_the_reference_implementation(links):
    parameters = sized(4, links)
    np.testing.assert_allclose(  # rounding
        straight_fins(parameters).inertia, equations.mass_matrix(parameters, np.zeros(links)), rtol=1e-12)


def test_the_step_falls_with_stiffness_damping_drag_frequency_and_links():
    def steps(*variants, gait=SWIM):
        return [largest_stable_step(Parameters().replace(**groups), gait, gait) for groups in variants]

    for falling in (
        steps(*({'fin': {'youngs_modulus': 1e8 * factor}} for factor in (0.3, 1.0, 3.0, 10.0))),
        steps(*({'fin': {'joint_damping': damping}} for damping in (0.3, 1.0, 3.0))),
        steps(*({'fin': {'drag_coefficient': drag}} for drag in (0.5, 2.0, 8.0)), gait=FAST),
        steps(*({'fin': {'links': links}} for links in (1, 2, 3, 5, 9))),
        [largest_stable_step(Parameters(), *2 * (dataclasses.replace(FAST, frequency=f),)) for f in (0.6, 2.5, 5.0)],
    ):
        assert all(before > after > 0.0 for before, after in zip(falling, falling[1:])), falling


def test_the_step_itself_has_no_influence():
    steps = {
        largest_stable_step(Parameters().replace(solver={'time_step': step}), SWIM, SWIM) for step in (1e-5, 0.1)}
    assert len(steps) == 1


def felt_over_body(parameters):
    """Return the largest ratio of what the body feels of its fins, their joints free, to its own inertia."""
    fin = parameters.fin
    joints = np.zeros((fin.chains, fin.links))
    felt = -sum(np.transpose([
        fin_dynamics(parameters, side, np.zeros((2, 3)), joints, joints, np.zeros(6), unit)[1] for unit in np.eye(6)
    ]) for side in range(2))
    root = np.sqrt([parameters.body.mass] * 3 + list(parameters.body.inertia))
    return float(np.linalg.eigvalsh(felt / root / root[:, None])[-1])


@pytest.mark.parametrize(('mass', 'stable'), [(2.1, False), (2.5, True)])
def test_no_step_of_the_sequential_coupling_is_stable_below_what_the_body_feels_of_its_fins(mass, stable):
    parameters = sized(8, 3).replace(body={'mass': mass})
    turn = dataclasses.replace(SWIM, amplitude=0.4)
    assert (felt_over_body(parameters) < 1.0) is stable
    assert (largest_stable_step(parameters, SWIM, turn) > 0.0) is stable
    assert math.isfinite(largest_rate(parameters, 5e-5, SWIM, turn, duration=0.3)) is stable
    assert largest_stable_step(parameters.replace(solver=MONOLITHIC), SWIM, turn) > 0.0


def test_a_command_beyond_the_largest_stable_step_warns_with_both_numbers_once():
    simulator = Simulator(Parameters().replace(solver={'time_step': 0.004}))
    largest = largest_stable_step(simulator.parameters, FAST, FAST)
    assert largest < 0.004 < largest_stable_step(simulator.parameters, SWIM, SWIM)
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        simulator.command(left=SWIM, right=SWIM)
    for _ in range(2):
        with pytest.warns(StabilityWarning) as caught:
            for amplitude in (0.5, 0.51, 0.52):
                gait = dataclasses.replace(FAST, amplitude=amplitude)
                simulator.command(left=gait, right=gait)
        numbers = re.fullmatch(r'solver\.time_step is (\S+) s, .* is about (\S+) s: .*', str(caught[0].message))
        assert len(caught) == 1 and caught[0].filename == __file__
        assert float(numbers[1]) == 0.004
        assert 0.9 * largest < float(numbers[2]) <= largest  # two digits, rounded down
        simulator.command(left=SWIM, right=SWIM)


def test_a_state_whose_gait_needs_a_smaller_step_is_warned_of_too():
    simulator = Simulator(sized(4, 2))
    simulator.command(left=FAST, right=FAST)
    coarse = simulator.parameters.replace(solver={'time_step': 0.05})
    with pytest.warns(StabilityWarning, match='0.05 s') as caught:
        Simulator(coarse, state=simulator.state)
        Simulator(coarse).reset(simulator.state)
    assert [warning.filename for warning in caught] == [__file__] * 2
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        Simulator(simulator.parameters, state=simulator.state)
        Simulator(coarse)


@pytest.mark.parametrize('groups', [
    {}, {'solver': MONOLITHIC}, {'fin': {'links': 2, 'drag_coefficient': 4.0}}, {'fin': {'thickness': 0.004}},
    {'fin': {'links': 1}}])
def test_no_gait_that_needs_a_smaller_step_goes_without_a_warning(groups):
    """A gait is not looked at by itself when all like it are stable: that must not hide one that is not."""
    parameters, random, warned = Parameters().replace(**groups), np.random.default_rng(4), 0
    for _ in range(40):
        left, right = (FinCommand(*random.uniform((0.0, 0.0, -0.5), (0.9, 5.0, 0.5))) for _ in range(2))
        largest = largest_stable_step(parameters, left, right)
        for time_step, wanted in ((0.999 * largest, False), (min(1.001 * largest, 0.1), largest < 0.099)):
            warning = step_warning(parameters.replace(solver={'time_step': time_step}), left, right)
            assert (warning is not None) is wanted, (left, right)
            warned += warning is not None
    assert warned


def test_fins_too_heavy_for_the_sequential_coupling_are_warned_of_with_the_way_out():
    with pytest.warns(StabilityWarning, match=r'0\.002 s, .* 0 s: .* set it to monolithic'):
        Simulator(Parameters().replace(body={'mass': 2.0})).command(left=SWIM, right=SWIM)


@pytest.mark.parametrize('groups', [
    {'rods': {'front_radius': 0.185, 'rear_radius': 0.235}}, {'body': {'inertia': (1.33, 0.001, 2.73)}},
    {'fin': {'span': 1e-3, 'thickness': 1e-5, 'density': 1.0}}, {'fin': {'links': 24}, 'solver': MONOLITHIC},
    {'fin': {'youngs_modulus': 1e13, 'links': 20}},
])
def test_any_valid_robot_and_gait_has_a_step_and_can_be_commanded(groups):
    parameters = sized(4, 3).replace(**groups)
    gait = FinCommand(amplitude=0.904, frequency=0.5, phase=0.0)  # with r_2 > r_1, little is left above it
    assert 0.0 <= largest_stable_step(parameters, gait, gait) <= 1.0 / (STEPS_PER_PERIOD * gait.frequency)
    simulator = Simulator(parameters)
    with warnings.catch_warnings():
        warnings.simplefilter('ignore', StabilityWarning)
        simulator.command(left=gait, right=gait)
    assert tuple(simulator.state.gait_commands[0, :2]) == (0.904, 0.5)


@pytest.mark.parametrize('frequency', [5e-324, 1e-308, 1e-12])
def test_a_gait_of_no_speed_is_rest(frequency):
    gait = FinCommand(amplitude=0.5, frequency=frequency, phase=0.2)
    assert largest_stable_step(Parameters(), gait, gait) == largest_stable_step(Parameters(), REST, REST)


def test_a_step_below_the_parameters_bound_is_not_recommended():
    parameters = sized(4, 20).replace(fin={'youngs_modulus': 1e13, 'span': 0.01})
    with pytest.warns(StabilityWarning, match=r'must be at least 1e-07 s: make the fins softer, or use fewer links'):
        Simulator(parameters).command(left=SWIM, right=SWIM)


def test_bad_commands_are_refused_by_name():
    for left, right, words in (
        (SWIM, (0.7, 0.6, 0.7), 'the right command is .* must be a FinCommand'),
        (dataclasses.replace(SWIM, amplitude=1.5, phase=3.0), SWIM, 'left amplitude 1.5 rad .* closes only below'),
    ):
        with pytest.raises(ValueError, match=words):
            largest_stable_step(Parameters(), left, right)


ADDED_MASS = {'added_mass': (1.4, 2.1, 106.0, 1.15, 2.4, 0.01)}
DAMPING = {'quadratic_damping': (0.0, 0.0, 0.0, 2.7, 0.0, 0.0), 'linear_damping': (0.0, 0.0, 0.0, 0.0, 0.0, 0.1)}


@pytest.mark.parametrize(('body', 'undamped'), [
    (ADDED_MASS, 'roll and yaw'), ({**ADDED_MASS, 'linear_damping': DAMPING['linear_damping']}, 'roll'),
    ({**ADDED_MASS, 'quadratic_damping': DAMPING['quadratic_damping']}, 'yaw')])
def test_added_mass_without_damping_in_roll_and_yaw_is_warned_of(body, undamped):
    reason = rf'^body\.added_mass is \[1\.4, .*no damping in {undamped}: .*linear_damping'
    with pytest.warns(ModelWarning, match=reason):
        Simulator(sized(4, 2).replace(body=body))


@pytest.mark.parametrize('body', [{}, DAMPING, {**ADDED_MASS, **DAMPING}])
def test_a_damped_body_and_one_without_added_mass_are_not_warned_of(body):
    assert body_warning(sized(4, 2).replace(body=body)) is None


def test_chordwise_instability_in_a_turn_is_warned_of_once():
    simulator = Simulator(sized(30, 3))
    left = dataclasses.replace(SWIM, frequency=0.8)
    simulator.command(left=left, right=dataclasses.replace(left, amplitude=0.35))
    reason = r'chordwise instability .* 0\.34 m/s .* fin\.chains, 30, .*fin\.shear_modulus'
    with pytest.warns(ModelWarning, match=reason) as seen:
        for _ in range(50):
            simulator.advance(0.1)
    assert len(seen) == 1
    assert turn_warning(simulator.parameters, simulator.state) is not None


@pytest.mark.parametrize(('fin', 'right'), [
    ({'chains': 30}, SWIM), ({'chains': 8, 'shear_modulus': 1e5}, dataclasses.replace(SWIM, amplitude=0.3))],
    ids=['straight', 'resistance to twist'])
def test_fins_that_are_stable_or_swim_straight_are_not_warned_of(fin, right):
    simulator = Simulator(Parameters().replace(fin=fin))
    simulator.command(left=SWIM, right=right)
    with warnings.catch_warnings():
        warnings.simplefilter('error', ModelWarning)
        for _ in range(100):
            simulator.advance(0.1)


@pytest.mark.parametrize('coupling', ['sequential', 'monolithic'])
@pytest.mark.parametrize(('chains', 'share'), [(8, 0.1), (8, 1.0), (12, 1.0), (30, 0.1)])
def test_the_step_of_fins_that_resist_twist_is_that_of_the_shortest_wave_along_the_chord(chains, share, coupling):
    parameters = Parameters().replace(
        fin={'chains': chains, 'shear_modulus': share * 1e8 / 2.6}, solver={'coupling': coupling})
    estimate = largest_stable_step(parameters, SWIM, SWIM)
    expected = largest_rate(parameters, estimate / 8.0, SWIM, SWIM, 1.0)
    assert largest_rate(parameters, estimate, SWIM, SWIM, 1.0) < 2.0 * expected
    assert largest_rate(parameters, 1.15 * estimate, SWIM, SWIM, 1.0) > 2.0 * expected  # measured: from 1.06 on


def test_damping_of_the_body_bounds_the_step_of_the_staggered_coupling():
    def step(damping):
        return largest_stable_step(Parameters().replace(
            water={'density': 0.0}, body={'linear_damping': (damping, 0.0, 0.0, 0.0, 0.0, 0.0)}), REST, REST)

    # 2 m / D of Euler's scheme, less what the fins feel one step late: a ninth of the mass of the body; measured: 0.88
    assert 0.8 < step(1e5) / (SAFETY * 2.0 * 20.0 / 1e5) < 1.0

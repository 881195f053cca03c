"""What holds for any valid parameters, state and gait, on examples that Hypothesis looks for."""

import collections
import dataclasses
import math

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from evidence.scenarios import MIRROR, bits
from manta_sim_ros.dynamics import (
    MONOLITHIC,
    SEQUENTIAL,
    FinCommand,
    Parameters,
    Simulator,
    State,
    fin_dynamics,
    largest_stable_step,
)
from manta_sim_ros.dynamics.state import SHAPES

pytestmark = pytest.mark.filterwarnings('ignore::manta_sim_ros.dynamics.StabilityWarning')
EXAMPLES = settings(
    max_examples=60, deadline=None, derandomize=True, database=None, suppress_health_check=list(HealthCheck))
SMALL = {'chains': 12, 'links': 6}  # more only takes longer
EXTENT = {  # elsewhere rounding outweighs the rest
    'fin.youngs_modulus': 1e9, 'fin.span': 1.0, 'fin.thickness': 0.05, 'fin.shear_modulus': 1e8,
    'fin.twist_damping': 1.0}


def number(low, high):
    """Return numbers from `low` to `high`, over all decades between where that spans many, and the bounds."""
    if low >= 0.0 and high > 1e3 * max(low, 1e-3):
        exponents = st.floats(math.log10(max(low, 1e-6 * high)), math.log10(high))
        return st.one_of(exponents.map(lambda e: min(max(10.0**e, low), high)), st.sampled_from((low, high)))
    return st.floats(low, high)


def group(name, moderate):
    """Return the groups of parameters of a name: each value within its bounds, or within 5 of its default."""
    kind, values = Parameters.groups()[name], {}
    for field, about in kind.quantities().items():
        default = getattr(kind(), field)
        if about.kind is bool:
            values[field] = st.booleans()
        elif about.kind is str:
            values[field] = st.sampled_from(about.choices)
        elif about.kind is int:
            values[field] = st.integers(int(about.low), SMALL.get(field, int(about.high)))
        else:
            low, high = about.low, min(about.high, EXTENT.get(f'{name}.{field}', math.inf)) if moderate else about.high
            one = number(low, high)
            if moderate and about.kind is float and default > 0.0:
                one = st.floats(max(low, default / 5.0), min(high, default * 5.0))
            values[field] = st.tuples(*about.size * (one,)) if about.kind is tuple else one
    return values


@st.composite
def parameters(draw, moderate=False):
    """Return valid parameters: of any size, or, if `moderate`, of robots that could be built."""
    groups = {
        name: {field: draw(value) for field, value in group(name, moderate).items()} for name in Parameters.groups()}
    if groups['solver']['coupling'] == SEQUENTIAL:
        groups['water']['added_mass_coefficient'] = 0.0
    rods = groups['rods']
    rods['support_length'] = max(rods['support_length'], 1.2 * abs(rods['front_radius'] - rods['rear_radius']))
    assume(rods['support_length'] <= 10.0)
    return Parameters().replace(**groups)


@st.composite
def moments(draw, of, rates=10.0, angles=3.0):
    """Return rod motion, joint angles and rates, body twist and acceleration of a fin with the parameters `of`."""
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    joints = (of.fin.chains, of.fin.links)
    swing = draw(st.floats(0.0, 0.3))
    return (
        random.uniform(-1.0, 1.0, (2, 3)) * [swing, rates, rates],
        random.uniform(-1.0, 1.0, joints) * draw(st.floats(0.0, angles)),
        random.uniform(-1.0, 1.0, joints) * draw(st.floats(0.0, rates)),
        random.uniform(-1.0, 1.0, 6) * draw(st.floats(0.0, 5.0)),
        random.uniform(-1.0, 1.0, 6) * draw(st.floats(0.0, 50.0)),
    )


@st.composite
def robots(draw, moderate=True, **ranges):
    of = draw(parameters(moderate=moderate))
    return of, draw(moments(of, **ranges))


def closes(of, rods):
    apart = np.subtract(*(
        radius * np.array([math.cos(angle), math.sin(angle)])
        for radius, angle in zip((of.rods.front_radius, of.rods.rear_radius), rods[:, 0])))
    return math.hypot(*apart) < 0.95 * of.rods.support_length


def inverse_mass_matrices(of, side, angles):
    """Return M^-1 (n, m, m) of all chains: what a torque at each joint adds to the joint accelerations.

    The torques are those of damping, whose coefficient is 1 in one of two evaluations and 0 in the other.
    """
    chains, links = angles.shape
    inverse = np.empty((chains, links, links))
    still = np.zeros(6)
    for joint in range(links):
        rates = np.zeros((chains, links))
        rates[:, joint] = -1.0
        with_damping, without = (
            fin_dynamics(of.replace(fin={'joint_damping': c}), side, np.zeros((2, 3)), angles, rates, still, still)[0]
            for c in (1.0, 0.0))
        inverse[:, :, joint] = with_damping - without
    return inverse


def soft(of):
    """Return the parameters without what would drown the difference of two evaluations in rounding."""
    return of.replace(
        fin={'youngs_modulus': 0.0, 'shear_modulus': 0.0, 'twist_damping': 0.0}, water={'density': 0.0})


@EXAMPLES
@given(robots())
def test_mass_matrices_of_the_chains_are_symmetric_with_positive_eigenvalues(robot):
    of, (_, angles, *_) = robot
    assume(closes(of, np.zeros((2, 3))))
    inverse = inverse_mass_matrices(soft(of), 0, angles)
    scale = np.abs(inverse).max(axis=(1, 2), keepdims=True)
    # derived: rounding, of sums of centrifugal terms some 10 times as large, grows with the condition, 1e6 at most
    np.testing.assert_allclose(inverse / scale, np.swapaxes(inverse, 1, 2) / scale, rtol=0.0, atol=1e-9)
    assert np.linalg.eigvalsh(inverse / scale).min() > 0.0


def felt_inertia(of, side, moment):
    """Return the inertia (6, 6) that a fin adds to the body: how its wrench falls with each acceleration."""
    *motion, _ = moment
    at_rest = fin_dynamics(of, side, *motion, np.zeros(6))[1]
    return np.stack([at_rest - fin_dynamics(of, side, *motion, unit)[1] for unit in 1e3 * np.eye(6)], axis=1) / 1e3


@EXAMPLES
@given(robots(angles=1.5), st.sampled_from((0, 1)))
def test_the_inertia_of_a_fin_that_the_body_feels_is_symmetric_and_never_negative(robot, side):
    of, moment = robot
    assume(closes(of, moment[0]))
    inertia = felt_inertia(soft(of), side, moment)
    size = np.sqrt(np.abs(np.diag(inertia)))
    scale = np.outer(size, size) + 1e-9 * np.abs(inertia).max()
    np.testing.assert_allclose(inertia / scale, inertia.T / scale, rtol=0.0, atol=1e-6)  # measured: 1e-8
    assert np.linalg.eigvalsh(inertia + inertia.T).min() > -1e-9 * np.abs(inertia).max()


@EXAMPLES
@given(robots())
def test_the_right_fin_is_the_left_one_in_a_mirror(robot):
    of, (rods, angles, rates, twist, acceleration) = robot
    assume(closes(of, rods))
    left = fin_dynamics(of, 0, rods, angles, rates, twist, acceleration)
    right = fin_dynamics(of, 1, rods, angles, rates, MIRROR * twist, MIRROR * acceleration)
    np.testing.assert_array_equal(right[0], left[0])
    np.testing.assert_array_equal(right[1], MIRROR * left[1])


@EXAMPLES
@given(robots(angles=1.0), st.sampled_from((0, 1)))
def test_drag_and_damping_take_energy_from_every_chain(robot, side):
    of, (_, angles, rates, *_) = robot
    assume(closes(of, np.zeros((2, 3))))
    inverse = inverse_mass_matrices(soft(of), side, angles)

    def accelerations(density, damping):
        changed = soft(of).replace(water={'density': density}, fin={'joint_damping': damping})
        return fin_dynamics(changed, side, np.zeros((2, 3)), angles, rates, np.zeros(6), np.zeros(6))[0]

    without = accelerations(0.0, 0.0)
    for density, damping in ((of.water.density, 0.0), (0.0, of.fin.joint_damping)):
        gained = accelerations(density, damping) - without
        power = np.einsum('kj,kj->k', rates, np.linalg.solve(inverse, gained[..., np.newaxis])[..., 0])
        assert power.max() <= 1e-9 * np.abs(power).max()


def any_gait(draw, moderate):
    highest = {'amplitude': 0.9, 'phase': 0.5, 'front_bias': 0.1, 'rear_bias': 0.1} if moderate else {}
    return FinCommand(*(
        draw(st.floats(max(about.low, -highest.get(name, about.high)), highest.get(name, about.high)))
        for name, about in FinCommand.quantities().items()))


def try_any_input(data, outcomes):
    """Take steps with any parameters within their bounds, any state and gait; count what becomes of them."""
    moderate = data.draw(st.booleans())
    of = data.draw(parameters(moderate=moderate))
    random = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    joints = (2, of.fin.chains, of.fin.links)
    start = State.at_rest(of)
    if data.draw(st.booleans()) and not of.solver.fixed_base:
        quaternion = random.normal(size=4)
        start = dataclasses.replace(
            start, position=random.normal(size=3) * 10.0, orientation=quaternion / np.linalg.norm(quaternion),
            twist=random.normal(size=6), acceleration=random.normal(size=6),
            joint_angles=random.uniform(-3.1, 3.1, joints), joint_rates=random.normal(size=joints) * 10.0)
    gaits = [any_gait(data.draw, moderate) for _ in range(2)]
    if moderate:  # robots that could be built, with a step that suits them
        try:
            step = largest_stable_step(of, *gaits)
        except ValueError as error:
            assert 'left' in str(error) or 'right' in str(error)
        else:
            of = of.replace(solver={'time_step': min(max(0.5 * step, 1e-7), 0.1)})
    simulator = Simulator(of, state=start)
    before = bits(simulator.state)
    try:
        simulator.command(left=gaits[0], right=gaits[1])
    except ValueError as error:
        assert 'left' in str(error) or 'right' in str(error)
        assert bits(simulator.state) == before
    for steps in (1, 20):
        before = simulator.state
        try:
            state = simulator.advance(steps * of.solver.time_step)
        except ValueError as error:
            assert 'solver.time_step' in str(error)
            assert simulator.state is before
            outcomes['diverged'] += 1
            return
        for name in (*SHAPES, 'joint_angles', 'joint_rates'):
            assert np.isfinite(getattr(state, name)).all(), name
        assert abs(np.linalg.norm(state.orientation) - 1.0) < 1e-12
    outcomes[of.solver.coupling if np.any(state.joint_rates) else 'at rest'] += 1


def test_no_valid_input_ends_in_a_nan():
    """The next state is sound, or an error says why not; enough of the examples move."""
    outcomes = collections.Counter()

    @settings(EXAMPLES, max_examples=150)
    @given(st.data())
    def look(data):
        try_any_input(data, outcomes)

    look()
    assert outcomes[SEQUENTIAL] > 5 and outcomes[MONOLITHIC] > 5, outcomes  # measured: 15 and more


@settings(EXAMPLES, max_examples=100)
@given(robots(moderate=False, rates=1e3, angles=50.0), st.sampled_from((0, 1)))
def test_no_valid_moment_gives_a_nan(robot, side):
    of, moment = robot
    try:
        accelerations, wrench = fin_dynamics(of, side, *moment)
    except ValueError as error:
        assert any(words in str(error) for words in ('too fast', 'rod ends', 'must be within +-pi'))
    else:
        assert np.isfinite(accelerations).all() and np.isfinite(wrench).all()


@pytest.mark.parametrize('coupling', [SEQUENTIAL, MONOLITHIC])
def test_the_examples_reach_both_couplings(coupling):
    seen = set()

    @EXAMPLES
    @given(parameters())
    def look(of):
        seen.add((of.solver.coupling, of.water.added_mass_coefficient > 0.0))

    look()
    assert (coupling, coupling == MONOLITHIC) in seen

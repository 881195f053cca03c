"""`fin_dynamics` agrees with two independent references, in any state and at any size of the fin."""

import math

import numpy as np
import pytest

from evidence.references import equations
from evidence.scenarios import (
    SIZES,
    any_moment,
    assert_close,
    assert_same_dynamics,
    other_parameters,
    sized,
    twisting,
)
from manta_sim_ros.dynamics import fin_dynamics
from manta_sim_ros.dynamics._kernels.fin import sine_cosine


def cases(chains, links):
    """Return the default and other parameters, without and with stiffness and damping of the twist."""
    plain = [sized(chains, links), other_parameters(chains, links, seed=chains)]
    return [*plain, *map(twisting, plain)]


@pytest.mark.parametrize('side', [0, 1])
@pytest.mark.parametrize(('chains', 'links'), SIZES)
def test_fin_dynamics_agree_with_the_reference_implementation(chains, links, side):
    for seed, parameters in enumerate(cases(chains, links)):
        moment = any_moment(parameters, seed=100 * chains + 10 * links + seed)
        assert_same_dynamics(
            fin_dynamics(parameters, side, *moment), equations.fin_dynamics(parameters, side, *moment))


@pytest.mark.parametrize('side', [0, 1])
@pytest.mark.parametrize(('chains', 'links'), SIZES)
def test_fin_dynamics_agree_with_pinocchio(chains, links, side, pinocchio_tree):
    for seed, parameters in enumerate(cases(chains, links)):
        moment = any_moment(parameters, seed=200 * chains + 10 * links + seed)
        assert_same_dynamics(
            fin_dynamics(parameters, side, *moment), pinocchio_tree.fin_dynamics(parameters, side, *moment))


def test_the_current_is_in_no_evaluation():
    moment = any_moment(sized(4, 2), seed=1)
    still = fin_dynamics(sized(4, 2), 0, *moment)
    flowing = fin_dynamics(sized(4, 2, water={'current': (1.0, -2.0, 3.0)}), 0, *moment)
    np.testing.assert_array_equal(still[0], flowing[0])
    np.testing.assert_array_equal(still[1], flowing[1])


def test_joint_angles_beyond_pi_are_the_angles_within_it():
    parameters = sized(5, 3)
    rods, angles, *motion = any_moment(parameters, seed=2)
    turns = 2.0 * math.pi * np.random.default_rng(2).integers(-3, 4, angles.shape)
    within, beyond = (fin_dynamics(parameters, 1, rods, q, *motion) for q in (angles, angles + turns))
    # derived: six turns are rounded to 4e-15 rad; the stiffness makes accelerations of it, 100 times as much at most
    assert_close(beyond[0], within[0], 1e-12)
    assert_close(beyond[1], within[1], 1e-12)


@pytest.mark.parametrize('scale', [1e-3, 1e-9, 1e-15])
def test_nearly_flat_fins_agree_with_the_reference_implementation(scale):
    parameters = sized(5, 3, water={'density': 0.0})
    _, angles, *_ = any_moment(parameters, seed=4)
    moment = np.zeros((2, 3)), scale * angles, np.zeros((5, 3)), np.zeros(6), np.zeros(6)
    assert_same_dynamics(fin_dynamics(parameters, 0, *moment), equations.fin_dynamics(parameters, 0, *moment))


def test_joints_bent_nearly_to_pi_agree_with_the_reference_implementation():
    parameters = sized(4, 2, fin={'youngs_modulus': 1e4})
    rods, angles, *motion = any_moment(parameters, seed=3)
    angles = np.sign(angles) * (math.pi - 0.01 - 0.1 * np.abs(angles))
    assert_same_dynamics(
        fin_dynamics(parameters, 0, rods, angles, *motion),
        equations.fin_dynamics(parameters, 0, rods, angles, *motion))


def test_sine_and_cosine_are_right_to_rounding():
    angles = np.concatenate([
        np.linspace(-math.pi / 2, math.pi / 2, 20001), np.geomspace(1e-300, math.pi / 2, 1000), [0.0]])
    sines, cosines = np.array([sine_cosine(angle) for angle in angles]).T
    # derived: a few sums of terms below 1.6, each rounded to 1.1e-16. Measured: 4.5e-16, 4.2e-16
    np.testing.assert_allclose(sines, np.sin(angles), rtol=6e-16, atol=0.0)
    np.testing.assert_allclose(cosines, np.cos(angles), rtol=0.0, atol=6e-16)


def test_any_layout_of_the_arrays_gives_the_same_and_none_is_written_to():
    parameters = sized(5, 3)
    moment = any_moment(parameters, seed=5)
    before = [array.copy() for array in moment]
    desired = fin_dynamics(parameters, 1, *moment)
    for array, copy in zip(moment, before):
        np.testing.assert_array_equal(array, copy)
    for layout in (np.asfortranarray, np.ndarray.tolist):
        accelerations, wrench = fin_dynamics(parameters, 1, *map(layout, moment))
        np.testing.assert_array_equal(accelerations, desired[0])
        np.testing.assert_array_equal(wrench, desired[1])


ARGUMENTS = ('rod_motion', 'joint_angles', 'joint_rates', 'body_twist', 'body_acceleration')


@pytest.mark.parametrize('invalid', [np.nan, np.inf])
@pytest.mark.parametrize('name', ARGUMENTS)
def test_values_that_are_not_finite_are_refused_by_name(name, invalid):
    parameters = sized(4, 2)
    moment = dict(zip(ARGUMENTS, any_moment(parameters, seed=6)))
    moment[name].flat[-1] = invalid
    with pytest.raises(ValueError, match=f'{name} must be finite, but has {invalid}'):
        fin_dynamics(parameters, 0, **moment)


@pytest.mark.parametrize('name', ARGUMENTS)
def test_arrays_of_a_wrong_shape_are_refused_by_name(name):
    parameters = sized(4, 2)
    moment = dict(zip(ARGUMENTS, any_moment(parameters, seed=7)))
    for wrong in (moment[name][..., :-1], moment[name][np.newaxis], moment[name].T[..., :1]):
        with pytest.raises(ValueError, match=f'{name} has shape'):
            fin_dynamics(parameters, 0, **{**moment, name: wrong})


@pytest.mark.parametrize('side', [-1, 2, 'left', None, True, 1.0])
def test_a_side_other_than_left_and_right_is_refused(side):
    with pytest.raises(ValueError, match='side is'):
        fin_dynamics(sized(4, 2), side, *any_moment(sized(4, 2), seed=8))


def test_rods_too_far_apart_for_the_support_are_refused():
    parameters = sized(4, 2).replace(rods={'front_radius': 0.2, 'rear_radius': 0.2, 'support_length': 0.3})
    _, *moment = any_moment(parameters, seed=9)
    bound = 2.0 * math.asin(0.3 / 0.4)  # the chord between two ends on one circle is 2 r sin(angle / 2)
    for apart, closes in ((bound - 1e-9, True), (bound + 1e-9, False)):
        rods = np.array([[apart - 0.3, 0.1, 0.2], [-0.3, -0.1, 0.3]])
        if closes:
            assert np.isfinite(fin_dynamics(parameters, 0, rods, *moment)[1]).all()
        else:
            with pytest.raises(ValueError, match='rod ends 0.3 m apart .* rods.support_length, 0.3 m'):
                fin_dynamics(parameters, 0, rods, *moment)


def test_a_motion_too_fast_for_numbers_is_refused():
    rods, angles, rates, _, acceleration = any_moment(sized(4, 2), seed=9)
    with pytest.raises(ValueError, match='too fast'):
        fin_dynamics(sized(4, 2), 0, rods, angles, rates, np.full(6, 1e160), acceleration)

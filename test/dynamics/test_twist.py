"""The twist of the fins along the chord: reference torques, natural frequencies, free edges, and the thrust."""

import numpy as np
import pytest

from evidence.references import equations
from evidence.scenarios import TWIST, any_moment, assert_close, other_parameters, sized
from manta_sim_ros.dynamics import Simulator, fin_dynamics
from manta_sim_ros.figures.gaits import STRAIGHT

AT_REST, RODS_AT_REST = np.zeros(6), np.zeros((2, 3))
SHEAR_MODULUS, TWIST_DAMPING = 1e6, 0.01  # of the reference state
ANGLES = np.array([[0.10, 0.05], [0.02, -0.04], [-0.06, 0.08], [0.03, 0.01]])  # [rad]
RATES = np.array([[1.0, -0.5], [0.2, 0.3], [-0.4, 0.6], [0.7, -0.8]])  # [rad/s]
ELASTIC = [[-3.482993, -2.368435], [2.925714, 2.925714], [2.089796, -0.278639], [-1.532517, -0.278639]]  # [N]
DAMPING = [[-0.193500, 0.0], [-0.024187, -0.072562], [0.411187, 0.0], [-0.193500, 0.072562]]  # [N]


def twist_torques(parameters, side, moment):
    """Return the torques (n, m) [N] of the twist, which make a difference to the joint accelerations."""
    without = parameters.replace(fin={'shear_modulus': 0.0, 'twist_damping': 0.0})
    difference = (fin_dynamics(parameters, side, *moment)[0] - fin_dynamics(without, side, *moment)[0])
    return np.array([equations.mass_matrix(parameters, q) @ q_ddot for q, q_ddot in zip(moment[1], difference)])


@pytest.mark.parametrize('coupling', ['sequential', 'monolithic'])
@pytest.mark.parametrize('side', [0, 1])
def test_the_torques_of_the_reference_state_are_those_computed_by_hand(side, coupling):
    moment = RODS_AT_REST, ANGLES, RATES, AT_REST, AT_REST
    for fin, expected in (({'shear_modulus': SHEAR_MODULUS}, ELASTIC), ({'twist_damping': TWIST_DAMPING}, DAMPING)):
        parameters = sized(4, 2, fin=fin, solver={'coupling': coupling})
        torques = twist_torques(parameters, side, moment)
        np.testing.assert_allclose(torques, expected, rtol=0.0, atol=6e-7)  # half a unit of the last digit
        assert_close(torques, equations.twist_torques(parameters, ANGLES, RATES), 1e-11)  # measured: 4e-14


def test_the_energy_of_the_reference_state_is_that_computed_by_hand():
    parameters = sized(4, 2, fin={'shear_modulus': SHEAR_MODULUS})
    assert equations.twist_energy(parameters, ANGLES) == pytest.approx(0.0284160, abs=5e-8)


@pytest.mark.parametrize(('chains', 'links'), [(2, 1), (5, 3), (17, 2)])
def test_the_elastic_torque_is_minus_the_derivative_of_the_energy(chains, links):
    parameters = other_parameters(chains, links, seed=1).replace(fin={'shear_modulus': TWIST['shear_modulus']})
    moment = any_moment(parameters, seed=2)
    torques = twist_torques(parameters, 0, moment)
    ds = parameters.rods.support_length / chains
    for k, j in np.ndindex(chains, links):
        step = np.zeros((chains, links))
        step[k, j] = 0.5  # the energy is quadratic, so that a central difference of any width is exact
        slope = (equations.twist_energy(parameters, moment[1] + step)
                 - equations.twist_energy(parameters, moment[1] - step))
        assert torques[k, j] == pytest.approx(-slope / ds, abs=1e-11 * np.abs(torques).max())  # measured: 1e-14


@pytest.mark.parametrize('coupling', ['sequential', 'monolithic'])
def test_chains_that_turn_alike_feel_nothing_of_the_twist(coupling):
    plain = sized(17, 3, solver={'coupling': coupling})
    rods, angles, rates, *body = any_moment(plain, seed=3)
    alike = rods, np.tile(angles[0], (17, 1)), np.tile(rates[0], (17, 1)), *body
    for one, other in zip(fin_dynamics(plain, 0, *alike), fin_dynamics(plain.replace(fin=TWIST), 0, *alike)):
        np.testing.assert_array_equal(one, other)


def test_the_twist_hands_no_net_torque_to_the_support():
    parameters = sized(7, 3, fin=TWIST)
    torques = twist_torques(parameters, 0, any_moment(parameters, seed=4))
    np.testing.assert_allclose(torques.sum(axis=0), 0.0, atol=1e-11 * np.abs(torques).max())


def test_the_edges_of_the_fin_are_free():
    # a fin that is twisted uniformly is bent by its edges only: inside, the moments of both neighbors cancel
    parameters = sized(6, 2, fin={'shear_modulus': SHEAR_MODULUS})
    slope, (dl, ds) = 0.05, (parameters.fin.span / 2, parameters.rods.support_length / 6)  # slope: rad per chain
    angles = np.outer((np.arange(6) - 1.4) * slope, [1.0, 0.0])
    torques = twist_torques(parameters, 0, (RODS_AT_REST, angles, np.zeros((6, 2)), AT_REST, AT_REST))
    moment = SHEAR_MODULUS * parameters.fin.thickness**3 / 3.0 * dl / ds**2 * slope  # on each link of the edges
    expected = np.zeros((6, 2))
    expected[0], expected[-1] = [2.0 * moment, moment], [-2.0 * moment, -moment]
    np.testing.assert_allclose(torques, expected, rtol=0.0, atol=1e-10 * moment)


def frequencies(parameters):
    """Return the natural frequencies [rad/s] of a flat fin without water and damping, from `fin_dynamics`."""
    shape, small = (parameters.fin.chains, parameters.fin.links), 1e-5

    def accelerations(angles):
        return fin_dynamics(
            parameters, 0, RODS_AT_REST, angles.reshape(shape), np.zeros(shape), AT_REST, AT_REST)[0].ravel()

    matrix = np.stack([(accelerations(-small * unit) - accelerations(small * unit)) / (2.0 * small)
                       for unit in np.eye(shape[0] * shape[1])], axis=1)
    return np.sqrt(np.sort(np.linalg.eigvals(matrix).real))


def frequencies_of_cosine_modes(parameters):
    """Return those of (K + (2 - 2 cos(pi i / n)) K_t dl / ds^2 L^T L, M), i = 0 to n - 1: each mode i is a cosine."""
    fin, (dl, ds) = parameters.fin, (
        parameters.fin.span / parameters.fin.links, parameters.rods.support_length / parameters.fin.chains)
    bending = fin.youngs_modulus * fin.thickness**3 / 12.0 / dl * np.eye(fin.links)
    twisting = fin.shear_modulus * fin.thickness**3 / 3.0 * dl / ds**2 * np.tri(fin.links).T @ np.tri(fin.links)
    mass = equations.mass_matrix(parameters, np.zeros(fin.links))
    squares = [
        np.linalg.eigvals(np.linalg.solve(mass, bending + (2.0 - 2.0 * np.cos(np.pi * i / fin.chains)) * twisting))
        for i in range(fin.chains)]
    return np.sqrt(np.sort(np.ravel(squares).real))


@pytest.mark.parametrize(('chains', 'links', 'shear_modulus'), [(4, 2, SHEAR_MODULUS), (9, 3, 3.8e7), (2, 1, 1e5)])
def test_natural_frequencies_are_those_of_cosines_along_the_chord(chains, links, shear_modulus):
    parameters = sized(
        chains, links, water={'density': 0.0}, fin={'joint_damping': 0.0, 'shear_modulus': shear_modulus})
    measured = frequencies(parameters)
    # the stiffness (14) is not linear, by the square of the angle, 1e-10; measured: 3e-10
    np.testing.assert_allclose(measured, frequencies_of_cosine_modes(parameters), rtol=3e-9)
    if (chains, links) == (4, 2):
        np.testing.assert_allclose(measured[:4], [28.4248845, 31.2618534, 37.0768245, 41.9403801], rtol=1e-8)


@pytest.mark.parametrize(('chains', 'shear_modulus', 'expected'), [
    (8, 0.0, 17.087), (30, 0.0, 17.077), (8, 3.846e6, 17.605), (30, 3.846e6, 17.555)])
def test_the_thrust_hardly_depends_on_the_number_of_chains(chains, shear_modulus, expected):
    step, period = 1.0 / 1200.0, 2000  # a whole number of steps per period at 0.6 Hz
    parameters = sized(
        chains, 3, fin={'shear_modulus': shear_modulus}, solver={'fixed_base': True, 'time_step': step},
        rods={'command_time_constant': 0.0})
    simulator = Simulator(parameters)
    simulator.command(left=STRAIGHT, right=STRAIGHT)
    simulator.advance(2 * period * step)
    thrust = np.mean([simulator.advance(10 * step).wrench[0] for _ in range(period // 10)])
    assert thrust == pytest.approx(expected, abs=6e-4)  # half a unit of the last digit, and the sampling


@pytest.mark.parametrize('angle', [3.2, -7.0])
def test_an_angle_beyond_pi_is_refused_because_a_full_turn_is_no_period_of_the_twist(angle):
    parameters = sized(4, 2, fin={'shear_modulus': 1e6})
    angles, rates = np.zeros((4, 2)), np.zeros((4, 2))
    angles[2, 1] = angle
    arguments = (0, np.zeros((2, 3)), angles, rates, np.zeros(6), np.zeros(6))
    reason = rf'^joint_angles reach {abs(angle):g} rad, but must be within .*fin\.shear_modulus'
    with pytest.raises(ValueError, match=reason):
        fin_dynamics(parameters, *arguments)
    fin_dynamics(parameters.replace(fin={'shear_modulus': 0.0}), *arguments)

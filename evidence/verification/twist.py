"""Theme 2, references: the twist of the fins along the chord, against its energy and its natural modes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from evidence.references import equations
from evidence.scenarios import any_moment, other_parameters, sized
from evidence.verification.claims import Claim, Section, rounded
from evidence.verification.figures import fitted_order
from manta_sim_ros.dynamics import FloatArray, Parameters, fin_dynamics
from manta_sim_ros.figures.style import MARKERS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHEAR_MODULUS = 1e6  # [Pa], so that twist and bending are of about the same stiffness with few chains
SIZES = (2, 1), (4, 2), (7, 3), (12, 3)  # chains, links
REFINED = 4, 8, 16, 32  # chains of fins of `SHEAR_MODULUS`
MODES = 1, 2, 3  # along the chord, whose frequencies are compared with those of a continuous strip


def _torque_error(chains: int, links: int, seeds: range) -> float:
    """Return the largest error of the torques of the twist in random states, relative to the largest torque."""
    parameters = other_parameters(chains, links, seed=chains).replace(fin={'shear_modulus': SHEAR_MODULUS})
    without, ds = parameters.replace(fin={'shear_modulus': 0.0}), parameters.rods.support_length / chains
    errors = []
    for seed in seeds:
        moment = any_moment(parameters, seed)
        difference = fin_dynamics(parameters, 0, *moment)[0] - fin_dynamics(without, 0, *moment)[0]
        torques = np.array([
            equations.mass_matrix(parameters, angles) @ accelerations
            for angles, accelerations in zip(moment[1], difference, strict=True)])
        slopes = np.empty((chains, links))
        for joint in np.ndindex(chains, links):
            step = np.zeros((chains, links))
            step[joint] = 0.5  # the energy is quadratic, so that a central difference of any width is exact
            slopes[joint] = (equations.twist_energy(parameters, moment[1] + step)
                             - equations.twist_energy(parameters, moment[1] - step))
        errors.append(float(np.abs(torques + slopes / ds).max() / np.abs(torques).max()))
    return max(errors)


def natural_frequencies(parameters: Parameters) -> FloatArray:
    """Return all natural frequencies [rad/s] of a flat fin without water and damping, from `fin_dynamics`."""
    shape, small = (parameters.fin.chains, parameters.fin.links), 1e-5

    def accelerations(angles: FloatArray) -> FloatArray:
        return fin_dynamics(parameters, 0, np.zeros((2, 3)), angles.reshape(shape), np.zeros(shape), np.zeros(6),
                            np.zeros(6))[0].ravel()

    matrix = np.stack([(accelerations(-small * unit) - accelerations(small * unit)) / (2.0 * small)
                       for unit in np.eye(shape[0] * shape[1])], axis=1)
    return np.sqrt(np.sort(np.linalg.eigvals(matrix).real))


def _modes(parameters: Parameters, wave: float) -> FloatArray:
    """Return the natural frequencies (m,) [rad/s] of shapes whose second difference along the chord is -`wave` ds^2.

    They are those of (K + wave K_t dl L^T L, M), with the bending K and the inertia M of a chain.
    """
    fin, dl = parameters.fin, parameters.fin.span / parameters.fin.links
    sums = np.tri(fin.links)
    stiffness = fin.youngs_modulus * fin.thickness**3 / 12.0 / dl * np.eye(fin.links)
    stiffness += wave * fin.shear_modulus * fin.thickness**3 / 3.0 * dl * sums.T @ sums
    mass = equations.mass_matrix(parameters, np.zeros(fin.links))
    return np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real))


def _cosines(parameters: Parameters) -> FloatArray:
    """Return the frequencies of all modes [rad/s]: the shapes of n chains with free edges are cosines."""
    chains, length = parameters.fin.chains, parameters.rods.support_length
    return np.sort(np.concatenate([
        _modes(parameters, (2.0 - 2.0 * math.cos(math.pi * i / chains)) * (chains / length) ** 2)
        for i in range(chains)]))


def _flat(chains: int, links: int) -> Parameters:
    return sized(chains, links, water={'density': 0.0}, fin={'joint_damping': 0.0, 'shear_modulus': SHEAR_MODULUS})


def twist_along_the_chord(quick: bool = False) -> Section:
    """Compare torques with the derivative of the energy, and natural frequencies with those of cosines."""
    torque = max(_torque_error(*size, range(2 if quick else 8)) for size in SIZES)
    spectra = {size: (natural_frequencies(_flat(*size)), _cosines(_flat(*size))) for size in SIZES}
    spectrum = max(float(np.abs(measured / exact - 1.0).max()) for measured, exact in spectra.values())
    length = Parameters().rods.support_length
    chains = REFINED[:3] if quick else REFINED
    measured = {number: natural_frequencies(_flat(number, 1)) for number in chains}
    strip = [float(_modes(_flat(chains[0], 1), (math.pi * i / length) ** 2)[0]) for i in MODES]
    errors = [float(np.abs(measured[number][1] / strip[0] - 1.0)) for number in chains]
    claims = (
        Claim('error of the torques of the twist in random states', 'minus the derivative of the energy, in NumPy',
              torque, 3e-13, 'rounding times the condition of the chain; measured with a margin of 20'),
        Claim('error of all natural frequencies of a fin with twist', 'cosines along the chord, derived', spectrum,
              1e-9, 'differences of 1e-5 rad lose half of the digits; measured with a margin of 5'),
        Claim('order of the first chordwise frequency in the number of chains', 'a continuous strip with free edges',
              fitted_order([1.0 / number for number in chains[-2:]], errors[-2:]), (1.9, 2.1),
              'derived: 2, for the second difference'),
    )

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        numbers = np.linspace(0.0, 12.0, 100)
        axes.plot(numbers, [_modes(_flat(4, 1), (math.pi * i / length) ** 2)[0] for i in numbers], 'k-', linewidth=0.9,
                  label='continuous strip')
        for marker, number in zip(MARKERS, chains, strict=False):
            axes.plot(range(min(number, 13)), measured[number][:13], marker, label=f'{number} chains')
        axes.set(xlabel='number of half waves along the chord', ylabel='natural frequency [rad/s]')
        axes.legend()

    return Section('Twist of the fins along the chord', f"""
`fin.shear_modulus` is not part of the paper: the links of one row then resist being turned against each other, like the
strip of a plate (Saint-Venant). The torques are compared with the derivative of the energy of these strips, for fins of
{len(SIZES)} sizes. The natural frequencies of a flat fin are those of waves along the chord whose shapes are cosines,
because the edges are free. The simulator is linearized by differences of `fin_dynamics`. With more chains, the
frequencies approach those of a continuous strip, here with one link per chain and G = {rounded(SHEAR_MODULUS)} Pa. So
the twist has a limit of many chains, unlike the paper's fin.
""", claims, draw, 'Natural frequencies of a flat fin of single links against the number of half waves.')


CHECKS = (twist_along_the_chord,)

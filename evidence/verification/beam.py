"""Theme 2, references: a chain of elastic links against the Euler-Bernoulli cantilever, as its links get shorter."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from evidence.scenarios import sized
from evidence.verification.claims import Claim, Section, rounded
from evidence.verification.figures import fitted_order, mark
from manta_sim_ros.dynamics import FloatArray, Parameters, Simulator, State, fin_dynamics

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LINKS = 1, 2, 3, 4, 6, 8, 12, 16, 24, 40
SHORT = 12, 24, 40  # numbers of links to which an order is fitted
ROOT_ACCELERATION = 1e-3  # [m/s^2], so small that the chain is linear
RODS_AT_REST = np.zeros((2, 3))


def _chain(links: int, **fin: float) -> Parameters:
    """Return parameters of a fin of two chains outside the water, without damping; `fin` replaces other values."""
    return sized(2, links, water={'density': 0.0}, fin={'joint_damping': 0.0, **fin})


def _acceleration(parameters: Parameters, angles: FloatArray, root: float) -> FloatArray:
    """Return the joint accelerations (m,) [rad/s^2] of a chain at rest whose `root` accelerates upward [m/s^2]."""
    both = np.tile(angles, (2, 1))
    body = np.array([0.0, 0.0, root, 0.0, 0.0, 0.0])
    return fin_dynamics(parameters, 0, RODS_AT_REST, both, np.zeros_like(both), np.zeros(6), body)[0][0]


def _stiffness_over_inertia(parameters: Parameters) -> FloatArray:
    """Return the matrix K (m, m) [1/s^2] of q-ddot = -K q about the straight chain, by central differences."""
    links, small = parameters.fin.links, 1e-6
    return np.stack([
        (_acceleration(parameters, -small * unit, 0.0) - _acceleration(parameters, small * unit, 0.0)) / (2.0 * small)
        for unit in np.eye(links)], axis=1)


def _tip(parameters: Parameters, angles: FloatArray) -> float:
    """Return the deflection of the tip from the straight chain [m]."""
    return parameters.fin.span / parameters.fin.links * float(np.sum(np.sin(np.cumsum(angles))))


def _flexibility(parameters: Parameters) -> tuple[float, float]:
    """Return EI [N m] and mass per area [kg/m^2] of the fin as a beam of unit chord."""
    fin = parameters.fin
    return fin.youngs_modulus * fin.thickness**3 / 12.0, fin.density * fin.thickness


def _wave_numbers() -> list[float]:
    """Return beta l of the first three modes of a cantilever, the roots of cos(x) cosh(x) = -1."""
    return [brentq(lambda x: math.cos(x) + 1.0 / math.cosh(x), low, high) for low, high in ((1, 3), (4, 6), (7, 9))]


def static_deflection(quick: bool = False) -> Section:
    """Compare the deflection of a chain under a uniform load with that of a cantilever."""
    errors, exact_errors = [], []
    for links in LINKS:
        parameters = _chain(links)
        bending_stiffness, area_mass = _flexibility(parameters)
        inertial = _acceleration(parameters, np.zeros(links), ROOT_ACCELERATION)
        deflection = _tip(parameters, np.linalg.solve(_stiffness_over_inertia(parameters), inertial))
        beam = -area_mass * ROOT_ACCELERATION * parameters.fin.span**4 / (8.0 * bending_stiffness)
        errors.append(deflection / beam - 1.0)
        exact_errors.append(abs(deflection / beam / (1.0 + 1.0 / links) ** 2 - 1.0))
    in_stream, rotation = _deflection_in_a_stream()
    errors_of_short = [errors[LINKS.index(links)] for links in SHORT]
    claims = (
        Claim('error of the tip deflection of m links under a uniform load', 'p l^4 / 8 EI (1 + 1/m)^2, derived',
              max(exact_errors), 5e-8, 'differences of 1e-6 rad lose half of the digits; measured with a margin of 4'),
        Claim('order of convergence of the deflection to that of a beam', 'Euler-Bernoulli beam, p l^4 / 8 EI',
              fitted_order([1.0 / links for links in SHORT], errors_of_short), (0.95, 1.1),
              'derived: 2/m + 1/m^2'),
        Claim('error of the tip deflection of 6 links in a stream, simulated',
              'p l^4 / 8 EI (1 + 1/m)^2, p = 1/2 rho C_D V^2', in_stream, 4e-6,
              f'the load decreases by the square of the rotation of the tip, {rounded(rotation)} rad; measured with a '
              'margin of 4'),
    )

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.loglog(LINKS, errors, 'o', label='chain of m links')
        axes.loglog(LINKS, [(1.0 + 1.0 / links) ** 2 - 1.0 for links in LINKS], '-', label='2/m + 1/m$^2$, derived')
        mark(axes, LINKS)
        axes.set(xlabel='links m', ylabel='relative excess of the tip deflection')
        axes.legend()

    at_default = errors[LINKS.index(Parameters().fin.links)]
    return Section('A cantilever under a uniform load', f"""
A fin on a support at rest is a cantilever with EI = E h^3 / 12 per unit chord. The load is the inertial force of the
links when the root accelerates by {rounded(ROOT_ACCELERATION)} m/s^2. Under such a uniform load p the tip of a beam is
deflected by p l^4 / 8 EI. A chain has hinges at 0, dl, 2 dl, ..., each with the stiffness EI / dl. The deflection of
its tip is the sum of p (l - x)^3 dl / 2 EI over the hinges, which is p l^4 / 8 EI (1 + 1/m)^2: the hinge at the root
counts fully, although it represents only half a link. So the chain is softer than the beam and converges to it with
first order only. With the default {Parameters().fin.links} links its deflection is {rounded(100.0 * at_default)} %
larger. For the first two claims, the equilibrium is where `fin_dynamics` gives no acceleration. For the last claim, the
`Simulator` runs in a weak stream until the fin is at rest.
""", claims, draw, 'Relative excess of the tip deflection of m links over that of a beam.')


def _deflection_in_a_stream() -> tuple[float, float]:
    """Return the relative error of the tip deflection of 6 links at rest in a stream, and the tip's angle [rad]."""
    speed, links = 0.02, 6
    parameters = sized(2, links, water={'current': (0.0, 0.0, speed)}, fin={'joint_damping': 0.5},
                       solver={'fixed_base': True, 'time_step': 1e-4})
    angles = Simulator(parameters).advance(3.0).joint_angles[0, 0]
    pressure = 0.5 * parameters.water.density * parameters.fin.drag_coefficient * speed**2
    bending_stiffness, _ = _flexibility(parameters)
    beam = pressure * parameters.fin.span**4 / (8.0 * bending_stiffness) * (1.0 + 1.0 / links) ** 2
    return abs(_tip(parameters, angles) / beam - 1.0), float(np.sum(angles))


def natural_frequencies(quick: bool = False) -> Section:
    """Compare the first three natural frequencies with those of a beam, and simulate one vibration."""
    wave_numbers = np.array(_wave_numbers())
    errors = np.full((len(LINKS), 3), np.nan)
    for row, links in enumerate(LINKS):
        parameters = _chain(links)
        bending_stiffness, area_mass = _flexibility(parameters)
        beam = (wave_numbers / parameters.fin.span) ** 2 * math.sqrt(bending_stiffness / area_mass)
        modes = np.sqrt(np.sort(np.linalg.eigvals(_stiffness_over_inertia(parameters)).real))[:3]
        errors[row, :len(modes)] = modes / beam[:len(modes)] - 1.0
    at = [LINKS.index(links) for links in SHORT]
    widths = [1.0 / links for links in SHORT]
    extrapolated = [float(np.polynomial.Polynomial.fit(widths, errors[at, mode] * np.array(SHORT), 2)(0.0))
                    for mode in range(3)]
    in_time = _frequency_in_time()
    claims = (
        *(Claim(f'm times the error of natural frequency {mode + 1}, limit of large m', 'perturbed beam: -1, derived',
                extrapolated[mode], (-1.0 - margin, -1.0 + margin),
                'derived: the root is more flexible by half a link; the fit neglects the third order')
          for mode, margin in enumerate((0.01, 0.02, 0.05))),
        *(Claim(f'order of convergence of natural frequency {mode + 1} to that of a beam', 'Euler-Bernoulli beam',
                fitted_order(widths, np.abs(errors[at, mode])), (0.8, 1.2), 'derived: 1') for mode in range(3)),
        Claim('error of the first natural frequency of 6 links, simulated', 'eigenvalue of the linearized chain',
              in_time, 5e-7, 'the square of the amplitude, 1e-3 rad, detunes it; measured with a margin of 3'),
    )

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for mode, marker in enumerate('os^'):
            axes.loglog(LINKS, np.abs(errors[:, mode]), marker, label=f'natural frequency {mode + 1}')
        axes.loglog(LINKS, [1.0 / links for links in LINKS], 'k--', linewidth=0.9, label='1/m, derived')
        mark(axes, LINKS)
        axes.set(xlabel='links m', ylabel='relative deviation from a beam')
        axes.legend()

    first = errors[LINKS.index(Parameters().fin.links), 0]
    return Section('Natural frequencies of a cantilever', f"""
Outside the water and without damping, `fin_dynamics` is linearized about the straight chain by central differences. Its
natural frequencies are compared with those of a cantilever, (beta l)^2 sqrt(EI / mu l^4) with cos(beta l) cosh(beta l)
= -1. The root of the chain is more flexible by half a link (see above). According to the first variation of Rayleigh's
quotient, this lowers every frequency by the share 1/m, because in every mode of a cantilever the square of the
curvature at the root is four times its mean square. So the order of convergence is one, and m times the relative error
tends to -1. This verifies the ratio of stiffness and inertia to a hundredth. With the default {Parameters().fin.links}
links the first frequency is {rounded(-100.0 * first)} % too low. The model has neither shear nor a rotary inertia
beyond that of thin links, and its chains are not coupled here.
""", claims, draw, 'Relative deviation of the natural frequencies of m links from those of a beam.')


def _frequency_in_time() -> float:
    """Return the relative difference of the frequency of 6 links, simulated for 10 periods, from the eigenvalue."""
    parameters = _chain(6).replace(solver={'fixed_base': True, 'time_step': 1e-4})
    squares, shapes = np.linalg.eig(_stiffness_over_inertia(parameters))
    first = int(np.argmin(squares.real))
    shape = shapes[:, first].real
    start = np.broadcast_to(1e-3 * shape / np.abs(shape).max(), (2, 2, 6))
    simulator = Simulator(parameters, state=dataclasses.replace(State.at_rest(parameters), joint_angles=start))
    expected, interval = math.sqrt(squares[first].real), 5e-4
    times, values = [], []
    while simulator.state.time < 10.25 * 2.0 * math.pi / expected:
        values.append(_tip(parameters, simulator.state.joint_angles[0, 0]))
        times.append(simulator.state.time)
        simulator.advance(interval)
    zeros = CubicSpline(times, values).roots(extrapolate=False)
    return abs(2.0 * math.pi * (len(zeros) - 1) / 2.0 / (zeros[-1] - zeros[0]) / expected - 1.0)


CHECKS = static_deflection, natural_frequencies

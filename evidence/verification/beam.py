"""Theme 2, references: a chain of elastic links as a cantilever of Euler and Bernoulli, as links get shorter."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from evidence.scenarios import sized
from evidence.verification.claims import Claim, Section, rounded
from evidence.verification.figures import fitted_order, mark
from manta_sim_ros.dynamics import Parameters, Simulator, State, fin_dynamics

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LINKS = 1, 2, 3, 4, 6, 8, 12, 16, 24, 40
SHORT = 12, 24, 40  # numbers of links for the order
PUSH = 1e-3  # [m/s^2], of the root: deflections so small that the chain is linear
RODS_AT_REST = np.zeros((2, 3))


def _chain(links: int, **fin: float) -> Parameters:
    """Return a fin of two chains, out of the water, without damping."""
    return sized(2, links, water={'density': 0.0}, fin={'joint_damping': 0.0, **fin})


def _acceleration(parameters: Parameters, angles: NDArray, push: float) -> NDArray:
    """Return the joint accelerations (m,) [rad/s^2] of a chain at rest whose root accelerates upward [m/s^2]."""
    both = np.tile(angles, (2, 1))
    pushed = np.array([0.0, 0.0, push, 0.0, 0.0, 0.0])
    return fin_dynamics(parameters, 0, RODS_AT_REST, both, np.zeros_like(both), np.zeros(6), pushed)[0][0]


def _stiffness_over_inertia(parameters: Parameters) -> NDArray:
    """Return the matrix (m, m) [1/s^2] of q-ddot = -matrix q about the straight chain, by central differences."""
    links, small = parameters.fin.links, 1e-6
    return np.stack([
        (_acceleration(parameters, -small * unit, 0.0) - _acceleration(parameters, small * unit, 0.0)) / (2.0 * small)
        for unit in np.eye(links)], axis=1)


def _tip(parameters: Parameters, angles: NDArray) -> float:
    """Return how far the tip is off the straight chain [m]."""
    return parameters.fin.span / parameters.fin.links * float(np.sum(np.sin(np.cumsum(angles))))


def _flexibility(parameters: Parameters) -> tuple[float, float]:
    """Return EI [N m] and mass per area [kg/m^2] of the fin, a beam per unit chord."""
    fin = parameters.fin
    return fin.youngs_modulus * fin.thickness**3 / 12.0, fin.density * fin.thickness


def _wave_numbers() -> list[float]:
    """Return beta l of the first three modes of a cantilever, cos(x) cosh(x) = -1."""
    return [brentq(lambda x: math.cos(x) + 1.0 / math.cosh(x), low, high) for low, high in ((1, 3), (4, 6), (7, 9))]


def static_deflection(quick: bool = False) -> Section:
    """Load the chain with its own weight: deflection of a cantilever under a uniform load."""
    errors, exact_errors = [], []
    for links in LINKS:
        parameters = _chain(links)
        bending_stiffness, area_mass = _flexibility(parameters)
        inertial = _acceleration(parameters, np.zeros(links), PUSH)
        deflection = _tip(parameters, np.linalg.solve(_stiffness_over_inertia(parameters), inertial))
        beam = -area_mass * PUSH * parameters.fin.span**4 / (8.0 * bending_stiffness)
        errors.append(deflection / beam - 1.0)
        exact_errors.append(abs(deflection / beam / (1.0 + 1.0 / links) ** 2 - 1.0))
    in_stream, strain = _deflection_in_a_stream()
    of_short = [errors[LINKS.index(links)] for links in SHORT]
    claims = (
        Claim('tip deflection of m links under a uniform load', 'p l^4 / 8 EI (1 + 1/m)^2, derived', max(exact_errors),
              5e-8, 'differences of 1e-6 rad lose half the digits; measured, margin 4'),
        Claim('order at which the deflection nears the beam', 'Euler and Bernoulli, p l^4 / 8 EI',
              fitted_order([1.0 / links for links in SHORT], of_short), (0.95, 1.1), 'derived: 2/m + 1/m^2'),
        Claim('tip deflection of 6 links in a stream, simulated', 'p l^4 / 8 EI (1 + 1/m)^2, p = 1/2 rho C_D V^2',
              in_stream, 4e-6, f'the tip turns by {rounded(strain)} rad and eludes the stream by its square; margin 4'),
    )

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.loglog(LINKS, errors, 'o', label='chain of m links')
        axes.loglog(LINKS, [(1.0 + 1.0 / links) ** 2 - 1.0 for links in LINKS], '-', label='2/m + 1/m$^2$, derived')
        mark(axes, LINKS)
        axes.set(xlabel='links m', ylabel='tip deflection over that of the beam, - 1')
        axes.legend()

    at_default = errors[LINKS.index(Parameters().fin.links)]
    return Section('A cantilever under a uniform load', f"""
A fin on a support at rest is a cantilever, per unit chord with EI = E h^3 / 12. Loaded uniformly (the root accelerates
by {rounded(PUSH)} m/s^2, the load is the links' inertia), a beam's tip sinks by p l^4 / 8 EI. A chain with hinges at 0,
dl, 2 dl, ..., each of stiffness EI / dl, sinks by the sum of p (l - x)^3 dl / 2 EI over its hinges, which is p l^4 / 8
EI (1 + 1/m)^2: the root hinge is a full one, though it stands for half a link. So the chain is softer than the beam and
nears it with first order only; with the default {Parameters().fin.links} links it sinks {rounded(100.0 * at_default)} %
further. Equilibrium is where `fin_dynamics` gives no acceleration. The last claim takes the other way, the `Simulator`
in a weak stream until the fin rests.
""", claims, draw, 'How much further the tip of m links sinks than that of a beam.')


def _deflection_in_a_stream() -> tuple[float, float]:
    """Return the relative error of the tip's deflection of 6 links at rest in a stream, and the tip's angle [rad]."""
    speed, links = 0.02, 6
    parameters = sized(2, links, water={'current': (0.0, 0.0, speed)}, fin={'joint_damping': 0.5},
                       solver={'fixed_base': True, 'time_step': 1e-4})
    angles = Simulator(parameters).advance(3.0).joint_angles[0, 0]
    pressure = 0.5 * parameters.water.density * parameters.fin.drag_coefficient * speed**2
    bending_stiffness, _ = _flexibility(parameters)
    beam = pressure * parameters.fin.span**4 / (8.0 * bending_stiffness) * (1.0 + 1.0 / links) ** 2
    return abs(_tip(parameters, angles) / beam - 1.0), float(np.sum(angles))


def natural_frequencies(quick: bool = False) -> Section:
    """Compare the first three natural frequencies, and one vibration in time, with the beam's."""
    waves = np.array(_wave_numbers())
    errors = np.full((len(LINKS), 3), np.nan)
    for row, links in enumerate(LINKS):
        parameters = _chain(links)
        bending_stiffness, area_mass = _flexibility(parameters)
        beam = (waves / parameters.fin.span) ** 2 * math.sqrt(bending_stiffness / area_mass)
        modes = np.sqrt(np.sort(np.linalg.eigvals(_stiffness_over_inertia(parameters)).real))[:3]
        errors[row, :len(modes)] = modes / beam[:len(modes)] - 1.0
    at = [LINKS.index(links) for links in SHORT]
    widths = [1.0 / links for links in SHORT]
    extrapolated = [float(np.polynomial.Polynomial.fit(widths, errors[at, mode] * np.array(SHORT), 2)(0.0))
                    for mode in range(3)]
    in_time = _frequency_in_time()
    claims = (
        *(Claim(f'm times the error of natural frequency {mode + 1}, m to infinity', 'perturbed beam: -1, derived',
                extrapolated[mode], (-1.0 - margin, -1.0 + margin),
                'derived: half a link more flexibility at the root; the fit leaves what is of third order')
          for mode, margin in enumerate((0.01, 0.02, 0.05))),
        *(Claim(f'order at which natural frequency {mode + 1} nears the beam', 'Euler and Bernoulli',
                fitted_order(widths, np.abs(errors[at, mode])), (0.8, 1.2), 'derived: 1') for mode in range(3)),
        Claim('first natural frequency of 6 links, vibration simulated', 'eigenvalue of the linearized chain', in_time,
              5e-7, 'amplitude 1e-3 rad, whose square is the detuning; measured, margin 3'),
    )

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for mode, marker in enumerate('os^'):
            axes.loglog(LINKS, np.abs(errors[:, mode]), marker, label=f'natural frequency {mode + 1}')
        axes.loglog(LINKS, [1.0 / links for links in LINKS], 'k--', linewidth=0.9, label='1/m, derived')
        mark(axes, LINKS)
        axes.set(xlabel='links m', ylabel='deviation from the beam, relative')
        axes.legend()

    first = errors[LINKS.index(Parameters().fin.links), 0]
    return Section('Natural frequencies of a cantilever', f"""
Out of the water and without damping, `fin_dynamics` is linearized about the straight chain by central differences; its
eigenvalues are set beside those of a cantilever, (beta l)^2 sqrt(EI / mu l^4) with cos(beta l) cosh(beta l) = -1. Half
a link of extra flexibility at the root (see above) lowers every one by 1/m, from the first variation of Rayleigh's
quotient: a cantilever's curvature at the root squared is four times its mean square in every mode. So the order is one,
and m times the relative error tends to -1: a check of stiffness against inertia to a hundredth. With the default
{Parameters().fin.links} links the first frequency is {rounded(-100.0 * first)} % low. Shear, rotary inertia beyond that
of thin links, and coupling along the chord are not in the model and not shown.
""", claims, draw, 'How far natural frequencies of m links are from those of a beam.')


def _frequency_in_time() -> float:
    """Return the relative difference of a simulated vibration's frequency from the eigenvalue, 6 links, 10 periods."""
    parameters = _chain(6).replace(solver={'fixed_base': True, 'time_step': 1e-4})
    squares, shapes = np.linalg.eig(_stiffness_over_inertia(parameters))
    first = int(np.argmin(squares.real))
    shape = shapes[:, first].real
    start = np.broadcast_to(1e-3 * shape / np.abs(shape).max(), (2, 2, 6))
    simulator = Simulator(parameters, state=dataclasses.replace(State.at_rest(parameters), joint_angles=start))
    expected, pace = math.sqrt(squares[first].real), 5e-4
    times, values = [], []
    while simulator.state.time < 10.25 * 2.0 * math.pi / expected:
        values.append(_tip(parameters, simulator.state.joint_angles[0, 0]))
        times.append(simulator.state.time)
        simulator.advance(pace)
    zeros = CubicSpline(times, values).roots(extrapolate=False)
    return abs(2.0 * math.pi * (len(zeros) - 1) / 2.0 / (zeros[-1] - zeros[0]) / expected - 1.0)


CHECKS = static_deflection, natural_frequencies

"""Themes 3 and 5: how many chains a swimming fin may have, and fresh water with added mass, where that decides."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from evidence.verification.claims import Claim, Section, rounded
from evidence.verification.mechanics import without_smoothing
from manta_sim_ros.dynamics import MONOLITHIC, Parameters, Simulator, fin_dynamics
from manta_sim_ros.figures.gaits import gait

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DIFFERENCE = 1e-6  # [rad] and [rad/s], of the central differences of a right-hand side that is smooth there
HEAVE = 0.1  # [m/s] that makes drag act; the limit does not depend on it
GROWING = 1e-6  # [1/s], a growth rate above rounding

FRESHWATER = Path(__file__).parents[2] / 'config' / 'freshwater.yaml'
PUBLISHED_CRUISE, PUBLISHED_THRUST = (0.25, 0.47), 20.0  # [m/s], [N]
GAITS = (30.0, 0.6, 40.0), (40.0, 0.6, 40.0), (40.0, 0.4, 40.0), (50.0, 0.6, 40.0)  # A [deg], f [Hz], phi [deg]
LEAD_IN, PERIODS = 30.0, 8  # [s] until the speed is that of cruise; periods that are looked at


def _jacobian(parameters: Parameters, twist: NDArray) -> NDArray:
    """Return d(q-dot, q-double-dot) / d(q, q-dot) (2 n m, 2 n m) of a flat left fin on a body that moves evenly."""
    shape = parameters.fin.chains, parameters.fin.links
    size = shape[0] * shape[1]

    def acceleration(state: NDArray) -> NDArray:
        angles, rates = state.reshape(2, *shape)
        return fin_dynamics(parameters, 0, np.zeros((2, 3)), angles, rates, twist, np.zeros(6))[0].ravel()

    slopes = [(acceleration(step) - acceleration(-step)) / (2.0 * DIFFERENCE) for step in DIFFERENCE * np.eye(2 * size)]
    return np.block([[np.zeros((size, size)), np.eye(size)], [np.stack(slopes, axis=1)]])


def first_frequency(parameters: Parameters) -> float:
    """Return omega_1 [rad/s], a chain's first natural frequency without drag and damping, with its added mass."""
    alone = parameters.replace(fin={'chains': 2, 'joint_damping': 0.0}, water={'density': 0.0})
    return float(np.sort(np.abs(np.linalg.eigvals(_jacobian(alone, np.zeros(6)))))[0])


def rippling_speed(parameters: Parameters) -> float:
    """Return the forward speed [m/s] from which a small disturbance of the flat fin grows."""
    def growth(speed: float) -> float:
        twist = np.array([speed, 0.0, HEAVE, 0.0, 0.0, 0.0])
        return float(np.linalg.eigvals(_jacobian(parameters, twist)).real.max()) - GROWING

    return float(brentq(growth, 0.0, 4.0 * limit(parameters), rtol=1e-3))


def limit(parameters: Parameters) -> float:
    """Return omega_1 L / n [m/s]."""
    return first_frequency(parameters) * parameters.rods.support_length / parameters.fin.chains


def _steps(parameters: Parameters, duration: float) -> float:
    """Return the multiple of the time step that is nearest to `duration` [s]."""
    return round(duration / parameters.solver.time_step) * parameters.solver.time_step


def mean_thrust(parameters: Parameters, case: tuple[float, float, float], periods: int = 3) -> float:
    """Return the forward force on the held body [N], averaged over whole periods after two."""
    held = without_smoothing(parameters.replace(solver={'fixed_base': True}))
    simulator, period, samples = Simulator(held), 1.0 / case[1], 100
    simulator.command(left=gait(*case), right=gait(*case))
    simulator.advance(_steps(held, 2.0 * period))
    start, forces = simulator.state.time, []
    for sample in range(periods * samples):
        due = start + (sample + 1) * period / samples
        forces.append(simulator.advance(_steps(held, due - simulator.state.time)).wrench[0])
    return float(np.mean(forces))


def cruise(parameters: Parameters, case: tuple[float, float, float]) -> tuple[float, float]:
    """Return mean speed [m/s] of `PERIODS` periods of cruise, and the ripple of the fins from chain to chain.

    The ripple is the mean difference of the joint rates of neighbors over the mean joint rate: 1.4 for a wave of four
    chains; a smooth surface of n chains has some 3 / n.
    """
    simulator, period = Simulator(parameters), _steps(parameters, 1.0 / case[1])
    simulator.command(left=gait(*case), right=gait(*case))
    before = simulator.advance(_steps(parameters, LEAD_IN))
    differences, rates = [], []
    for _ in range(PERIODS * 10):
        after = simulator.advance(_steps(parameters, period / 10.0))
        differences.append(np.abs(np.diff(after.joint_rates, axis=1)).mean())
        rates.append(np.abs(after.joint_rates).mean())
    way = float(np.linalg.norm(after.position - before.position))
    return way / (after.time - before.time), float(np.mean(differences) / np.mean(rates))


def how_many_chains(quick: bool = False) -> Section:
    """A fin with too many chains ripples in a flow: where that begins, linear and in the swimming robot."""
    sizes = (8, 15) if quick else (8, 15, 30)
    coefficients = (0.0, 0.6) if quick else (0.0, 0.2, 0.6, 1.0)
    measured, predicted = {}, {}
    for coefficient in coefficients:
        for chains in sizes:
            parameters = Parameters().replace(
                solver={'coupling': MONOLITHIC}, water={'added_mass_coefficient': coefficient},
                fin={'chains': chains, 'joint_damping': 0.0})
            measured[coefficient, chains] = rippling_speed(parameters)
            predicted[coefficient, chains] = limit(parameters)
    worst = max(abs(measured[case] / predicted[case] - 1.0) * case[1] for case in measured)
    default = Parameters()
    swum = {chains: cruise(Parameters().replace(fin={'chains': chains}), GAITS[1])
            for chains in ((8, 48) if quick else (8, 15, 25, 30, 35, 40, 60, 120, 240))}
    limits = {chains: limit(Parameters().replace(fin={'chains': chains})) for chains in swum}
    few = [chains for chains in swum if swum[8][0] < limits[chains]]
    many = [chains for chains in swum if swum[8][0] > 1.2 * limits[chains]]
    claims = (
        Claim('speed from which waves along the chord grow, times chains', 'omega_1 L / n, derived', worst, 3.0,
              'the edges, where (11) is one-sided, are a share 1/n of the fin; measured, margin 2'),
        Claim('ripple of the swimming robot below that speed, times chains', 'a smooth surface has some 3',
              max(swum[chains][1] * chains for chains in few), 6.0, 'a wave of four chains has 11 and more'),
        Claim('ripple of the swimming robot a fifth above it', 'a wave of four chains has 1.41',
              min(swum[chains][1] for chains in many), (0.5, 1.6),
              'the central difference of (11) feels that wave most; a smooth surface has some 3/n'),
    )

    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2)
        for marker, coefficient in zip('os^D', coefficients, strict=False):
            drawn = left.loglog(sizes, [measured[coefficient, chains] for chains in sizes], marker,
                                label=f'$C_a$ = {coefficient:g}, eigenvalues')[0]
            left.loglog(sizes, [predicted[coefficient, chains] for chains in sizes], '--', linewidth=0.9,
                        color=drawn.get_color())
        left.loglog([], [], 'k--', linewidth=0.9, label=r'$\omega_1 L / n$')
        left.set(xlabel='chains n', ylabel='speed from which a fin ripples [m/s]', ylim=(0.02, None))
        left.legend(loc='lower left')
        right.plot(list(swum), [speed for speed, _ in swum.values()], 'o-', label='cruise speed [m/s]')
        right.plot(list(limits), list(limits.values()), 'k--', linewidth=0.9, label=r'$\omega_1 L / n$ [m/s]')
        right.plot(list(swum), [ripple for _, ripple in swum.values()], 's-', label='ripple from chain to chain')
        right.set(xlabel='chains n, default parameters', ylim=(0.0, 2.3))
        right.legend(loc='upper left')

    text = f"""
Chains of {default.fin.links} links, with added mass and without, follow the same rule: put q ~ exp(i k x + lambda t)
in the equation of the section before, without joint damping; it grows as soon as V k > omega_1, however strong or
weak the drag is, omega_1 being the first natural frequency of a chain with its added mass. So a fin is smooth up to a
speed of **omega_1 L / n**. On the left, it is compared with eigenvalues of `fin_dynamics`, differenced about a flat
fin that moves evenly. On the right, the free robot: where its speed would be above the line, the fins carry a wave of
four chains, and the robot slows down to the line. With the default parameters omega_1 =
{rounded(first_frequency(default), 3)} rad/s, and {default.fin.chains} chains are smooth up to
{rounded(limit(default), 3)} m/s, just enough for this gait. A robot that is faster, softer or has added mass wants
fewer.
"""
    return Section('How many chains swim smoothly', text, claims, draw,
                   'Left: speed from which waves grow. Right: cruise from rest, 40 deg, 0.6 Hz, phi = 40 deg.')


def fresh_water(quick: bool = False) -> Section:
    """The published thrust and cruise come out of config/freshwater.yaml."""
    parameters = Parameters.from_yaml(FRESHWATER)
    rods, fin = parameters.rods, parameters.fin
    amplitudes = (50.0,) if quick else (10.0, 20.0, 30.0, 40.0, 50.0)
    frequencies = (0.6,) if quick else (0.2, 0.4, 0.6)
    thrusts = {
        (amplitude, frequency): mean_thrust(parameters, (amplitude, frequency, 30.0))
        for amplitude in amplitudes for frequency in frequencies}
    greatest = max(thrusts, key=thrusts.__getitem__)
    swum = {case: cruise(parameters, case) for case in (GAITS[1:2] if quick else GAITS)}
    refined = {chains: cruise(parameters.replace(fin={'chains': chains}), GAITS[1])
               for chains in ((fin.chains,) if quick else (4, 6, 8, 10, 12, 16, 24, 30))}
    paper = swum[GAITS[1]][0]
    keulegan = 2.0 * math.pi * rods.rear_radius * math.sin(math.radians(GAITS[1][0])) / rods.support_length
    claims = (
        Claim('greatest mean thrust in fresh water', "the prototype's: about 20 N, at 0.6 Hz or less",
              abs(thrusts[greatest] - PUBLISHED_THRUST), 2.0, 'a tenth: published as about 20 N', 'N'),
        Claim('cruise in fresh water, 40 deg, 0.6 Hz', 'mantas, 0.25 to 0.47 m/s', paper, PUBLISHED_CRUISE,
              'published', 'm/s'),
        Claim("fin's drag coefficient against 8 KC^(-1/3)", 'plates in oscillating flow (Graham, 1980)',
              abs(fin.drag_coefficient / (8.0 * keulegan ** (-1.0 / 3.0)) - 1.0), 0.05, 'a value of one digit'),
        Claim('fastest cruise in fresh water over the speed from which its fins ripple', 'eigenvalues, as above',
              max(speed for speed, _ in swum.values()) / rippling_speed(parameters), 1.0, 'no ripple below 1'),
    )

    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2)
        for marker, frequency in zip('os^', frequencies, strict=False):
            left.plot(amplitudes, [thrusts[amplitude, frequency] for amplitude in amplitudes], f'{marker}-',
                      label=f'{frequency:g} Hz')
        left.axhline(PUBLISHED_THRUST, color='0.3', linestyle=':', label='prototype, about')
        left.set(xlabel='amplitude A [deg], phi = 30 deg', ylabel='mean thrust [N]')
        left.legend()
        chains = np.array(list(refined))
        right.plot(chains, [speed for speed, _ in refined.values()], 'o-', label='cruise speed [m/s]')
        right.plot(chains, first_frequency(parameters) * rods.support_length / chains, 'k--', linewidth=0.9,
                   label=r'$\omega_1 L / n$ [m/s]')
        right.plot(chains, [ripple for _, ripple in refined.values()], 's-', label='ripple from chain to chain')
        right.axvline(fin.chains, color='0.3', linestyle=':', label='chosen')
        right.set(xlabel='chains n', ylim=(0.0, 2.3))
        right.legend(loc='upper left')

    table = '\n'.join(
        f'| {amplitude:g} deg | {frequency:g} Hz | {phase:g} deg | {rounded(speed, 2)} |'
        for (amplitude, frequency, phase), (speed, _) in swum.items())
    text = f"""
`config/freshwater.yaml` takes Table 1's effective density of {Parameters().water.density:g} kg/m^3 back to
{parameters.water.density:g} kg/m^3 and adds the inertia of the water that the fins set in motion. Its two
coefficients are those of plates: C_a = {parameters.water.added_mass_coefficient:g}, an accelerated plate as long as
it is wide, and C_D = {fin.drag_coefficient:g}, a plate that swings, at the Keulegan-Carpenter number
{rounded(keulegan, 2)} that the rods have at {GAITS[1][0]:g} deg. Neither was fitted to the thrust:
{rounded(thrusts[greatest], 3)} N at A = {greatest[0]:g} deg and {greatest[1]:g} Hz comes out, and so does the cruise.
Added mass makes a chain slow, omega_1 = {rounded(first_frequency(parameters), 3)} rad/s, so that only {fin.chains}
chains are smooth at these speeds; the cruise hardly knows how many they are, up to where waves begin (right). Not
shown: that the coefficients are the real fin's; no measured wrench of it is published.

| A | f | phi | cruise [m/s] |
|---|---|---|---|
{table}
"""
    return Section('Fresh water of its true density', text, claims, draw,
                   'Mean thrust on the held body; cruise and ripple against the number of chains, 40 deg, 0.6 Hz.')

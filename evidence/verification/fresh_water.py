"""Themes 3 and 6: how many chains a fin may have, and fresh water with added mass, where this number matters."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq

from evidence.report import table
from evidence.verification.claims import Claim, Section, rounded
from evidence.verification.mechanics import without_smoothing
from manta_sim_ros.dynamics import MONOLITHIC, FloatArray, Parameters, Simulator, fin_dynamics
from manta_sim_ros.figures.gaits import gait

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DIFFERENCE = 1e-6  # [rad] and [rad/s], of central differences, where the right-hand side is smooth
HEAVE = 0.1  # [m/s], so that drag acts; the critical speed does not depend on it
GROWING = 1e-6  # [1/s], a growth rate that is larger than rounding

FRESHWATER = Path(__file__).parents[2] / 'config' / 'freshwater.yaml'
PUBLISHED_CRUISE, PUBLISHED_THRUST = (0.25, 0.47), 20.0  # [m/s], [N]
GAITS = (30.0, 0.6, 40.0), (40.0, 0.6, 40.0), (40.0, 0.4, 40.0), (50.0, 0.6, 40.0)  # A [deg], f [Hz], phi [deg]
LEAD_IN, PERIODS = 30.0, 8  # [s] before the speed is that of cruise; number of periods that are averaged


def _jacobian(parameters: Parameters, twist: FloatArray) -> FloatArray:
    """Return d(q-dot, q-ddot) / d(q, q-dot) (2 n m, 2 n m) of a flat left fin on a body that moves steadily."""
    shape = parameters.fin.chains, parameters.fin.links
    size = shape[0] * shape[1]

    def acceleration(state: FloatArray) -> FloatArray:
        angles, rates = state.reshape(2, *shape)
        return fin_dynamics(parameters, 0, np.zeros((2, 3)), angles, rates, twist, np.zeros(6))[0].ravel()

    slopes = [(acceleration(step) - acceleration(-step)) / (2.0 * DIFFERENCE) for step in DIFFERENCE * np.eye(2 * size)]
    return np.block([[np.zeros((size, size)), np.eye(size)], [np.stack(slopes, axis=1)]])


def first_frequency(parameters: Parameters) -> float:
    """Return omega_1 [rad/s], the first natural frequency of a chain with its added mass, without drag and damping."""
    alone = parameters.replace(fin={'chains': 2, 'joint_damping': 0.0}, water={'density': 0.0})
    return float(np.sort(np.abs(np.linalg.eigvals(_jacobian(alone, np.zeros(6)))))[0])


def critical_speed(parameters: Parameters) -> float:
    """Return the forward speed [m/s] above which the flat fin is unstable along its chord, from eigenvalues."""
    def growth(speed: float) -> float:
        twist = np.array([speed, 0.0, HEAVE, 0.0, 0.0, 0.0])
        return float(np.linalg.eigvals(_jacobian(parameters, twist)).real.max()) - GROWING

    return float(brentq(growth, 0.0, 4.0 * predicted_speed(parameters), rtol=1e-3))


def predicted_speed(parameters: Parameters) -> float:
    """Return omega_1 L / n [m/s], the prediction of `critical_speed`."""
    return first_frequency(parameters) * parameters.rods.support_length / parameters.fin.chains


def _steps(parameters: Parameters, duration: float) -> float:
    """Return the multiple of the time step that is nearest to `duration` [s]."""
    return round(duration / parameters.solver.time_step) * parameters.solver.time_step


def mean_thrust(parameters: Parameters, case: tuple[float, float, float], periods: int = 3) -> float:
    """Return the forward force on the held body [N], averaged over `periods` periods after the first two."""
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
    """Return the mean speed [m/s] over `PERIODS` periods of cruise, and the roughness of the fins.

    The roughness is the mean difference of the joint rates of neighboring chains over the mean joint rate. It is 1.4
    for a wavelength of four chains, and about 3 / n for a smooth surface of n chains.
    """
    simulator, period = Simulator(parameters), _steps(parameters, 1.0 / case[1])
    simulator.command(left=gait(*case), right=gait(*case))
    before = simulator.advance(_steps(parameters, LEAD_IN))
    differences, rates = [], []
    for _ in range(PERIODS * 10):
        after = simulator.advance(_steps(parameters, period / 10.0))
        differences.append(np.abs(np.diff(after.joint_rates, axis=1)).mean())
        rates.append(np.abs(after.joint_rates).mean())
    distance = float(np.linalg.norm(after.position - before.position))
    return distance / (after.time - before.time), float(np.mean(differences) / np.mean(rates))


def how_many_chains(quick: bool = False) -> Section:
    """Compare the onset of the chordwise instability with its prediction, for a linearized fin and the free robot."""
    sizes = (8, 15) if quick else (8, 15, 30)
    coefficients = (0.0, 0.6) if quick else (0.0, 0.2, 0.6, 1.0)
    measured, predicted = {}, {}
    for coefficient in coefficients:
        for chains in sizes:
            parameters = Parameters().replace(
                solver={'coupling': MONOLITHIC}, water={'added_mass_coefficient': coefficient},
                fin={'chains': chains, 'joint_damping': 0.0})
            measured[coefficient, chains] = critical_speed(parameters)
            predicted[coefficient, chains] = predicted_speed(parameters)
    largest = max(abs(measured[case] / predicted[case] - 1.0) * case[1] for case in measured)
    default = Parameters()
    cruises = {chains: cruise(Parameters().replace(fin={'chains': chains}), GAITS[1])
               for chains in ((8, 48) if quick else (8, 15, 25, 30, 35, 40, 60, 120, 240))}
    limits = {chains: predicted_speed(Parameters().replace(fin={'chains': chains})) for chains in cruises}
    few = [chains for chains in cruises if cruises[8][0] < limits[chains]]
    many = [chains for chains in cruises if cruises[8][0] > 1.2 * limits[chains]]
    claims = (
        Claim('error of the critical speed of the chordwise instability, times chains', 'omega_1 L / n, derived',
              largest, 3.0,
              'the edges, where (11) is one-sided, are a share 1/n of the fin; measured with a margin of 2'),
        Claim('roughness of the fins of the free robot below that speed, times chains', 'a smooth surface has about 3',
              max(cruises[chains][1] * chains for chains in few), 6.0, 'a wavelength of four chains has 11 and more'),
        Claim('roughness of the fins of the free robot at 1.2 times that speed or more',
              'a wavelength of four chains has 1.41', min(cruises[chains][1] for chains in many), (0.5, 1.6),
              'the central difference of (11) is largest for this wavelength; a smooth surface has about 3/n'),
    )

    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2)
        for marker, coefficient in zip('os^D', coefficients, strict=False):
            drawn = left.loglog(sizes, [measured[coefficient, chains] for chains in sizes], marker,
                                label=f'$C_a$ = {coefficient:g}, eigenvalues')[0]
            left.loglog(sizes, [predicted[coefficient, chains] for chains in sizes], '--', linewidth=0.9,
                        color=drawn.get_color())
        left.loglog([], [], 'k--', linewidth=0.9, label=r'$\omega_1 L / n$')
        left.set(xlabel='chains n', ylabel='critical speed [m/s]', ylim=(0.02, None))
        left.legend(loc='lower left')
        right.plot(list(cruises), [speed for speed, _ in cruises.values()], 'o-', label='cruise speed [m/s]')
        right.plot(list(limits), list(limits.values()), 'k--', linewidth=0.9, label=r'$\omega_1 L / n$ [m/s]')
        right.plot(list(cruises), [roughness for _, roughness in cruises.values()], 's-', label='roughness of the fins')
        right.set(xlabel='chains n, default parameters', ylim=(0.0, 2.3))
        right.legend(loc='upper left')

    text = f"""
Chains of {default.fin.links} links, with or without added mass, follow the same rule. Insert q ~ exp(i k x + lambda t)
into the equation of the previous section, without joint damping. This disturbance grows as soon as V k > omega_1,
however strong or weak the drag is. Here omega_1 is the first natural frequency of a chain with its added mass. So a fin
is stable along its chord up to the speed **omega_1 L / n**. The plot on the left compares this critical speed with the
eigenvalues of `fin_dynamics`, which is linearized about a flat fin that moves steadily. The plot on the right shows the
free robot. Where its speed would be above the line, the fins oscillate with a wavelength of four chains, and the robot
slows down to the line. The roughness of the fins is the mean difference of the joint rates of neighboring chains over
the mean joint rate. With the default parameters omega_1 is {rounded(first_frequency(default), 3)} rad/s, and
{default.fin.chains} chains are stable up to {rounded(predicted_speed(default), 3)} m/s, which is just enough for this
gait. A robot that is faster or softer or has added mass needs fewer chains.
"""
    return Section('How many chains a fin may have', text, claims, draw,
                   'Left: critical speed of the chordwise instability. Right: cruise from rest, A = 40°, f = 0.6 Hz, '
                   'φ = 40°.')


def fresh_water(quick: bool = False) -> Section:
    """Compare the thrust and the cruise speed of config/freshwater.yaml with the published ones."""
    parameters = Parameters.from_yaml(FRESHWATER)
    rods, fin = parameters.rods, parameters.fin
    amplitudes = (50.0,) if quick else (10.0, 20.0, 30.0, 40.0, 50.0)
    frequencies = (0.6,) if quick else (0.2, 0.4, 0.6)
    thrusts = {
        (amplitude, frequency): mean_thrust(parameters, (amplitude, frequency, 30.0))
        for amplitude in amplitudes for frequency in frequencies}
    greatest = max(thrusts, key=thrusts.__getitem__)
    cruises = {case: cruise(parameters, case) for case in (GAITS[1:2] if quick else GAITS)}
    refined = {chains: cruise(parameters.replace(fin={'chains': chains}), GAITS[1])
               for chains in ((fin.chains,) if quick else (4, 6, 8, 10, 12, 16, 24, 30))}
    keulegan = 2.0 * math.pi * rods.rear_radius * math.sin(math.radians(GAITS[1][0])) / rods.support_length
    claims = (
        Claim('error of the greatest mean thrust in fresh water', 'prototype, about 20 N at 0.6 Hz or less',
              abs(thrusts[greatest] - PUBLISHED_THRUST), 2.0, 'a tenth of the published value', 'N'),
        Claim('cruise speed in fresh water, A = 40°, f = 0.6 Hz', 'mantas, 0.25 to 0.47 m/s', cruises[GAITS[1]][0],
              PUBLISHED_CRUISE, 'published range', 'm/s'),
        Claim('error of the drag coefficient of the fin', '8 KC^(-1/3), plates in oscillating flow (Graham, 1980)',
              abs(fin.drag_coefficient / (8.0 * keulegan ** (-1.0 / 3.0)) - 1.0), 0.05,
              'the coefficient has one digit'),
        Claim('fastest cruise in fresh water over the critical speed of its fins', 'eigenvalues, as above',
              max(speed for speed, _ in cruises.values()) / critical_speed(parameters), 1.0,
              'derived: the fins are stable below 1'),
    )

    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2)
        for marker, frequency in zip('os^', frequencies, strict=False):
            left.plot(amplitudes, [thrusts[amplitude, frequency] for amplitude in amplitudes], f'{marker}-',
                      label=f'{frequency:g} Hz')
        left.axhline(PUBLISHED_THRUST, color='0.3', linestyle=':', label='prototype')
        left.set(xlabel='amplitude A [degrees], φ = 30°', ylabel='mean thrust [N]')
        left.legend()
        chains = np.array(list(refined))
        right.plot(chains, [speed for speed, _ in refined.values()], 'o-', label='cruise speed [m/s]')
        right.plot(chains, first_frequency(parameters) * rods.support_length / chains, 'k--', linewidth=0.9,
                   label=r'$\omega_1 L / n$ [m/s]')
        right.plot(chains, [roughness for _, roughness in refined.values()], 's-', label='roughness of the fins')
        right.axvline(fin.chains, color='0.3', linestyle=':', label='chosen number')
        right.set(xlabel='chains n', ylim=(0.0, 2.3))
        right.legend(loc='upper left')

    speeds = table(('A', 'f', 'φ', 'cruise speed'), (
        (f'{amplitude:g}°', f'{frequency:g} Hz', f'{phase:g}°', f'{rounded(speed, 2)} m/s')
        for (amplitude, frequency, phase), (speed, _) in cruises.items()))
    text = f"""
`config/freshwater.yaml` replaces Table 1's effective density of {Parameters().water.density:g} kg/m^3 by
{parameters.water.density:g} kg/m^3 and adds the inertia of the water that the fins set in motion. Its two coefficients
are those of plates. C_a = {parameters.water.added_mass_coefficient:g} is that of an accelerated plate that is as long
as it is wide. C_D = {fin.drag_coefficient:g} is that of an oscillating plate at the Keulegan-Carpenter number
{rounded(keulegan, 2)}, which the rods have at {GAITS[1][0]:g} degrees. Neither coefficient was fitted to the thrust,
but the greatest mean thrust, {rounded(thrusts[greatest], 3)} N at A = {greatest[0]:g} degrees and {greatest[1]:g} Hz,
and the cruise speed agree with the published ones. The added mass lowers the natural frequency of a chain to
{rounded(first_frequency(parameters), 3)} rad/s, so that only {fin.chains} chains are stable along the chord at these
speeds. The cruise speed hardly depends on the number of chains until the chordwise instability sets in (see the plot on
the right). This section does not verify that the coefficients are those of the real fin, since no measured wrench of it
is published.

{speeds}
"""
    return Section('Fresh water with its true density', text, claims, draw,
                   'Left: mean thrust on the held body. Right: cruise speed and roughness of the fins against the '
                   'number of chains, A = 40°, f = 0.6 Hz.')

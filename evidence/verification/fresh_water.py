"""Themes 3 and 6: how many chains a fin of the paper may have, and the robot in fresh water with its true density."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from evidence.references import equations
from evidence.report import table
from evidence.verification.claims import Claim, Section, rounded
from evidence.verification.mechanics import without_smoothing
from evidence.verification.turns import with_a_stable_step
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
HALF_AXES = (0.40, 0.30, 0.04)  # [m], of the ellipsoid that the added mass of the body belongs to
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


def growth_rate(parameters: Parameters, speed: float) -> float:
    """Return the growth rate [1/s] of the fastest growing disturbance of the flat fin at a forward speed [m/s]."""
    twist = np.array([speed, 0.0, HEAVE, 0.0, 0.0, 0.0])
    return float(np.linalg.eigvals(_jacobian(parameters, twist)).real.max())


def critical_speed(parameters: Parameters) -> float:
    """Return the forward speed [m/s] above which the flat fin is unstable along its chord, from eigenvalues."""
    return float(brentq(
        lambda speed: growth_rate(parameters, speed) - GROWING, 0.0, 4.0 * predicted_speed(parameters), rtol=1e-3))


def predicted_speed(parameters: Parameters) -> float:
    """Return omega_1 L / n [m/s], the prediction of `critical_speed`."""
    return first_frequency(parameters) * parameters.rods.support_length / parameters.fin.chains


def twist_wave_speed(parameters: Parameters) -> float:
    """Return C_t [m/s], of the slowest waves of twist along the chord: a slower flow amplifies no wave."""
    fin, water, links = parameters.fin, parameters.water, parameters.fin.links
    dl, sums = fin.span / links, np.tri(links)
    mass = equations.mass_matrix(parameters, np.zeros(links))
    middles = dl * np.maximum(0.0, np.arange(links)[:, None] + 0.5 - np.arange(links))  # heave of midpoints per joint
    added = water.added_mass_coefficient * water.added_mass_density * math.pi / 4.0 * parameters.rods.support_length
    twist = fin.shear_modulus * fin.thickness**3 / 3.0 * dl * sums.T @ sums
    return math.sqrt(np.linalg.eigvals(np.linalg.solve(mass + added * dl * middles.T @ middles, twist)).real.min())


def ellipsoid_added_mass(half_axes: tuple[float, float, float], density: float = 1000.0) -> FloatArray:
    """Return the added mass (6,) [kg, kg m^2] of an ellipsoid along and about its axes (Lamb, 1932)."""
    squares = np.square(half_axes)
    mass = density * 4.0 / 3.0 * math.pi * math.prod(half_axes)

    def share(axis: int) -> float:
        def integrand(t: float) -> float:
            at = squares + t / (1.0 - t)
            return 1.0 / (at[axis] * math.sqrt(at.prod()) * (1.0 - t) ** 2)

        return math.prod(half_axes) * quad(integrand, 0.0, 1.0, epsabs=1e-12, limit=500)[0]

    shares = [share(axis) for axis in range(3)]
    moments = []
    for first, second in ((1, 2), (2, 0), (0, 1)):
        difference, total = squares[first] - squares[second], squares[first] + squares[second]
        surplus = shares[second] - shares[first]
        moments.append(mass / 5.0 * difference**2 * surplus / (2.0 * difference - total * surplus))
    return np.array([*(mass * share / (2.0 - share) for share in shares), *moments])


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


class Cruise(NamedTuple):
    """Cruise over `PERIODS` periods: mean speed [m/s], roughness of the fins, largest angle of attack [degrees].

    The roughness is the mean difference of the joint rates of neighboring chains over the mean joint rate. It is 1.4
    for a wavelength of four chains, and about 3 / n for a smooth surface of n chains. The angle of attack is that of
    the body, between its x axis and its path.
    """

    speed: float
    roughness: float
    angle_of_attack: float


def cruise(parameters: Parameters, case: tuple[float, float, float]) -> Cruise:
    """Simulate a straight gait from rest until the robot cruises, and measure."""
    simulator, period = Simulator(parameters), _steps(parameters, 1.0 / case[1])
    simulator.command(left=gait(*case), right=gait(*case))
    before = simulator.advance(_steps(parameters, LEAD_IN))
    differences, rates, angles = [], [], []
    for _ in range(PERIODS * 10):
        after = simulator.advance(_steps(parameters, period / 10.0))
        differences.append(np.abs(np.diff(after.joint_rates, axis=1)).mean())
        rates.append(np.abs(after.joint_rates).mean())
        angles.append(abs(math.atan2(after.twist[2], after.twist[0])))
    distance = float(np.linalg.norm(after.position - before.position))
    return Cruise(distance / (after.time - before.time), float(np.mean(differences) / np.mean(rates)),
                  math.degrees(max(angles)))


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
    few = [chains for chains in cruises if cruises[8].speed < limits[chains]]
    many = [chains for chains in cruises if cruises[8].speed > 1.2 * limits[chains]]
    claims = (
        Claim('error of the critical speed of the chordwise instability, times chains', 'omega_1 L / n, derived',
              largest, 3.0,
              'the edges, where (11) is one-sided, are a share 1/n of the fin; measured with a margin of 2'),
        Claim('roughness of the fins of the free robot below that speed, times chains', 'a smooth surface has about 3',
              max(cruises[chains].roughness * chains for chains in few), 6.0,
              'a wavelength of four chains has 11 and more'),
        Claim('roughness of the fins of the free robot at 1.2 times that speed or more',
              'a wavelength of four chains has 1.41', min(cruises[chains].roughness for chains in many), (0.5, 1.6),
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
        right.plot(list(cruises), [run.speed for run in cruises.values()], 'o-', label='cruise speed [m/s]')
        right.plot(list(limits), list(limits.values()), 'k--', linewidth=0.9, label=r'$\omega_1 L / n$ [m/s]')
        right.plot(list(cruises), [run.roughness for run in cruises.values()], 's-', label='roughness of the fins')
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
gait. A robot that is faster or softer or has added mass needs fewer chains, or fins that resist twist
(`fin.shear_modulus`), as in "Fresh water".
"""
    return Section('How many chains a fin may have', text, claims, draw,
                   'Left: critical speed of the chordwise instability. Right: cruise from rest, A = 40°, f = 0.6 Hz, '
                   'φ = 40°.')


def fresh_water(quick: bool = False) -> Section:
    """Compare thrust, cruise and coefficients of config/freshwater.yaml with published values."""
    parameters = Parameters.from_yaml(FRESHWATER)
    rods, fin, body = parameters.rods, parameters.fin, parameters.body
    amplitudes = (50.0,) if quick else (10.0, 20.0, 30.0, 40.0, 50.0)
    frequencies = (0.6,) if quick else (0.2, 0.4, 0.6)
    thrusts = {
        (amplitude, frequency): mean_thrust(parameters, (amplitude, frequency, 30.0))
        for amplitude in amplitudes for frequency in frequencies}
    greatest = max(thrusts, key=thrusts.__getitem__)
    cruises = {case: cruise(parameters, case) for case in (GAITS[1:2] if quick else GAITS)}
    swimming = cruises[GAITS[1]]
    chains = (8, fin.chains, 16) if quick else (4, 6, 8, fin.chains, 16, 24, 30, 40)
    refined = {number: cruise(_stable(parameters, number), GAITS[1]) for number in chains}
    keulegan = 2.0 * math.pi * rods.rear_radius * math.sin(math.radians(GAITS[1][0])) / rods.support_length
    lamb, waves = ellipsoid_added_mass(HALF_AXES), twist_wave_speed(parameters)
    fastest = max(run.speed for run in cruises.values())
    growth = max(growth_rate(parameters.replace(fin={'chains': number, 'joint_damping': 0.0}), fastest)
                 for number in ((8, 12) if quick else (8, 12, 24, 40)))
    displaced = 4.0 / 3.0 * math.pi * math.prod(HALF_AXES) * parameters.water.density
    claims = (
        Claim('error of the greatest mean thrust in fresh water', 'prototype, about 20 N at 0.6 Hz or less',
              abs(thrusts[greatest] - PUBLISHED_THRUST), 2.0, 'a tenth of the published value', 'N'),
        Claim('cruise speed in fresh water, A = 40°, f = 0.6 Hz', 'mantas, 0.25 to 0.47 m/s', swimming.speed,
              PUBLISHED_CRUISE, 'published range', 'm/s'),
        Claim('largest angle of attack of the body in this cruise', 'a body that follows its path',
              swimming.angle_of_attack, (8.0, 12.0), 'measured with a margin of 2 degrees', 'degrees'),
        Claim('largest deviation of this cruise speed from 8 chains on', 'the same cruise with most chains',
              max(abs(refined[number].speed / refined[chains[-1]].speed - 1.0) for number in chains if number >= 8),
              0.01, 'required: 1 %, for a model that does not depend on the grid'),
        Claim('error of the drag coefficient of the fin', '8 KC^(-1/3), plates in oscillating flow (Graham, 1980)',
              abs(fin.drag_coefficient / (8.0 * keulegan ** (-1.0 / 3.0)) - 1.0), 0.05,
              'the coefficient has one digit'),
        Claim('error of the added mass of the body', 'ellipsoid in potential flow (Lamb, 1932)',
              float(np.abs(np.array(body.added_mass) / lamb - 1.0).max()), 0.05, 'the values have one to three digits'),
        Claim('fastest cruise in fresh water over the speed of twist waves', 'C_t of the fin, derived',
              fastest / waves, 1.0, 'derived: below 1 the flow amplifies no wave along the chord'),
        Claim('growth rate of the flat fin at the fastest cruise, from 8 chains on',
              'eigenvalues of the linearized fin', growth, 0.0, 'derived: disturbances decay', '1/s'),
    )

    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2)
        for marker, frequency in zip('os^', frequencies, strict=False):
            left.plot(amplitudes, [thrusts[amplitude, frequency] for amplitude in amplitudes], f'{marker}-',
                      label=f'{frequency:g} Hz')
        left.axhline(PUBLISHED_THRUST, color='0.3', linestyle=':', label='prototype')
        left.set(xlabel='amplitude A [degrees], φ = 30°', ylabel='mean thrust [N]')
        left.legend()
        right.plot(chains, [run.speed for run in refined.values()], 'o-', label='cruise speed [m/s]')
        right.axhline(waves, color='k', linestyle='--', linewidth=0.9, label=r'$C_t$ [m/s]')
        right.plot(chains, [run.roughness for run in refined.values()], 's-', label='roughness of the fins')
        right.axvline(fin.chains, color='0.3', linestyle=':', label='chosen number')
        right.set(xlabel='chains n', ylim=(0.0, 2.3))
        right.legend(loc='center right')

    speeds = table(('A', 'f', 'φ', 'cruise speed', 'angle of attack'), (
        (f'{amplitude:g}°', f'{frequency:g} Hz', f'{phase:g}°', f'{rounded(run.speed, 2)} m/s',
         f'{run.angle_of_attack:.1f}°')
        for (amplitude, frequency, phase), run in cruises.items()))
    text = f"""
`config/freshwater.yaml` replaces Table 1's effective density of {Parameters().water.density:g} kg/m^3 by
{parameters.water.density:g} kg/m^3. Fins and body set water in motion, and the fins resist twist. The coefficients are
those of plates and of an ellipsoid. C_a = {parameters.water.added_mass_coefficient:g} is that of an accelerated plate
that is as long as it is wide. C_D = {fin.drag_coefficient:g} is that of an oscillating plate at the Keulegan-Carpenter
number {rounded(keulegan, 2)}, which the rods have at {GAITS[1][0]:g} degrees. The added mass of the body is that of an
ellipsoid with half axes of {HALF_AXES[0]:g}, {HALF_AXES[1]:g} and {HALF_AXES[2]:g} m, which displaces
{rounded(displaced, 3)} kg. No coefficient was fitted to a motion. The greatest mean thrust,
{rounded(thrusts[greatest], 3)} N at A = {greatest[0]:g} degrees and {greatest[1]:g} Hz, and the cruise speed agree with
the published ones. Waves of twist run along the chord at C_t = {rounded(waves, 3)} m/s or more, much faster than the
robot swims. So the fins are stable along the chord, and the cruise speed does not depend on the number of chains. The
angle of attack is the largest one between the body's x axis and its path. This section does not verify that the
coefficients are those of the real robot, since no measured wrench of it is published.

{speeds}
"""
    return Section('Fresh water with its true density', text, claims, draw,
                   'Left: mean thrust on the held body. Right: cruise speed and roughness of the fins against the '
                   'number of chains, A = 40°, f = 0.6 Hz.')


def _stable(parameters: Parameters, chains: int) -> Parameters:
    return with_a_stable_step(parameters.replace(fin={'chains': chains}))

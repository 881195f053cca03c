"""Theme 3, refinement: where refinement along the chord ends, since the model becomes unstable along the chord."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.optimize import brentq

from evidence.references.mechanism import support_pose
from evidence.scenarios import sized
from evidence.verification.claims import Claim, Section, rounded
from evidence.verification.gaits import GAITS
from evidence.verification.mechanics import without_smoothing
from manta_sim_ros.dynamics import MONOLITHIC, FinCommand, FloatArray, Parameters, Simulator, State
from manta_sim_ros.figures.style import MARKERS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ALONG, THROUGH = 0.5, 0.05  # [m/s], speed of the fin along its chord, and of the water normal to the fin
CHAINS = 6, 10, 14, 20, 30, 45
SMALL = 1e-7  # [rad], initial amplitude of a mode
TIME_STEP = 5e-4  # [s], rounded down to divide the period of a mode
SWIM_TIME = 10.0  # [s]


class Mode(NamedTuple):
    """A chordwise mode of a fin of single links: its complex growth rate [1/s] and complex joint angles (n,)."""

    rate: complex
    shape: FloatArray


def _links(chains: int) -> Parameters:
    """Return a held robot with fins of single links, in a stream along the chord and normal to the fin."""
    parameters = sized(chains, 1, solver={'fixed_base': True})
    rotation = support_pose(parameters, 0, np.zeros((2, 3)))[0].value
    return parameters.replace(water={'current': rotation @ [-ALONG, 0.0, THROUGH]})


def _slope_matrix(chains: int, spacing: float) -> FloatArray:
    """Return the matrix (n, n) [1/m] of the chordwise slope of (11): central inside, one-sided at the edges."""
    matrix = np.zeros((chains, chains))
    for k in range(chains):
        ahead, behind = max(k - 1, 0), min(k + 1, chains - 1)
        matrix[k, ahead] += 1.0 / ((behind - ahead) * spacing)
        matrix[k, behind] -= 1.0 / ((behind - ahead) * spacing)
    return matrix


def fastest_mode(parameters: Parameters, along: float = ALONG) -> Mode:
    """Return the fastest growing solution of (11) and (12), linearized.

    The equation is q-ddot + (c/I + d) q-dot + (k/I) q - d V dq/dx = 0 with V = `along` [m/s].
    """
    fin, water, chains = parameters.fin, parameters.water, parameters.fin.chains
    inertia = fin.density * fin.thickness * fin.span**3 / 3.0
    stiffness = fin.youngs_modulus * fin.thickness**3 / 12.0 / fin.span
    drag = water.density * fin.drag_coefficient * THROUGH * fin.span**3 / 4.0 / inertia
    slope = _slope_matrix(chains, parameters.rods.support_length / chains)
    rates, shapes = np.linalg.eig(np.block([
        [np.zeros((chains, chains)), np.eye(chains)],
        [drag * along * slope - stiffness / inertia * np.eye(chains),
         -(drag + fin.joint_damping / inertia) * np.eye(chains)]]))
    fastest = int(np.argmax(rates.real + 1e-9 * rates.imag))
    return Mode(complex(rates[fastest]), shapes[:chains, fastest])


def _simulated_growth(parameters: Parameters, mode: Mode, step: float) -> float:
    """Return the growth rate [1/s] of a mode over one of its periods, from the bent equilibrium in the stream."""
    fin, water = parameters.fin, parameters.water

    def imbalance(angle: float) -> float:
        pressure = 0.5 * water.density * fin.drag_coefficient * (THROUGH * math.cos(angle)) ** 2
        tangent = math.tan(0.5 * angle)
        bending = 2.0 * fin.youngs_modulus * fin.thickness**3 / 12.0 / fin.span * tangent * (1.0 + tangent**2)
        return bending - pressure * fin.span**2 / 2.0

    bent = brentq(imbalance, 0.0, 0.5)
    period = 2.0 * math.pi / mode.rate.imag
    count = math.ceil(period / step)
    timed = parameters.replace(solver={'time_step': period / count})
    shape = SMALL * mode.shape / np.abs(mode.shape).max()
    angles, rates = np.zeros((2, 2, fin.chains, 1))
    angles[0, :, 0], rates[0, :, 0] = bent + shape.real, (mode.rate * shape).real
    angles[1] = bent
    start = dataclasses.replace(State.at_rest(timed), joint_angles=angles, joint_rates=rates)
    after = Simulator(timed, state=start).advance(period).joint_angles[0, :, 0] - bent
    return math.log(np.linalg.norm(after) / np.linalg.norm(shape.real)) / period


def _roughness(
    gaits: tuple[FinCommand, FinCommand], chains: int, time_step: float = 2e-3,
) -> tuple[FloatArray, FloatArray]:
    """Return times [s] and the largest second difference of the tips' angles along the chord [rad], body free."""
    parameters = without_smoothing(sized(chains, 3, solver={'coupling': MONOLITHIC, 'time_step': time_step}))
    simulator = Simulator(parameters)
    simulator.command(left=gaits[0], right=gaits[1])
    roughness = []
    for _ in range(round(SWIM_TIME / 0.1)):
        tips = simulator.advance(0.1).joint_angles.sum(axis=2)
        roughness.append(float(np.abs(np.diff(tips, 2, axis=1)).max()))
    return 0.1 * np.arange(1, len(roughness) + 1), np.array(roughness)


def limit_of_refinement(quick: bool = False) -> Section:
    """Measure the growth of the fastest chordwise mode in a stream, and the roughness of the fins in the gaits."""
    modes = {number: fastest_mode(_links(number)) for number in CHAINS}
    growth = {number: _simulated_growth(_links(number), mode, TIME_STEP) for number, mode in modes.items()
              if mode.rate.imag > 1.0}
    finest = CHAINS[-1]
    halved = _simulated_growth(_links(finest), modes[finest], TIME_STEP / 2.0)
    largest = max(abs(growth[number] - modes[number].rate.real) / abs(modes[number].rate) for number in growth)
    straight, turn = 'straight gait, A = 40°, f = 0.6 Hz', 'turn of set 2, A = 40/20°, f = 0.8 Hz'
    runs = {(name, number): _roughness(GAITS[name], number)
            for name, number in ((straight, 30), (straight, 60), (turn, 8), (turn, 30))}
    stable, unstable = (runs[straight, number][1][-20:].max() for number in (30, 60))
    reference = 'a smooth surface has second differences of about 1/n^2'
    claims = (
        Claim(f'error of the growth rates of chordwise modes, {min(growth)} to {finest} chains',
              '(11), (12) linearized by hand', largest, 1e-3,
              'relative to the modulus of the rate; the linearization neglects the bend of the fin; measured with a '
              'margin of 3'),
        Claim(f'change of the growth rate with half the step, {finest} chains', 'the same with the whole step',
              abs(halved / growth[finest] - 1.0), 1e-7,
              'fourth order: the instability is that of the model and not of the integrator'),
        Claim('roughness of the fins in the straight gait, 30 chains', reference, float(stable), 5e-3,
              'measured with a margin of 5', 'rad'),
        Claim('roughness of the fins in the straight gait, 60 chains', reference, float(unstable), (0.05, 3.0),
              'above the limit there must be a sawtooth along the chord', 'rad'),
    )

    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2)
        left.plot(CHAINS, [mode.rate.real for mode in modes.values()], 'k-', linewidth=0.9, label='derived')
        left.plot(list(growth), list(growth.values()), 'o', label='simulated')
        left.axhline(0.0, color='0.6', linewidth=0.6)
        left.set(xlabel='chains n', ylabel='growth rate of the fastest mode [1/s]')
        left.legend()
        for marker, ((name, number), (time, roughness)) in zip(MARKERS, runs.items(), strict=False):
            right.semilogy(time, roughness, marker, markersize=2.5, linestyle='-', linewidth=0.8,
                           label=f'{name.split(",")[0]}, n = {number}')
        right.set(xlabel='time [s]', ylabel='second difference along the chord [rad]')
        right.legend()

    parameters = _links(finest)
    fin = parameters.fin
    frequency = math.sqrt(fin.youngs_modulus * fin.thickness**3 / 12.0 / fin.span / (
        fin.density * fin.thickness * fin.span**3 / 3.0))
    most_chains = frequency * parameters.rods.support_length / ALONG
    turns = ' and '.join(f'{rounded(runs[turn, number][1][-20:].max())} rad with {number} chains' for number in (8, 30))
    return Section('Where refinement along the chord ends', f"""
Neighboring chains are coupled by the normal (11) alone, and nothing resists bending along the chord. A fin may
therefore be unstable along its chord. On a fin that moves with the speed V along its chord through the water, a
disturbance with the wave number k along the chord obeys q-ddot + (c/I + d) q-dot + w^2 q - d V dq/dx = 0. Here d is the
damping rate of the drag, and w is the natural frequency of a chain. The drag damps the motion relative to the water, so
it amplifies a disturbance that travels more slowly than the water passes. Without joint damping the disturbance grows
where V k > w. This is the chordwise instability. The largest wave number of n chains is k = n / L. With more than about
n = w L / V chains, the model itself is therefore unstable, at a rate that increases with n. This number is
{rounded(most_chains)} in the example on the left, with {rounded(ALONG)} m/s along and {rounded(THROUGH)} m/s normal to
a fin of single links. The growth rates of the simulator agree with those of the equations, and the step does not change
them. So a shorter step does not help, and there is no limit of infinitely many chains.

The plot on the right shows the largest second difference of the tips' angles along the chord in the paper's gaits from
rest. In the straight gait at 0.6 Hz, fins of 30 chains stay smooth, and fins of 60 chains end in a sawtooth. In the
turn of set 2, at 0.8 Hz, the fin that meets the faster flow becomes unstable earlier: after {rounded(SWIM_TIME)} s the
second difference is {turns}. A result with a sawtooth is not a property of the robot. According to the formula, fewer
chains, a stiffer fin or a lower speed avoid the instability. The paper's model has no stiffness along the chord;
`fin.shear_modulus` adds one, which removes the instability, see "Fresh water". This section does not cover the turns
after {rounded(SWIM_TIME)} s.
""", claims, draw, 'Left: growth rate of the fastest chordwise mode of a flat fin in a stream. '
        'Right: roughness of the fins of the free robot.')


CHECKS = (limit_of_refinement,)

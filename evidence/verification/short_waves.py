"""Theme 3, refinement: where refining along the chord ends, since the model leaves short chordwise waves unstable."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from evidence.references.pinocchio_tree import support_pose
from evidence.scenarios import sized
from evidence.verification.claims import Claim, Section, rounded
from evidence.verification.gaits import GAITS
from evidence.verification.mechanics import without_smoothing
from manta_sim_ros.dynamics import MONOLITHIC, FinCommand, Parameters, Simulator, State
from manta_sim_ros.figures.style import MARKERS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ALONG, THROUGH = 0.5, 0.05  # [m/s], speed of the fin along its chord and of the water normal to it
CHAINS = 6, 10, 14, 20, 30, 45
SMALL = 1e-7  # [rad], amplitude of the wave at the start
TIME_STEP = 5e-4  # [s], about
SWIM_TIME = 10.0  # [s]


class Wave(NamedTuple):
    """The fastest growing wave of a fin of single links: its rate [1/s], complex, and joint angles (n,), complex."""

    rate: complex
    shape: NDArray


def _links(chains: int) -> Parameters:
    """Return a held robot with fins of single links in a stream along the chord and through the fin."""
    parameters = sized(chains, 1, solver={'fixed_base': True})
    rotation = support_pose(parameters, 0, np.zeros((2, 3)))[0].value
    return parameters.replace(water={'current': rotation @ [-ALONG, 0.0, THROUGH]})


def _slope_matrix(chains: int, spacing: float) -> NDArray:
    """Return the matrix (n, n) [1/m] of the chordwise slope of (11): central inside, one-sided at the edges."""
    matrix = np.zeros((chains, chains))
    for k in range(chains):
        ahead, behind = max(k - 1, 0), min(k + 1, chains - 1)
        matrix[k, ahead] += 1.0 / ((behind - ahead) * spacing)
        matrix[k, behind] -= 1.0 / ((behind - ahead) * spacing)
    return matrix


def fastest_wave(parameters: Parameters, along: float = ALONG) -> Wave:
    """Return the fastest growing solution of q'' + (c/I + d) q' + (k/I) q - d V dq/dx = 0, (11) and (12) linearized."""
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
    return Wave(complex(rates[fastest]), shapes[:chains, fastest])


def _simulated_growth(parameters: Parameters, wave: Wave, step: float) -> float:
    """Return the growth rate [1/s] of a wave over one of its periods, on the bent fin at rest in the stream."""
    fin, water = parameters.fin, parameters.water

    def unbalanced(angle: float) -> float:
        pressure = 0.5 * water.density * fin.drag_coefficient * (THROUGH * math.cos(angle)) ** 2
        tangent = math.tan(0.5 * angle)
        bending = 2.0 * fin.youngs_modulus * fin.thickness**3 / 12.0 / fin.span * tangent * (1.0 + tangent**2)
        return bending - pressure * fin.span**2 / 2.0

    bent = brentq(unbalanced, 0.0, 0.5)
    period = 2.0 * math.pi / wave.rate.imag
    count = math.ceil(period / step)
    timed = parameters.replace(solver={'time_step': period / count})
    shape = SMALL * wave.shape / np.abs(wave.shape).max()
    angles, rates = np.zeros((2, 2, fin.chains, 1))
    angles[0, :, 0], rates[0, :, 0] = bent + shape.real, (wave.rate * shape).real
    angles[1] = bent
    start = dataclasses.replace(State.at_rest(timed), joint_angles=angles, joint_rates=rates)
    after = Simulator(timed, state=start).advance(period).joint_angles[0, :, 0] - bent
    return math.log(np.linalg.norm(after) / np.linalg.norm(shape.real)) / period


def _roughness(gaits: tuple[FinCommand, FinCommand], chains: int, time_step: float = 2e-3) -> tuple[NDArray, NDArray]:
    """Return times [s] and largest second difference of the tips' angles along the chord [rad] in free swimming."""
    parameters = without_smoothing(sized(chains, 3, solver={'coupling': MONOLITHIC, 'time_step': time_step}))
    simulator = Simulator(parameters)
    simulator.command(left=gaits[0], right=gaits[1])
    rough = []
    for _ in range(round(SWIM_TIME / 0.1)):
        tips = simulator.advance(0.1).joint_angles.sum(axis=2)
        rough.append(float(np.abs(np.diff(tips, 2, axis=1)).max()))
    return 0.1 * np.arange(1, len(rough) + 1), np.array(rough)


def short_waves(quick: bool = False) -> Section:
    """Grow the fastest chordwise wave of a fin in a stream, and watch the paper's gaits for such waves."""
    waves = {number: fastest_wave(_links(number)) for number in CHAINS}
    growth = {number: _simulated_growth(_links(number), wave, TIME_STEP) for number, wave in waves.items()
              if wave.rate.imag > 1.0}
    finest = CHAINS[-1]
    halved = _simulated_growth(_links(finest), waves[finest], TIME_STEP / 2.0)
    worst = max(abs(growth[number] - waves[number].rate.real) / abs(waves[number].rate) for number in growth)
    runs = {(name, number): _roughness(GAITS[name], number) for name, number in (
        ('forward, A 40, 0.6 Hz', 30), ('forward, A 40, 0.6 Hz', 60), ('turn 2, A 40/20, 0.8 Hz', 8),
        ('turn 2, A 40/20, 0.8 Hz', 30))}
    smooth, rough = (runs['forward, A 40, 0.6 Hz', number][1][-20:].max() for number in (30, 60))
    reference = 'no wave: a smooth surface has second differences of 1/n^2'
    claims = (
        Claim(f'growth rates of chordwise waves, {min(growth)} to {finest} chains', '(11), (12) linearized by hand',
              worst, 1e-3, 'over the modulus of the rate; that the fin is bent is left out; measured, margin 3'),
        Claim(f'growth rate with half the step, {finest} chains', 'the same with the whole step',
              abs(halved / growth[finest] - 1.0), 1e-7, "fourth order: the wave is the model's, not the integrator's"),
        Claim('roughness of the fins swimming forward, 30 chains', reference, float(smooth), 5e-3,
              'measured, margin 5', 'rad'),
        Claim('roughness of the fins swimming forward, 60 chains', reference, float(rough), (0.05, 3.0),
              'shown: past the limit, a sawtooth along the chord', 'rad'),
    )

    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2)
        left.plot(CHAINS, [wave.rate.real for wave in waves.values()], 'k-', linewidth=0.9, label='derived')
        left.plot(list(growth), list(growth.values()), 'o', label='simulated')
        left.axhline(0.0, color='0.6', linewidth=0.6)
        left.set(xlabel='chains n', ylabel='growth rate of the fastest wave [1/s]')
        left.legend()
        for marker, ((name, number), (time, rough)) in zip(MARKERS, runs.items(), strict=False):
            right.semilogy(time, rough, marker, markersize=2.5, linestyle='-', linewidth=0.8,
                           label=f'{name.split(",")[0]}, n = {number}')
        right.set(xlabel='time [s]', ylabel='second difference along chord [rad]')
        right.legend()

    parameters = _links(finest)
    fin = parameters.fin
    frequency = math.sqrt(fin.youngs_modulus * fin.thickness**3 / 12.0 / fin.span / (
        fin.density * fin.thickness * fin.span**3 / 3.0))
    most = frequency * parameters.rods.support_length / ALONG
    after = {key: rough[-20:].max() for key, (_, rough) in runs.items()}
    turns = ', '.join(f'{rounded(after["turn 2, A 40/20, 0.8 Hz", number])} rad with {number}' for number in (8, 30))
    return Section('Where refining along the chord ends', f"""
Chains are tied to each other by the normal (11) alone; nothing resists bending along the chord. A wave along the chord
with wave number k, on a fin that moves through the water with V along its chord, obeys q'' + (c/I + d) q' + w^2 q - d V
dq/dx = 0, where d is the rate of the drag and w the natural frequency. Drag damps in the frame of the water, so it
feeds a wave that runs slower than the water passes: without joint damping it grows where V k > w. The finest wave that
n chains see has k = n / L. So beyond about n = w L / V chains the model itself is unstable, at a rate that rises with
n: {rounded(most)} in the example on the left ({rounded(ALONG)} m/s along, {rounded(THROUGH)} m/s through a fin of
single links). The simulator's growth rates are those of the equations, and the step does not change them: a shorter
step does not help, and there is no limit of infinitely many chains.

On the right, the paper's gaits from rest, by the largest second difference of the tips' angles along the chord. Forward
at 0.6 Hz, 30 chains stay smooth and 60 end in a sawtooth. In the turn of set 2, at 0.8 Hz, the fin that meets the water
faster gets there sooner: after {rounded(SWIM_TIME)} s it has {turns} chains. A result with a sawtooth is no property of
the robot. By the formula, fewer chains, a stiffer fin or slower swimming avoid it; a stiffness along the chord would
remove it, but the paper's model has none. What becomes of the turns later than {rounded(SWIM_TIME)} s is not shown.
""", claims, draw,
        'Left: growth rate of the fastest chordwise wave of a flat fin in a stream. Right: roughness in free swimming.')


CHECKS = (short_waves,)

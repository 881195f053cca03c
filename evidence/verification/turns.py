"""Theme 6, fresh water: the turns of config/freshwater.yaml converge in chains, links, time and step."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from evidence.report import table
from evidence.verification.claims import Claim, Section
from evidence.verification.figures import mark
from evidence.verification.mechanics import without_smoothing
from manta_sim_ros.dynamics import MONOLITHIC, SEQUENTIAL, Parameters, Simulator, State, largest_stable_step
from manta_sim_ros.figures.gaits import TURNS
from manta_sim_ros.figures.style import MARKERS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FRESHWATER = Path(__file__).parents[2] / 'config' / 'freshwater.yaml'
DURATION, LONG = 25.0, 60.0  # [s] of a turn from rest
SETTLED = 12.0  # [s] until a turn is steady enough to compare couplings
SAMPLE = 0.125  # [s] between two headings, a tenth of a period
CHAINS = 8, 12, 16, 24, 30, 40, 60
LINKS = 2, 3, 4, 6, 8
COARSE = 8  # chains while links or couplings are compared
STEP_SHARE = 0.9  # of the largest stable step, if that of the file is above it
COUPLED_STEPS = 5e-4, 2.5e-4  # [s] of the staggered coupling


class Turn(NamedTuple):
    """A turn from rest: mean yaw rate [degrees/s] and radius [m] of its last quarter."""

    yaw_rate: float
    radius: float


def _heading(state: State) -> float:
    x, y, z, w = state.orientation
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def with_a_stable_step(parameters: Parameters, names: tuple[str, ...] = tuple(TURNS)) -> Parameters:
    """Return the parameters with a smaller step that divides `SAMPLE`, if that of the file is too large for a turn."""
    longest = STEP_SHARE * min(largest_stable_step(parameters, *TURNS[name]) for name in names)
    if parameters.solver.time_step <= longest:
        return parameters
    return parameters.replace(solver={'time_step': SAMPLE / math.ceil(SAMPLE / longest)})


def turn(parameters: Parameters, name: str, duration: float = DURATION) -> Turn:
    """Simulate a turn of Figures 10 and 11 from rest."""
    simulator = Simulator(parameters)
    simulator.command(left=TURNS[name][0], right=TURNS[name][1])
    samples = round(duration / SAMPLE)
    last = samples // 4
    states = [simulator.advance((samples - last) * SAMPLE)]
    states += [simulator.advance(SAMPLE) for _ in range(last)]
    headings = np.unwrap([_heading(state) for state in states])
    x, y = np.array([state.position[:2] for state in states]).T
    circle = np.linalg.lstsq(np.stack([2.0 * x, 2.0 * y, np.ones_like(x)], axis=1), x**2 + y**2, rcond=None)[0]
    return Turn(math.degrees(headings[-1] - headings[0]) / (last * SAMPLE), math.sqrt(circle[2] + circle[0] ** 2
                                                                                    + circle[1] ** 2))


def _limit(rates: dict[int, float]) -> float:
    """Return the yaw rate for infinitely many links, from those of 2, 4 and 6 links by two powers of 1 / m."""
    widths = 1.0 / np.array([2.0, 4.0, 6.0])
    matrix = np.stack([widths**0, widths, widths**2], axis=1)
    return float(np.linalg.solve(matrix, [rates[links] for links in (2, 4, 6)])[0])


def turns_converge(quick: bool = False) -> Section:
    """Refine the chains, the links and the step of both turns, and let them last longer."""
    base = without_smoothing(Parameters.from_yaml(FRESHWATER))
    default = base.fin.links
    chains, links = (CHAINS[:3], LINKS[:4]) if quick else (CHAINS, LINKS)
    duration = SETTLED if quick else DURATION
    of_chains = {name: {number: turn(with_a_stable_step(base.replace(fin={'chains': number})), name, duration)
                        for number in chains} for name in TURNS}
    of_links = {name: {number: turn(with_a_stable_step(base.replace(fin={'chains': COARSE, 'links': number})), name,
                                    duration) for number in links} for name in TURNS}
    longer = {name: [turn(base, name, time).yaw_rate for time in (DURATION, LONG)] for name in TURNS}
    bare = base.replace(water={'added_mass_coefficient': 0.0}, fin={'chains': COARSE})
    coupled = {
        name: [turn(bare.replace(solver={'coupling': coupling, 'time_step': step}), name, SETTLED).yaw_rate
               for coupling, step in ((MONOLITHIC, COUPLED_STEPS[0]), *((SEQUENTIAL, step) for step in COUPLED_STEPS))]
        for name in TURNS}
    claims = []
    for name in TURNS:
        finest = of_chains[name][chains[-1]].yaw_rate
        rates = {number: result.yaw_rate for number, result in of_links[name].items()}
        monolithic, staggered, fine = coupled[name]
        claims += [
            Claim(f'largest deviation of the yaw rate of {name} from 8 chains on', 'the same turn with most chains',
                  max(abs(result.yaw_rate / finest - 1.0) for result in of_chains[name].values()), 0.01,
                  'required: 1 %, for a model that does not depend on the grid'),
            Claim(f'change of the yaw rate of {name} from {DURATION:g} to {LONG:g} s', 'the same turn, longer',
                  abs(longer[name][1] / longer[name][0] - 1.0), 0.01, 'required: 1 %, for a steady turn'),
            Claim(f'deviation of the yaw rate of {name} with {default} links',
                  'limit extrapolated from 2, 4 and 6 links',
                  abs(rates[default] / _limit(rates) - 1.0), 0.2,
                  'first order, as for the thrust and the cantilever; measured with a margin of 1.5'),
            Claim(f'deviation of the yaw rate of {name}, staggered, step {1e3 * COUPLED_STEPS[0]:g} ms',
                  'monolithic, both without added mass of the fins', abs(staggered / monolithic - 1.0), 5e-4,
                  'first order; measured with a margin of 4'),
        ]
    ratios = [abs(staggered - monolithic) / abs(fine - monolithic) for monolithic, staggered, fine in coupled.values()]
    claims.append(Claim(
        'ratio of the deviations of the staggered coupling with the whole and half the step, set 2',
        'order 1 of the forward Euler method', ratios[1], (1.8, 2.2), 'derived: 2'))

    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2, sharey=True)
        for axes, runs, label in ((left, of_chains, 'chains n'), (right, of_links, 'links m')):
            sizes = list(runs['set 1'])
            for marker, (name, of_size) in zip(MARKERS, runs.items(), strict=False):
                axes.semilogx(sizes, [-of_size[size].yaw_rate for size in sizes], f'{marker}-', label=name)
            mark(axes, sizes)
            axes.set(xlabel=label, ylim=(0.0, 110.0))
            axes.legend(loc='lower left')
        left.set_ylabel('yaw rate to the right [degrees/s]')

    rows = table(('turn', 'yaw rate', 'radius', *(f'{number} links' for number in links)), (
        (name, f'{of_chains[name][base.fin.chains].yaw_rate:.1f}°/s',
         f'{of_chains[name][base.fin.chains].radius:.2f} m',
         *(f'{of_links[name][number].yaw_rate:.1f}°/s' for number in links)) for name in TURNS))
    return Section('Turns in fresh water', f"""
With the paper's model alone the number of chains decides how fast the robot turns, see "Chains along the chord". With
stiffness against twist and a body in water, as in `config/freshwater.yaml`, it does not. Both turns of Figures 10 and
11 start from rest, and the yaw rate is averaged over the last quarter of {DURATION:g} s. Where the step of the file is
above the largest stable step, {STEP_SHARE:g} times that step is used. Both turns are to the right. The number of links
matters more than that of the chains, since a chain of few links is softer than a beam by the share 2/m, see "A
cantilever under a uniform load". The staggered coupling refuses added mass of the fins, so both couplings are compared
without it. This section does not verify that a robot turns so fast: identify the yaw damping of the body on your robot.

{rows}
""", tuple(claims), draw, f'Yaw rates of both turns, against chains (with {default} links) and links '
                          f'(with {COARSE} chains).')


CHECKS = (turns_converge,)

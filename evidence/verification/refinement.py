"""Theme 3, refinement: what chains, links and step do to thrust, cruise and turn, and which grid gives 1 %."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evidence.verification.claims import Claim, Section, rounded
from evidence.verification.figures import mark
from evidence.verification.mechanics import without_smoothing
from manta_sim_ros.dynamics import MONOLITHIC, SEQUENTIAL, Parameters, Simulator, State
from manta_sim_ros.figures.gaits import STRAIGHT, gait
from manta_sim_ros.figures.style import MARKERS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PERIODS = 5.0  # [s], three periods of 0.6 Hz: what is averaged
HELD_LEAD_IN, FREE_LEAD_IN = 2.0, 5.0  # [s] until the swing, or the body's speed, repeats itself
CHAINS = 4, 6, 8, 12, 16, 24
TOO_MANY_CHAINS = 30, 60, 120, 240  # see `short_waves`
LINKS = {1: 2e-3, 2: 2e-3, 3: 2e-3, 4: 1e-3, 6: 5e-4, 8: 2.5e-4, 12: 1e-4}  # each with a step that is stable, [s]
STEPS = 2.5e-3, 2e-3, 1e-3, 5e-4, 2.5e-4  # [s]
COARSE = 8  # chains while links or steps are refined
TURN = gait(35.0, 0.6)  # of the right fin, the left one swims with STRAIGHT
QUANTITIES = 'thrust', 'cruise speed', 'yaw rate'


class Swim(NamedTuple):
    """Mean thrust on the held body [N], speed straight ahead [m/s], and yaw rate of a turn [rad/s]."""

    thrust: float
    speed: float
    yaw_rate: float


def swim(chains: int, links: int, time_step: float, coupling: str = MONOLITHIC) -> Swim:
    """Run the paper's gait with the body held and free, and a turn (A 40 and 35 degrees), and average over 5 s."""
    free = without_smoothing(Parameters().replace(
        fin={'chains': chains, 'links': links}, solver={'time_step': time_step, 'coupling': coupling}))
    held = Simulator(free.replace(solver={'fixed_base': True}))
    held.command(left=STRAIGHT, right=STRAIGHT)
    held.advance(HELD_LEAD_IN)
    thrust = float(np.mean([held.advance(0.02).wrench[0] for _ in range(round(PERIODS / 0.02))]))
    straight, turning = Simulator(free), Simulator(free)
    straight.command(left=STRAIGHT, right=STRAIGHT)
    turning.command(left=STRAIGHT, right=TURN)
    first, last = straight.advance(FREE_LEAD_IN), straight.advance(PERIODS)
    speed = float(np.linalg.norm(last.position - first.position)) / PERIODS
    headings = [_heading(turning.advance(FREE_LEAD_IN))]
    headings += [_heading(turning.advance(0.5)) for _ in range(round(PERIODS / 0.5))]
    return Swim(thrust, speed, float(np.unwrap(headings)[-1] - headings[0]) / PERIODS)


def _heading(state: State) -> float:
    x, y, z, w = state.orientation
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _deviations(swims: Iterable[Swim], limit: Swim) -> NDArray:
    """Return how far each is from the limit, relative, (runs, 3)."""
    return np.abs(np.array(list(swims)) / np.array(limit) - 1.0)


def _limit(swims: Mapping[int, Swim], sizes: tuple[int, int, int], powers: tuple[int, int]) -> Swim:
    """Return the limit of infinite size: a constant and two powers of 1/size through three runs."""
    widths = 1.0 / np.array(sizes)
    matrix = np.stack([widths**0, widths ** powers[0], widths ** powers[1]], axis=1)
    return Swim(*np.linalg.solve(matrix, np.array([swims[size] for size in sizes]))[0].tolist())


def _order(coarse: float, middle: float, fine: float) -> float:
    """Return the order seen in three runs of doubled size, whatever the limit."""
    return math.log2(abs((coarse - middle) / (middle - fine)))


def _draw(axes: Axes, sizes: ArrayLike, deviations: NDArray, label: str) -> None:
    for marker, name, values in zip(MARKERS, QUANTITIES, 100.0 * deviations.T, strict=False):
        axes.loglog(sizes, values, f'{marker}-', label=name)
    axes.axhline(1.0, color='k', linestyle='--', linewidth=0.9, label='1 %')
    mark(axes, sizes)
    axes.set(xlabel=label, ylabel='deviation from the limit [%]')
    axes.legend()


def _enough(sizes: Iterable[int], deviations: NDArray) -> str:
    """Return from which size a quantity stays within 1 %, in words."""
    sizes = list(sizes)
    within = [bool(np.all(deviations[row:] < 0.01)) for row in range(len(sizes))]
    if any(within):
        return f'{sizes[within.index(True)]}'
    return f'more than {sizes[-1]}, by first order about {math.ceil(sizes[-1] * float(deviations[-1]) / 0.01)}'


def chains(quick: bool = False) -> Section:
    """Refine along the chord."""
    sizes = CHAINS if quick else CHAINS + TOO_MANY_CHAINS
    swims = {number: swim(number, 3, 2e-3) for number in sizes}
    limit = _limit(swims, (8, 16, 24), (1, 2))
    deviations = _deviations(swims.values(), limit)
    at_coarse = deviations[CHAINS.index(COARSE)]
    reference = 'limit extrapolated from 8, 16 and 24 chains'
    claims = (
        *(Claim(f'{name} with {COARSE} chains', reference, float(at_coarse[column]), tolerance, 'measured, margin 2')
          for column, (name, tolerance) in enumerate(zip(QUANTITIES, (2e-3, 1e-3, 5e-2), strict=True))),
        Claim('order of the yaw rate in the number of chains', 'yaw rate with 6, 12 and 24 chains',
              _order(*(swims[number].yaw_rate for number in (6, 12, 24))), (0.9, 1.6),
              'first order of the one-sided tangents at the two edges; measured, higher orders add to it'),
    )

    def draw(figure: Figure) -> None:
        _draw(figure.subplots(), sizes, deviations, 'chains n')

    enough = ', '.join(f'{name} {_enough(CHAINS, values[:len(CHAINS)])}'
                       for name, values in zip(QUANTITIES, deviations.T, strict=True))
    return Section('Chains along the chord', f"""
Mean thrust with the body held, speed straight ahead and yaw rate of a turn (A = 40 and 35 degrees) at 0.6 Hz, over
three periods, with 3 links, step 2 ms, monolithic. Chains from which each stays within 1 % of its limit: {enough}.
A step costs in proportion to the chains. From {TOO_MANY_CHAINS[0]} chains on, one after the other of these runs ends in
a sawtooth along the chord, the turn first and the held body last, and the deviation leaps: that is no error of the grid
but an instability of the model, see "Where refining along the chord ends".
""", claims, draw, 'Deviation from the limit of smooth fins against the number of chains.')


def links(quick: bool = False) -> Section:
    """Refine along the span."""
    sizes = {number: step for number, step in LINKS.items() if not quick or number in (2, 3, 4, 8)}
    swims = {number: swim(COARSE, number, step) for number, step in sizes.items()}
    limit = _limit(swims, (2, 4, 8), (1, 2))
    deviations = _deviations(swims.values(), limit)
    default = Parameters().fin.links
    at_default = deviations[list(sizes).index(default)]
    reference = 'limit extrapolated from 2, 4 and 8 links'
    claims = (
        *(Claim(f'{name} with the default {default} links', reference, float(at_default[column]), tolerance, reason)
          for column, (name, tolerance, reason) in enumerate(zip(QUANTITIES, ((0.09, 0.15), 0.006, (0.07, 0.13)), (
              'first order, as the cantilever; measured, to a quarter', 'measured, margin 3', 'measured, to a third'),
              strict=True))),
        Claim('order of thrust in the number of links', 'thrust with 2, 4 and 8 links',
              _order(*(swims[number].thrust for number in (2, 4, 8))), (0.9, 1.4),
              'derived: 1, of the hinge at the root, as for the cantilever; the next order adds to it'),
    )

    def draw(figure: Figure) -> None:
        _draw(figure.subplots(), list(sizes), deviations, 'links m')

    most = max(sizes)
    cost = most * LINKS[default] / (default * sizes[most])
    enough = '; '.join(f'{name} {_enough(sizes, values)}'
                       for name, values in zip(QUANTITIES, deviations.T, strict=True))
    return Section('Links along the span', f"""
The same with {COARSE} chains. Links from which each stays within 1 % of its limit: {enough}. With the default {default}
links the thrust is {rounded(100.0 * float(at_default[0]))} % from its limit, since a chain is softer than a beam by
2/m: a fin of given stiffness wants more links, or E raised by (1 + 1/m)^2 with few. Short links need short steps:
{most} links at {rounded(1e3 * sizes[most])} ms cost {rounded(cost)} times the default's links times steps. The damping
c is that of a joint, so the fin's own damping falls as links are added; that too is in these figures.
""", claims, draw, 'Deviation from the limit against the number of links.')


def steps(quick: bool = False) -> Section:
    """Refine in time."""
    sizes = (2e-3, 1e-3) if quick else STEPS
    swims = {coupling: {step: swim(COARSE, 3, step, coupling) for step in sizes}
             for coupling in (SEQUENTIAL, MONOLITHIC)}
    limit = swims[MONOLITHIC][min(sizes)]
    deviations = {coupling: _deviations(of_step.values(), limit) for coupling, of_step in swims.items()}
    default = Parameters().solver.time_step
    reference = 'monolithic with a shorter step'
    claims = tuple(
        Claim(f'{name} with the default step, {coupling}', reference,
              float(deviations[coupling][sizes.index(default), column]), tolerance, 'measured, margin 3')
        for coupling, tolerances in ((SEQUENTIAL, (3e-7, 1e-3, 6e-3)), (MONOLITHIC, (3e-7, 1e-7, 8e-6)))
        for column, (name, tolerance) in enumerate(zip(QUANTITIES, tolerances, strict=True)))

    def draw(figure: Figure) -> None:
        for axes, (coupling, values) in zip(figure.subplots(1, 2), deviations.items(), strict=True):
            drawn = slice(None) if coupling == SEQUENTIAL else slice(0, -1)  # the last is the limit itself
            _draw(axes, [1e3 * step for step in sizes[drawn]], values[drawn], 'step [ms]')
            axes.set_title(coupling)

    return Section('Time step', f"""
The same with {COARSE} chains of 3 links, both couplings. The limit is that of the monolithic coupling, whose error at
the default step of {rounded(1e3 * default)} ms is far below that of any grid; the sequential one, with the body a step
behind, is the larger where the body turns.
""", claims, draw, 'Deviation from the limit against the step.')


CHECKS = chains, links, steps

"""Theme 3, refinement: the effect of chains, links and step on thrust, cruise and turn, and the grid for 1 %."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from evidence.verification.claims import Claim, Section, rounded
from evidence.verification.figures import mark
from evidence.verification.laws import COUPLINGS
from evidence.verification.mechanics import without_smoothing
from manta_sim_ros.dynamics import MONOLITHIC, FloatArray, Parameters, Simulator, State
from manta_sim_ros.figures.gaits import STRAIGHT, gait
from manta_sim_ros.figures.style import MARKERS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PERIODS = 5.0  # [s], three periods at 0.6 Hz, over which results are averaged
HELD_LEAD_IN, FREE_LEAD_IN = 2.0, 5.0  # [s] until the motion of the fins, or the body's speed, is periodic
CHAINS = 4, 6, 8, 12, 16, 24
TOO_MANY_CHAINS = 30, 60, 120, 240  # see `chordwise_instability`
LINKS = {1: 2e-3, 2: 2e-3, 3: 2e-3, 4: 1e-3, 6: 5e-4, 8: 2.5e-4, 12: 1e-4}  # number of links: a stable step [s]
STEPS = 2.5e-3, 2e-3, 1e-3, 5e-4, 2.5e-4  # [s]
COARSE = 8  # chains while links or steps are refined
TURN = gait(35.0, 0.6)  # of the right fin; that of the left fin is STRAIGHT
QUANTITIES = 'thrust', 'cruise speed', 'yaw rate'


class Swim(NamedTuple):
    """Mean thrust on the held body [N], speed of the straight gait [m/s], and yaw rate of a turn [rad/s]."""

    thrust: float
    speed: float
    yaw_rate: float


def swim(chains: int, links: int, time_step: float, coupling: str = MONOLITHIC) -> Swim:
    """Simulate the paper's gait, with the body held and free, and a turn; return the averages over 5 s."""
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


def _deviations(swims: Iterable[Swim], limit: Swim) -> FloatArray:
    """Return the relative deviation of each run from the limit (runs, 3)."""
    return np.abs(np.array(list(swims)) / np.array(limit) - 1.0)


def _limit(swims: Mapping[int, Swim], sizes: tuple[int, int, int], powers: tuple[int, int]) -> Swim:
    """Return the limit of infinite size from three runs: the constant of a fit with two powers of 1/size."""
    widths = 1.0 / np.array(sizes)
    matrix = np.stack([widths**0, widths ** powers[0], widths ** powers[1]], axis=1)
    return Swim(*np.linalg.solve(matrix, np.array([swims[size] for size in sizes]))[0].tolist())


def _order(coarse: float, middle: float, fine: float) -> float:
    """Return the order of convergence of three runs with doubled sizes; the limit need not be given."""
    return math.log2(abs((coarse - middle) / (middle - fine)))


def _draw(axes: Axes, sizes: ArrayLike, deviations: FloatArray, label: str) -> None:
    for marker, name, values in zip(MARKERS, QUANTITIES, 100.0 * deviations.T, strict=False):
        axes.loglog(sizes, values, f'{marker}-', label=name)
    axes.axhline(1.0, color='k', linestyle='--', linewidth=0.9, label='1 %')
    mark(axes, sizes)
    axes.set(xlabel=label, ylabel='deviation from the limit [%]')
    axes.legend()


def _enough(sizes: Iterable[int], deviations: FloatArray) -> str:
    """Return the size from which each quantity stays within 1 % of its limit; it is extrapolated with first order."""
    sizes, texts = list(sizes), []
    for name, values in zip(QUANTITIES, deviations.T, strict=True):
        within = [bool(np.all(values[row:] < 0.01)) for row in range(len(sizes))]
        texts.append(f'{sizes[within.index(True)]} ({name})' if any(within)
                     else f'about {math.ceil(sizes[-1] * float(values[-1]) / 0.01)} ({name})')
    return f'{", ".join(texts[:-1])} and {texts[-1]}'


def chains(quick: bool = False) -> Section:
    """Refine the fins along the chord."""
    sizes = CHAINS if quick else CHAINS + TOO_MANY_CHAINS
    swims = {number: swim(number, 3, 2e-3) for number in sizes}
    limit = _limit(swims, (8, 16, 24), (1, 2))
    deviations = _deviations(swims.values(), limit)
    at_coarse = deviations[CHAINS.index(COARSE)]
    reference = 'limit extrapolated from 8, 16 and 24 chains'
    claims = (
        *(Claim(f'deviation of the {name} with {COARSE} chains', reference, float(at_coarse[column]), tolerance,
                'measured with a margin of 2')
          for column, (name, tolerance) in enumerate(zip(QUANTITIES, (2e-3, 1e-3, 5e-2), strict=True))),
        Claim('order of the yaw rate in the number of chains', 'yaw rate with 6, 12 and 24 chains',
              _order(*(swims[number].yaw_rate for number in (6, 12, 24))), (0.9, 1.6),
              'first order of the one-sided tangents at the two edges; measured, since higher orders add to it'),
    )

    def draw(figure: Figure) -> None:
        _draw(figure.subplots(), sizes, deviations, 'chains n')

    return Section('Chains along the chord', f"""
Three quantities are averaged over three periods at 0.6 Hz: the thrust with the body held, the cruise speed of the
straight gait, and the yaw rate of a turn (A = 40 degrees on the left, 35 degrees on the right). The chains have 3
links, the step is 2 ms, and the coupling is monolithic. The numbers of chains from which these quantities stay within
1 % of their limits are {_enough(CHAINS, deviations[:len(CHAINS)])}. The cost of a step is proportional to the number of
chains.

From {TOO_MANY_CHAINS[0]} chains on, the runs become unstable along the chord one after the other, the turn first and
the held body last, and their deviations jump. This is not an error of the grid but an instability of the model; see
"Where refinement along the chord ends".
""", claims, draw, 'Deviation from the limit of stable fins against the number of chains.')


def links(quick: bool = False) -> Section:
    """Refine the fins along the span."""
    sizes = {number: step for number, step in LINKS.items() if not quick or number in (2, 3, 4, 8)}
    swims = {number: swim(COARSE, number, step) for number, step in sizes.items()}
    limit = _limit(swims, (2, 4, 8), (1, 2))
    deviations = _deviations(swims.values(), limit)
    default = Parameters().fin.links
    at_default = deviations[list(sizes).index(default)]
    reference = 'limit extrapolated from 2, 4 and 8 links'
    claims = (
        *(Claim(f'deviation of the {name} with the default {default} links', reference, float(at_default[column]),
                tolerance, reason)
          for column, (name, tolerance, reason) in enumerate(zip(QUANTITIES, ((0.09, 0.15), 0.006, (0.07, 0.13)), (
              'first order, as for the cantilever; measured to a quarter', 'measured with a margin of 3',
              'measured to a third'), strict=True))),
        Claim('order of the thrust in the number of links', 'thrust with 2, 4 and 8 links',
              _order(*(swims[number].thrust for number in (2, 4, 8))), (0.9, 1.4),
              'derived: 1, due to the hinge at the root, as for the cantilever; the next order adds to it'),
    )

    def draw(figure: Figure) -> None:
        _draw(figure.subplots(), list(sizes), deviations, 'links m')

    most = max(sizes)
    cost = most * LINKS[default] / (default * sizes[most])
    return Section('Links along the span', f"""
The same quantities are measured with {COARSE} chains. The numbers of links from which they stay within 1 % of their
limits are {_enough(sizes, deviations)}, where "about" marks an extrapolation with first order. With the default
{default} links the thrust deviates by {rounded(100.0 * float(at_default[0]))} % from its limit, because a chain is
softer than a beam by the share 2/m. A fin of a given stiffness therefore needs more links, or a Young's modulus that is
raised by (1 + 1/m)^2 if it has few links. Short links need short steps: {most} links at {rounded(1e3 * sizes[most])} ms
cost {rounded(cost)} times as much as the default. The damping c is that of a joint, so the damping of the fin decreases
as links are added. This effect is part of these deviations.
""", claims, draw, 'Deviation from the limit against the number of links.')


def steps(quick: bool = False) -> Section:
    """Refine the time step."""
    sizes = (2e-3, 1e-3) if quick else STEPS
    swims = {name: {step: swim(COARSE, 3, step, coupling) for step in sizes} for name, coupling in COUPLINGS.items()}
    limit = swims['monolithic'][min(sizes)]
    deviations = {name: _deviations(of_step.values(), limit) for name, of_step in swims.items()}
    default = Parameters().solver.time_step
    reference = 'monolithic with a shorter step'
    claims = tuple(
        Claim(f'deviation of the {name} with the default step, {coupling}', reference,
              float(deviations[coupling][sizes.index(default), column]), tolerance, 'measured with a margin of 3')
        for coupling, tolerances in (('staggered', (3e-7, 1e-3, 6e-3)), ('monolithic', (3e-7, 1e-7, 8e-6)))
        for column, (name, tolerance) in enumerate(zip(QUANTITIES, tolerances, strict=True)))

    def draw(figure: Figure) -> None:
        for axes, (coupling, values) in zip(figure.subplots(1, 2), deviations.items(), strict=True):
            drawn = slice(None) if coupling == 'staggered' else slice(0, -1)  # the last run is the limit
            _draw(axes, [1e3 * step for step in sizes[drawn]], values[drawn], 'step [ms]')
            axes.set_title(coupling)

    return Section('Time step', f"""
The same quantities are measured with {COARSE} chains of 3 links and with both couplings. The limit is that of the
monolithic coupling, whose error with the default step of {rounded(1e3 * default)} ms is far below that of any grid. The
error of the staggered coupling, in which the body is one step behind, is larger when the body turns.
""", claims, draw, 'Deviation from the limit against the step.')


CHECKS = chains, links, steps

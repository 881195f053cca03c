"""Theme 5, the largest stable step: its estimate without a simulation, against steps at which simulations diverge."""
from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from evidence.scenarios import largest_rate
from evidence.verification.claims import Check, Claim, Section, rounded
from evidence.verification.figures import mark
from evidence.verification.laws import COUPLINGS
from manta_sim_ros.dynamics import (
    MONOLITHIC,
    SEQUENTIAL,
    FinCommand,
    FloatArray,
    Parameters,
    largest_stable_step,
)
from manta_sim_ros.figures.gaits import STRAIGHT, gait

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DURATION = 4.0  # [s], two to twenty cycles
TOO_FAST = 2.0  # ratio of the largest joint rate to its reference from which a simulation counts as diverged
RESOLUTION = 1.02  # ratio of the bounds between which the diverging step is bisected
BAND = 1.0, 1.5

REST = FinCommand(amplitude=0.0, frequency=0.0, phase=0.0)
HELD: Mapping[str, Any] = {'fixed_base': True}
TOGETHER: Mapping[str, Any] = {'coupling': MONOLITHIC}
LIGHT: Mapping[str, Any] = {'mass': 3.0, 'inertia': (0.3, 0.3, 0.5)}

CASES: tuple[tuple[FinCommand, FinCommand, Mapping[str, Mapping[str, Any]]], ...] = (
    (STRAIGHT, STRAIGHT, {}),
    (STRAIGHT, STRAIGHT, {'solver': HELD}),
    (gait(40, 0.8), gait(20, 0.8), {}),
    (gait(30, 0.4, 0.0), REST, {}),
    (gait(50, 0.8, -40.0), gait(50, 0.8, -40.0), {'solver': HELD}),
    (gait(20, 5.0, 20.0), gait(20, 5.0, 20.0), {'solver': HELD}),
    (gait(30, 5.0, 20.0), gait(30, 5.0, 20.0), {}),
    (STRAIGHT, STRAIGHT, {'fin': {'youngs_modulus': 0.0}}),
    (STRAIGHT, STRAIGHT, {'fin': {'youngs_modulus': 1e6}}),
    (STRAIGHT, STRAIGHT, {'fin': {'youngs_modulus': 1e7}}),
    (STRAIGHT, STRAIGHT, {'fin': {'youngs_modulus': 1e9}}),
    (STRAIGHT, STRAIGHT, {'fin': {'thickness': 0.004}}),
    (STRAIGHT, STRAIGHT, {'fin': {'thickness': 0.02}}),
    (STRAIGHT, STRAIGHT, {'fin': {'joint_damping': 0.0}}),
    (STRAIGHT, STRAIGHT, {'fin': {'joint_damping': 1.0}}),
    (STRAIGHT, STRAIGHT, {'fin': {'links': 1}}),
    (STRAIGHT, STRAIGHT, {'fin': {'links': 2}}),
    (STRAIGHT, STRAIGHT, {'fin': {'links': 8}}),
    (STRAIGHT, STRAIGHT, {'fin': {'links': 2, 'drag_coefficient': 4.0}}),
    (STRAIGHT, STRAIGHT, {'fin': {'span': 0.15}}),
    (STRAIGHT, STRAIGHT, {'fin': {'span': 0.5}}),
    (STRAIGHT, STRAIGHT, {'water': {'density': 0.0}}),
    (STRAIGHT, STRAIGHT, {'water': {'density': 1000.0}}),
    (REST, REST, {'water': {'current': (0.0, 0.0, 1.0)}, 'solver': HELD}),
    (STRAIGHT, STRAIGHT, {'solver': TOGETHER}),
    (STRAIGHT, STRAIGHT, {'water': {'added_mass_coefficient': 1.0}, 'solver': TOGETHER}),
    (STRAIGHT, STRAIGHT, {
        'water': {'added_mass_coefficient': 1.0, 'density': 1000.0}, 'body': LIGHT, 'solver': TOGETHER}),
)
BEYOND: tuple[tuple[FinCommand, FinCommand, Mapping[str, Mapping[str, Any]]], ...] = (
    (STRAIGHT, STRAIGHT, {'fin': {'span': 1.0}, 'solver': HELD}),
    (STRAIGHT, STRAIGHT,
     {'fin': {'youngs_modulus': 1e7}, 'water': {'added_mass_coefficient': 1.0}, 'solver': TOGETHER}),
    (STRAIGHT, STRAIGHT, {'fin': {'links': 2, 'span': 0.5}}),
    (gait(30, 1.0, 0.0), gait(15, 1.0, 0.0), {'fin': {'links': 1, 'youngs_modulus': 1e9}}),
    (gait(40, 0.1), gait(40, 0.1), {'fin': {'links': 1}}),
    (STRAIGHT, STRAIGHT, {'fin': {'links': 2, 'drag_coefficient': 4.0}, 'solver': HELD}),
    (gait(40, 5.0, 20.0), gait(40, 5.0, 20.0), {'solver': HELD}),
    (STRAIGHT, STRAIGHT, {'water': {'current': (1.0, 0.0, 0.0)}, 'solver': HELD}),
    (STRAIGHT, STRAIGHT, {'fin': {'links': 1}, 'water': {'current': (-0.5, 0.0, 0.0)}, 'solver': HELD}),
    (STRAIGHT, STRAIGHT, {'fin': {'links': 1}, 'water': {'current': (0.0, 0.0, 0.5)}, 'solver': HELD}),
)
"""Cases that mostly leave the band: chordwise instability, stiff fins of few links, a slow gait, drag, currents."""
QUICK = slice(0, None, 4)
RANDOM_ROBOTS = 60


def diverging_step(
    parameters: Parameters, left: FinCommand, right: FinCommand, start: float, duration: float = DURATION,
) -> float:
    """Return the smallest step [s] at which a simulation diverges, searched from `start` / 1.5 to `start` * 3."""
    bound = TOO_FAST * largest_rate(parameters, start / 8.0, left, right, duration)
    low, high = start / 1.5, start / 1.5
    while high < 3.0 * start and largest_rate(parameters, high, left, right, duration) < bound:
        low, high = high, 1.1 * high
    while high > RESOLUTION * low:
        middle = math.sqrt(low * high)
        if largest_rate(parameters, middle, left, right, duration) < bound:
            low = middle
        else:
            high = middle
    return high


def compared(
    cases: tuple[tuple[FinCommand, FinCommand, Mapping[str, Mapping[str, Any]]], ...],
) -> tuple[FloatArray, FloatArray]:
    """Return the estimated and the measured steps [s] of cases."""
    steps = []
    for left, right, groups in cases:
        parameters = Parameters().replace(**groups)
        estimate = largest_stable_step(parameters, left, right)
        steps.append((estimate, diverging_step(parameters, left, right, estimate)))
    estimates, measured = np.transpose(steps)
    return estimates, measured


def random_robots(count: int) -> list[tuple[FinCommand, FinCommand, Parameters]]:
    """Return robots of 3 to 5 links with random stiffness, size, water and gaits, and with both couplings in turn."""
    random, robots = np.random.default_rng(7), []
    while len(robots) < count:
        gaits = [gait(random.uniform(5.0, 45.0), frequency, random.uniform(-40.0, 40.0))
                 for frequency in random.uniform(0.2, 2.0, 2)]
        parameters = Parameters().replace(
            fin={'chains': 6, 'links': int(random.integers(3, 6)), 'youngs_modulus': 10.0 ** random.uniform(7.0, 9.0),
                 'span': random.uniform(0.2, 0.4), 'joint_damping': random.uniform(0.0, 0.5)},
            water={'density': random.uniform(500.0, 9800.0)},
            solver={'coupling': (SEQUENTIAL, MONOLITHIC)[len(robots) % 2]})
        robots.append((gaits[0], gaits[1], parameters))
    return robots


def stable_share(count: int) -> float:
    """Return the share of random robots whose simulations are stable at the estimated step."""
    stable = 0
    for left, right, parameters in random_robots(count):
        step = largest_stable_step(parameters, left, right)
        expected = largest_rate(parameters, step / 8.0, left, right, DURATION)
        stable += largest_rate(parameters, step, left, right, DURATION) < TOO_FAST * expected
    return stable / count


def check_largest_stable_step(quick: bool = False) -> Section:
    """Compare the estimate with bisection on simulations, for several gaits, fins, waters and both couplings."""
    within, beyond = compared(CASES[QUICK] if quick else CASES), compared(BEYOND[QUICK] if quick else BEYOND)
    ratios, others = within[1] / within[0], beyond[1] / beyond[0]
    robots = RANDOM_ROBOTS // 6 if quick else RANDOM_ROBOTS
    share = stable_share(robots)
    reference = f'bisection on simulations of {DURATION:g} s'
    reason = 'required: the estimate is safe, and within a factor of 1.5'
    return Section(
        title='The largest stable step',
        text=f"""
`largest_stable_step` is compared with the step at which a simulation diverges: either it ends in an error, or its
joints become {TOO_FAST:g} times as fast as with an eighth of the step. In {len(ratios)} cases this step is
{_range(ratios)} times the estimate. Two constants of the estimate were calibrated on these cases: the share of the
joint speeds that it uses, and its safety margin. So these cases show a fit and not a prediction.

The crosses in the plot are {len(others)} other cases, most of which leave the band: long or soft fins, which are
unstable along their chords and then move faster than single chains would; stiff fins of one or two links; a slow gait
whose start is faster than the gait; and strong drag or currents on a held fin. In these cases the step that diverges is
{_range(others)} times the estimate. Where this ratio is below 1, the estimate is not safe.

In addition, {robots} robots were drawn at random. They have 3 to 5 links, random values of stiffness, span, damping and
density, and two different gaits up to 2 Hz, and both couplings are used. {100.0 * share:.0f} % of them are stable with
the estimated step. Chains of one or two links are not part of this claim: do not rely on the estimate for them.
""",
        claims=(
            Claim('smallest diverging step over the estimate', reference, float(ratios.min()), BAND, reason),
            Claim('largest diverging step over the estimate', reference, float(ratios.max()), BAND, reason),
            Claim('share of random robots of 3 to 5 links that are stable at the estimate',
                  f'simulations of {DURATION:g} s', share, (0.9, 1.0),
                  'measured; the linearized chain does not cover every motion'),
        ),
        draw=lambda figure: _draw(figure, within, beyond),
        caption='Steps at which simulations diverge, against the estimate. The shaded band is one to one and a half '
                'times the estimate. Crosses are cases that the claim does not cover.',
    )


SHEAR_MODULUS = 1e8 / 2.6  # [Pa], of the default fin, isotropic with Poisson's ratio 0.3
SHARES = 0.0, 0.1, 1.0  # of it
TWISTED_CHAINS = 8, 12, 30, 60
TWIST_BAND = 1.0, 1.15
STEP_TICKS = 0.2, 0.5, 1.0, 2.0, 5.0  # [ms]
SHORT = 1.0  # [s]; a step that is too small for the twist diverges at once


def twisted(quick: bool = False) -> Section:
    """Compare the estimate with bisection on simulations, for fins that resist twist."""
    chains, shares = (TWISTED_CHAINS[:1], SHARES[::2]) if quick else (TWISTED_CHAINS, SHARES)
    estimates: dict[tuple[str, float], list[float]] = {}
    ratios: dict[tuple[str, float], list[float]] = {}
    for name, coupling in COUPLINGS.items():
        for share in shares:
            estimates[name, share], ratios[name, share] = [], []
            for number in chains:
                parameters = Parameters().replace(
                    fin={'chains': number, 'shear_modulus': share * SHEAR_MODULUS}, solver={'coupling': coupling})
                estimate = largest_stable_step(parameters, STRAIGHT, STRAIGHT)
                measured = diverging_step(parameters, STRAIGHT, STRAIGHT, estimate, SHORT)
                estimates[name, share].append(estimate)
                ratios[name, share].append(measured / estimate)
    claims = tuple(
        Claim(f'{which} diverging step over the estimate with twist, {name}',
              f'bisection on simulations of {SHORT:g} s',
              choose(value for (coupling, _), values in ratios.items() if coupling == name for value in values),
              TWIST_BAND, 'required: the estimate is safe, and within 15 %')
        for name in COUPLINGS for which, choose in (('smallest', min), ('largest', max)))

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for marker, share in zip('os^', shares, strict=False):
            values = np.array(estimates['staggered', share])
            drawn = axes.loglog(chains, 1e3 * values * ratios['staggered', share], marker,
                                label=f'G = {rounded(share * SHEAR_MODULUS)} Pa' if share else 'G = 0')[0]
            axes.loglog(chains, 1e3 * values, '--', linewidth=0.9, color=drawn.get_color())
        axes.loglog([], [], 'k--', linewidth=0.9, label='estimate')
        mark(axes, chains)
        axes.set_yticks(STEP_TICKS, [f'{step:g}' for step in STEP_TICKS])
        axes.set(xlabel='chains n', ylabel='step that diverges [ms]')
        axes.legend()

    return Section('The largest stable step of fins that resist twist', f"""
With `fin.shear_modulus`, the shortest wave along the chord decides the step. Its stiffness grows with the square of the
number of chains, so that the largest stable step is in inverse proportion to this number. The estimate is compared with
bisection on simulations of the straight gait of {SHORT:g} s, for {len(chains)} numbers of chains, {len(shares)} shear
moduli from 0 to E / 2.6, and both couplings.
""", claims, draw, 'Steps at which simulations with the staggered coupling diverge, against the number of chains.')


def _range(ratios: FloatArray) -> str:
    return f'{rounded(float(ratios.min()), 3)} to {rounded(float(ratios.max()), 3)}'


def _draw(figure: Figure, within: tuple[FloatArray, FloatArray], beyond: tuple[FloatArray, FloatArray]) -> None:
    axes = figure.subplots()
    ends = 1e3 * np.array([0.8, 1.25]) * [np.min(within[0]), np.max(beyond[0])]
    axes.fill_between(ends, BAND[0] * ends, BAND[1] * ends, alpha=0.2, linewidth=0.0, label='claim')
    for (estimates, measured), marker, label in ((within, 'o', 'covered by the claim'), (beyond, 'x', 'not covered')):
        axes.loglog(1e3 * estimates, 1e3 * measured, marker, label=label)
    axes.legend()
    axes.set_xlabel('estimate of the largest stable step [ms]')
    axes.set_ylabel('step that diverges [ms]')


CHECKS: tuple[Check, ...] = check_largest_stable_step, twisted

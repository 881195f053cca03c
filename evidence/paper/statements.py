"""What the paper says of its results, in short quotes, and what the simulator answers, from measured numbers."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable

import numpy as np

from evidence.paper.cost import Cost
from manta_sim_ros.dynamics import largest_stable_step
from manta_sim_ros.figures.figure_7 import Figure7
from manta_sim_ros.figures.figure_8 import Figure8
from manta_sim_ros.figures.figure_9 import FREQUENCY, SETTLED, WINDOW, Figure9
from manta_sim_ros.figures.gaits import STRAIGHT, robot
from manta_sim_ros.figures.turning import Turn, Turning

HOLDS, IN_PART, NOT, OPEN = 'holds', 'holds in part', 'does not hold', 'cannot be judged'

PAPER_STEP = 0.01  # s, Section 4
FORAGING = (0.25, 0.47)  # m/s, Section 1.1
MINOR_ATTACK = 10.0
"""Angle of attack [degrees]: beyond it a plate stalls, and it is certainly not minor."""
NOTICEABLE = 0.5
"""A lag along the span is called highly noticeable from this part of the lag along the chord on."""
SAME_HEIGHT = 1e-3
"""Relative: the samples of a period miss the highest point of a rod by less."""
OSCILLATING = 0.01
"""Ripple over mean speed from which on a speed is said to oscillate."""
STEADY_MOMENT = 0.1
"""A moment is stable over periods in which its mean stays within this part of the mean of all of them."""
STEADY_PERIODS = 10
"""For so many periods, half of what the paper shows, a moment must be stable to be called consistent."""
PLAUSIBLE = 10.0
"""Factor between a literal version in NumPy and the paper's program within which its time is plausible."""
OF_THE_GRID = 0.2
"""Relative difference between numbers of chains from which on a result is not that of the model but of the grid."""

NO_EXPERIMENT = "The text gives no values of the experiment."


@dataclasses.dataclass(frozen=True)
class Results:
    """All that the statements are held against."""

    figure_7: Figure7
    figure_8: Figure8
    figure_9: Figure9
    turning: Turning
    cost: Cost


@dataclasses.dataclass(frozen=True)
class Statement:
    """A statement of the paper: where, its words, whether it holds for the simulator, and what was measured."""

    place: str
    quote: str
    verdict: str
    answer: str


def statements(results: Results) -> list[Statement]:
    """Return all statements, in the order of the paper."""
    return [
        *_introduction(results),
        *_modelling(results),
        *_computing(results.cost),
        *_wave_transmission(results),
        *_thrust(results.figure_8),
        *_straight(results.figure_9),
        *_turns(results.turning),
    ]


def graded(wholly: bool, partly: bool = False) -> str:
    """Return the verdict on a statement of which all, or else a part, was found."""
    return HOLDS if wholly else IN_PART if partly else NOT


def listed(values: Iterable[float], digits: int = 1) -> str:
    """Return numbers as '1.0, 2.0 and 3.0'."""
    texts = [f'{value:.{digits}f}' for value in values]
    return f'{", ".join(texts[:-1])} and {texts[-1]}' if len(texts) > 1 else texts[0]


def _introduction(results: Results) -> list[Statement]:
    usual = next(one for one in results.figure_9.swims if one.amplitude == 40.0)
    return [
        Statement(
            'Abstract', 'our model performs well in the rigid-flexible coupling analysis of the manta robot', OPEN,
            '"Well" has no measure. The paper\'s coupling is of first order and fails for light bodies, see '
            '[verification.md](verification.md), "Coupling".'),
        Statement(
            'Abstract', 'we elucidate the viability of tailoring turning gaits through systematic variations in input '
            'parameters', graded(_turn_right(results.turning)), 'See Figure 10 below.'),
        Statement(
            'Abstract', 'compared with finite element and CFD methods, the PRB method has high computational '
            'efficiency',
            OPEN, 'The paper times no such method, and neither does this page.'),
        Statement(
            'Section 1.1', 'they can forage at a speed of 0.25–0.47 m/s',
            graded(FORAGING[0] <= usual.mean <= FORAGING[1]),
            f'Mantas, that is. The robot swims at {usual.mean:.2f} m/s with A = 40°, f = 0.6 Hz.'),
    ]


def _modelling(results: Results) -> list[Statement]:
    straight, turns = results.figure_9, list(results.turning.by_chains.items())
    (many, with_many), (few, with_few) = turns[0], turns[-1]
    attack = [float(np.abs(one.attack[one.window]).max()) for one in straight.swims]
    differ = [abs(a.turning_rate / b.turning_rate - 1.0) for a, b in zip(with_many, with_few, strict=True)]
    return [
        Statement(
            'Section 3.2, an assumption', 'when the discretization width ds of the link tends towards 0, the tangents '
            'R and E can be considered as the line connecting the origins of two adjacent links',
            graded(max(differ) < OF_THE_GRID, _agree_at_first(with_many, with_few)),
            'While the surface is smooth. In a flow that is fast enough, the slope of (11) feeds waves along the '
            'chord, and the more chains there are, the slower a flow will do ([verification.md](verification.md), '
            f'"Where refining along the chord ends"). So there is no limit of many chains: the turns below end at '
            f'{listed(turn.turning_rate for turn in with_many)}°/s with {many} chains, at '
            f'{listed(turn.turning_rate for turn in with_few)}°/s with {few}.'),
        Statement(
            'Section 3.4, an assumption', 'Since the angle of attack of the body is minor, the lift can be neglected',
            graded(max(attack) < MINOR_ATTACK),
            f'The body heaves against the flapping, so its angle of attack swings: in Figure 9 by up to '
            f'{listed(attack, 0)}° at A = {listed((one.amplitude for one in straight.swims), 0)}°. The model has no '
            f'lift of the body, here as in the paper.'),
    ]


def _agree_at_first(of_many: list[Turn], of_few: list[Turn]) -> bool:
    return all(abs(a.yaw_rates[0] / b.yaw_rates[0] - 1.0) < OF_THE_GRID for a, b in zip(of_many, of_few, strict=True))


def _computing(cost: Cost) -> list[Statement]:
    stable = largest_stable_step(robot(), STRAIGHT, STRAIGHT)
    step = cost.literal / cost.steps
    plausible = 1.0 / PLAUSIBLE < step / cost.paper < PLAUSIBLE
    return [
        Statement(
            'Section 4', 'for a simulation corresponding to 0.01 s physical time step, the computational time is 0.18 '
            's',
            graded(plausible and stable >= PAPER_STEP, plausible),
            f'A step of the literal version in NumPy takes {step:.1f} s, so the time is '
            f'{"plausible" if plausible else "not plausible"}. A step of 0.01 s is '
            f'{"possible" if stable >= PAPER_STEP else "not possible"}: the paper\'s scheme with these values is '
            f'stable up to {stable:.4f} s.'),
        Statement(
            'Section 4', 'the algorithm is computationally efficient, providing the possibility of real-time '
            'calculation',
            graded(cost.library < PAPER_STEP),
            f'The paper\'s program is {cost.paper / PAPER_STEP:.0f} times slower than real time. This library swims '
            f'{PAPER_STEP / cost.library:.0f} s in a second.'),
    ]


def _wave_transmission(results: Results) -> list[Statement]:
    figure = results.figure_7
    chord, span, directions = figure.chordwise_lags, figure.spanwise_lags[-1, 1:], figure.direction_lags[-1, 1:]
    record = results.turning.turns[0].record
    rods = record.parameters.rods
    front, rear = (radius * np.sin(np.abs(record.rod_angles[:, :, rod])).max()
                   for rod, radius in enumerate((rods.front_radius, rods.rear_radius)))
    return [
        Statement(
            'Section 5', 'ensuring that the endpoints of the two rods reach the same height',
            graded(abs(front / rear - 1.0) < SAME_HEIGHT),
            f'Front {1000.0 * front:.1f} mm, rear {1000.0 * rear:.1f} mm at A = 40°.'),
        Statement(
            'Section 5.1, Figure 7', 'in the three passive segments (q_1, q_2, q_3), a conspicuous phenomenon of phase '
            'lag '
            'is evident', graded(bool(np.all(chord > 0.0))),
            f'Along the chord the last chain lags the first by {listed(chord)}° in its joints, about '
            f'as much as the rear rods lag the front ones, {np.degrees(figure.gait.phase):.0f}°: the wave is that of '
            'the rods.'),
        Statement(
            'Section 5.1, Figure 7', 'a highly noticeable phase lag phenomenon is observable, corresponding to the '
            'spanwise wave transmission',
            graded(bool(np.all(span > NOTICEABLE * np.abs(chord).mean())), bool(np.all(span > 0.0))),
            f'At the trailing edge the second and third joint lag the first by {listed(span)}°: outward, as it should, '
            f'but small. The directions of these links, which the eye sees, lag by {listed(directions)}°.'),
    ]


def _thrust(figure: Figure8) -> list[Statement]:
    with_amplitude, with_phase = figure.thrust_of_amplitude, figure.thrust_of_phase
    grows = bool(np.all(np.diff(with_amplitude, axis=1) > 0.0) and np.all(np.diff(with_amplitude, axis=0) > 0.0))
    disputed = with_amplitude[figure.frequencies.index(0.51), figure.amplitudes.index(40.0)]
    fastest = figure.frequencies[-1]
    rises = bool(np.all(np.diff(with_phase, axis=1) > 0.0))
    return [
        Statement(
            'Section 5.1, Figure 8', 'the simulated average thrust under various flapping amplitudes closely aligns '
            'with the experimental one', OPEN,
            f'{NO_EXPERIMENT} Our thrust {"grows" if grows else "does not grow throughout"} with amplitude and with '
            f'frequency, up to {with_amplitude[-1, -1]:.1f} N at A = {figure.amplitudes[-1]:.0f}°, {fastest:g} Hz.'),
        Statement(
            'Section 5.1, Figure 8', 'As the flapping amplitude approaches 40°, the thrust differences between red '
            'lines '
            'and blue lines become apparent', OPEN, NO_EXPERIMENT),
        Statement(
            'Section 5.1, Figure 8', 'The thrust difference reaches the maximum (about 1.8 N) at the amplitude Am = '
            '40° and the frequency f = 0.51 Hz', OPEN,
            f'{NO_EXPERIMENT} Our thrust is {disputed:.1f} N there.'),
        Statement(
            'Section 5.1, Figure 8', 'attributed to the lack of accuracy in the Morison equation when describing large '
            'amplitude motions', OPEN, 'A model cannot tell where it departs from the robot.'),
        Statement(
            'Section 5.1, Figure 8', 'the calculated trend of average thrust matches the experimental results', OPEN,
            f'{NO_EXPERIMENT} Our thrust {"grows" if rises else "does not grow throughout"} with the phase, at '
            f'{fastest:g} Hz from {with_phase[-1, 0]:.1f} N at {figure.phases[0]:.0f}° to {with_phase[-1, -1]:.1f} N '
            f'at {figure.phases[-1]:.0f}°.'),
        Statement(
            'Section 5.1, Figure 8', 'The error is relatively small when the phase difference is positive', OPEN,
            NO_EXPERIMENT),
        Statement(
            'Section 5.1', 'the two sets of experiments effectively validated the reliability of our flexible fins '
            'model',
            OPEN, f'{NO_EXPERIMENT} The values that the paper leaves out were chosen here so that the thrust comes out '
            f'right: its size proves nothing. See the sensitivities below.'),
    ]


def _straight(figure: Figure9) -> list[Statement]:
    swims, smooth = figure.swims, figure.smooth
    ripples, smooth_ripples = [one.ripple for one in swims], [one.ripple for one in smooth]
    amplitudes = f'A = {listed((one.amplitude for one in swims), 0)}°'
    settled_from = [one.settled_from for one in swims]
    return [
        Statement(
            'Section 5.2, Figure 9', 'The motion mode of MPF led to oscillations in forward velocity',
            graded(min(one.ripple / one.mean for one in swims) > OSCILLATING),
            f'Peak to peak {listed(ripples, 3)} m/s at {amplitudes}.'),
        Statement(
            'Section 5.2, Figure 9', 'keeping the input parameters constant, the velocity of the robot eventually '
            'converges and stabilizes',
            graded(None not in settled_from, any(known is not None for known in settled_from)),
            f'Means of a period stay within {100.0 * SETTLED:.0f} % of {listed((one.final for one in swims), 3)} m/s '
            f'from period {listed((math.nan if known is None else known + 1 for known in settled_from), 0)} on. The '
            f'window from {WINDOW[0]:g} to {WINDOW[1]:g} s begins in period {int(WINDOW[0] * FREQUENCY) + 1}: its '
            f'means are {listed((one.mean for one in swims), 3)} m/s.'),
        Statement(
            'Section 5.2, Figure 9', 'the simulated velocity, on average, closely aligns with the experimental results '
            'without significant differences', OPEN, NO_EXPERIMENT),
        Statement(
            'Section 5.2, Figure 9', "as the flapping amplitude Am increases, the oscillation amplitude of the robot's "
            'forward velocity becomes larger',
            graded(bool(np.all(np.diff(ripples) > 0.0) and np.all(np.diff(smooth_ripples) > 0.0))),
            f'See above; with {smooth[0].chains} chains {listed(smooth_ripples, 3)} m/s.'),
        Statement(
            'Section 5.2, Figure 9', 'When the amplitude rises above 40°, the error becomes significant', OPEN,
            f'{NO_EXPERIMENT} At {swims[-1].amplitude:.0f}° {swims[-1].chains} chains and {smooth[-1].chains} chains '
            f'give different speeds, {swims[-1].final:.3f} and {smooth[-1].final:.3f} m/s in the end, as waves run '
            f'along the chord of the first; at 40° {swims[-2].final:.3f} and {smooth[-2].final:.3f} m/s.'),
        Statement(
            'Section 5.2, Figure 9', 'Taking the amplitude Am = 50° as an example, the error of the average velocity '
            'reaches 0.07 m/s', OPEN, f'{NO_EXPERIMENT} Our average in the window is {swims[-1].mean:.3f} m/s.'),
        Statement(
            'Section 5.2, Figure 9', "attributed to the inaccuracy of Morison's equation at large amplitude motions",
            OPEN, 'A model cannot tell where it departs from the robot.'),
        Statement(
            'Section 5.2', 'the model proves accurate enough for a manta robot focused on dynamics and control', OPEN,
            NO_EXPERIMENT),
    ]


def _turns(turning: Turning) -> list[Statement]:
    by_chains = list(turning.by_chains.items())
    (many, with_many), (few, with_few) = by_chains[0], by_chains[-1]
    first = [[turn.mean_wrenches[0, 5] for turn in turns] for turns in (with_many, with_few)]
    peak = [np.abs(turn.record.wrench[:turn.record.samples, 5]).max() for turn in with_many]
    circle, spin = with_many[1], with_few[1]
    begin, lasting = steady_stretch(spin)
    lasting_many = steady_stretch(circle)[1]
    moments, rates = spin.mean_wrenches[begin:begin + lasting, 5], spin.yaw_rates[begin:begin + lasting]
    return [
        Statement(
            'Section 5.2, Figure 10', 'The asymmetry in the phase difference of the drive mechanisms on both sides of '
            'the pectoral fins and the inconsistency in the flapping amplitudes can both give rise to the turning '
            'gaits',
            graded(_turn_right(turning)),
            f'In the second period they turn at {listed((turn.yaw_rates[1] for turn in with_many), 0)}°/s (negative: '
            f'to the right), at the end at {listed(turn.turning_rate for turn in with_many)}°/s on circles of '
            f'{listed((turn.turning_radius for turn in with_many), 2)} m.'),
        Statement(
            'Section 5.2, Figure 11', 'the turning mode, which involves altering the phase difference, ϕ_l and ϕ_r, '
            'exhibits a higher rotational acceleration during the initial stages of motion',
            graded(all(abs(one) > abs(two) for one, two in first)),
            f'Mean M_z of the first period {listed(first[0], 2)} N m, largest {listed(peak, 2)} N m.'),
        Statement(
            'Section 5.2, Figure 11', 'the turning mode associated with amplitude variations, Am_l and Am_r, can '
            'consistently generate a stable driving moment',
            graded(min(lasting, lasting_many) >= STEADY_PERIODS, max(lasting, lasting_many) >= STEADY_PERIODS),
            f'While the fins are smooth: with {few} chains its mean M_z stays within {100.0 * STEADY_MOMENT:.0f} % of '
            f'{moments.mean():.2f} N m for {lasting} periods, with {many} chains for {lasting_many}, as waves begin to '
            f'run along the chord. That of set 1 is below half of its first in period {halved(with_few[0])} and '
            f'{halved(with_many[0])}.'),
        Statement(
            'Section 5.2, Figure 11', 'making it suitable for cruising swimming with circular trajectories',
            graded(all(_circles(turns[1]) for turns in (with_many, with_few)), _circles(circle)),
            f'With {many} chains it settles on a circle of {circle.turning_radius:.2f} m{_from(circle)}. But smooth '
            f'fins hardly brake the yaw: with {few} chains M_z goes from {moments[0]:.2f} to {moments[-1]:.2f} N m '
            f'only, while the yaw rate goes from {rates[0]:.0f} to {rates[-1]:.0f}°/s, and the robot ends up spinning '
            'on the spot. What ends the turn\'s tightening is the waves along the chord, and so the number of '
            'chains.'),
        Statement(
            'Section 6', 'we have been able to numerically recover the characteristic hydrodynamic forces of the '
            'robotic '
            'manta during different motion gaits', OPEN, NO_EXPERIMENT),
    ]


def _turn_right(turning: Turning) -> bool:
    return all(bool(np.all(turn.yaw_rates < 0.0)) for turn in turning.turns)


def steady_stretch(turn: Turn) -> tuple[int, int]:
    """Return where the longest stretch of periods begins (0 is the first) in which M_z is stable, and its length.

    In a stretch the mean of each period is within STEADY_MOMENT of the mean of all.
    """
    means = turn.mean_wrenches[:, 5]
    best = (0, 0)
    for begin in range(len(means)):
        for end in range(begin + best[1] + 1, len(means) + 1):
            inside = means[begin:end]
            if np.all(np.abs(inside - inside.mean()) <= STEADY_MOMENT * abs(inside.mean())):
                best = (begin, end - begin)
    return best


def halved(turn: Turn) -> int:
    """Return in which period (1 is the first) the mean M_z falls below half of the first one's."""
    means = turn.mean_wrenches[:, 5]
    return int(np.argmax(means / means[0] < 0.5)) + 1


def _circles(turn: Turn) -> bool:
    """Return whether a turn becomes a steady circle so wide that the inner fin still goes forward."""
    parameters = turn.record.parameters
    half_span = parameters.rods.rear_motor_position[1] + parameters.rods.rear_radius + parameters.fin.span
    return turn.steady_from is not None and turn.turning_radius > half_span


def _from(turn: Turn) -> str:
    return '' if turn.steady_from is None else f' from period {turn.steady_from + 1} on'

"""Statements of the paper about its results, as short quotes, and the simulator's results, from measured numbers."""

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

PAPER_STEP = 0.01  # [s], Section 4
FORAGING = (0.25, 0.47)  # [m/s], Section 1.1
MINOR_ATTACK = 10.0
"""Angle of attack [degrees] above which a plate stalls, so that it is certainly not minor."""
NOTICEABLE = 0.5
"""Ratio of the lag along the span to the lag along the chord above which the former is highly noticeable."""
SAME_HEIGHT = 1e-3
"""Relative difference of two heights; the samples of a period miss the highest point of a rod by less."""
OSCILLATING = 0.01
"""Ratio of peak-to-peak oscillation to mean speed above which a speed oscillates."""
STEADY_MOMENT = 0.1
"""A moment is stable over periods if the mean of each is within this share of the mean of all of them."""
STEADY_PERIODS = 10
"""Number of periods, half of what the paper shows, over which a consistent moment must be stable."""
PLAUSIBLE = 10.0
"""Largest ratio between the times of the reference implementation and of the paper's program that is plausible."""
OF_THE_GRID = 0.2
"""Relative difference between numbers of chains above which a result is one of the grid and not of the model."""

NO_EXPERIMENT = 'The text gives no values of the experiment.'


@dataclasses.dataclass(frozen=True)
class Results:
    """All results that the statements are compared with."""

    figure_7: Figure7
    figure_8: Figure8
    figure_9: Figure9
    turning: Turning
    cost: Cost


@dataclasses.dataclass(frozen=True)
class Statement:
    """A statement of the paper: its place, its words, whether it holds for the simulator, and the measured answer."""

    place: str
    quote: str
    verdict: str
    answer: str


def statements(results: Results) -> list[Statement]:
    """Return all statements, in the order of the paper."""
    return [
        *_introduction(results),
        *_modeling(results),
        *_computing(results.cost),
        *_wave_transmission(results),
        *_thrust(results.figure_8),
        *_straight(results.figure_9),
        *_turns(results.turning),
    ]


def graded(wholly: bool, partly: bool = False) -> str:
    """Return the verdict on a statement that holds wholly, else partly, or not at all."""
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
            'The paper gives no measure of "well". Its coupling is of first order and diverges for light bodies; see '
            '[verification.md](verification.md), "Coupling".'),
        Statement(
            'Abstract', 'we elucidate the viability of tailoring turning gaits through systematic variations in input '
            'parameters', graded(_turn_right(results.turning)), 'See the statements on Figure 10 below.'),
        Statement(
            'Abstract', 'compared with finite element and CFD methods, the PRB method has high computational '
            'efficiency',
            OPEN, 'Neither the paper nor this page measures the time of such a method.'),
        Statement(
            'Section 1.1', 'they can forage at a speed of 0.25–0.47 m/s',
            graded(FORAGING[0] <= usual.mean <= FORAGING[1]),
            f'The statement is about mantas. The robot swims at {usual.mean:.2f} m/s with A = 40° and f = 0.6 Hz.'),
    ]


def _modeling(results: Results) -> list[Statement]:
    straight, turns = results.figure_9, list(results.turning.by_chains.items())
    (many, with_many), (few, with_few) = turns[0], turns[-1]
    attack = [float(np.abs(one.attack[one.window]).max()) for one in straight.swims]
    differences = [abs(a.turning_rate / b.turning_rate - 1.0) for a, b in zip(with_many, with_few, strict=True)]
    return [
        Statement(
            'Section 3.2, an assumption', 'when the discretization width ds of the link tends towards 0, the tangents '
            'R and E can be considered as the line connecting the origins of two adjacent links',
            graded(max(differences) < OF_THE_GRID, _agree_at_first(with_many, with_few)),
            'This holds as long as the fins are stable along their chords. In a flow that is fast enough, the slope of '
            '(11) causes a chordwise instability, and with more chains a slower flow is enough '
            '([verification.md](verification.md), "Where refinement along the chord ends"). So the results have no '
            'limit for many chains: the turns below end with '
            f'{listed(turn.turning_rate for turn in with_many)}°/s with {many} chains, and with '
            f'{listed(turn.turning_rate for turn in with_few)}°/s with {few} chains.'),
        Statement(
            'Section 3.4, an assumption', 'Since the angle of attack of the body is minor, the lift can be neglected',
            graded(max(attack) < MINOR_ATTACK),
            'The body heaves in response to the flapping, so its angle of attack oscillates: in Figure 9 it '
            f'reaches {listed(attack, 0)}° at A = {listed((one.amplitude for one in straight.swims), 0)}°. As in '
            'the paper, the model has no lift of the body.'),
    ]


def _agree_at_first(of_many: list[Turn], of_few: list[Turn]) -> bool:
    return all(abs(a.yaw_rates[0] / b.yaw_rates[0] - 1.0) < OF_THE_GRID for a, b in zip(of_many, of_few, strict=True))


def _computing(cost: Cost) -> list[Statement]:
    stable = largest_stable_step(robot(), STRAIGHT, STRAIGHT)
    step = cost.reference / cost.steps
    plausible = 1.0 / PLAUSIBLE < step / cost.paper < PLAUSIBLE
    return [
        Statement(
            'Section 4', 'for a simulation corresponding to 0.01 s physical time step, the computational time is 0.18 '
            's',
            graded(plausible and stable >= PAPER_STEP, plausible),
            f'A step of the reference implementation in NumPy takes {step:.1f} s, so the time in the paper is '
            f'{"plausible" if plausible else "not plausible"}. A step of 0.01 s is '
            f'{"possible" if stable >= PAPER_STEP else "not possible"}: with these values the scheme of the paper is '
            f'stable up to {stable:.4f} s.'),
        Statement(
            'Section 4', 'the algorithm is computationally efficient, providing the possibility of real-time '
            'calculation',
            graded(cost.library < PAPER_STEP),
            f'The program of the paper is {cost.paper / PAPER_STEP:.0f} times slower than real time. This library '
            f'simulates {PAPER_STEP / cost.library:.0f} s of swimming in one second.'),
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
            f'The front rod reaches {1000.0 * front:.1f} mm and the rear rod {1000.0 * rear:.1f} mm at A = 40°.'),
        Statement(
            'Section 5.1, Figure 7', 'in the three passive segments (q_1, q_2, q_3), a conspicuous phenomenon of phase '
            'lag '
            'is evident', graded(bool(np.all(chord > 0.0))),
            f'Along the chord the joints of the last chain lag those of the first chain by {listed(chord)}°. This '
            f'is about the lag of the rear rods behind the front rods, {np.degrees(figure.gait.phase):.0f}°, so the '
            'wave is that of the rods.'),
        Statement(
            'Section 5.1, Figure 7', 'a highly noticeable phase lag phenomenon is observable, corresponding to the '
            'spanwise wave transmission',
            graded(bool(np.all(span > NOTICEABLE * np.abs(chord).mean())), bool(np.all(span > 0.0))),
            f'At the trailing edge the second and the third joint lag the first joint by {listed(span)}°. The wave '
            'travels outward, as it should, but the lag is small. The directions of these links, which an observer '
            f'sees, lag by {listed(directions)}°.'),
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
            f'{NO_EXPERIMENT} The simulated thrust {"grows" if grows else "does not always grow"} with the '
            f'amplitude and with the frequency, up to {with_amplitude[-1, -1]:.1f} N at A = '
            f'{figure.amplitudes[-1]:.0f}° and {fastest:g} Hz.'),
        Statement(
            'Section 5.1, Figure 8', 'As the flapping amplitude approaches 40°, the thrust differences between red '
            'lines '
            'and blue lines become apparent', OPEN, NO_EXPERIMENT),
        Statement(
            'Section 5.1, Figure 8', 'The thrust difference reaches the maximum (about 1.8 N) at the amplitude Am = '
            '40° and the frequency f = 0.51 Hz', OPEN,
            f'{NO_EXPERIMENT} The simulated thrust is {disputed:.1f} N there.'),
        Statement(
            'Section 5.1, Figure 8', 'attributed to the lack of accuracy in the Morison equation when describing large '
            'amplitude motions', OPEN, 'A model cannot show where it differs from the robot.'),
        Statement(
            'Section 5.1, Figure 8', 'the calculated trend of average thrust matches the experimental results', OPEN,
            f'{NO_EXPERIMENT} The simulated thrust {"grows" if rises else "does not always grow"} with the phase. At '
            f'{fastest:g} Hz it is {with_phase[-1, 0]:.1f} N at {figure.phases[0]:.0f}° and {with_phase[-1, -1]:.1f} N '
            f'at {figure.phases[-1]:.0f}°.'),
        Statement(
            'Section 5.1, Figure 8', 'The error is relatively small when the phase difference is positive', OPEN,
            NO_EXPERIMENT),
        Statement(
            'Section 5.1', 'the two sets of experiments effectively validated the reliability of our flexible fins '
            'model',
            OPEN, f'{NO_EXPERIMENT} The values that the paper does not give were chosen here so that the thrust agrees '
            'with that of the prototype, so its size does not verify the model. See the sensitivities below.'),
    ]


def _straight(figure: Figure9) -> list[Statement]:
    swims, smooth = figure.swims, figure.smooth
    oscillations, smooth_oscillations = [one.oscillation for one in swims], [one.oscillation for one in smooth]
    amplitudes = f'A = {listed((one.amplitude for one in swims), 0)}°'
    settled_from = [one.settled_from for one in swims]
    return [
        Statement(
            'Section 5.2, Figure 9', 'The motion mode of MPF led to oscillations in forward velocity',
            graded(min(one.oscillation / one.mean for one in swims) > OSCILLATING),
            f'From peak to peak the speed oscillates by {listed(oscillations, 3)} m/s at {amplitudes}.'),
        Statement(
            'Section 5.2, Figure 9', 'keeping the input parameters constant, the velocity of the robot eventually '
            'converges and stabilizes',
            graded(None not in settled_from, any(period is not None for period in settled_from)),
            f'The mean of each period stays within {100.0 * SETTLED:.0f} % of '
            f'{listed((one.final for one in swims), 3)} m/s from period '
            f'{listed((math.nan if period is None else period + 1 for period in settled_from), 0)} on. The window '
            f'from {WINDOW[0]:g} to {WINDOW[1]:g} s begins earlier, in period {int(WINDOW[0] * FREQUENCY) + 1}, and '
            f'its means are {listed((one.mean for one in swims), 3)} m/s.'),
        Statement(
            'Section 5.2, Figure 9', 'the simulated velocity, on average, closely aligns with the experimental results '
            'without significant differences', OPEN, NO_EXPERIMENT),
        Statement(
            'Section 5.2, Figure 9', "as the flapping amplitude Am increases, the oscillation amplitude of the robot's "
            'forward velocity becomes larger',
            graded(bool(np.all(np.diff(oscillations) > 0.0) and np.all(np.diff(smooth_oscillations) > 0.0))),
            f'See above. With {smooth[0].chains} chains the speed oscillates by {listed(smooth_oscillations, 3)} m/s.'),
        Statement(
            'Section 5.2, Figure 9', 'When the amplitude rises above 40°, the error becomes significant', OPEN,
            f'{NO_EXPERIMENT} At {swims[-1].amplitude:.0f}° the final speeds with {swims[-1].chains} and with '
            f'{smooth[-1].chains} chains differ, {swims[-1].final:.3f} and {smooth[-1].final:.3f} m/s, because the '
            f'fins with {swims[-1].chains} chains are unstable along their chords. At 40° they are '
            f'{swims[-2].final:.3f} and {smooth[-2].final:.3f} m/s.'),
        Statement(
            'Section 5.2, Figure 9', 'Taking the amplitude Am = 50° as an example, the error of the average velocity '
            'reaches 0.07 m/s', OPEN, f'{NO_EXPERIMENT} The simulated average in the window is '
            f'{swims[-1].mean:.3f} m/s.'),
        Statement(
            'Section 5.2, Figure 9', "attributed to the inaccuracy of Morison's equation at large amplitude motions",
            OPEN, 'A model cannot show where it differs from the robot.'),
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
    in_water = turning.in_water
    begin, lasting = steady_stretch(spin)
    lasting_many = steady_stretch(circle)[1]
    moments, rates = spin.mean_wrenches[begin:begin + lasting, 5], spin.yaw_rates[begin:begin + lasting]
    return [
        Statement(
            'Section 5.2, Figure 10', 'The asymmetry in the phase difference of the drive mechanisms on both sides of '
            'the pectoral fins and the inconsistency in the flapping amplitudes can both give rise to the turning '
            'gaits',
            graded(_turn_right(turning)),
            'In the second period the yaw rates of set 1 and set 2 are '
            f'{listed((turn.yaw_rates[1] for turn in with_many), 0)}°/s, where a negative rate is a turn to the right. '
            f'At the end they are {listed(turn.turning_rate for turn in with_many)}°/s, on circles with radii of '
            f'{listed((turn.turning_radius for turn in with_many), 2)} m. With twist stiffness and a body in water '
            f'they end with {listed(turn.turning_rate for turn in in_water)}°/s, on circles with radii of '
            f'{listed((turn.turning_radius for turn in in_water), 2)} m.'),
        Statement(
            'Section 5.2, Figure 11', 'the turning mode, which involves altering the phase difference, ϕ_l and ϕ_r, '
            'exhibits a higher rotational acceleration during the initial stages of motion',
            graded(all(abs(one) > abs(two) for one, two in first)),
            f'In the first period the mean of M_z is {listed(first[0], 2)} N m for set 1 and set 2, and its largest '
            f'magnitude is {listed(peak, 2)} N m. With twist stiffness and a body in water the mean is '
            f'{listed((turn.mean_wrenches[0, 5] for turn in in_water), 2)} N m.'),
        Statement(
            'Section 5.2, Figure 11', 'the turning mode associated with amplitude variations, Am_l and Am_r, can '
            'consistently generate a stable driving moment',
            graded(min(lasting, lasting_many) >= STEADY_PERIODS, max(lasting, lasting_many) >= STEADY_PERIODS),
            f'This holds as long as the fins are stable along their chords. With {few} chains the mean M_z of set 2 '
            f'stays within {100.0 * STEADY_MOMENT:.0f} % of {moments.mean():.2f} N m for {lasting} periods. With '
            f'{many} chains it is stable for only {lasting_many} periods, because the chordwise instability sets '
            f'in. The mean M_z of set 1 is below half of its first value in period {halved(with_few[0])} with {few} '
            f'chains, and in period {halved(with_many[0])} with {many} chains. With twist stiffness and a body in '
            'water the moments of both sets are stable: for '
            f'{listed((steady_stretch(turn)[1] for turn in in_water), 0)} of {len(in_water[0].yaw_rates)} periods '
            f'they stay within {100.0 * STEADY_MOMENT:.0f} % of '
            f'{listed((_stable_moment(turn) for turn in in_water), 2)} N m.'),
        Statement(
            'Section 5.2, Figure 11', 'making it suitable for cruising swimming with circular trajectories',
            graded(all(_circles(turns[1]) for turns in (with_many, with_few)), _circles(circle)),
            f'With {many} chains the robot settles on a circle with a radius of {circle.turning_radius:.2f} '
            f'm{_from(circle)}. But fins that are stable along their chords hardly brake the yaw: with {few} chains '
            f'M_z changes only from {moments[0]:.2f} to {moments[-1]:.2f} N m, while the yaw rate changes from '
            f'{rates[0]:.0f} to {rates[-1]:.0f}°/s, and the robot finally spins on the spot. The turn becomes '
            'tighter until the chordwise instability sets in, so the number of chains determines the result. With '
            'twist stiffness and a body in water it does not: the robot settles on a circle with a radius of '
            f'{in_water[1].turning_radius:.2f} m{_from(in_water[1])}. This circle is so narrow that the inner fin '
            'moves backward.'),
        Statement(
            'Section 6', 'we have been able to numerically recover the characteristic hydrodynamic forces of the '
            'robotic '
            'manta during different motion gaits', OPEN, NO_EXPERIMENT),
    ]


def _turn_right(turning: Turning) -> bool:
    return all(bool(np.all(turn.yaw_rates < 0.0)) for turn in turning.turns)


def steady_stretch(turn: Turn) -> tuple[int, int]:
    """Return the first period (0 is the first) of the longest stretch in which M_z is stable, and its length.

    In a stretch the mean of each period is within STEADY_MOMENT of the mean of all of its periods.
    """
    means = turn.mean_wrenches[:, 5]
    best = (0, 0)
    for begin in range(len(means)):
        for end in range(begin + best[1] + 1, len(means) + 1):
            inside = means[begin:end]
            if np.all(np.abs(inside - inside.mean()) <= STEADY_MOMENT * abs(inside.mean())):
                best = (begin, end - begin)
    return best


def _stable_moment(turn: Turn) -> float:
    """Return the mean M_z [N m] of the longest stretch in which it is stable."""
    begin, length = steady_stretch(turn)
    return float(turn.mean_wrenches[begin:begin + length, 5].mean())


def halved(turn: Turn) -> int:
    """Return the period (1 is the first) in which the mean M_z falls below half of that of the first period."""
    means = turn.mean_wrenches[:, 5]
    return int(np.argmax(means / means[0] < 0.5)) + 1


def _circles(turn: Turn) -> bool:
    """Return whether a turn becomes a steady circle that is so wide that the inner fin still moves forward."""
    parameters = turn.record.parameters
    half_span = parameters.rods.rear_motor_position[1] + parameters.rods.rear_radius + parameters.fin.span
    return turn.steady_from is not None and turn.turning_radius > half_span


def _from(turn: Turn) -> str:
    return '' if turn.steady_from is None else f' from period {turn.steady_from + 1} on'

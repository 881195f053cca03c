"""The page docs/paper.md."""

from __future__ import annotations

import collections
from collections.abc import Iterable, Sequence

from evidence.paper.cost import Cost
from evidence.paper.sensitivity import Sensitivity
from evidence.paper.slips import SLIPS
from evidence.paper.statements import HOLDS, IN_PART, NOT, OPEN, Results, Statement, listed, statements
from evidence.report import picture, prose, table
from manta_sim_ros.dynamics import Parameters, Quantity
from manta_sim_ros.figures.figure_8 import AMPLITUDE_OF_PHASES, PHASE_OF_AMPLITUDES
from manta_sim_ros.figures.figure_9 import WINDOW

HEAD = """# The paper's results, and what this simulator makes of them

Qu et al., *A Rigid-Flexible Coupling Dynamic Model for Robotic Manta with Flexible Pectoral Fins*, J. Mar. Sci. Eng.
2024, 12, 292, shows its results in Figures 7 to 11. `make paper` draws them again, measures every number on this page,
and writes it. `ros2 run manta_sim_ros paper_figures` draws the same figures, with their data as CSV, and an animation
of each gait into a directory of your own. Numbers in parentheses are the paper's equations.
"""
FIGURES = ('figure_7', 'figure_8', 'figure_9', 'figure_10', 'figure_11')
PLOTS = (*FIGURES, 'sensitivity')
ANIMATION = 'The straight gait, from a camera that stays and from one that follows.'


def text(results: Results, sensitivity: Sensitivity) -> str:
    """Return the page."""
    said = statements(results)
    return '\n\n'.join([
        HEAD.strip(),
        '## What the paper says', _counted(said), statement_table(said),
        '## The figures', picture('paper/straight.gif', ANIMATION), *figure_blocks(results),
        '## Where the print is not followed',
        prose("What is computed instead, and where: names are those of modules and functions in "
                "`manta_sim_ros/dynamics/_kernels`. [model.md](model.md) says what goes beyond the paper."),
        slip_table(),
        '## Table 1, as used', parameter_table(printed=True),
        '## What is assumed', *_assumed(sensitivity),
        '## What a step costs', *_cost(results.cost),
    ]) + '\n'


def verdicts(results: Results) -> str:
    """Return the verdicts as text, a statement a line."""
    return '\n'.join(f'{said.verdict:<16}  {said.place}: {said.quote}' for said in statements(results))


def statement_table(said: Iterable[Statement]) -> str:
    """Return the statements as a table in Markdown."""
    return table(('where', 'the paper', 'here it', 'measured'), (
        (statement.place, f'"{statement.quote}"', f'**{statement.verdict}**', statement.answer) for statement in said))


def slip_table() -> str:
    """Return the slips of the print as a table in Markdown."""
    return table(('where', 'in print', 'as implemented', 'code'), (
        (slip.where, slip.printed, slip.implemented, slip.code and f'`{slip.code}`') for slip in SLIPS))


def parameter_table(printed: bool) -> str:
    """Return the parameters whose source is Table 1 as printed, or those with any other source, as a table."""
    parameters = Parameters()
    rows = []
    for full_name, about in Parameters.quantities().items():
        if is_printed(about) == printed:
            group, name = full_name.split('.')
            value = getattr(getattr(parameters, group), name)
            shown = f'({", ".join(f"{part:g}" for part in value)})' if about.kind is tuple else (
                f'{value:g}' if about.kind in (int, float) else str(value).lower())
            rows.append((f'`{full_name}`', f'{shown} {about.unit}'.rstrip(), about.description, about.source))
    return table(('parameter', 'value', 'meaning', 'source'), rows)


def is_printed(about: Quantity) -> bool:
    """Return whether a value stands in Table 1."""
    return about.source.startswith('Table 1')


def _counted(said: Sequence[Statement]) -> str:
    counts = collections.Counter(statement.verdict for statement in said)
    return prose(
        f'{len(said)} statements: '
        f'{", ".join(f"{counts[verdict]} {verdict}" for verdict in (HOLDS, IN_PART, NOT, OPEN))}. Those that compare '
        'with experiments cannot be judged, as the text gives no values of these. Quotes are shortened at their ends, '
        'their symbols simplified.')


def figure_blocks(results: Results) -> list[str]:
    """Return heading, prose and picture of each figure."""
    wave, thrust, straight = results.figure_7, results.figure_8, results.figure_9
    (many, turns), (few, few_turns) = list(results.turning.by_chains.items())
    set_1, set_2 = turns
    usual = straight.swims[[one.amplitude for one in straight.swims].index(40.0)]
    return [
        '### Figure 7: waves along the chord and along the span',
        prose(f'Body held, gait of Figure 9 (the paper names none). The motion is periodic after '
                f'{wave.transient} period{"s" * (wave.transient != 1)}; lags are those of the fundamental. Along the '
                f'chord {listed(wave.chordwise_lags)}° in joints 1 to 3, along the span of the trailing chain '
                f'{listed(wave.spanwise_lags[1, 1:])}° from joint 1 to joints 2 and 3.'),
        picture('paper/figure_7.png', 'Joint angles of the leading and the trailing chain over two periods.'),
        '### Figure 8: thrust',
        prose(
            f'Body held; φ = {PHASE_OF_AMPLITUDES:.0f}° on the left, A = {AMPLITUDE_OF_PHASES:.0f}° on the right. The '
            'mean is that of one period, after the thrust repeats to a thousandth of its swing, which takes at '
            f'most {thrust.longest_transient} period{"s" * (thrust.longest_transient != 1)}.'),
        picture('paper/figure_8.png', 'Mean thrust of both fins against amplitude and against phase.'),
        '### Figure 9: straight ahead',
        prose(f'Mean and ripple are those from {WINDOW[0]:g} to {WINDOW[1]:g} s, as in the paper; the ripple is the '
                f'largest less the smallest deviation from the average over a period. At A = 40°: {usual.mean:.3f} '
                f'm/s, ripple {usual.ripple:.3f} m/s. At 50° the robot is so fast that with {many} chains waves run '
                f'along the chord of its fins, which slow it down; with {few} chains there are none (see "How many '
                f'chains" in [model.md](model.md)).'),
        picture('paper/figure_9.png', 'Forward speed against time.'),
        '### Figure 10: turns',
        prose(
            f'Set 1: A 40/40°, φ 40/0° (left/right); set 2: A 40/20°, φ 40/40°. With the paper\'s {many} chains set 1 '
            f'ends at {set_1.turning_rate:.1f}°/s on a radius of {set_1.turning_radius:.2f} m, set 2 at '
            f'{set_2.turning_rate:.1f}°/s on {set_2.turning_radius:.2f} m. Both rates are set by the waves along the '
            f'chord, which brake the yaw. With {few} chains these begin later, and the turns tighten until they do. In '
            'the first period, before there are any, the yaw rates agree: '
            f'{listed(turn.yaw_rates[0] for turn in turns)}°/s with {many} chains, '
            f'{listed(turn.yaw_rates[0] for turn in few_turns)}°/s with {few}.'),
        picture(
            'paper/figure_10.png',
            'Trajectories of the center of mass; the dot is the end. Left as in the paper, right '
            'with fewer chains.'),
        '### Figure 11: the wrench in the turns',
        prose('Force and moment of both fins on the body about its center of mass, in the body frame. The last row '
                'is the averaged M_z once more, enlarged: that of set 1 is larger at first and fades as the robot '
                'turns, that of set 2 stays, until waves run along the chord.'),
        picture('paper/figure_11.png', 'Components of the wrench against time.'),
    ]


def _assumed(sensitivity: Sensitivity) -> list[str]:
    return [
        prose(
            'All that Table 1 does not give. The paper begins its gaits at once, and so do all results on this page '
            '(`rods.command_time_constant` 0).'),
        parameter_table(printed=False),
        prose(
            'How much each result hangs on what is assumed, or printed without a clear meaning: change of the result '
            'when one value is 20 % smaller or larger, the others as they are.'),
        picture('paper/sensitivity.png', sensitivity.caption),
        sensitivity.table(),
    ]


def cost_table(cost: Cost) -> str:
    """Return what the paper's program, the literal version and the library cost as a table in Markdown."""
    rows = [
        ("the paper's Python, on its own machine", cost.paper, 1),
        ('the literal version in NumPy, 6 x 6 matrices as printed', cost.literal, cost.steps),
        ('this library', cost.library, cost.steps),
    ]
    return table(('program', 'time', 'a step', 'times real time', "the paper's time over it"), (
        (name, f'{seconds:.2g} s', f'{seconds / steps:.2g} s', f'{0.01 / seconds:.2g}', f'{cost.paper / seconds:.2g}')
        for name, seconds, steps in rows))


def _cost(cost: Cost) -> list[str]:
    return [
        prose(
            'Computing time of 0.01 s of swimming, 30 chains of 3 links a fin. The lower two on one core in the same '
            'run, five steps of 0.002 s; the first is the paper\'s figure, one step of 0.01 s. `make bench` compares '
            'with others.'),
        cost_table(cost),
    ]

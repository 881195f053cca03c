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

HEAD = """# The paper's results, compared with those of this simulator

Qu et al., *A Rigid-Flexible Coupling Dynamic Model for Robotic Manta with Flexible Pectoral Fins*, J. Mar. Sci. Eng.
2024, 12, 292, shows its results in Figures 7 to 11. `make paper` draws these figures with this simulator, measures
every number on this page, and writes the page. `ros2 run manta_sim_ros paper_figures` writes the same figures, their
data as CSV files, and an animation of each gait into a directory of your choice. Numbers in parentheses are those of
the paper's equations.
"""
FIGURES = ('figure_7', 'figure_8', 'figure_9', 'figure_10', 'figure_11')
PLOTS = (*FIGURES, 'sensitivity')
ANIMATION = 'The straight gait, seen from a fixed camera and from one that follows the robot.'


def text(results: Results, sensitivity: Sensitivity) -> str:
    """Return the page."""
    judged = statements(results)
    return '\n\n'.join([
        HEAD.strip(),
        '## The statements of the paper', _counted(judged), statement_table(judged),
        '## The figures', picture('paper/straight.gif', ANIMATION), *figure_blocks(results),
        '## Where the print is not followed',
        prose('The table lists what the simulator computes instead. The last column gives the modules and functions in '
              '`manta_sim_ros/dynamics/_kernels` that compute it. [model.md](model.md) describes what goes beyond the '
              'paper.'),
        slip_table(),
        '## Table 1, as used', parameter_table(printed=True),
        '## Assumed values', *_assumed(sensitivity),
        '## The cost of a step', *_cost(results.cost),
    ]) + '\n'


def verdicts(results: Results) -> str:
    """Return the verdicts as text, one statement per line."""
    return '\n'.join(
        f'{statement.verdict:<16}  {statement.place}: {statement.quote}' for statement in statements(results))


def statement_table(judged: Iterable[Statement]) -> str:
    """Return the statements as a table in Markdown."""
    return table(('place', 'statement of the paper', 'verdict', 'result of the simulator'), (
        (statement.place, f'"{statement.quote}"', f'**{statement.verdict}**', statement.answer)
        for statement in judged))


def slip_table() -> str:
    """Return the slips of the print as a table in Markdown."""
    return table(('place', 'in print', 'as implemented', 'code'), (
        (slip.where, slip.printed, slip.implemented, slip.code and f'`{slip.code}`') for slip in SLIPS))


def parameter_table(printed: bool) -> str:
    """Return the parameters whose source is Table 1, or those with another source, as a table in Markdown."""
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
    """Return whether the source of a value is Table 1."""
    return about.source.startswith('Table 1')


def _counted(judged: Sequence[Statement]) -> str:
    counts = collections.Counter(statement.verdict for statement in judged)
    verdicts = ', '.join(f'"{verdict}" for {counts[verdict]}' for verdict in (HOLDS, IN_PART, NOT, OPEN))
    return prose(
        f'The table has {len(judged)} statements. The verdict is {verdicts}. Statements that compare the model with '
        'experiments cannot be judged, because the text gives no values of the experiments. Quotes are shortened at '
        'their ends, and their symbols are simplified.')


def figure_blocks(results: Results) -> list[str]:
    """Return the heading, the prose and the picture of each figure."""
    wave, thrust, straight = results.figure_7, results.figure_8, results.figure_9
    (many, turns), (few, few_turns) = list(results.turning.by_chains.items())
    set_1, set_2 = turns
    water_1, water_2 = results.turning.in_water
    usual = straight.swims[[one.amplitude for one in straight.swims].index(40.0)]
    return [
        '### Figure 7: the wave along the chord and along the span',
        prose('The body is held, and the gait is that of Figure 9, since the paper does not give one. The motion '
              f'is periodic after {wave.transient} period{"s" * (wave.transient != 1)}. Lags are those of the '
              'fundamental. Along the chord, the trailing chain lags the leading chain by '
              f'{listed(wave.chordwise_lags)}° in joints 1 to 3. Along the span of the trailing chain, joints 2 and '
              f'3 lag joint 1 by {listed(wave.spanwise_lags[1, 1:])}°.'),
        picture('paper/figure_7.png', 'Joint angles of the leading and the trailing chain over two periods.'),
        '### Figure 8: thrust',
        prose(
            f'The body is held, with φ = {PHASE_OF_AMPLITUDES:.0f}° on the left and A = {AMPLITUDE_OF_PHASES:.0f}° '
            'on the right. The thrust is averaged over one period, after it has become periodic to a thousandth of '
            f'its range. This takes at most {thrust.longest_transient} '
            f'period{"s" * (thrust.longest_transient != 1)}.'),
        picture('paper/figure_8.png', 'Mean thrust of both fins against amplitude and against phase.'),
        '### Figure 9: the straight gait',
        prose(f'The mean and the oscillation are those from {WINDOW[0]:g} to {WINDOW[1]:g} s, as in the paper. The '
              'oscillation is the largest minus the smallest deviation of the speed from its average over a '
              f'period. At A = 40° the mean is {usual.mean:.3f} m/s, and the oscillation is {usual.oscillation:.3f} '
              f'm/s. At 50° the robot is so fast that fins with {many} chains are unstable along their chords, '
              f'which slows the robot down. Fins with {few} chains stay stable (see '
              '[verification.md](verification.md), "How many chains a fin may have").'),
        picture('paper/figure_9.png', 'Forward speed against time.'),
        '### Figure 10: turns',
        prose(
            f'Set 1 has A = 40/40° and φ = 40/0° (left/right); set 2 has A = 40/20° and φ = 40/40°. With the {many} '
            f'chains of the paper, set 1 ends with {set_1.turning_rate:.1f}°/s on a radius of '
            f'{set_1.turning_radius:.2f} m, and set 2 with {set_2.turning_rate:.1f}°/s on a radius of '
            f'{set_2.turning_radius:.2f} m. Both rates are determined by the chordwise instability of the fins, '
            f'which brakes the yaw. With {few} chains the instability sets in later, and the turns become tighter '
            'until then. In the first period, before the instability sets in, the yaw rates of the two sets are '
            f'{listed(turn.yaw_rates[0] for turn in turns)}°/s with {many} chains and '
            f'{listed(turn.yaw_rates[0] for turn in few_turns)}°/s with {few} chains.'),
        prose(
            'The third column shows the same turns with twist stiffness and a body in water, which the paper leaves '
            'out: the robot of `config/freshwater.yaml`. Its fins resist twist along the chord, so that the '
            'chordwise instability does not set in, and its body has added mass and quadratic damping, which brake the '
            f'yaw. Set 1 ends with {water_1.turning_rate:.1f}°/s on a radius of {water_1.turning_radius:.2f} m, and '
            f'set 2 with {water_2.turning_rate:.1f}°/s on a radius of {water_2.turning_radius:.2f} m. The number of '
            'chains does not change these turns; [Validation](validation.md) measures this and compares them with '
            'mantas.'),
        picture(
            'paper/figure_10.png',
            'Trajectories of the center of mass; dots are their ends. The left column has the number of chains of the '
            'paper, the center column has fewer chains, and the right column has twist stiffness and a body in water. '
            'The scales differ.'),
        '### Figure 11: the wrench in the turns',
        prose('The figure shows the force and the moment of both fins on the body about its center of mass, in the '
              'body frame. The last row shows the averaged M_z again on a larger scale. The moment of set 1 is '
              'larger at first and decreases as the robot turns. The moment of set 2 remains until the chordwise '
              'instability sets in. With twist stiffness and a body in water (right) both moments are steady after a '
              'few periods: they balance the quadratic damping of yaw. The moments and the vertical force are larger '
              'there.'),
        picture('paper/figure_11.png', 'Components of the wrench against time.'),
    ]


def _assumed(sensitivity: Sensitivity) -> list[str]:
    return [
        prose(
            'The following values are not given in Table 1. The gaits of the paper start at full amplitude, and so do '
            'all gaits on this page (`rods.command_time_constant` 0).'),
        parameter_table(printed=False),
        prose(
            'The plot and the table below show how much each result depends on the values that are assumed or whose '
            'printed meaning is not clear. They give the change of the result when one value is 20 % smaller or '
            'larger, with all other values unchanged.'),
        picture('paper/sensitivity.png', sensitivity.caption),
        sensitivity.table(),
    ]


def cost_table(cost: Cost) -> str:
    """Return the cost of the paper's program, the reference implementation and the library as a table in Markdown."""
    rows = [
        ("the paper's Python program, on the authors' machine", cost.paper, 1),
        ('the reference implementation in NumPy, with 6 x 6 matrices', cost.reference, cost.steps),
        ('this library', cost.library, cost.steps),
    ]
    return table(('program', 'time', 'time per step', 'simulated over computing time', 'speedup over the paper'), (
        (name, f'{seconds:.2g} s', f'{seconds / steps:.2g} s', f'{0.01 / seconds:.2g}', f'{cost.paper / seconds:.2g}')
        for name, seconds, steps in rows))


def _cost(cost: Cost) -> list[str]:
    return [
        prose(
            'The table shows the computing time of 0.01 s of swimming with 30 chains of 3 links per fin. The first '
            'row is the time that the paper gives for one step of 0.01 s. The other two rows were measured in one '
            'run on one core, with five steps of 0.002 s. `make bench` compares the simulator with other programs.'),
        cost_table(cost),
    ]

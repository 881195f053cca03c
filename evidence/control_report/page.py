"""The page docs/control_report.md."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from evidence.control_report.conditions import CONDITIONS, CURRENT, NOISE, UNCERTAIN, WRONG
from evidence.control_report.courses import (
    AFTER_CORNER,
    BEFORE_CORNER,
    OF_HEIGHT,
    ON_CURVES,
    ON_LEGS,
    ON_LEGS_IN_CURRENT,
    START,
)
from evidence.control_report.robots import CONTROLLERS, ROBOTS
from evidence.control_report.steps import CRUISE, SETTLED, WIDTH, Settling
from evidence.control_report.swims import Result, Row, verdict
from evidence.report import picture, prose, read_table, table

HEAD = """# Path following, measured

This page says how near the robot stays to paths with the [path follower](control.md), how well it settles, and what
that costs. The controller and the simulator run in one process, without middleware, faster than real time. `make
control-report` measured all numbers on this page and wrote it.
"""
TITLES = {'freshwater': 'In fresh water, `config/freshwater.yaml`',
          'manta': 'With the parameters of the paper, `config/manta.yaml`'}
TRACKS = (
    'From left to right: the paths (black) and the tracks from above, the errors, and the height errors, with their '
    'bounds (dotted), under each condition.')
SETTLING = 'The cross-track error after the step, under each condition; gray: settled.'
MET = {True: 'yes', False: '**no**'}
KEY = ('path', 'condition', 'controller')


def text(results: Mapping[Row, Result], settlings: Mapping[Row, Settling]) -> str:
    """Return the page, from what was measured."""
    return '\n\n'.join([
        HEAD.strip(), method(), '## Which bounds are met', summary(results),
        *(part for name in ROBOTS for part in section(name, results, settlings)),
    ]) + '\n'


def method() -> str:
    """Return what is measured, in words."""
    widened = ', '.join(f'`config/{name}.yaml`' for name, robot in ROBOTS.items() if robot.widening != 1.0)
    factor = next(robot.widening for robot in ROBOTS.values() if robot.widening != 1.0)
    names = ', '.join(f'`{group}.{name}`' for group, values in UNCERTAIN.items() for name in values)
    controllers = ', '.join(f'`{name}`' for name in CONTROLLERS)
    return '## What is measured\n\n' + prose(f"""
The paths are those of the [missions](control.md#missions) in `config/missions/`. The robot starts at rest at the
origin, along x. Controllers: {controllers}.

The cross-track error is the horizontal distance of the center of mass to the nearest point of the path, and the height
error is the vertical one; both contain the motion within a flapping period. They count after {START:g} m, and not from
{BEFORE_CORNER:g} m before to {AFTER_CORNER:g} m after a corner, where the robot turns. Bounds are those of the 95th
percentiles: on straight legs {ON_LEGS:g} m, and {ON_LEGS_IN_CURRENT:g} m in a current; on circle and helix
{ON_CURVES:g} m; of the height {OF_HEIGHT:g} m. With {widened} they are {factor:g} times as large. In station keeping,
the distance from the point in the center takes the place of the cross-track error, and the bound of the largest
distance is that of the mission with both. A swim that does not reach the end of its path meets no bound.

The effort is the mean absolute rate of the amplitudes, phases and biases that are commanded. The power is that of the
motors into the fins. The cost of transport is this power divided by the weight in air and by the mean speed along the
path.

The conditions are:
""") + '\n\n' + '\n'.join(f'- {prose(line)}' for line in (
        'calm: still water, and odometry that is the ground truth.',
        f'current: the water flows with {CURRENT:g} m/s along y.',
        'noise: the odometry has Gaussian noise that is independent from sample to sample, with standard deviations of '
        f'{NOISE.position:g} m, {math.degrees(NOISE.orientation):g}°, {NOISE.linear_velocity:g} m/s and '
        f'{NOISE.angular_velocity:g} rad/s.',
        f'wrong parameters: the robot that swims differs from the one of the gains. Each of these values is by '
        f'{100.0 * WRONG:g} % smaller or larger, by chance: {names}.',
    )) + '\n\n' + prose(f"""
There are {CONDITIONS['noise'].draws} swims with noise and {CONDITIONS['wrong parameters'].draws} with wrong parameters,
with different seeds. The tables have the largest error of these swims, and the mean of the other columns.

The step: while the robot cruises, after {CRUISE:g} m, the path is moved by {WIDTH:g} m to the left. The robot has
settled where the cross-track error remains within {SETTLED:g} m.""")


def summary(results: Mapping[Row, Result]) -> str:
    """Return how many bounds are met, and each one that is not."""
    verdicts = {(row, kind): met for row, result in results.items() for kind, met in (
        ('error', verdict(row, result).met), ('height error', verdict(row, result).height_met))}
    lines = [prose(f'{sum(verdicts.values())} of {len(verdicts)} bounds are met.')]
    missed = [f'- `config/{row.robot}.yaml`, {row.course}, {row.condition}, {row.controller}: {kind}'
              for (row, kind), met in verdicts.items() if not met]
    if missed:
        lines += ['These are not:', '\n'.join(missed)]
    return '\n\n'.join(lines)


def section(name: str, results: Mapping[Row, Result], settlings: Mapping[Row, Settling]) -> list[str]:
    """Return what was measured with a robot."""
    of_robot = {row: result for row, result in results.items() if row.robot == name}
    return [
        f'## {TITLES[name]}', '### Errors', error_table(of_robot), picture(f'control_report/tracks_{name}.png', TRACKS),
        '### Effort and cost', cost_table(of_robot),
        '### A step to the side', step_table({row: one for row, one in settlings.items() if row.robot == name}),
        picture(f'control_report/step_{name}.png', SETTLING),
    ]


def error_table(results: Mapping[Row, Result]) -> str:
    """Return the errors with their bounds."""
    head = (*KEY, 'error, mean [m]', '95 % [m]', 'largest [m]', 'bound [m]', 'met',
            'height error, 95 % [m]', 'largest [m]', 'bound [m]', 'met')
    return table(head, (
        (*row[1:], f'{result.mean:.2f}', f'{result.most:.2f}', f'{result.largest:.2f}', f'{found.bound:.2f}',
         MET[found.met], f'{result.height:.2f}', f'{result.largest_height:.2f}', f'{found.height_bound:.2f}',
         MET[found.height_met])
        for row, result in results.items() for found in [verdict(row, result)]))


def cost_table(results: Mapping[Row, Result]) -> str:
    """Return effort, power, cost of transport and time."""
    head = (*KEY, 'effort [°/s]', 'power [W]', 'cost of transport', 'time [s]')
    return table(head, (
        (*row[1:], f'{math.degrees(result.effort):.2f}', f'{result.power:.2f}', f'{result.cost:.3f}',
         f'{result.time:.0f}' if result.finished else f'not at the end after {result.time:.0f}')
        for row, result in results.items()))


def step_table(settlings: Mapping[Row, Settling]) -> str:
    """Return how the robot settles after the step."""
    head = ('condition', 'controller', 'settling length [m]', 'settling time [s]', 'overshoot [m]')
    return table(head, (
        (*row[2:], *(f'{value:.{digits}f}' if math.isfinite(value) else 'does not settle'
                     for value, digits in zip(one, (1, 0, 2), strict=True)))
        for row, one in settlings.items()))


def verdicts(page: str) -> dict[tuple[str, ...], bool]:
    """Return whether each bound on a page is met: by configuration, path, condition, controller, and column."""
    found: dict[tuple[str, ...], bool] = {}
    for name, title in TITLES.items():
        _, heading, part = page.partition(f'## {title}\n')
        head, *rows = read_table(part) if heading else [[]]
        columns = [column for column, title in enumerate(head) if title == 'met']
        for row in rows:
            for kind, column in zip(('error', 'height error'), columns, strict=True):
                found[(name, *row[:len(KEY)], kind)] = row[column] == MET[True]
    return found


def broken(before: str, after: str) -> Sequence[str]:
    """Return the bounds that are met on the page before but not on the one after, each in a line."""
    now = verdicts(after)
    return [', '.join(key) for key, met in verdicts(before).items() if met and not now.get(key, True)]

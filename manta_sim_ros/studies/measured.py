"""Measured runs for identification, read from tables (CSV) and bags, without ROS."""

from __future__ import annotations

import contextlib
import csv
import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from manta_sim_ros.dynamics import REST, FinCommand, FloatArray, Parameters, Simulator, shown
from manta_sim_ros.nodes.settings import Settings
from manta_sim_ros.sensors import Imu
from manta_sim_ros.studies.bag import BagReader
from manta_sim_ros.studies.gaits import ORDER, Gaits
from manta_sim_ros.studies.recorded_swim import RODS, UNIT_TOLERANCE

CHANNELS: dict[str, tuple[str, ...]] = {
    'position': ('x', 'y', 'z'),
    'orientation': ('qx', 'qy', 'qz', 'qw'),
    'twist': ('u', 'v', 'w', 'p', 'q', 'r'),
    'imu_orientation': ('imu_qx', 'imu_qy', 'imu_qz', 'imu_qw'),
    'angular_velocity': ('imu_p', 'imu_q', 'imu_r'),
    'specific_force': ('imu_ax', 'imu_ay', 'imu_az'),
    'wrench': ('Fx', 'Fy', 'Fz', 'Mx', 'My', 'Mz'),
    'rod_angles': RODS,
    'rod_torques': tuple(f'{rod}_torque' for rod in RODS),
}
"""What may be measured, with the columns of a table: SI units, rad; frames as on the topics of the node."""

ORIENTATIONS = ('orientation', 'imu_orientation')
"""Channels of unit quaternions. Their errors are rotation vectors in the body frame, with three components [rad]."""

COMMANDS = (*ORDER.split(','), *(f'{rod}_bias_{side}' for rod in ('front', 'rear') for side in 'lr'))
"""The columns of a command, in the order of a `fin_command`; the biases may be absent."""

BAGS = ('.mcap', '.db3')
"""Suffixes of the files of a bag."""

LEVEL = 0.02
"""Largest angle of the rods at the beginning of a run, at which they count as level [rad]."""

NOT_KNOWN = np.zeros(36)
"""The covariance of a pose or a twist whose noise is not known."""

LONGEST_RUN = 3600.0
"""Longest time of a run [s]."""


class Series(NamedTuple):
    """The measured values of one channel: T values of k components."""

    time: FloatArray
    """(T,) [s] from the beginning of the run."""
    values: FloatArray
    """(T, k)."""
    deviations: FloatArray
    """(T, k) standard deviations of the noise; NaN where they are not known. (T, 3) for orientations."""


class Run(NamedTuple):
    """A measured run. It begins with level fins, before the first command."""

    name: str
    """Where it was read, for messages."""
    commands: tuple[tuple[float, Gaits], ...]
    """Times [s] and gaits of both fins from then on, in order."""
    channels: Mapping[str, Series]
    """The channels of CHANNELS that were measured."""
    imu: Imu = Imu()
    """Where the IMU was on the body, and its constant biases."""


def read_run(
    path: Path, settings: Settings, namespace: str | None = None, chosen: Sequence[str] = tuple(CHANNELS),
) -> Run:
    """Return the run in a table, or in a bag if the path is a directory or an MCAP or SQLite file.

    A table (CSV) has a line of names, `time` [s], those of CHANNELS that were measured, and those of COMMANDS. A column
    NAME_std has the standard deviation of the noise of NAME. A cell may be empty: nothing was measured, and the gait
    goes on.

    From a bag, `odom` is taken, or `pose` and `twist` where there is none, `imu/data`, `fin_wrench`, the rods of
    `joint_states`, and `fin_command`. Variances of 0 stand for noise that is not known. A command that the node refuses
    is left out.

    `settings` have the place of the IMU and the bounds of the commands; only the `chosen` ones of CHANNELS are taken.

    Raises
    ------
    ValueError
        The file is no such file, a value is wrong, or nothing was measured or commanded. Names the file, the line, the
        value and the bound.
    OSError
        The file cannot be read.

    """
    is_bag = path.is_dir() or path.suffix in BAGS
    commands, samples = _of_bag(path, namespace) if is_bag else _of_table(path)
    samples = {name: rows for name, rows in samples.items() if name in chosen}
    if not samples:
        raise ValueError(f'{path}: has no measurement of {", ".join(chosen)}')
    if not commands:
        raise ValueError(f'{path}: has no command of the fins')
    origin = min(rows[0][0] for rows in samples.values())
    began = min(origin, commands[0].time)  # that of a bag may be earlier than all that was measured
    origin = origin if math.isinf(began) else began
    lasts = max(rows[-1][0] for rows in samples.values()) - origin
    if lasts > LONGEST_RUN:
        raise ValueError(f'{path}: lasts {lasts:g} s, but a run must last at most {LONGEST_RUN:g} s')
    channels = {
        name: Series(np.array([row[0] for row in rows]) - origin, np.array([row[1] for row in rows], dtype=float),
                     np.array([row[2] for row in rows], dtype=float)) for name, rows in samples.items()}
    for name, series in channels.items():
        if not np.isfinite(series.values).all():
            raise ValueError(f'{path}: {name} has a value that is not finite')
        if name in ORIENTATIONS and (np.abs(np.linalg.norm(series.values, axis=1) - 1.0) > UNIT_TOLERANCE).any():
            raise ValueError(f'{path}: {name} has a quaternion whose norm is not 1 within {UNIT_TOLERANCE:g}')
        if (np.diff(series.time) <= 0.0).any():
            raise ValueError(f'{path}: the times of {name} do not increase')
    rods = channels.get('rod_angles')
    if rods is not None and rods.time[0] <= commands[0].time - origin and np.abs(rods.values[0]).max() > LEVEL:
        raise ValueError(f'{path}: begins with a rod at {np.abs(rods.values[0]).max():.3g} rad, but the fins must be '
                         f'level within {LEVEL:g} rad: record from before the first command on')
    gaits = _gaits(commands, settings.model, origin, leave_out=is_bag)
    return Run(str(path), gaits, channels, settings.imu)


class _Command(NamedTuple):
    time: float
    values: Sequence[float]
    source: str


_Rows = dict[str, list[tuple[float, Any, Any]]]
"""Time, values and standard deviations of the samples of each channel."""


def _gaits(
    commands: Sequence[_Command], parameters: Parameters, origin: float, *, leave_out: bool,
) -> tuple[tuple[float, Gaits], ...]:
    """Return the commands as gaits that differ from the one before.

    One that the node refuses is left out, or raises a ValueError that names its source.
    """
    simulator = Simulator(parameters.replace(rods={'command_time_constant': 0.0}))
    gaits: list[tuple[float, Gaits]] = []
    for command in commands:
        try:
            if len(command.values) not in (6, 10):
                raise ValueError(f'there are {len(command.values)} values, but must be 6 or 10')
            left, right = FinCommand(*command.values[::2]), FinCommand(*command.values[1::2])
            with warnings.catch_warnings():
                warnings.simplefilter('ignore')  # they come in the simulation
                simulator.command(left=left, right=right)
        except ValueError as error:
            if leave_out:
                continue
            raise ValueError(f'{command.source}: {error}') from error
        if (left, right) != (gaits[-1][1] if gaits else (REST, REST)):
            gaits.append((max(0.0, command.time - origin), (left, right)))
    return tuple(gaits)


def _of_table(path: Path) -> tuple[list[_Command], _Rows]:
    try:
        with path.open(newline='', encoding='utf-8-sig') as file:
            rows = csv.reader(file, strict=True)
            names = [cell.strip() for cell in next(rows, [])]
            if len(names) == 1 and (other := {';', '\t'} & set(names[0])):
                raise ValueError(f'{path}: is separated by {other.pop()!r}, but must be by commas')
            lines = [(rows.line_num, row) for row in rows if row]
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f'{path}: is no table of comma-separated values: {error}') from error
    commanded = COMMANDS if COMMANDS[-1] in names else COMMANDS[:6]
    measured = {channel: columns for channel, columns in CHANNELS.items() if set(columns) & set(names)}
    known = {'time', *commanded, *(column for columns in measured.values() for column in columns)}
    for name in names:
        if names.count(name) > 1 or name.removesuffix('_std') not in known:
            raise ValueError(f'{path}, line 1: {shown(name)} is no name of a column, or is there twice')
    for name in ('time', *commanded, *known):
        if name not in names:
            raise ValueError(f'{path}, line 1: there is no column {name}')
    commands: list[_Command] = []
    samples: _Rows = {}
    time = -math.inf
    for number, row in lines:
        source = f'{path}, line {number}'
        if len(row) != len(names):
            raise ValueError(f'{source}: there are {len(row)} values, but must be {len(names)}, one for each column')
        cells = {name: _number(source, name, cell) for name, cell in zip(names, row, strict=True) if cell.strip()}
        if not time < (now := cells.get('time', math.nan)) < math.inf:
            raise ValueError(f'{source}: time is {now:g} s, but must be finite and more than {time:g} s')
        time = now
        if gait := _together(source, cells, commanded):
            commands.append(_Command(time, gait, source))
        for channel, columns in measured.items():
            if values := _together(source, cells, columns):
                deviations = [cells.get(f'{column}_std', math.nan) for column in columns]
                if any(deviation <= 0.0 for deviation in deviations):
                    raise ValueError(f'{source}: a standard deviation of {channel} is not more than 0')
                samples.setdefault(channel, []).append(
                    (time, values, deviations[:3] if channel in ORIENTATIONS else deviations))
    return commands, samples


def _number(source: str, name: str, cell: str) -> float:
    try:
        number = float(cell)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f'{source}: {name} is {shown(cell)}, but must be a finite number')
    return number


def _together(source: str, cells: Mapping[str, float], columns: Sequence[str]) -> list[float] | None:
    """Return the values of columns, None if all cells are empty; some of them only is an error."""
    missing = [column for column in columns if column not in cells]
    if 0 < len(missing) < len(columns):
        raise ValueError(f'{source}: {missing[0]} is empty, but must be there with {columns[0]}')
    return None if missing else [cells[column] for column in columns]


def _of_bag(path: Path, namespace: str | None) -> tuple[list[_Command], _Rows]:
    commands: list[_Command] = []
    samples: dict[str, dict[float, tuple[float, Any, Any]]] = {}
    now = -math.inf
    with BagReader(path, namespace) as bag:
        poses = ('odom',) if 'odom' in bag.names else ('pose', 'twist')
        if 'rod_command' in bag.names:
            raise ValueError(f'{path}: has commands on rod_command, but only those on fin_command can be simulated')
        for logged in bag.messages((*poses, 'imu/data', 'fin_wrench', 'joint_states', 'fin_command', '/clock')):
            if logged.name == 'fin_command':
                with contextlib.suppress(ValueError):  # rosbags does not read an empty one, which the node refuses
                    commands.append(_Command(now, bag.decode(logged).data.tolist(), str(path)))
                continue
            message = bag.decode(logged)
            stamp = message.clock if logged.name == '/clock' else message.header.stamp
            now = stamp.sec + stamp.nanosec * 1e-9
            for channel, values, deviations in _measured(logged.name, message):
                samples.setdefault(channel, {})[now] = (now, values, deviations)  # a repeated state counts once
    return commands, {channel: [by_time[time] for time in sorted(by_time)] for channel, by_time in samples.items()}


def _measured(topic: str, message: Any) -> Iterator[tuple[str, Any, Any]]:
    """Yield the channels of a message with their values and standard deviations."""
    if topic in ('odom', 'pose'):
        pose, known = (message.pose.pose, message.pose.covariance) if topic == 'odom' else (message.pose, NOT_KNOWN)
        yield 'position', _vector(pose.position), _deviations(known[:15:7])
        yield 'orientation', _quaternion(pose.orientation), _deviations(known[21::7])
    if topic in ('odom', 'twist'):
        twist, known = (message.twist.twist, message.twist.covariance) if topic == 'odom' else (
            message.twist, NOT_KNOWN)
        yield 'twist', [*_vector(twist.linear), *_vector(twist.angular)], _deviations(known[::7])
    if topic == 'imu/data':
        for channel, values, known in (
                ('imu_orientation', _quaternion(message.orientation), message.orientation_covariance),
                ('angular_velocity', _vector(message.angular_velocity), message.angular_velocity_covariance),
                ('specific_force', _vector(message.linear_acceleration), message.linear_acceleration_covariance)):
            if known[0] >= 0.0:  # -1 says that it is not measured
                yield channel, values, _deviations(known[::4])
    if topic == 'fin_wrench':
        yield 'wrench', [*_vector(message.wrench.force), *_vector(message.wrench.torque)], [math.nan] * 6
    if topic == 'joint_states':
        rods = [list(message.name).index(rod) for rod in RODS if rod in message.name]
        for channel, values in (('rod_angles', message.position), ('rod_torques', message.effort)):
            if len(rods) == len(RODS) and len(values) == len(message.name):
                yield channel, values[rods], [math.nan] * len(RODS)


def _quaternion(part: Any) -> list[float]:
    return [*_vector(part), part.w]


def _vector(part: Any) -> list[float]:
    return [part.x, part.y, part.z]


def _deviations(variances: Any) -> FloatArray:
    """Return standard deviations, NaN where the variance is 0, which stands for one that is not known."""
    values = np.asarray(variances, dtype=float)
    return np.sqrt(np.where(values > 0.0, values, np.nan))

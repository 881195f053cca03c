"""Commands at given times: from a table (CSV), from a bag, or one gait from the beginning."""

from __future__ import annotations

import csv
import math
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from manta_sim_ros.dynamics import Parameters, Simulator, shown
from manta_sim_ros.nodes.messages import COMMAND_VALUES, NANOSECONDS, fin_commands, seconds
from manta_sim_ros.studies.bag import BagReader
from manta_sim_ros.studies.gaits import gaits_from

COLUMNS = ('A_l', 'A_r', 'f_l', 'f_r', 'phi_l', 'phi_r', 'front_bias_l', 'front_bias_r', 'rear_bias_l', 'rear_bias_r')
"""The columns of a table beside `time`, in the order of a `fin_command` [rad, Hz, rad, rad, rad]; biases may be absent.
"""

OTHER_NAMES = dict(zip(COMMAND_VALUES.split(', '), COLUMNS, strict=False))
"""The names of the first six in the errors of the node, which are taken as well."""

MESSAGES = {'fin_command': Float64MultiArray, 'rod_command': JointState}
"""The class of the messages on each topic of commands."""

BAGS = ('.mcap', '.db3')
"""Suffixes of the files of a bag."""


class Command(NamedTuple):
    """A message on one of the two topics of commands, at a time."""

    time: float
    """Simulated time [s] from which it acts."""
    topic: str
    """`fin_command` or `rod_command`."""
    message: Float64MultiArray | JointState
    source: str
    """Where it was read, for messages."""


def constant_gait(degrees: Sequence[float], model: Parameters) -> list[Command]:
    """Return the command of one gait from the beginning on.

    `degrees` are the six or ten values of a `fin_command` with angles in degrees, frequencies in Hz.

    Raises
    ------
    ValueError
        The gait is impossible; names value and bound.

    """
    values = np.stack([gait.as_array() for gait in gaits_from(degrees)], axis=-1).ravel()[:len(degrees)].tolist()
    _check(values, _checking(model))
    return [Command(0.0, 'fin_command', Float64MultiArray(data=values), 'the gait')]


def read_commands(path: Path, model: Parameters, namespace: str | None = None) -> list[Command]:
    """Return the commands of a table, or those of a bag if the path is a directory or an MCAP or SQLite file.

    Raises
    ------
    ValueError, OSError
        As those of `read_table` and `read_bag`.

    """
    return read_bag(path, namespace) if path.is_dir() or path.suffix in BAGS else read_table(path, model)


def read_table(path: Path, model: Parameters) -> list[Command]:
    """Return the commands of a table (CSV): its first line names the columns, `time` [s] and six or ten of `COLUMNS`.

    Raises
    ------
    ValueError
        A column is missing or unknown, a value is no number, times decrease, or a gait is impossible. Names the file,
        the line, the value and the bound.
    OSError
        The file cannot be read.

    """
    try:
        with path.open(newline='', encoding='utf-8-sig') as file:
            rows = csv.reader(file, strict=True)
            names = [OTHER_NAMES.get(cell.strip(), cell.strip()) for cell in next(rows, [])]
            lines = [(rows.line_num, row) for row in rows if row]
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f'{path}: is no table of comma-separated values: {error}') from error
    wanted = COLUMNS if len(names) > 7 else COLUMNS[:6]
    if sorted(names) != sorted(('time', *wanted)):
        raise ValueError(
            f'{path}, line 1: the columns are {shown(",".join(names))}, but must be '
            f'time,{",".join(wanted)} in any order')
    checking = _checking(model)
    commands: list[Command] = []
    for number, row in lines:
        source, earliest = f'{path}, line {number}', commands[-1].time if commands else 0.0
        try:
            cells = _numbers(names, row)
            if not earliest <= cells['time'] < math.inf:
                raise ValueError(f'time is {cells["time"]:g} s, but must be finite and at least {earliest:g} s')
            values = [cells[name] for name in wanted]
            _check(values, checking)
        except ValueError as error:
            raise ValueError(f'{source}: {error}') from error
        commands.append(Command(cells['time'], 'fin_command', Float64MultiArray(data=values), source))
    if not commands:
        raise ValueError(f'{path}: has no line of values below the names of the columns')
    return commands


def _numbers(names: Sequence[str], row: Sequence[str]) -> dict[str, float]:
    """Return the numbers of a line by the names of their columns."""
    if len(row) != len(names):
        raise ValueError(f'there are {len(row)} values, but must be {len(names)}, one for each column')
    numbers = {}
    for name, cell in zip(names, row, strict=True):
        try:
            numbers[name] = float(cell)
        except ValueError:
            raise ValueError(f'{name} is {shown(cell)}, but must be a number') from None
    return numbers


def _checking(model: Parameters) -> Simulator:
    """Return a robot that takes each gait at once, whatever came before."""
    return Simulator(model.replace(rods={'command_time_constant': 0.0}))


def _check(values: Sequence[float], checking: Simulator) -> None:
    """Refuse a gait that is impossible whatever came before."""
    left, right = fin_commands(values)
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # they come when the command acts
        checking.command(left=left, right=right)


def read_bag(path: str | Path, namespace: str | None = None) -> list[Command]:
    """Return the commands of a bag, at the simulated times at which they were logged.

    A time is that of the last `/clock` before the command; without that topic, times count from the first command.

    Raises
    ------
    ValueError
        It is no bag, or has no command. Begins with the path.

    """
    commands: list[Command] = []
    with BagReader(path, namespace) as bag:
        clocked, now, began = '/clock' in bag.names, 0.0, None
        for logged in bag.messages((*MESSAGES, '/clock')):
            if logged.name == '/clock':
                now = seconds(deserialize_message(logged.data, Clock).clock)
                continue
            if not clocked:
                began = logged.time if began is None else began
                now = (logged.time - began) / NANOSECONDS
            message = deserialize_message(logged.data, MESSAGES[logged.name])
            commands.append(Command(now, logged.name, message, f'{path}, command {len(commands) + 1}'))
    if not commands:
        raise ValueError(f'{path}: has no message on {" or ".join(MESSAGES)}')
    return commands

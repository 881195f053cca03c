"""The command `simulate`: a swim without middleware, faster than real time, recorded as the node would publish it."""

from __future__ import annotations

import argparse
import itertools
import signal
import sys
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.serialization import serialize_message
from tqdm import tqdm

from manta_sim_ros.dynamics import Parameters, State, compile_kernels
from manta_sim_ros.figures.jobs import say
from manta_sim_ros.nodes import messages
from manta_sim_ros.nodes.interface import TOPICS
from manta_sim_ros.nodes.qos import QUEUE_DEPTH, VOLATILE, message_class
from manta_sim_ros.nodes.robot import Robot
from manta_sim_ros.nodes.settings import Settings, whole_steps
from manta_sim_ros.nodes.state_messages import TRANSFORMS, StateMessages, optional_topics
from manta_sim_ros.signals import ENDING, on_ending
from manta_sim_ros.studies.arguments import LONGEST_DURATION, Parser, read_settings
from manta_sim_ros.studies.bag import BagWriter, check_new
from manta_sim_ros.studies.commands import Command, constant_gait, read_commands
from manta_sim_ros.studies.gaits import ORDER, values_of

RESOLUTION = 1e-9
"""Resolution of the times of commands [s], which is that of stamps."""

BAR = '{percentage:3.0f}%|{bar}| {n:.1f} of {total:g} s, {rate_noinv:.1f} times real time, {remaining} left'


class SimulationWarning(UserWarning):
    """What the node would log: a refused command, a motion that diverged, a timeout."""


def simulate(
    settings: Settings, commands: Iterable[Command], duration: float, path: str | Path, *, markers: bool = False,
    progress: Callable[[float], object] = lambda time: None,
) -> State:
    """Simulate a swim from rest, and record it in a new bag as a node that is advanced in lockstep would publish it.

    The messages, their order on each topic, their stamps and the QoS are those of the node; only bytes that align
    others have any value. All are logged at their simulated time. A command acts from the first output on that is not
    before its time, and is logged there; one that the node would refuse is refused with a warning, and is not logged.
    `/diagnostics` is left out: it says how the node keeps up with the clock on the wall.

    Parameters
    ----------
    settings
        The parameters of model, sensors and node. Those of pace have no effect.
    commands
        In the order of their times; those from `duration` on have no effect.
    duration
        Simulated time [s], a whole number of time steps.
    path
        The directory of the bag, which must not exist.
    markers
        Whether `fin_markers` are recorded, as for a node with a subscriber to them.
    progress
        Is called with the simulated time [s] after each output. When it raises an exception, the bag is completed
        before the exception goes on.

    Returns
    -------
    State
        The last state.

    Raises
    ------
    ValueError
        A value is invalid, or the directory exists. Nothing is written then.
    OSError
        The bag cannot be written.

    """
    path = Path(path)
    _check_duration(duration, settings.model)
    check_new(path)
    robot = Robot(settings, _warn, _warn)
    due = deque(command for command in commands if command.time < duration)
    transform_class = _transform_class()
    outputs = StateMessages(lambda: settings, lambda: robot.mean_current, lambda: markers, transform_class)
    left_out = {topic for topic, is_there in [*optional_topics(settings).items(), ('fin_markers', markers)]
                if not is_there or topic in TRANSFORMS and transform_class is None}
    recorded = [topic for topic, about in TOPICS.items() if about.direction == 'out' and topic not in left_out]
    with BagWriter(path, settings) as bag:
        def write(topic: str, stamp: Time, message: Any) -> None:
            data = message if isinstance(message, bytes) else serialize_message(message)
            bag.write(topic, stamp.sec * messages.NANOSECONDS + stamp.nanosec, data)

        for topic in [*recorded, *{command.topic: None for command in due}]:
            bag.add_topic(topic, QUEUE_DEPTH, keeps_last=topic not in VOLATILE)
        for state in itertools.chain([robot.state], robot.ticks(duration)):
            stamp = messages.time_message(state.time)
            for topic, message in outputs.of(state, stamp):
                if topic in recorded:
                    write(topic, stamp, message)
            while due and due[0].time <= state.time + RESOLUTION:
                command = due.popleft()
                if _take(command, robot):
                    write(command.topic, stamp, command.message)
            progress(state.time)
    return robot.state


def _check_duration(duration: float, model: Parameters) -> None:
    if not 0.0 < duration <= LONGEST_DURATION:
        raise ValueError(
            f'duration is {duration:g} s, but must be finite and more than 0, and at most {LONGEST_DURATION:g} s')
    whole_steps(duration, model.solver.time_step, 'duration')


def _take(command: Command, robot: Robot) -> bool:
    """Command the robot as the node does, and return whether it was not refused."""
    try:
        if command.topic == 'fin_command':
            robot.command(*messages.commands_of(command.message))
        else:
            robot.command_rods(messages.rod_command(command.message, robot.rod_targets))
    except ValueError as error:
        _warn(f'{command.source}: {command.topic} refused at {robot.state.time:.9g} s, the last one continues: {error}')
        return False
    return True


def _warn(line: str) -> None:
    warnings.warn(line, SimulationWarning, stacklevel=3)


def _transform_class() -> type[Any] | None:
    """Return the class of the transform, which the node publishes where tf2_msgs is installed."""
    try:
        return message_class(TOPICS['/tf'].type)
    except ModuleNotFoundError:
        return None


def main(args: Sequence[str] | None = None) -> None:
    """Run the command; the exit status is 0, 1 after a failure, 2 for wrong input, or 128 and the number of a signal.

    A signal ends the simulation after the present output; the bag is complete up to there.
    """
    parser = _parser()
    options = parser.parse_args(args)
    with warnings.catch_warnings():
        warnings.simplefilter('always', SimulationWarning)
        warnings.showwarning = lambda message, *_, **__: tqdm.write(f'{parser.prog}: {message}', sys.stderr)
        _run(parser, options)


def _run(parser: Parser, options: argparse.Namespace) -> None:
    try:
        settings = Settings() if options.config is None else read_settings(options.config)
        if options.fin_joints:
            settings = settings.replace([('publish_fin_joints', True)])
        _check_duration(options.duration, settings.model)
        check_new(options.output)
        if options.gait is None:
            commands = read_commands(options.commands, settings.model, options.namespace)
        else:
            commands = constant_gait(values_of(options.gait), settings.model)
    except (OSError, ValueError) as error:
        parser.error(str(error))
    late = sum(command.time >= options.duration for command in commands)
    if late:
        _warn(f'{late} of {len(commands)} commands are not before the end at {options.duration:g} s: they do not act')
    compile_kernels(settings.model, lambda line: say(line, sys.stderr))
    try:
        _simulate(options, settings, commands)
    except OSError as error:
        sys.exit(f'{parser.prog}: {error}')


def _simulate(options: argparse.Namespace, settings: Settings, commands: Iterable[Command]) -> None:
    """Simulate with a progress bar; a signal ends the process when the bag is complete."""
    received: list[int] = []
    for ending in ENDING:
        signal.signal(ending, lambda number, frame: received.append(number))
    on_ending(None)
    began = time.monotonic()
    with tqdm(total=options.duration, disable=None, bar_format=BAR) as bar:
        def progress(now: float) -> None:
            bar.update(now - bar.n)
            if received:
                name = signal.Signals(received[0]).name
                _warn(f'{name} ended this at {now:.9g} s; {options.output} is complete up to there')
                sys.exit(128 + received[0])

        simulate(settings, commands, options.duration, options.output, markers=options.markers, progress=progress)
    elapsed = time.monotonic() - began
    say(f'{options.output}: {options.duration:g} s of simulated time in {elapsed:.1f} s, '
        f'{options.duration / elapsed:.0f} times real time')


def _parser() -> Parser:
    parser = Parser(
        prog='simulate', description='Simulate a swim from rest without middleware, as fast as the machine can, and '
                                     'record what sim_node would publish in a bag of rosbag2 (MCAP).')
    parser.add_argument('--config', type=Path, metavar='FILE',
                        help='a ROS 2 parameter file with parameters of /manta_sim (default: the built-in values)')
    commands = parser.add_mutually_exclusive_group(required=True)
    commands.add_argument('--gait', metavar=ORDER,
                          help='one gait from the beginning on, in degrees and Hz; ten values have the biases, too')
    commands.add_argument('--commands', type=Path, metavar='FILE',
                          help='a table (CSV) with the columns time [s] and the names of the six or ten values of '
                               'fin_command [rad, Hz], or a bag with fin_command or rod_command')
    parser.add_argument('--namespace', metavar='NAMESPACE',
                        help='the robot whose commands are taken, where a bag has several')
    parser.add_argument('--duration', type=float, required=True, metavar='T', help='simulated time [s]')
    parser.add_argument('--output', type=Path, required=True, metavar='DIRECTORY', help='the new bag')
    parser.add_argument('--fin-joints', action='store_true',
                        help='record the joints of the fins in joint_states (publish_fin_joints), which report draws')
    parser.add_argument('--markers', action='store_true',
                        help='record fin_markers, for RViz and Foxglove: one takes longer to make than all other '
                             'messages of an output')
    return parser

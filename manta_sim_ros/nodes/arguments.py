"""The command line of a node: words that are not for ROS 2 are refused, and those without effect are warned of."""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import PurePath

from rclpy.node import Node
from rclpy.utilities import remove_ros_args

from manta_sim_ros.dynamics import cut, read_sections, shown, shown_name, shown_names

USAGE = '%(prog)s [--ros-args [-p NAME:=VALUE] [--params-file FILE] [-r __ns:=NAMESPACE] [-r FROM:=TO] ...]'


def check_arguments(make: Callable[[], Node], arguments: Sequence[str]) -> None:
    """End the process if there are words beside the ROS 2 arguments, with one line and status 2; `--help` prints help.

    `make` is the class of the node: the description is the first paragraph of its module's docstring.
    """
    description = (sys.modules[make.__module__].__doc__ or '').partition('\n\n')[0]
    parser = argparse.ArgumentParser(
        prog=PurePath(arguments[0]).name if arguments else None, usage=USAGE, description=description,
        allow_abbrev=False, epilog='All after --ros-args is for ROS 2. "ros2 param list" and "ros2 param describe" '
                                   'show the parameters of the running node.')
    _, others = parser.parse_known_args(remove_ros_args(arguments)[1:])
    if others:
        parser.exit(2, f'{parser.prog}: {shown(" ".join(others))} is not taken: ROS 2 arguments come after --ros-args, '
                       'such as --ros-args -p NAME:=VALUE\n')


def warn_of_parameters_for_others(node: Node, arguments: Sequence[str]) -> None:
    """Log a warning for each parameter file, and for each parameter with the name of a node, that is not for `node`."""
    name, warn = node.get_fully_qualified_name(), node.get_logger().warning
    for option, value in _ros_options(arguments):
        if option == '--params-file':
            try:
                sections = read_sections(value)
            except (OSError, ValueError) as error:  # ROS 2 has read it, but perhaps otherwise than it looks
                warn(f'parameter file {cut(str(error))}')
                continue
            if not any(section.applies_to(name) for section in sections):
                warn(f'the parameter file {shown_name(value)} has no effect on this node, {name}: it is for '
                     f'{shown_names(section.node for section in sections) or "no node"}')
        elif option in ('-p', '--param'):
            other, colon, _ = value.partition(':=')[0].rpartition(':')
            if colon and f'/{other}' != name:
                warn(f'{option} {shown_name(value)} has no effect on this node, {name}: it is for /{shown_name(other)}')


def _ros_options(arguments: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield each ROS 2 argument with the word after it."""
    for_ros = False
    for word, after in itertools.pairwise([*arguments, '']):
        for_ros = word == '--ros-args' or for_ros and word != '--'
        if for_ros:
            yield word, after

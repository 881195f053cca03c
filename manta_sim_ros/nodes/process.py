"""Start and end of the executables: one line for an error, exit status 0 for Ctrl-C and SIGTERM."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from types import FrameType
from typing import TypeVar

import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from manta_sim_ros.dynamics import cut
from manta_sim_ros.nodes.arguments import check_arguments, warn_of_parameters_for_others

Started = TypeVar('Started')
NodeType = TypeVar('NodeType', bound=Node)

LONGEST_LINE = 600
"""Largest number of characters of an error: those of rclpy have the values that they refuse."""


def run_node(
    make: Callable[[], NodeType],
    start: Callable[[NodeType], None],
    spin: Callable[[NodeType], None],
    args: list[str] | None,
) -> None:
    """Make a node, start it, and spin it until it is interrupted or the context is shut down.

    If ROS 2 arguments or a parameter are invalid, the process ends with status 1 and one line on standard error, and
    with status 2 if there are other arguments. What has no effect is warned of.
    """
    spinning = interrupted = False

    def interrupt(signum: int, frame: FrameType | None) -> None:
        nonlocal interrupted
        if not spinning:  # perhaps in the middle of a compilation, which catches exceptions
            os._exit(0)
        interrupted = True
        raise KeyboardInterrupt  # rclpy may turn it into another exception

    def report(unraisable: sys.UnraisableHookArgs) -> None:
        # a signal in a destructor: its exception ends nothing, but rclpy has shut the context down
        if not (interrupted and issubclass(unraisable.exc_type, KeyboardInterrupt)):
            sys.__unraisablehook__(unraisable)

    for ending in (signal.SIGINT, signal.SIGTERM):  # rclpy's own handlers shut its context down and call these
        signal.signal(ending, interrupt)
    sys.unraisablehook = report
    try:
        _or_exit(lambda: rclpy.init(args=args))
        arguments = sys.argv if args is None else args
        check_arguments(make, arguments)
        node = _or_exit(make)
        warn_of_parameters_for_others(node, arguments)
        start(node)
        spinning = True
        spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except Exception:
        if not interrupted:  # else it is a consequence of the interruption
            raise
    finally:
        spinning = False  # a second signal must not interrupt the end
        rclpy.try_shutdown()
        for ending in (signal.SIGINT, signal.SIGTERM):
            signal.signal(ending, signal.SIG_IGN)


def _or_exit(begin: Callable[[], Started]) -> Started:
    try:
        return begin()
    except (ValueError, RuntimeError, ParameterException) as error:  # errors of rcl are RuntimeErrors
        cure = '; set ROS_LOG_DIR to a folder that can be written to' if 'initialize logging' in str(error) else ''
        sys.exit(f'{sys.argv[0].rpartition("/")[2]}: {cut(" ".join(str(error).split()), LONGEST_LINE)}{cure}')

"""How the executables start and end: one clear line for what cannot work, exit status 0 for Ctrl-C and SIGTERM."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from typing import TypeVar

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

Started = TypeVar('Started')
NodeType = TypeVar('NodeType', bound=Node)


def run_node(make: Callable[[], NodeType], start: Callable[[NodeType], None], args: list[str] | None) -> None:
    """Make a node, start it, and spin it until it is interrupted or the context is shut down.

    Ends the process with status 1 and one line on standard error when ROS 2 arguments or a parameter are bad.
    """
    # SIGTERM ends whatever Python is doing at the moment, a first compilation included, as Ctrl-C does
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        with _or_exit(lambda: rclpy.init(args=args)):
            node = _or_exit(make)
            start(node)
            rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


def _or_exit(begin: Callable[[], Started]) -> Started:
    try:
        return begin()
    except (ValueError, RuntimeError) as error:  # errors of rcl are RuntimeErrors
        sys.exit(f'{sys.argv[0].rpartition("/")[2]}: {" ".join(str(error).split())}')

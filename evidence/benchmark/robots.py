"""Several robots in one process, each in a thread and a namespace of its own."""

from __future__ import annotations

import contextlib
import sys
import threading

import rclpy
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException

from manta_sim_ros.nodes.sim_node import SimNode


def arguments(name: str) -> list[str]:
    """Return the ROS 2 arguments of a robot with this namespace: it swims by itself, and has a clock of its own."""
    return ['--ros-args', '-r', f'__ns:=/{name}', '-r', f'/clock:=/{name}/clock']


def main(names: list[str]) -> None:
    """Simulate these robots until the process is ended."""
    threads = [threading.Thread(target=_simulate, args=(name,)) for name in names]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def _simulate(name: str) -> None:
    context = Context()
    rclpy.init(args=arguments(name), context=context)
    node = SimNode(context)
    node.start()
    with contextlib.suppress(ExternalShutdownException):
        node.spin()


if __name__ == '__main__':
    main(sys.argv[1:])

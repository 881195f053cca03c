"""Several robots in one process, each in a thread and a namespace of its own."""

from __future__ import annotations

import contextlib
import signal
import sys
import threading

import rclpy
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException

from manta_sim_ros.nodes.sim_node import SimNode

ENDING = [signal.SIGINT, signal.SIGTERM]


def arguments(name: str) -> list[str]:
    """Return the ROS 2 arguments of a robot with this namespace: it swims by itself, and has a clock of its own."""
    return ['--ros-args', '-r', f'__ns:=/{name}', '-r', f'/clock:=/{name}/clock']


def main(names: list[str]) -> None:
    """Simulate these robots until a signal ends the process."""
    signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)  # of all threads: it is waited for below
    contexts = [Context() for _ in names]
    threads = [threading.Thread(target=_simulate, args=pair) for pair in zip(names, contexts, strict=True)]
    for thread in threads:
        thread.start()
    signal.sigwait(ENDING)
    for context in contexts:
        context.try_shutdown()
    for thread in threads:
        thread.join()


def _simulate(name: str, context: Context) -> None:
    rclpy.init(args=arguments(name), context=context)
    node = SimNode(context)
    with contextlib.suppress(ExternalShutdownException):
        node.start()
        node.spin()
    node.destroy_node()


if __name__ == '__main__':
    main(sys.argv[1:])

"""Start and end of the nodes: one line for an error, exit status 0 for Ctrl-C, SIGTERM and SIGHUP."""

from __future__ import annotations

import contextlib
import gc
import math
import os
import sys
import threading
import time
from collections.abc import Callable
from typing import TypeVar

import rclpy
from rclpy.context import Context
from rclpy.exceptions import ParameterException
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from manta_sim_ros.dynamics import cut
from manta_sim_ros.nodes.arguments import check_arguments, warn_of_parameters_for_others
from manta_sim_ros.signals import ignore_endings, on_ending

GRACE = 1.0
"""Time in which the main thread ends by itself after a signal, if it does not compute [s].

After it, the node is destroyed in the thread of the signals. That leaves shared memory if the main thread still spins,
as an executor holds the entities for which it waits.
"""

END_LIMIT = 2.0
"""Longest time from a signal to the end of the process, whatever hangs [s]."""

Started = TypeVar('Started')
NodeType = TypeVar('NodeType', bound=Node)

LONGEST_LINE = 600
"""Largest number of characters of an error: those of rclpy have the values that they refuse."""


def run_node(
    make: Callable[[], NodeType],
    start: Callable[[NodeType], None],
    spin: Callable[[NodeType, Future[None]], object],
    args: list[str] | None,
    finish: Callable[[NodeType], object] = lambda node: None,
) -> None:
    """Make a node, start it, and spin it until the context is shut down. A signal ends the process with status 0.

    `spin` is called with the node and a future, and returns when that is done: after a signal.

    Whatever ends it, `finish` is called once while the node can still publish: after a signal in another thread, at the
    same time as what the node does.

    If ROS 2 arguments or a parameter are invalid, the process ends with status 1 and one line on standard error, and
    with status 2 if there are other arguments. What has no effect is warned of.
    """
    node: NodeType | None = None
    finishing: NodeType | None = None
    lock, finish_lock, left = threading.Lock(), threading.Lock(), threading.Event()
    ending: Future[None] = Future()  # done as soon as a signal has come

    def finish_once() -> None:
        nonlocal finishing
        with finish_lock:
            present, finishing = finishing, None
            if present is not None and rclpy.ok():
                finish(present)

    def destroy() -> None:
        nonlocal node
        with lock:
            present, node = node, None
            if present is not None:
                present.destroy_node()  # else it leaves shared memory
            rclpy.try_shutdown()

    def end() -> None:  # in the thread of the signals, as the main thread may be compiling or computing
        limit = threading.Timer(END_LIMIT, os._exit, [0])
        limit.daemon = True
        limit.start()
        ending.set_result(None)
        with contextlib.suppress(Exception):
            finish_once()
        with contextlib.suppress(Exception):
            with lock:
                if node is None:
                    rclpy.try_shutdown()  # ends the making of it
            left.wait(GRACE)
            destroy()
        os._exit(0)

    on_ending(end)
    try:
        _or_exit(lambda: rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO))
        arguments = sys.argv if args is None else args
        check_arguments(make, arguments)
        made = node = finishing = _or_exit(make)
        warn_of_parameters_for_others(made, arguments)
        if not ending.done():
            start(made)
            gc.freeze()  # the garbage collector need not look again at what was imported and made
        if not ending.done():
            spin(made, ending)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except (Exception, SystemExit):
        if not ending.done():  # else it is a consequence of the shutdown
            raise
    finally:
        if ending.done() and node is None:
            gc.collect()  # ends a node that was made in part: else it leaves shared memory
        try:
            finish_once()
        finally:
            left.set()
            destroy()
        if ending.done():
            os._exit(0)  # the end of the interpreter takes a second
        ignore_endings()


def executor(context: Context) -> Executor:
    """Return the executor with the least load: it is told what is ready, and does not ask each entity."""
    try:
        from rclpy.experimental.events_executor import EventsExecutor
    except ImportError:  # of the first releases of Jazzy
        return SingleThreadedExecutor(context=context)
    return EventsExecutor(context=context)


def run_waiting(callbacks: Executor, until: float = math.inf) -> bool:
    """Run the callbacks of what was received until now, and not of what comes meanwhile; return whether that is all.

    It goes on until a steady time [s]. An executor that is told what is ready runs it in the order in which it came, so
    that a service that is called behind thousands of messages has its turn after all of them. The single-threaded one
    runs one callback.
    """
    if isinstance(callbacks, SingleThreadedExecutor):
        callbacks.spin_once(timeout_sec=0.0)
        return True
    last = callbacks.create_task(lambda: None)
    while not last.done() and rclpy.ok(context=callbacks.context):
        if time.monotonic() > until:
            return False
        callbacks.spin_once(timeout_sec=0.0)
    return True


def _or_exit(begin: Callable[[], Started]) -> Started:
    try:
        return begin()
    except (ValueError, RuntimeError, ParameterException) as error:  # errors of rcl are RuntimeErrors
        cure = '; set ROS_LOG_DIR to a folder that can be written to' if 'initialize logging' in str(error) else ''
        sys.exit(f'{sys.argv[0].rpartition("/")[2]}: {cut(" ".join(str(error).split()), LONGEST_LINE)}{cure}')

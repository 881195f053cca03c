"""Time from the start of the built `sim_node` to its first message, and processor time beside the least node."""

from __future__ import annotations

import contextlib
import functools
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64MultiArray
from visualization_msgs.msg import MarkerArray

from evidence.benchmark import robots
from evidence.benchmark.bare_node import EXECUTORS
from evidence.benchmark.bare_node import TOPIC as BARE_TOPIC
from evidence.harness.processes import command_of

STARTED_WITHIN = 300.0  # s, a first start on a slow machine
SETTLED = 2.0  # s after the first message, before processor time is counted
ROUNDS = 5  # of the measurement of processor time
BARE_NODE = 'evidence.benchmark.bare_node'
PROCESS_CLOCK = 2  # in the number of a clock of Linux: all threads of a process, nanoseconds
ROBOTS = 10
FAST_RATE = 1000.0  # Hz
SWIM = [0.7, 0.7, 0.6, 0.6, 0.7, 0.7]


def node_figures(starts: int, seconds: float) -> dict[str, float]:
    """Measure the first start, `starts` later starts, and the processor time over `seconds` of swimming at 100 Hz.

    A start lasts from the creation of the process to its first `pose`; the first one finds no compiled kernels. The
    processor shares are those of one core, and those of bare nodes at the same time: while nobody listens, with a
    subscriber of each odometry, and with one of the markers.
    """
    rclpy.init()
    with tempfile.TemporaryDirectory() as kernels:
        watch = rclpy.create_node('node_timing')
        seen: list[PoseStamped] = []
        first = watch.create_subscription(PoseStamped, 'pose', seen.append, 10)
        commands = watch.create_publisher(Float64MultiArray, 'fin_command', 10)

        def start() -> float:
            seen.clear()
            began = time.monotonic()
            while not seen:
                rclpy.spin_once(watch, timeout_sec=0.05)
                if time.monotonic() - began > STARTED_WITHIN:
                    raise TimeoutError(f'no pose within {STARTED_WITHIN:g} s')
            return time.monotonic() - began

        taken = []
        for _ in range(1 + starts):
            with _running(kernels) as process:
                taken.append(start())
                if len(taken) == 1 + starts:
                    commands.publish(Float64MultiArray(data=SWIM))
                    watch.destroy_subscription(first)
                    with contextlib.ExitStack() as bare:
                        pids = {'ours': process.pid} | {
                            name: bare.enter_context(_process([sys.executable, '-m', BARE_NODE, name])).pid
                            for name in EXECUTORS}
                        time.sleep(SETTLED)
                        shares = _processor_shares(pids, lambda: time.sleep(seconds / ROUNDS))
                        heard: list[Odometry] = []
                        listeners = [watch.create_subscription(Odometry, topic, heard.append, 10)
                                     for topic in ('odom', BARE_TOPIC)]
                        _spin(watch, SETTLED)
                        if len({message.child_frame_id for message in heard}) < len(listeners):
                            raise TimeoutError(f'no odometry of both nodes within {SETTLED:g} s')
                        with_listeners = _processor_shares(pids, lambda: time.sleep(seconds / ROUNDS))
                        for listener in listeners:
                            watch.destroy_subscription(listener)
                        markers: list[MarkerArray] = []
                        watch.create_subscription(MarkerArray, 'fin_markers', markers.append, 10)
                        _spin(watch, SETTLED)
                        if not markers:
                            raise TimeoutError(f'no fin_markers within {SETTLED:g} s')
                        with_markers = _processor_shares(pids, lambda: _spin(watch, seconds / ROUNDS))
    rclpy.shutdown()
    return {
        'first start [s]': taken[0], 'warm start [s]': sorted(taken[1:])[starts // 2],
        'processor share': statistics.median(shares['ours']),
        **{f'processor share of a bare node, {name}': statistics.median(shares[name]) for name in EXECUTORS},
        'ours / bare': _ratio(shares), 'ours / bare, heard': _ratio(with_listeners),
        'processor share with markers': statistics.median(with_markers['ours']),
        'ours with markers / bare': _ratio(with_markers),
    }


def pace_figures(seconds: float) -> dict[str, float]:
    """Measure how much of real time robots reach in `seconds` of swimming, and the processor time that they take.

    Of several robots, the factor is that of the slowest one. The robots are one at `FAST_RATE` on one core, then
    `ROBOTS` at 100 Hz, in as many processes and in one.
    """
    names = [f'robot_{number}' for number in range(ROBOTS)]
    fast = [*command_of('sim_node'), *robots.arguments('fast'), '-p', f'publish_rate:={FAST_RATE}',
            '-p', f'solver.time_step:={1.0 / FAST_RATE}']
    figures = {}
    for label, commands, heard in (
        ('at 1000 Hz on one core', [['taskset', '-c', '0', *fast]], ['fast']),
        ('in ten processes', [[*command_of('sim_node'), *robots.arguments(name)] for name in names], names),
        ('in one process', [[sys.executable, '-m', 'evidence.benchmark.robots', *names]], names),
    ):
        with contextlib.ExitStack() as processes:
            pids = [processes.enter_context(_process(command)).pid for command in commands]
            factor, share = _pace(pids, heard, seconds)
        figures |= {f'real-time factor {label}': factor, f'processor share {label}': share}
    return figures


def _pace(pids: list[int], names: list[str], seconds: float) -> tuple[float, float]:
    """Return the real-time factor of the slowest robot, and the share of a core of all processes."""
    rclpy.init()
    watch = rclpy.create_node('pace')
    commands = [watch.create_publisher(Float64MultiArray, f'/{name}/fin_command', 10) for name in names]

    def clocks() -> dict[str, tuple[float, float]]:
        """Return the simulated time of each robot [s], and the elapsed time at which it was heard."""
        times: dict[str, tuple[float, float]] = {}

        def hear(name: str, message: Clock) -> None:
            times.setdefault(name, (message.clock.sec + 1e-9 * message.clock.nanosec, time.monotonic()))

        subscriptions = [
            watch.create_subscription(Clock, f'/{name}/clock', functools.partial(hear, name), 1) for name in names]
        began = time.monotonic()
        while len(times) < len(names):
            rclpy.spin_once(watch, timeout_sec=0.05)
            if time.monotonic() - began > STARTED_WITHIN:
                raise TimeoutError(f'no clock within {STARTED_WITHIN:g} s')
        for subscription in subscriptions:
            watch.destroy_subscription(subscription)
        return times

    clocks()
    for command in commands:
        command.publish(Float64MultiArray(data=SWIM))
    time.sleep(SETTLED)
    before, began, used = clocks(), time.monotonic(), sum(map(processor_time, pids))
    time.sleep(seconds)
    share = (sum(map(processor_time, pids)) - used) / (time.monotonic() - began)
    after = clocks()
    rclpy.shutdown()
    factors = [np.subtract(after[name], before[name]) for name in names]
    return min(simulated / elapsed for simulated, elapsed in factors), share


def _spin(node: Node, seconds: float) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        rclpy.spin_once(node, timeout_sec=0.05)


def _processor_shares(pids: dict[str, int], wait: Callable[[], None]) -> dict[str, list[float]]:
    """Return the share of a core of each process in each of several rounds, all processes at the same time."""
    shares: dict[str, list[float]] = {name: [] for name in pids}
    for _ in range(ROUNDS):
        before, began = {name: processor_time(pid) for name, pid in pids.items()}, time.monotonic()
        wait()
        for name, pid in pids.items():
            shares[name].append((processor_time(pid) - before[name]) / (time.monotonic() - began))
    return shares


def _ratio(shares: dict[str, list[float]]) -> float:
    """Return the median ratio of our share to that of the bare node with the single-threaded executor."""
    return statistics.median(
        ours / bare for ours, bare in zip(shares['ours'], shares['single-threaded'], strict=True))


def _running(kernels: str) -> contextlib.AbstractContextManager[subprocess.Popen]:
    return _process(command_of('sim_node'), os.environ | {'NUMBA_CACHE_DIR': kernels})


@contextlib.contextmanager
def _process(command: list[str], environment: dict[str, str] | None = None) -> Iterator[subprocess.Popen]:
    process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


def processor_time(pid: int) -> float:
    """Return the processor time of a process and all its threads [s]."""
    return time.clock_gettime(~pid << 3 | PROCESS_CLOCK)

"""Time from the start of the built `sim_node` to its first message, and processor time beside the least node."""

from __future__ import annotations

import contextlib
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray
from visualization_msgs.msg import MarkerArray

from evidence.benchmark.bare_node import EXECUTORS
from evidence.harness.processes import command_of

STARTED_WITHIN = 300.0  # s, a first start on a slow machine
SETTLED = 2.0  # s after the first message, before processor time is counted
ROUNDS = 5  # of the measurement of processor time
BARE_NODE = 'evidence.benchmark.bare_node'
SWIM = [0.7, 0.7, 0.6, 0.6, 0.7, 0.7]


def node_figures(starts: int, seconds: float) -> dict[str, float]:
    """Measure the first start, `starts` later starts, and the processor time over `seconds` of swimming at 100 Hz.

    A start lasts from the creation of the process to its first `pose`; the first one finds no compiled kernels. The
    processor shares are those of one core, without and with a subscriber of the markers, and those of bare nodes at the
    same time.
    """
    rclpy.init()
    with tempfile.TemporaryDirectory() as kernels:
        watch = rclpy.create_node('node_timing')
        seen: list[PoseStamped] = []
        watch.create_subscription(PoseStamped, 'pose', seen.append, 10)
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
                    with contextlib.ExitStack() as bare:
                        pids = {'ours': process.pid} | {
                            name: bare.enter_context(_process([sys.executable, '-m', BARE_NODE, name])).pid
                            for name in EXECUTORS}
                        time.sleep(SETTLED)
                        shares = _processor_shares(pids, lambda: time.sleep(seconds / ROUNDS))
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
        'ours / bare': _ratio(shares), 'processor share with markers': statistics.median(with_markers['ours']),
        'ours with markers / bare': _ratio(with_markers),
    }


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
    """Return the processor time of a process [s], user and system."""
    fields = Path(f'/proc/{pid}/stat').read_text(encoding='ascii').rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')

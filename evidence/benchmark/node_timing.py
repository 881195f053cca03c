"""Time from the start of the built `sim_node` to its first message, and processor time while it runs."""

from __future__ import annotations

import contextlib
import os
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray
from visualization_msgs.msg import MarkerArray

from evidence.harness.processes import command_of

STARTED_WITHIN = 300.0  # s, a first start on a slow machine
SETTLED = 2.0  # s after the first message, before processor time is counted
SWIM = [0.7, 0.7, 0.6, 0.6, 0.7, 0.7]


def node_figures(starts: int, seconds: float) -> dict[str, float]:
    """Measure the first start, `starts` later starts, and the processor time over `seconds` of swimming at 100 Hz.

    A start lasts from the creation of the process to its first `pose`; the first one finds no compiled kernels. The
    processor shares are those of one core, without and with a subscriber of the markers.
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
                    time.sleep(SETTLED)
                    share = _processor_share(process.pid, lambda: time.sleep(seconds))
                    markers: list[MarkerArray] = []
                    watch.create_subscription(MarkerArray, 'fin_markers', markers.append, 10)
                    _spin(watch, SETTLED)
                    if not markers:
                        raise TimeoutError(f'no fin_markers within {SETTLED:g} s')
                    share_with_markers = _processor_share(process.pid, lambda: _spin(watch, seconds))
    rclpy.shutdown()
    return {
        'first start [s]': taken[0], 'warm start [s]': sorted(taken[1:])[starts // 2],
        'processor share': share, 'processor share with markers': share_with_markers,
    }


def _spin(node: Node, seconds: float) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        rclpy.spin_once(node, timeout_sec=0.05)


def _processor_share(pid: int, wait: Callable[[], None]) -> float:
    before, began = _processor_time(pid), time.monotonic()
    wait()
    return (_processor_time(pid) - before) / (time.monotonic() - began)


@contextlib.contextmanager
def _running(kernels: str) -> Iterator[subprocess.Popen]:
    process = subprocess.Popen(
        command_of('sim_node'), env=os.environ | {'NUMBA_CACHE_DIR': kernels},
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


def _processor_time(pid: int) -> float:
    """Return the processor time of a process [s], user and system."""
    fields = Path(f'/proc/{pid}/stat').read_text(encoding='ascii').rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')

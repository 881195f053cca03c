"""How long the built `sim_node` takes to its first message, and what it costs to keep it running."""

from __future__ import annotations

import contextlib
import os
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import rclpy
from ament_index_python.packages import get_package_prefix
from geometry_msgs.msg import PoseStamped
from std_msgs.msg import Float64MultiArray

STARTED_WITHIN = 300.0  # s, a first start on a slow machine
SETTLED = 2.0  # s after the first message, before processor time is counted
SWIM = [0.7, 0.7, 0.6, 0.6, 0.7, 0.7]


def node_figures(starts: int, seconds: float) -> dict[str, float]:
    """Measure the first start, `starts` warm starts, and the processor time over `seconds` of swimming at 100 Hz.

    A start lasts from the birth of the process to its first `pose`; the first one finds no compiled kernels. The
    processor share is that of one core.
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
                    before, began = _processor_time(process.pid), time.monotonic()
                    time.sleep(seconds)
                    share = (_processor_time(process.pid) - before) / (time.monotonic() - began)
    rclpy.shutdown()
    return {'first start [s]': taken[0], 'warm start [s]': sorted(taken[1:])[starts // 2], 'processor share': share}


@contextlib.contextmanager
def _running(kernels: str) -> Iterator[subprocess.Popen]:
    program = Path(get_package_prefix('manta_sim_ros')) / 'lib' / 'manta_sim_ros' / 'sim_node'
    process = subprocess.Popen(
        [program], env=os.environ | {'NUMBA_CACHE_DIR': kernels}, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


def _processor_time(pid: int) -> float:
    """Processor time of a process [s], user and system."""
    fields = Path(f'/proc/{pid}/stat').read_text(encoding='ascii').rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')

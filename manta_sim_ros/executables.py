"""The executables. Ctrl-C and SIGTERM end them at any time without a traceback, nodes with status 0.

The handlers are set before the imports, which take a second or two.
"""

from __future__ import annotations

import os
import signal
from types import FrameType


def sim_node() -> None:
    """Run the simulator."""
    _end_when_interrupted()
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')  # for small matrices, threads cost time
    from manta_sim_ros.nodes.sim_node import main
    main()


def gait_node() -> None:
    """Run the example controller."""
    _end_when_interrupted()
    from manta_sim_ros.nodes.gait_node import main
    main()


def monitor_node() -> None:
    """Run the monitor."""
    _end_when_interrupted()
    from manta_sim_ros.nodes.monitor_node import main
    main()


def paper_figures() -> None:
    """Draw the paper's figures."""
    _end_when_interrupted(status=130)
    from manta_sim_ros.figures.command import main
    main()


def _end_when_interrupted(status: int = 0) -> None:
    """End the process at once when it is interrupted, until `main` sets its handlers: nothing has begun yet."""
    def end(signum: int, frame: FrameType | None) -> None:
        os._exit(status)

    for ending in (signal.SIGINT, signal.SIGTERM):
        signal.signal(ending, end)

"""The executables: from their first moment on, Ctrl-C and SIGTERM end them without a traceback, nodes with status 0.

The imports take a second or two, in which an exception would end in the middle of anything.
"""

from __future__ import annotations

import os
import signal
from types import FrameType


def sim_node() -> None:
    """Run the simulator."""
    _end_when_interrupted()
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')  # its matrices are small: threads only wait for each other
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
    """Until `main` takes over: nothing has begun that would have to be ended."""
    def end(signum: int, frame: FrameType | None) -> None:
        os._exit(status)

    for ending in (signal.SIGINT, signal.SIGTERM):
        signal.signal(ending, end)

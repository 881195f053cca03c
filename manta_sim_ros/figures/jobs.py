"""Long computations, several at a time, with a progress bar."""

from __future__ import annotations

import concurrent.futures
import multiprocessing
import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from tqdm import tqdm

Done = Callable[[], object]
"""Called after each part of a job."""

POLL = 0.1  # s between two looks at the progress


class Job(NamedTuple):
    """One thing to do: `run(done)` in a process of its own; it and its result must be picklable."""

    name: str
    """For the line that says that it is done; empty for none."""
    parts: int
    """How often `run` calls `done`."""
    run: Callable[[Done], Any]


def run_jobs(jobs: Sequence[Job], processes: int | None = None) -> list[Any]:
    """Run jobs, by default as many at a time as there are cores, and return their results in the order of `jobs`.

    Prints a line for each that is done, and shows a progress bar on standard error if that is a terminal. When a job
    fails or the process is interrupted, all others are ended at once, with every other child of this process; what they
    had begun to write stays behind.

    Raises
    ------
    concurrent.futures.BrokenExecutor
        A process was killed.
    Exception
        What the first job that failed raised.

    """
    context = multiprocessing.get_context('spawn')
    parts = context.Queue()
    bar = tqdm(total=sum(job.parts for job in jobs), disable=None, unit='part', smoothing=0.1)
    executor = concurrent.futures.ProcessPoolExecutor(
        max(1, min(processes or len(os.sched_getaffinity(0)), len(jobs))), mp_context=context, initializer=_begin,
        initargs=(parts,))
    try:
        with bar:
            runs = {executor.submit(_timed, job): job for job in jobs}
            waiting = set(runs)
            while waiting:
                finished, waiting = concurrent.futures.wait(
                    waiting, POLL, return_when=concurrent.futures.FIRST_COMPLETED)
                bar.update(_taken(parts))
                for run in finished:
                    seconds = run.result()[1]
                    if runs[run].name:
                        with bar.external_write_mode():
                            say(f'{runs[run].name} ({seconds:.0f} s)')
            bar.update(bar.total - bar.n)
    except BaseException:
        for process in multiprocessing.active_children():
            process.terminate()
        executor.shutdown(cancel_futures=True)
        raise
    executor.shutdown()
    return [run.result()[0] for run in runs]


def say(line: str) -> None:
    """Print a line at once; if nobody listens any more, the work goes on without it."""
    try:
        print(line, flush=True)
    except BrokenPipeError:
        with open(os.devnull, 'w') as nowhere:  # or Python's own flush at the end would fail
            os.dup2(nowhere.fileno(), sys.stdout.fileno())


def _taken(parts: Any) -> int:
    count = 0
    while True:
        try:
            parts.get_nowait()
        except queue.Empty:
            return count
        count += 1


_parts: Any = None
"""Where a process tells the first one of each part that is done."""


def _begin(parts: Any) -> None:
    """Prepare a process that works: it ends by SIGTERM, or when the first process is gone, and by nothing else."""
    global _parts
    _parts = parts
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    for ending in (signal.SIGINT, signal.SIGHUP):  # a terminal sends them to all processes
        signal.signal(ending, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _timed(job: Job) -> tuple[Any, float]:
    start = time.monotonic()
    return job.run(_done), time.monotonic() - start


def _done() -> None:
    _parts.put(None)

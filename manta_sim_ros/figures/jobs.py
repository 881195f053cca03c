"""Long computations that run at the same time in several processes, with a progress bar."""

from __future__ import annotations

import concurrent.futures
import contextlib
import multiprocessing
import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from types import FrameType
from typing import Any, NamedTuple, TextIO

from tqdm import tqdm

from manta_sim_ros.signals import ENDING

Done = Callable[[], object]
"""Called after each part of a job."""

POLL = 0.1  # [s], between two updates of the progress


class Job(NamedTuple):
    """A job that calls `run(done)` in a separate process; `run` and its result must be picklable."""

    name: str
    """Name in the line that is printed when the job is done; no line is printed if it is empty."""
    parts: int
    """Number of times that `run` calls `done`."""
    run: Callable[[Done], Any]


def run_jobs(jobs: Sequence[Job], processes: int | None = None) -> list[Any]:
    """Run jobs, by default as many at a time as there are cores, and return their results in the order of `jobs`.

    A line is printed for each finished job, and a progress bar is shown on standard error if that is a terminal. When a
    job fails or the process is interrupted, all other jobs are ended at once, and so is every other child of this
    process. Their incomplete files remain.

    Raises
    ------
    concurrent.futures.BrokenExecutor
        A process was killed.
    Exception
        The exception of the first job that failed.

    """
    context = multiprocessing.get_context('spawn')
    parts = context.Queue()
    bar = tqdm(total=sum(job.parts for job in jobs), disable=None, unit='part', smoothing=0.1)
    executor = concurrent.futures.ProcessPoolExecutor(
        max(1, min(processes or len(os.sched_getaffinity(0)), len(jobs))), mp_context=context, initializer=_begin,
        initargs=(parts,))
    try:
        with bar, _signals_held() as let_signals_act:
            runs = {executor.submit(_timed, job): job for job in jobs}
            waiting = set(runs)
            while waiting:
                finished, waiting = concurrent.futures.wait(
                    waiting, POLL, return_when=concurrent.futures.FIRST_COMPLETED)
                let_signals_act()
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


@contextlib.contextmanager
def _signals_held() -> Iterator[Callable[[], None]]:
    """Hold back the signals that end the process, and yield a function that runs the handlers of those that came.

    A handler raises an exception. That could leave the lock of a future taken, for which the executor would wait
    forever. Only the main thread has handlers.
    """
    came: list[tuple[int, FrameType | None]] = []
    handlers: dict[int, Callable[[int, FrameType | None], Any]] = {}
    if threading.current_thread() is threading.main_thread():
        for ending in ENDING:
            handler = signal.getsignal(ending)
            if callable(handler):
                handlers[ending] = handler
                signal.signal(ending, lambda number, frame: came.append((number, frame)))

    def act() -> None:
        while came:
            number, frame = came.pop(0)
            handlers[number](number, frame)

    try:
        yield act
    finally:
        for number, handler in handlers.items():
            if signal.getsignal(number) != signal.SIG_IGN:  # as a handler may have decided
                signal.signal(number, handler)
    act()


def say(line: str, file: TextIO | None = None) -> None:
    """Print a line at once, by default to standard output; if its reader is gone, continue without printing."""
    file = sys.stdout if file is None else file
    try:
        print(line, file=file, flush=True)
    except BrokenPipeError:
        with open(os.devnull, 'w') as nowhere:  # otherwise Python's flush at the end would fail
            os.dup2(nowhere.fileno(), file.fileno())


def _taken(parts: Any) -> int:
    count = 0
    while True:
        try:
            parts.get_nowait()
        except queue.Empty:
            return count
        count += 1


_parts: Any = None
"""Queue by which a worker process reports each finished part to the first process."""


def _begin(parts: Any) -> None:
    """Prepare a worker process, which ends only after SIGTERM or when the first process is gone."""
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

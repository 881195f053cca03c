"""Starts and stops of the node: exit status, processes and shared memory that are left."""

from __future__ import annotations

import collections
import contextlib
import os
import random
import re
import signal
import time
from pathlib import Path

from rosgraph_msgs.msg import Clock

from evidence.soak.facts import Fact, Lengths, abandoned, equal, mapped_files, nodes, printed, shared_files

TITLE = 'Starts and stops'
ABOUT = """
The node is started and ended, in turn with SIGINT and SIGTERM: half of the times after its first `/clock`, and half
of the times at a random time of up to 2.5 s after it has set its handlers of signals, in the middle of its imports or
first outputs. Afterwards no process may be left that inherited its environment, and none of the files in /dev/shm
that it made, if it was heard."""
NOT_SURVIVED = """
In the first moments of the process, before Python has set the handlers, a signal ends the process as it ends any
program, with the status of the signal. A node that is ended in the last part of its start, when Fast DDS has begun,
leaves one to three files in /dev/shm. After SIGKILL the files in /dev/shm stay: see "Faults"."""

MARK = 'MANTA_SOAK_START'
LATEST = 2.5  # s


def marked(value: str) -> list[str]:
    """Return the processes that have this value of MARK in their environment."""
    found = []
    for path in Path('/proc').glob('[0-9]*/environ'):
        with contextlib.suppress(OSError):
            if f'{MARK}={value}'.encode() in path.read_bytes().split(b'\0'):
                found.append(path.parent.name)
    return found


def handles(pid: int) -> bool:
    """Return whether a process has a handler of SIGTERM."""
    caught = re.search(r'^SigCgt:\s*(\w+)', Path(f'/proc/{pid}/status').read_text(encoding='utf-8'), re.MULTILINE)
    return caught is not None and bool(int(caught[1], 16) >> (signal.SIGTERM - 1) & 1)


def measure(lengths: Lengths) -> list[Fact]:
    """Start and end the node again and again: first those that are heard, then those that are still starting."""
    chance, statuses = random.Random(lengths.seed), collections.Counter[int]()
    left = {}
    orphans, noisy, starting, ending = 0, 0, [], []
    for heard in (True, False):
        made: set[str] = set()
        with nodes() as (launch, probe):
            clock = probe.record(Clock, '/clock')
            for number in range(lengths.starts // 2):
                mark, began, first = f'{os.getpid()}_{heard}_{number}', time.monotonic(), time.time_ns()
                others = shared_files()
                node = launch('sim_node', environment={MARK: mark})
                if heard:
                    probe.until(lambda clock=clock, first=first: clock.sent[-1:] > [first], 'the clock')
                    starting.append(time.monotonic() - began)
                else:
                    probe.until(lambda pid=node.process.pid: handles(pid), 'the handlers')
                    probe.listen(chance.uniform(0.0, LATEST))
                made |= mapped_files(node.process.pid) - others
                moment = time.monotonic()
                node.send((signal.SIGINT, signal.SIGTERM)[number % 2])
                statuses[node.exit_status()] += 1
                ending.append(time.monotonic() - moment)
                noisy += 'Traceback' in node.output
                orphans += len(marked(mark))
                node.end()
        left[heard] = len(abandoned(made))  # the probe has closed what it had opened
    return [
        equal('starts', sum(statuses.values()), lengths.starts),
        equal('exit statuses', dict(statuses), {0: lengths.starts}),
        equal('tracebacks', noisy, 0), equal('processes left', orphans, 0),
        equal('files left in /dev/shm, of nodes that were heard', left[True], 0),
        printed('files left in /dev/shm, of nodes that were still starting', left[False]),
        printed('longest time from start to clock [s]', max(starting)),
        printed('longest time from signal to end [s]', max(ending))]

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

from evidence.soak.facts import Fact, Lengths, equal, nodes, printed
from manta_sim_ros.nodes.process import GRACE

TITLE = 'Starts and stops'
ABOUT = """
The node is started and ended, in turn with SIGINT and SIGTERM: half of the times after its first `/clock`, and half
of the times at a random time of up to 2.5 s after it has set its handlers of signals, in the middle of its imports or
first outputs. Afterwards no process may be left that inherited its environment, and no segment in /dev/shm that it
made, if it was heard and its end took less than 1 s. It is looked for at once, as other processes with Fast DDS remove
some of what a process leaves. Files of ports do not count: all processes with Fast DDS on a machine share them."""
NOT_SURVIVED = """
In the first moments of the process, before Python has set the handlers, a signal ends the process as it ends any
program, with the status of the signal. A node that is ended while it starts may leave a segment in /dev/shm, and so
may one on a machine that is so busy that its end takes 1 s. After SIGKILL it stays: see "Faults"."""

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
    """Start and end the node again and again."""
    chance, statuses = random.Random(lengths.seed), collections.Counter[int]()
    left = collections.Counter[bool]()  # segments, by whether none is expected
    orphans, noisy, starting, ending = 0, 0, [], []
    with nodes() as (launch, probe):
        clock = probe.record(Clock, '/clock')
        for number in range(lengths.starts):
            mark, others = f'{os.getpid()}_{number}', set(Path('/dev/shm').iterdir())
            began, first = time.monotonic(), time.time_ns()
            node = launch('sim_node', environment={MARK: mark})
            heard = number % 4 < 2
            if heard:
                probe.until(lambda first=first: clock.sent[-1:] > [first], 'the clock')
                starting.append(time.monotonic() - began)
            else:
                probe.until(lambda pid=node.process.pid: handles(pid), 'the handlers')
                probe.listen(chance.uniform(0.0, LATEST))
            used, moment = node.shared_memory - others, time.monotonic()
            node.send((signal.SIGINT, signal.SIGTERM)[number % 2])
            statuses[node.exit_status()] += 1
            ending.append(time.monotonic() - moment)
            left[heard and ending[-1] < GRACE] += sum(path.exists() for path in used)
            noisy += 'Traceback' in node.output
            orphans += len(marked(mark))
            node.end()
    return [
        equal('starts', sum(statuses.values()), lengths.starts),
        equal('exit statuses', dict(statuses), {0: lengths.starts}),
        equal('tracebacks', noisy, 0), equal('processes left', orphans, 0),
        equal('segments left in /dev/shm by nodes that were heard', left[True], 0),
        printed('segments left in /dev/shm by those that were starting, or whose end was slow', left[False]),
        printed(f'ends that took longer than {GRACE:g} s', sum(each > GRACE for each in ending)),
        printed('longest time from start to clock [s]', max(starting)),
        printed('longest time from signal to end [s]', max(ending))]

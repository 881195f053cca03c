"""Load: four publishers of commands at 1 kHz, and thirty subscribers, one of them slow and one stopped."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from evidence.benchmark.node_timing import processor_time
from evidence.harness.lockstep import LockstepRobot
from evidence.harness.processes import LIMIT
from evidence.soak.facts import Fact, Lengths, at_least, equal, nodes, printed, resident

TITLE = 'Load'
ABOUT = """
Four publishers, each in a process of its own, send commands at 1 kHz. Thirty subscribers listen to `odom`: 28 in four
processes, one that takes 0.1 s for each message, and one whose process is stopped (SIGSTOP). At the end the robot is
paused, and a `~/step` with 50 outputs is asked for while one subscriber is still stopped. Then the load ends, and the
robot must obey a command."""
NOT_SURVIVED = """
Messages to the slow and the stopped subscriber are lost: the queue of a publisher has 10 messages. Commands that come
faster than the node takes them replace each other in its queue, and the last one counts. A `~/step` with more than 10
outputs waits up to 5 s for a subscriber that does not take its messages, then goes on without it. On a machine whose
cores are all busy, simulated time becomes slower."""

PUBLISHERS, FAST = 4, 28
SUBSCRIBERS = FAST + 2  # with the slow one and the stopped one
ROOT = Path(__file__).parents[2]


class Peer:
    """A process of peer.py in the ROS namespace of this test."""

    def __init__(self, kind: str, count: int, number: float) -> None:
        self._output = tempfile.TemporaryFile()
        self.process = subprocess.Popen(
            [sys.executable, '-m', 'evidence.soak.peer', kind, str(count), str(number)], cwd=ROOT,
            stdin=subprocess.DEVNULL, stdout=self._output)

    @property
    def lines(self) -> list[bytes]:
        """What it has printed."""
        return os.pread(self._output.fileno(), 100_000, 0).splitlines()

    def end(self) -> dict[str, Any]:
        """End it, and return what it did."""
        self.process.send_signal(signal.SIGCONT)
        self.process.terminate()
        self.process.wait(LIMIT)
        return json.loads(self.lines[-1])


def measure(lengths: Lengths) -> list[Fact]:
    """Run the node under load."""
    with nodes() as (launch, probe):
        robot = LockstepRobot(launch, probe, 'loaded')
        pid = robot.node.process.pid
        heard = robot.odometry
        groups = range(lengths.groups)
        publishers = [Peer('command', PUBLISHERS // lengths.groups, 1000.0) for _ in groups]
        listeners = [Peer('listen', FAST // lengths.groups, 0.0) for _ in groups]
        slow, stopped = Peer('listen', 1, 0.1), Peer('listen', 1, 0.0)
        peers = [*publishers, *listeners, slow, stopped]
        try:
            probe.until(lambda: probe.node.count_publishers('/loaded/fin_command') >= PUBLISHERS, 'the publishers')
            probe.until(lambda: probe.node.count_subscribers('/loaded/odom') >= SUBSCRIBERS + 1, 'the subscribers')
            probe.until(lambda: all(b'all heard' in peer.lines for peer in [*listeners, slow, stopped]),
                        'a message to each subscriber')
            stopped.process.send_signal(signal.SIGSTOP)
            probe.listen(1.0)
            probe.until(lambda: heard, 'an output')
            first, began, used, memory = len(heard) - 1, time.monotonic(), processor_time(pid), resident(pid)
            probe.listen(lengths.load)
            outputs, elapsed = len(heard) - 1 - first, time.monotonic() - began
            share = (processor_time(pid) - used) / elapsed
            simulated = 1e-9 * (heard.stamps[-1] - heard.stamps[first])
            grown = resident(pid) - memory
            robot.pause()
            robot.set_parameter('step_duration', 0.5)
            began = time.monotonic()
            stepped = robot.trigger('step').success
            waited = time.monotonic() - began
        finally:
            found = {peer: peer.end() for peer in peers}
        robot.pause(False)
        robot.trigger('reset')
        fast = [found[peer] for peer in listeners]
        probe.until(lambda: heard[-1].twist.twist.linear.x == 0.0, 'rest')
        gait = robot.commands.msg_type(data=[0.7, 0.7, 0.6, 0.6, 0.7, 0.7])
        probe.until(lambda: heard[-1].twist.twist.linear.x > 0.01, 'motion',
                    doing=lambda: robot.commands.publish(gait))
        return [
            printed('commands per second, all publishers', round(sum(found[peer]['rate'] for peer in publishers))),
            at_least('subscribers that heard the robot', sum(each['heard'] for each in [*fast, found[slow]]),
                     SUBSCRIBERS - 1),
            equal('stamps that went backward, all subscribers',
                  sum(found[peer]['backward'] for peer in [*listeners, slow, stopped]), 0),
            equal('finite', heard.finite, True),
            at_least('outputs during the load', outputs, 1),
            printed('simulated time over elapsed time', simulated / elapsed),
            printed('messages lost by the 28 fast subscribers [%]', 100.0 * _lost(fast)),
            printed('messages lost by the slow subscriber [%]', 100.0 * _lost([found[slow]])),
            printed('share of a core of the node [%]', 100.0 * share),
            printed('memory of the node that was added [MiB]', grown),
            equal('a step beside a stopped subscriber succeeds', stepped, True),
            printed('duration of this step of 50 outputs [s]', waited),
            equal('obeys a command afterwards', True, True),
        ]


def _lost(found: list[dict[str, Any]]) -> float:
    lost, received = (sum(each[name] for each in found) for name in ('lost', 'received'))
    return lost / max(1, lost + received)

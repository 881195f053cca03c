"""Faults from outside: a process is stopped, killed or starved, a disk is full, two nodes have one name."""

from __future__ import annotations

import contextlib
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64MultiArray

from evidence import harness
from evidence.harness.processes import LIMIT, command_of
from evidence.soak.facts import Fact, Lengths, at_most, equal, nodes, printed

TITLE = 'Faults'
ABOUT = """
The node is stopped (SIGSTOP) and goes on (SIGCONT); it is starved on one core beside 20 processes that compute; it is
killed (SIGKILL) and started again; and a second node of the same name is started. Simulated time must not catch up. A
full disk is a limit of the size of files (`ulimit -f`), while `paper_figures` writes a figure and while a recorder
writes a bag of the running node, and `/dev/full` as the output of the node."""
NOT_SURVIVED = """
A node that was killed starts again at time 0 with the robot at rest: those who listen see time go backward, its state
and its gait are lost, and its files in /dev/shm stay until Fast DDS removes them. A recorder stops at a full disk:
its bag ends there and has no index. Two nodes of one name both answer to commands and publish: subscribers get two
robots mixed, with stamps that go backward, and a service call acts on both. The node warns of the second `/clock`,
but does not end. During SIGSTOP nothing is answered, and what is sent in that time is lost, but for the last 10
messages of each topic, which may come some seconds late."""

CATCH_UP = 0.2  # s: twenty outputs, the jitter of a busy machine; to catch up would be the whole time
FIGURE_LIMIT, BAG_LIMIT = 10_000, 2**20  # bytes; shared memory of Fast DDS needs half a MiB
BUSY = 20


def caught_up(clock: Any, moment: int) -> float:
    """Return the simulated time that ran faster than real time since a moment [ns, system clock], in s."""
    first = max(0, clock.first_sent_after(moment) - 1)
    stamps, started = clock.stamps, max(clock.sent[first], moment)
    return max(1e-9 * ((stamp - stamps[first]) - max(0, sent - started))
               for stamp, sent in zip(stamps[first:], clock.sent[first:], strict=True))


def refused(diagnostics: Any) -> int:
    """Return the number of wrong commands that the node has refused."""
    return max(int(value.value) for message in diagnostics for status in message.status for value in status.values
               if value.key == 'refused')


def stop_and_starve(launch: Any, probe: Any, lengths: Lengths) -> list[Fact]:
    """Stop the node for a while, then let it have almost no processor time."""
    node, clock = launch('sim_node'), probe.record(Clock, '/clock')
    probe.until(lambda: len(clock) > 20, 'the clock')
    commands = probe.node.create_publisher(Float64MultiArray, '/fin_command', 10)
    diagnostics = probe.record(DiagnosticArray, '/diagnostics')
    probe.until(lambda: commands.get_subscription_count() and diagnostics, 'the node')
    node.process.send_signal(signal.SIGSTOP)
    probe.listen(lengths.stop)
    moment, heard = time.time_ns(), len(clock)
    node.process.send_signal(signal.SIGCONT)
    probe.until(lambda: len(clock) > heard + 100, 'the clock to go on')
    probe.until(lambda: refused(diagnostics) > 0, 'a refusal',
                doing=lambda: commands.publish(Float64MultiArray(data=[])))
    facts = [printed('SIGSTOP: duration [s]', lengths.stop),
             equal('SIGSTOP: takes messages afterwards', refused(diagnostics) > 0, True),
             at_most('SIGSTOP: simulated time caught up afterwards [s]', caught_up(clock, moment), CATCH_UP)]

    cores = os.sched_getaffinity(0)
    pin(node, {max(cores)})
    with busy(max(cores)):
        probe.listen(0.5)
        before, began = clock.stamps[-1], time.monotonic()
        probe.listen(lengths.starved)
        factor = 1e-9 * (clock.stamps[-1] - before) / (time.monotonic() - began)
    moment, heard = time.time_ns(), len(clock)
    pin(node, cores)
    probe.until(lambda: len(clock) > heard + 100, 'the clock to go on')
    facts += [printed('starved: simulated time over elapsed time', factor),
              at_most('starved: simulated time caught up afterwards [s]', caught_up(clock, moment), CATCH_UP),
              equal('SIGSTOP and starved: stamps rise', clock.rising, True)]
    node.end()
    return [*facts, equal('SIGSTOP and starved: exit status at the end', node.exit_status(), 0)]


def kill(launch: Any, probe: Any, lengths: Lengths) -> list[Fact]:
    """Kill the node, and start it again."""
    others = set(Path('/dev/shm').iterdir())
    node, odometry = launch('sim_node'), probe.record(Odometry, '/odom')
    probe.until(lambda: len(odometry) > 20, 'odometry')
    files = node.shared_memory - others
    node.send(signal.SIGKILL)
    status, reached = node.exit_status(), odometry.stamps[-1]
    stayed = sum(path.exists() for path in files)
    node.end()
    began, first = time.monotonic(), time.time_ns()
    again = launch('sim_node')
    probe.until(lambda: odometry.sent[-1:] > [first], 'odometry of the second node')
    started, restarted = time.monotonic() - began, odometry.stamps[-1] < reached
    commands = probe.node.create_publisher(Float64MultiArray, '/fin_command', 10)
    probe.until(lambda: odometry[-1].twist.twist.linear.x > 0.01, 'motion', doing=lambda: commands.publish(
        Float64MultiArray(data=[0.7, 0.7, 0.6, 0.6, 0.7, 0.7])))
    again.end()
    return [
        equal('SIGKILL: status', status, -signal.SIGKILL),
        printed('SIGKILL: files that stay in /dev/shm', stayed),
        printed('SIGKILL: start again until odometry [s]', started),
        printed('SIGKILL: simulated time starts again at 0', restarted),
        equal('SIGKILL: the second node obeys and ends with status', again.exit_status(), 0),
        printed('SIGKILL: files that stay after the end of the second node',
                sum(path.exists() for path in files))]


def pin(node: Any, cores: set[int]) -> None:
    """Let all threads of a node run on these cores only."""
    for thread in os.listdir(f'/proc/{node.process.pid}/task'):
        with contextlib.suppress(ProcessLookupError):  # it has ended
            os.sched_setaffinity(int(thread), cores)


@contextlib.contextmanager
def busy(core: int) -> Any:
    """Let processes compute on a core."""
    processes = [subprocess.Popen(['sh', '-c', 'while :; do :; done'], preexec_fn=lambda: os.sched_setaffinity(
        0, {core})) for _ in range(BUSY)]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


def names(launch: Any, probe: Any, lengths: Lengths) -> list[Fact]:
    """Start two nodes of one name."""
    clock = probe.record(Clock, '/clock')
    both = [launch('sim_node') for _ in range(2)]
    for node in both:
        probe.until(lambda node=node: 'another node publishes /clock too' in node.output, 'a warning')
    stamps = clock.stamps
    for node in both:
        node.end()
    return [
        equal('one name: nodes that warn of the second /clock', 2, 2),
        printed('one name: steps backward of /clock',
                sum(after < before for before, after in zip(stamps, stamps[1:], strict=False))),
        equal('one name: exit statuses', [node.exit_status() for node in both], [0, 0])]


def limit(size: int) -> Any:
    """Return what a process does before it starts, so that no file becomes larger than `size` [bytes]."""
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def full_disk(launch: Any, probe: Any, lengths: Lengths) -> list[Fact]:
    """Write a figure, a bag and the lines of the node where there is no room."""
    with tempfile.TemporaryDirectory() as folder:
        older = Path(folder, 'figure_7.png')
        older.write_text('older')
        figure = subprocess.run(
            [*command_of('paper_figures'), 'figure_7', '-o', folder], preexec_fn=limit(FIGURE_LIMIT), check=False,
            capture_output=True, text=True, timeout=3.0 * LIMIT)
        left = [path.name for path in Path(folder).iterdir()]
        facts = [
            equal('full disk, figure: exit status', figure.returncode, 1),
            equal('full disk, figure: lines on standard error', len(figure.stderr.splitlines()), 1),
            equal('full disk, figure: the older file is as it was', older.read_bytes() == b'older', True),
            equal('full disk, figure: files cut short', sum(name.startswith('.part') for name in left), 0)]
        clock = probe.record(Clock, '/clock')
        with Path('/dev/full').open('wb') as full:
            node = subprocess.Popen(
                [*command_of('sim_node'), '--ros-args', '-p', 'publish_rate:=500.0'], stdin=subprocess.DEVNULL,
                stdout=full, stderr=full)
        commands = probe.node.create_publisher(Float64MultiArray, '/fin_command', 10)
        try:
            probe.until(lambda: clock, 'the clock')
            recorder = subprocess.Popen(
                [sys.executable, str(Path(harness.__file__).with_name('recorder.py')), str(Path(folder, 'bag.mcap')),
                 '/odom', '/fin_wrench', '/imu/data'],
                preexec_fn=limit(BAG_LIMIT), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL)
            probe.until(lambda: recorder.poll() is not None, 'the end of the recorder',
                        doing=lambda: commands.publish(Float64MultiArray(data=[])))  # the node warns
            before, size = len(clock), Path(folder, 'bag.mcap').stat().st_size
            probe.until(lambda: len(clock) > before + 20, 'the clock to go on')
        finally:
            node.terminate()
            status = node.wait(LIMIT)
    return [
        *facts,
        equal('full disk, bag: exit status of the recorder', recorder.returncode, 1),
        printed('full disk, bag: size [bytes]', size),
        equal('full disk, output of the node to /dev/full: stamps rise', clock.rising, True),
        equal('full disk, output of the node to /dev/full: exit status', status, 0)]


def measure(lengths: Lengths) -> list[Fact]:
    """Try one fault after the other."""
    facts = []
    for fault in (stop_and_starve, kill, names, full_disk):
        with nodes() as (launch, probe):
            facts += fault(launch, probe, lengths)
    return facts

"""Endurance: a day through the library, and an hour through the node."""

from __future__ import annotations

import math
import multiprocessing
import time
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool

from evidence.scenarios import SWIM
from evidence.soak.facts import Fact, Lengths, at_least, at_most, equal, nodes, printed, resident
from manta_sim_ros.dynamics import FinCommand, Parameters, Simulator

TITLE = 'Endurance'
ABOUT = """
The robot of `config/manta.yaml` (30 chains of 3 links, time step 2 ms) swims straight, both fins alike, with the
surface at 1000 m, as it rises slowly: through the library in calls of 10 s, and through the node as fast as it can
(`real_time_factor` 0) with 20 outputs per simulated second. Nothing may be sideways, not even by rounding: y, roll
and yaw must be exactly zero. The memory must not grow after the first tenth."""
NOT_SURVIVED = """
Nothing was found. A robot that swims in a current that varies, or with different fins, drifts, of course. The time of a
state is at most 1e12 s, and a float resolves the position to a nanometer up to about 10,000 km."""

CALL = 10.0  # s, simulated
RATE = 20.0  # Hz
SURFACE = {'surface_height': 1000.0}
NORM_TOLERANCE = 1e-12  # measured: 4e-16
GROWTH = 8.0  # MiB, of allocators and of queues that fill


def library(simulated: float) -> dict[str, float]:
    """Swim through the library, and return what was found."""
    simulator = Simulator(Parameters().replace(water=SURFACE))
    simulator.command(left=SWIM, right=SWIM)
    found = dict.fromkeys(('norm', 'sideways', 'not finite'), 0.0)
    began, calls, memory = time.monotonic(), round(simulated / CALL), 0.0
    for call in range(calls):
        state = simulator.advance(CALL)
        if call == calls // 10:
            memory = resident(multiprocessing.current_process().pid or 0)
        found['norm'] = max(found['norm'], abs(math.hypot(*state.orientation) - 1.0))
        sideways = [state.position[1], *state.orientation[[0, 2]], *state.twist[[1, 3, 5]]]
        found['sideways'] = max(found['sideways'], float(np.abs(sideways).max()))
        found['not finite'] += not all(np.isfinite(value).all() for value in vars(state).values())
    return {**found, 'time': state.time, 'x': float(state.position[0]), 'elapsed': time.monotonic() - began,
            'grown': resident(multiprocessing.current_process().pid or 0) - memory}


def node(lengths: Lengths) -> list[Fact]:
    """Swim through the node."""
    with nodes() as (launch, probe):
        process = launch('sim_node', f'-p real_time_factor:=0.0 -p start_paused:=true -p publish_rate:={RATE} '
                         '-p water.surface_height:=1000.0')
        pid = process.process.pid
        odometry, clock = probe.record(Odometry, '/odom'), probe.record(Clock, '/clock')
        diagnostics = probe.record(DiagnosticArray, '/diagnostics')
        commands = probe.node.create_publisher(Float64MultiArray, '/fin_command', 10)
        gait = Float64MultiArray(data=[value for value in _values(SWIM) for _ in range(2)])
        probe.until(lambda: any(value.value not in ('-', '') for message in diagnostics for status in message.status
                                for value in status.values if value.key.startswith('age of')),
                    'the command', doing=lambda: commands.publish(gait))
        probe.call(SetBool, '/manta_sim/pause', data=False)
        probe.until(lambda: clock, 'the clock')
        began, memory = time.monotonic(), 0.0
        outputs, last, norm, sideways, orderly, finite = 0, 0, 0.0, 0.0, True, True

        while last < lengths.node * 1e9:
            probe.until(lambda: len(odometry) > 50, 'odometry')
            stamps = [last, *odometry.stamps]
            orderly &= stamps == sorted(stamps)
            finite &= odometry.finite
            for message in odometry:
                pose, twist = message.pose.pose, message.twist.twist
                turn = pose.orientation
                norm = max(norm, abs(math.hypot(turn.x, turn.y, turn.z, turn.w) - 1.0))
                sideways = max(sideways, *map(abs, (
                    pose.position.y, turn.x, turn.z, twist.linear.y, twist.angular.x, twist.angular.z)))
            outputs, last = outputs + len(odometry), stamps[-1]
            for recording in (odometry, clock, diagnostics):
                recording.clear()
                recording.sent.clear()
            if not memory and last > lengths.node * 1e8:
                memory = resident(pid)
        elapsed, grown = time.monotonic() - began, resident(pid) - memory
        process.end()
        return [
            at_least('node: simulated [s]', last // 1_000_000_000, round(lengths.node)),
            printed('node: elapsed [s]', round(elapsed)),
            printed('node: messages of odom checked', outputs),
            equal('node: stamps in order', orderly, True), equal('node: all numbers finite', finite, True),
            at_most('node: largest difference of the norm of the quaternion from 1', norm, NORM_TOLERANCE),
            equal('node: largest sideways position, speed, roll or yaw', sideways, 0.0),
            at_most('node: memory added after the first tenth [MiB]', grown, GROWTH),
            equal('node: exit status', process.exit_status(), 0)]


def _values(command: FinCommand) -> tuple[float, float, float]:
    return command.amplitude, command.frequency, command.phase


def measure(lengths: Lengths) -> list[Fact]:
    """Swim in both ways, at the same time."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context('spawn')) as executor:
        swimming = executor.submit(library, lengths.simulated)
        of_node = node(lengths)
        found = swimming.result()
    return [
        at_least('library: simulated [s]', round(found['time']), round(lengths.simulated)),
        printed('library: elapsed [s]', round(found['elapsed'])), printed('library: distance swum [m]', found['x']),
        equal('library: states that are not finite', int(found['not finite']), 0),
        at_most('library: largest difference of the norm of the quaternion from 1', found['norm'], NORM_TOLERANCE),
        equal('library: largest sideways position, speed, roll or yaw', found['sideways'], 0.0),
        at_most('library: memory added after the first tenth [MiB]', found['grown'], GROWTH), *of_node]

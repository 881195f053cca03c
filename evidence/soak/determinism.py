"""Determinism: the same bits in fresh processes, whatever their environment, and through the node at any pace."""

from __future__ import annotations

import subprocess
import tempfile
import warnings

from evidence.harness.lockstep import LockstepRobot, numbers
from evidence.scenarios import run_python
from evidence.soak.facts import Fact, Lengths, at_least, equal, nodes, printed
from manta_sim_ros.dynamics import FinCommand, ModelWarning, Simulator

TITLE = 'Determinism'
ABOUT = """
Fresh processes simulate a swim that begins with different fins, with both couplings, and print the hash (SHA-256) of
all bytes of the state: with the kernels that are kept, with an empty folder of kernels, in each of the locales C,
C.UTF-8 and de_DE.UTF-8 that is installed, and with one thread and two threads. Then the node runs the same gait at
three real-time factors, and each of its messages that was received must have the bits of the state of the library at
its stamp."""
NOT_SURVIVED = """
The bits are those of one machine: Numba compiles for the processor that it finds, so that another processor, or
another version of Numba or NumPy, may round differently. With a real-time factor, a command acts from the tick on
before which the node took it: for the same motion in each run, send commands while the robot is paused (lockstep)."""

GAIT = [0.7, 0.4, 0.6, 0.5, 0.7, 0.3]
KEPT, AGAIN = 'one thread, kernels that are kept', 'kernels compiled again'
FACTORS = (0.0, 0.5, 1.0)
PERIOD = 10_000_000  # ns
SWIM = f"""
import hashlib, locale, sys, warnings
import numpy as np
from manta_sim_ros.dynamics import FinCommand, Parameters, Simulator
locale.setlocale(locale.LC_ALL, '')
warnings.simplefilter('ignore')
bits = b''
for coupling in sys.argv[2:]:
    simulator = Simulator(Parameters().replace(solver={{'coupling': coupling}}))
    simulator.command(left=FinCommand(*{GAIT[0::2]}), right=FinCommand(*{GAIT[1::2]}))
    state = simulator.advance(float(sys.argv[1]))
    bits += b''.join(np.asarray(value).tobytes() for _, value in sorted(vars(state).items()))
print(hashlib.sha256(bits).hexdigest())
"""


def environments(lengths: Lengths) -> dict[str, dict[str, str]]:
    """Return the environments of the fresh processes."""
    there = subprocess.run(['locale', '-a'], capture_output=True, text=True, check=False).stdout.split()
    found = {
        KEPT: {}, 'LC_ALL=C': {'LC_ALL': 'C'}, 'LC_ALL=C.UTF-8': {'LC_ALL': 'C.UTF-8'},
        'two threads': {f'{name}_NUM_THREADS': '2' for name in ('NUMBA', 'OMP', 'OPENBLAS', 'MKL')}}
    if 'de_DE.utf8' in there:
        found['LC_ALL=de_DE.UTF-8'] = {'LC_ALL': 'de_DE.UTF-8'}
    if lengths.cold:
        found[AGAIN] = {}
    return found


def processes(lengths: Lengths) -> list[Fact]:
    """Return whether all fresh processes give the same bits."""
    couplings = ['sequential', 'monolithic'] if lengths.cold else ['sequential']
    hashes = {}
    for name, variables in environments(lengths).items():
        with tempfile.TemporaryDirectory() as folder:
            kernels = {'NUMBA_CACHE_DIR': folder} if name == AGAIN else {}
            hashes[name] = run_python(
                SWIM, folder, lengths.swim, *couplings, **variables, **kernels).stdout.strip()
    wanted = hashes.pop(KEPT)
    return [printed(f'{KEPT}: hash of the states', wanted[:16]),
            *(equal(f'{name}: the same hash', value == wanted, True) for name, value in hashes.items())]


def at_factor(robot: LockstepRobot, lengths: Lengths, factor: float) -> list[Fact]:
    """Return whether the node at a real-time factor has the bits of the library."""
    robot.set_parameter('real_time_factor', factor)
    robot.trigger('reset')
    robot.command(GAIT)
    began = robot.now()
    robot.pause(False)
    end = began + round(lengths.swim * 1e9)
    robot.probe.until(
        lambda: robot.odometry.stamps[-1] >= end and robot.wrench.stamps[-1] >= end, 'the end of the swim')
    robot.pause()
    simulator, states = Simulator(), {}
    simulator.command(left=FinCommand(*GAIT[0::2]), right=FinCommand(*GAIT[1::2]))
    with warnings.catch_warnings():
        warnings.simplefilter('ignore', ModelWarning)  # this gait turns
        for number in range(1, 1 + round((robot.odometry.stamps[-1] - began) / PERIOD)):
            state = simulator.advance(1e-9 * PERIOD)
            states[began + number * PERIOD] = [*state.position, *state.twist, *state.wrench]
    wrenches = dict(zip(robot.wrench.stamps, robot.wrench, strict=True))
    compared = different = 0
    for stamp, odometry in zip(robot.odometry.stamps, robot.odometry, strict=True):
        if stamp in states and stamp in wrenches:
            at = odometry.pose.pose.position
            compared += 1
            different += [at.x, at.y, at.z, *numbers(odometry, wrenches[stamp])] != states[stamp]
    return [at_least(f'node at a real-time factor of {factor:g}: outputs compared', compared, 10),
            equal(f'node at a real-time factor of {factor:g}: outputs with other bits', different, 0)]


def measure(lengths: Lengths) -> list[Fact]:
    """Compare processes, then the node at its factors."""
    facts = processes(lengths)
    with nodes() as (launch, probe):
        robot = LockstepRobot(launch, probe, 'paced', '-p start_paused:=true')
        for factor in FACTORS:
            facts += at_factor(robot, lengths, factor)
    return facts

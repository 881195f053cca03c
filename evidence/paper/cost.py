"""The cost of the paper's 0.01 s of simulated time, for the reference implementation in NumPy and for the library.

Times are processor time of this process, so they do not include other work of the machine. Rounds of the library run
before and after the reference implementation, which is so slow that one round is enough.
"""

from __future__ import annotations

import dataclasses
import time

import numpy as np

from evidence.references import equations
from evidence.verification.mechanics import rods_of
from manta_sim_ros.dynamics import FloatArray, Parameters, Simulator
from manta_sim_ros.figures.gaits import STRAIGHT, robot

PAPER_TIME = 0.18
"""Computing time of SPAN in Section 4, on an i5-8365U, with 30 chains of 3 links per fin [s]."""
SPAN = 0.01
"""Simulated time [s]."""
ROUNDS = 20
SPANS = 50
"""Number of SPANs in each round of the library."""


@dataclasses.dataclass(frozen=True)
class Cost:
    """Computing time on one core for SPAN of the straight gait, with both fins and the body."""

    reference: float
    """Time of the reference implementation in NumPy [s]."""
    library: float
    """Time of the library, the median of the rounds [s]."""
    steps: int
    """Number of steps in SPAN, the same for both."""
    paper: float = PAPER_TIME
    """Time in the paper, of another machine and of one step [s]."""


def measure(quick: bool = False) -> Cost:
    """Time both; for tests, `quick` runs one step of the reference implementation and few rounds."""
    parameters = robot()
    steps = round(SPAN / parameters.solver.time_step)
    rounds = 3 if quick else ROUNDS
    simulator = Simulator(parameters)
    simulator.command(left=STRAIGHT, right=STRAIGHT)
    simulator.advance(1.0)  # so that the kernels are compiled and the robot swims
    before = [library_seconds(simulator) for _ in range(rounds)]
    reference = steps * reference_seconds(parameters, 1 if quick else steps)
    after = [library_seconds(simulator) for _ in range(rounds)]
    return Cost(reference, float(np.median(before + after)), steps)


def library_seconds(simulator: Simulator) -> float:
    """Return the computing time [s] of SPAN of a simulation."""
    start = time.process_time()
    simulator.advance(SPANS * SPAN)
    return (time.process_time() - start) / SPANS


def reference_seconds(parameters: Parameters, steps: int) -> float:
    """Return the computing time [s] of a step of the reference implementation, the mean of `steps` steps from rest."""
    state = equations.rest_state(parameters)
    start = time.process_time()
    for _ in range(steps):
        state = equations.step(parameters, state, lambda side, at: rod_motion(parameters, at))
    return (time.process_time() - start) / steps


def rod_motion(parameters: Parameters, at: float) -> FloatArray:
    """Return angle, rate and acceleration [rad, s] of the front and the rear rod (2, 3) in the straight gait, (38)."""
    return rods_of(parameters, STRAIGHT, np.array([at]))[0]

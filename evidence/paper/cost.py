"""What the paper's 0.01 s of simulated time cost: the literal version in NumPy and the library, in one run.

Times are this process's processor time, so what else the machine does does not count. Rounds of the library come before
and after the literal version, which is slow enough for one.
"""

from __future__ import annotations

import dataclasses
import time

import numpy as np

from evidence.references import equations
from evidence.verification.mechanics import rods_of
from manta_sim_ros.dynamics import Parameters, Simulator
from manta_sim_ros.figures.gaits import STRAIGHT, robot

PAPER_TIME = 0.18
"""[s] Section 4: computing time of SPAN on an i5-8365U, 30 chains of 3 links a fin."""
SPAN = 0.01
"""[s] of simulated time."""
ROUNDS = 20
SPANS = 50
"""SPAN so many times in each round of the library."""


@dataclasses.dataclass(frozen=True)
class Cost:
    """Seconds of one core for SPAN of straight swimming, both fins and the body."""

    literal: float
    """The literal version in NumPy [s]."""
    library: float
    """The library, median of the rounds [s]."""
    steps: int
    """Steps in SPAN, of both."""
    paper: float = PAPER_TIME
    """What the paper says, of another machine and one step [s]."""


def measure(quick: bool = False) -> Cost:
    """Time both; `quick` takes one step of the literal version and few rounds, for tests."""
    parameters = robot()
    steps = round(SPAN / parameters.solver.time_step)
    rounds = 3 if quick else ROUNDS
    simulator = Simulator(parameters)
    simulator.command(left=STRAIGHT, right=STRAIGHT)
    simulator.advance(1.0)  # compiled, and swimming
    before = [library_seconds(simulator) for _ in range(rounds)]
    literal = steps * literal_seconds(parameters, 1 if quick else steps)
    after = [library_seconds(simulator) for _ in range(rounds)]
    return Cost(literal, float(np.median(before + after)), steps)


def library_seconds(simulator: Simulator) -> float:
    """Return the seconds that SPAN of a simulation takes."""
    start = time.process_time()
    simulator.advance(SPANS * SPAN)
    return (time.process_time() - start) / SPANS


def literal_seconds(parameters: Parameters, steps: int) -> float:
    """Return the seconds that a step of the literal version takes, mean of so many from rest on."""
    state = equations.rest_state(parameters)
    start = time.process_time()
    for _ in range(steps):
        state = equations.step(parameters, state, lambda side, at: rod_motion(parameters, at))
    return (time.process_time() - start) / steps


def rod_motion(parameters: Parameters, at: float) -> np.ndarray:
    """Return angle, rate and acceleration (3) of the front and the rear rod (2, 3) in the straight gait, (38)."""
    return rods_of(parameters, STRAIGHT, np.array([at]))[0]

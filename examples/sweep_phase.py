#!/usr/bin/env python3
"""Find the phase between the rods that swims fastest: many robots at once, one for each phase."""

import math

import numpy as np

from manta_sim_ros.dynamics import FinCommand, Parameters, State, simulate_batch

PHASES = np.radians(np.arange(10.0, 90.0, 10.0))
AMPLITUDE = math.radians(30.0)
FREQUENCY = 0.5  # Hz; a period is a whole number of time steps

parameters = Parameters().replace(fin={'chains': 12, 'links': 3})
gaits = [FinCommand(amplitude=AMPLITUDE, frequency=FREQUENCY, phase=phase) for phase in PHASES]
at_rest = [State.at_rest(parameters)] * len(gaits)

started = simulate_batch(parameters, at_rest, [(gait, gait) for gait in gaits], 4.0 / FREQUENCY)
period = simulate_batch(parameters, started, None, 1.0 / FREQUENCY)  # the gaits go on
for phase, before, after in zip(PHASES, started, period, strict=True):
    speed = (after.position[0] - before.position[0]) * FREQUENCY
    print(f'phase {math.degrees(phase):2.0f}°  {speed:6.3f} m/s')

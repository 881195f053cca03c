#!/usr/bin/env python3
"""Swim straight ahead, and print the mean forward speed of each period."""

import math

from manta_sim_ros.dynamics import FinCommand, Simulator

FREQUENCY = 0.5  # Hz
PERIODS = 10

simulator = Simulator()
gait = FinCommand(amplitude=math.radians(40.0), frequency=FREQUENCY, phase=math.radians(40.0))
simulator.command(left=gait, right=gait)

start = simulator.state.position[0]
for period in range(PERIODS):
    state = simulator.advance(1.0 / FREQUENCY)
    speed = (state.position[0] - start) * FREQUENCY
    start = state.position[0]
    print(f'period {period + 1:2d}: {speed:.3f} m/s')

#!/usr/bin/env python3
"""Compute the mean thrust over amplitude and frequency, with the body held as in a water tunnel."""

import math

import numpy as np

from manta_sim_ros.dynamics import FinCommand, Parameters, Simulator

AMPLITUDES = (10.0, 20.0, 30.0, 40.0)  # degrees
FREQUENCIES = (0.25, 0.5, 0.625)  # Hz; a period is a whole number of time steps, and so is a sample
PHASE = math.radians(40.0)
SAMPLES = 50  # per period

held = Parameters().replace(solver={'fixed_base': True})


def mean_thrust(amplitude, frequency):
    """Return the mean forward force [N] of both fins over the third period."""
    simulator = Simulator(held)
    gait = FinCommand(amplitude=amplitude, frequency=frequency, phase=PHASE)
    simulator.command(left=gait, right=gait)
    simulator.advance(2.0 / frequency)  # the gait starts, and the fins settle
    return np.mean([simulator.advance(1.0 / frequency / SAMPLES).wrench[0] for _ in range(SAMPLES)])


print('thrust [N]  ' + ''.join(f'{frequency:7.3f} Hz' for frequency in FREQUENCIES))
for amplitude in AMPLITUDES:
    thrusts = (mean_thrust(math.radians(amplitude), frequency) for frequency in FREQUENCIES)
    print(f'{amplitude:9.0f}°  ' + ''.join(f'{thrust:10.2f}' for thrust in thrusts))

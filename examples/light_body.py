#!/usr/bin/env python3
"""Make the body lighter, and compare the staggered with the monolithic coupling.

The staggered coupling, which is the paper's, gives the fins the acceleration of the body in the step before. The motion
diverges when the body is too light for this delay. The monolithic coupling solves for the body and the fins at once.
"""

import math
import warnings

from manta_sim_ros.dynamics import (
    MONOLITHIC,
    SEQUENTIAL,
    DivergenceError,
    FinCommand,
    Parameters,
    Simulator,
    StabilityWarning,
)

DURATION = 2.0  # s
gait = FinCommand(amplitude=math.radians(40.0), frequency=0.6, phase=math.radians(40.0))


def distance(mass, coupling):
    """Return how far [m] a robot with this mass of the body [kg] swims, or 'diverges'."""
    inertia = tuple(value * mass / full.mass for value in full.inertia)
    simulator = Simulator(Parameters().replace(body={'mass': mass, 'inertia': inertia}, solver={'coupling': coupling}))
    simulator.command(left=gait, right=gait)
    try:
        return f'{simulator.advance(DURATION).position[0]:.4f}'
    except DivergenceError:
        return 'diverges'


full = Parameters().body
warnings.simplefilter('ignore', StabilityWarning)  # it says beforehand that the staggered coupling diverges
print(f'{"mass [kg]":>10} {"staggered [m]":>14} {"monolithic [m]":>15}')
for part in (1.0, 0.5, 0.4, 0.3, 0.2, 0.1):
    mass = part * full.mass
    print(f'{mass:10.1f} {distance(mass, SEQUENTIAL):>14} {distance(mass, MONOLITHIC):>15}')

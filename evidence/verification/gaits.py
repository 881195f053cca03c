"""The paper's gaits by the names that docs/verification.md has for them."""

from __future__ import annotations

from manta_sim_ros.figures.gaits import STRAIGHT, TURNS

GAITS = {
    'forward, A 40, 0.6 Hz': (STRAIGHT, STRAIGHT),
    'turn 1, phi 40/0, 0.8 Hz': TURNS['set 1'],
    'turn 2, A 40/20, 0.8 Hz': TURNS['set 2'],
}
"""Left and right gait, of Figures 9 to 11."""

"""The paper's gaits by the names that docs/verification.md uses for them."""

from __future__ import annotations

from manta_sim_ros.figures.gaits import STRAIGHT, TURNS

GAITS = {
    'straight gait, A = 40°, f = 0.6 Hz': (STRAIGHT, STRAIGHT),
    'turn of set 1, φ = 40/0°, f = 0.8 Hz': TURNS['set 1'],
    'turn of set 2, A = 40/20°, f = 0.8 Hz': TURNS['set 2'],
}
"""The left and the right fin's gait in Figures 9 to 11."""

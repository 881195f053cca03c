"""The shape of the body for drawings. The model needs none: its body is a mass with drag coefficients."""

from __future__ import annotations

import numpy as np

from manta_sim_ros.dynamics import FloatArray

SECTIONS = np.array([
    (0.32, 0.0, 0.0), (0.31, 0.13, 0.035), (0.26, 0.23, 0.06), (0.15, 0.295, 0.08), (-0.01, 0.30, 0.08),
    (-0.16, 0.295, 0.06), (-0.26, 0.19, 0.04), (-0.33, 0.06, 0.02), (-0.43, 0.02, 0.012), (-0.60, 0.0, 0.0),
])
"""Cross sections of the body from nose to tail, in F_b: x, half the width, half the height [m]."""


def body_surface(sections: FloatArray, points: int) -> FloatArray:
    """Return points (a, points, 3) [m] on the ellipses of `sections` (a, 3); the last of each is the first one."""
    x, width, height = sections.T[..., None]
    around = np.linspace(0.0, 2.0 * np.pi, points)
    return np.stack(np.broadcast_arrays(x, width * np.cos(around), height * np.sin(around)), axis=-1)

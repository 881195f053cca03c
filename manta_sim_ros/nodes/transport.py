"""What swimming costs: mean power of the rods, mean forward speed, and the energy per distance that follows."""

from __future__ import annotations

import math

from manta_sim_ros.dynamics import State

SLOWEST = 0.01
"""Least mean forward speed, forward or backward, for which an energy per distance is given [m/s]."""


class Transport:
    """Means over simulated time, from one state for each interval."""

    def __init__(self) -> None:
        self._energy = self._distance = self._time = 0.0

    def add(self, state: State, duration: float) -> None:
        """Add an interval [s] that ended with this state."""
        self._energy += state.rod_power * duration
        self._distance += float(state.twist[0]) * duration
        self._time += duration

    def take(self) -> tuple[float, float]:
        """Return mean power of the rods [W] and mean forward speed [m/s] since the last call; NaN if no time passed."""
        energy, distance, time = self._energy, self._distance, self._time
        self._energy = self._distance = self._time = 0.0
        return (energy / time, distance / time) if time > 0.0 else (math.nan, math.nan)


def energy_per_distance(power: float, speed: float) -> float:
    """Return power [W] over speed [m/s], which is in J/m; NaN if the robot does not move, or if one of them is NaN."""
    return power / abs(speed) if abs(speed) >= SLOWEST else math.nan


def cost_of_transport(power: float, speed: float, weight: float) -> float:
    """Return power [W] over weight [N] times speed [m/s]; NaN as `energy_per_distance`, and without a weight."""
    return energy_per_distance(power, speed) / weight if weight > 0.0 else math.nan

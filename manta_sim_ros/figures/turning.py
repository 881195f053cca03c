"""The two turning gaits of Figures 10 and 11: trajectories, turning rates and radii, and wrenches."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from manta_sim_ros.dynamics import FloatArray, Parameters
from manta_sim_ros.figures.gaits import FEW_CHAINS, IN_WATER, TURNS, robot
from manta_sim_ros.figures.periodic import end_mean, settled
from manta_sim_ros.figures.record import Record, record

PERIODS = 20
"""Number of periods of a turn, as in the paper."""
SETTLED = 0.05
"""A turn is steady when the yaw rate of each further period is within this share of the final yaw rate."""


@dataclasses.dataclass(frozen=True)
class Turn:
    """A turning gait from rest."""

    name: str
    record: Record

    @property
    def chains(self) -> int:
        """Number of chains per fin."""
        return self.record.parameters.fin.chains

    @property
    def in_water(self) -> bool:
        """Whether the fins resist twist and the body moves water, which the paper leaves out."""
        return self.record.parameters.fin.shear_modulus > 0.0

    @property
    def robot(self) -> str:
        """The robot of this turn: its number of chains, and whether it is not the paper's."""
        return f'{self.chains} chains{", twist stiffness and body in water" if self.in_water else ""}'

    @property
    def headings(self) -> FloatArray:
        """(T,) direction of the body's x axis in plan view [rad], positive to the left, without jumps."""
        return np.unwrap(Rotation.from_quat(self.record.orientation).as_euler('ZYX')[:, 0])

    @property
    def yaw_rates(self) -> FloatArray:
        """(periods,) rate of the heading over each period [degrees/s], positive to the left."""
        at_ends = np.concatenate([[0.0], self.headings[self.record.samples - 1::self.record.samples]])
        return np.degrees(np.diff(at_ends)) / self.record.period

    @property
    def speeds(self) -> FloatArray:
        """(periods,) speed along the path [m/s].

        It is the magnitude of the mean velocity of a period, in a frame that turns with the heading, so it does not
        include the flapping.
        """
        velocity = Rotation.from_quat(self.record.orientation).apply(self.record.twist[:, :3])
        headed = Rotation.from_euler('Z', self.headings[:, None]).inv().apply(velocity)
        return np.asarray(np.linalg.norm(self.record.by_period(headed).mean(axis=1), axis=1))

    @property
    def steady_from(self) -> int | None:
        """First period (0 is the first) of a steady yaw rate; None if it is not steady before the last quarter."""
        return settled(self.yaw_rates, SETTLED)

    @property
    def turning_rate(self) -> float:
        """Mean yaw rate of the last quarter of the periods [degrees/s], positive to the left."""
        return end_mean(self.yaw_rates)

    @property
    def turning_radius(self) -> float:
        """Mean speed divided by turning rate, both of the last quarter of the periods [m]."""
        return float(end_mean(self.speeds) / np.radians(abs(self.turning_rate)))

    @property
    def mean_wrenches(self) -> FloatArray:
        """(periods, 6) mean wrench of both fins in each period, in F_b [N, N m]."""
        return np.asarray(self.record.by_period(self.record.wrench).mean(axis=1))


@dataclasses.dataclass(frozen=True)
class Turning:
    """Both sets with the paper's number of chains, with few chains, and with twist stiffness and a body in water."""

    turns: tuple[Turn, ...]

    @classmethod
    def measure(
        cls, parameters: Parameters | None = None, periods: int = PERIODS, chains: tuple[int, ...] | None = None,
        done: Callable[[], object] = lambda: None,
    ) -> Turning:
        """Simulate both sets with each robot; `done` is called after each turn.

        By default the robots are the paper's, the same with few chains, and that of `IN_WATER`. With `chains`, they are
        the paper's with each of these numbers of chains.
        """
        default = (robot(parameters).fin.chains, FEW_CHAINS)
        robots = [robot(parameters, fin={'chains': number})
                  for number in dict.fromkeys(default if chains is None else chains)]
        if chains is None:
            robots.append(robot(Parameters().replace(**IN_WATER)))
        turns = []
        for one in robots:
            for name, (left, right) in TURNS.items():
                turns.append(Turn(name, record(one, left, right, periods)))
                done()
        return cls(tuple(turns))

    @property
    def by_robot(self) -> dict[str, list[Turn]]:
        """The turns of each robot by its description, in the order of the columns of the figures."""
        robots = dict.fromkeys(turn.robot for turn in self.turns)
        return {name: [turn for turn in self.turns if turn.robot == name] for name in robots}

    @property
    def by_chains(self) -> dict[int, list[Turn]]:
        """The turns of the paper's model for each number of chains."""
        return {turns[0].chains: turns for turns in self.by_robot.values() if not turns[0].in_water}

    @property
    def in_water(self) -> list[Turn]:
        """The turns with twist stiffness and a body in water; empty if they were not simulated."""
        return [turn for turn in self.turns if turn.in_water]

"""The track of a robot along a path: its errors, and a figure of both."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from manta_sim_ros.control.polyline import Polyline, Projection
from manta_sim_ros.dynamics import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SEARCHED = 3.0
"""Length of the path behind the last nearest point in which the next one is searched [m]."""

MOST_OF_THE_TIME = 95.0
"""Percentile of the errors."""


class Track:
    """Positions of a robot, measured against a path while they come.

    Parameters
    ----------
    path
        The path.

    """

    def __init__(self, path: Polyline) -> None:
        self.path = path
        self._rows: list[list[float]] = []

    def add(self, time: float, position: FloatArray) -> Projection:
        """Take a position (3,) [m], world frame, at a time [s], and return where it is relative to the path."""
        station = self._rows[-1][4] if self._rows else 0.0
        where = self.path.project(position, station, station + SEARCHED)
        self._rows.append([time, *position, *where])
        return where

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def table(self) -> FloatArray:
        """(n, 7) time [s], position [m], station, cross-track error and height error [m] of each position."""
        return np.array(self._rows).reshape(-1, 7)

    def __str__(self) -> str:
        """Return the errors in two lines."""
        time, _, _, _, station, cross_track, height = self.table.T
        return (f'{station[-1]:.1f} m of {self.path.length:.1f} m of the path in {time[-1] - time[0]:.1f} s\n'
                f'cross-track error: {within(cross_track)}; height error: {within(height)}')


def within(errors: FloatArray) -> str:
    """Return in words how large errors [m] are."""
    sizes = np.abs(errors)
    return (f'{np.percentile(sizes, MOST_OF_THE_TIME):.2f} m or less for {MOST_OF_THE_TIME:g} % of the time, '
            f'{sizes.max():.2f} m at most')


def draw(track: Track, file: Path) -> None:
    """Draw the path and the track from above, and the heights and the errors over time, into a PNG file."""
    from manta_sim_ros.figures.files import whole
    from manta_sim_ros.figures.style import save_png

    time, x, y, z, station, cross_track, height = track.table.T
    time = time - time[0]

    def panels(figure: Figure) -> None:
        axes = figure.subplot_mosaic([['top', 'height'], ['top', 'errors']], width_ratios=[1.2, 1.0])
        path_style: dict[str, Any] = {'color': '#444444', 'linestyle': '--'}
        axes['top'].plot(*track.path.waypoints.T[:2], **path_style, label='path')
        axes['top'].plot(x, y, label='track')
        axes['top'].plot(x[0], y[0], 'o', color='#0072b2', label='start')
        axes['top'].set(xlabel='x [m]', ylabel='y [m]', aspect='equal')
        axes['top'].margins(0.1)
        axes['height'].plot(time, [track.path.point(each)[2] for each in station], **path_style)
        axes['height'].plot(time, z)
        axes['height'].set(ylabel='height z [m]')
        axes['height'].sharex(axes['errors'])
        axes['errors'].plot(time, cross_track, label='cross-track', color='#d55e00')
        axes['errors'].plot(time, height, label='height', color='#009e73')
        axes['errors'].set(xlabel='time [s]', ylabel='error [m]')
        for name in ('top', 'errors'):
            axes[name].legend()

    with whole(file) as part:
        save_png(panels, part, height=4.0)

"""The plots of docs/control_report.md."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from evidence.control_report.conditions import CONDITIONS
from evidence.control_report.courses import COURSES
from evidence.control_report.steps import SETTLED, Step
from evidence.control_report.swims import Row, Swim, verdict
from manta_sim_ros.figures.style import legend_below

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STYLES = ('-', '--', ':')
"""Of the lines of each controller."""
POINTS = 400
"""Points at which a path is drawn."""


@dataclasses.dataclass(frozen=True)
class Tracks:
    """The tracks on each course from above, and the errors along it, with their bounds."""

    height = 11.0

    swims: Mapping[Row, Swim]
    """The first swim of each row of one robot."""

    def draw(self, figure: Figure) -> None:
        """Draw a row of panels for each course."""
        panels = figure.subplots(len(COURSES), 3, width_ratios=[1.0, 1.2, 1.2])
        for (name, course), (above, aside, height) in zip(COURSES.items(), panels, strict=True):
            points = np.array([course.path.point(station) for station in np.linspace(0.0, course.path.length, POINTS)])
            above.plot(points[:, 0], points[:, 1], color='0.0', linewidth=0.8)
            swims = {row: swim for row, swim in self.swims.items() if row.course == name}
            for row, swim in swims.items():
                flight, line = swim.flight, look(row, self.swims)
                before_end = flight.station < course.path.length
                above.plot(flight.position[:, 0], flight.position[:, 1], **line)
                aside.plot(flight.station[before_end], swim.error[before_end], **line)
                height.plot(flight.station[before_end], flight.height[before_end], **line)
            verdicts = [verdict(row, swim.result) for row, swim in swims.items()]
            for axes, bounds in ((aside, {one.bound for one in verdicts}), (height, {verdicts[0].height_bound})):
                for line_at in (sign * bound for bound in bounds for sign in (-1.0, 1.0)):
                    axes.axhline(line_at, color='0.0', linestyle=':', linewidth=0.8)
            if course.kept:  # a distance
                aside.set_ylim(bottom=0.0)
            above.set(ylabel=f'{name}\ny [m]')
            above.axis('equal')
            aside.set(ylabel='distance [m]' if course.kept else 'cross-track error [m]')
            height.set(ylabel='height error [m]')
        for axes, label in zip(panels[-1], ('x [m]', 'along the path [m]', 'along the path [m]'), strict=True):
            axes.set_xlabel(label)
        legend_below(figure, panels[0, 0].lines[1:], 4)


@dataclasses.dataclass(frozen=True)
class Steps:
    """The cross-track error after the step."""

    height = 2.8

    steps: Mapping[Row, Step]
    """The first swim of each row of one robot."""

    def draw(self, figure: Figure) -> None:
        """Draw one panel."""
        axes = figure.subplots()
        axes.axhspan(-SETTLED, SETTLED, color='0.9', linewidth=0.0)
        for row, one in self.steps.items():
            axes.plot(one.position[:, 0], one.position[:, 1], **look(row, self.steps))
        axes.set(xlabel='along the path after the step [m]', ylabel='cross-track error [m]')
        legend_below(figure, axes.lines, 4)


def look(row: Row, rows: Mapping[Row, object]) -> dict[str, Any]:
    """Return how the line of a row is drawn: a color for each condition, a style for each controller."""
    controllers = sorted({other.controller for other in rows})
    name = row.condition if len(controllers) == 1 else f'{row.condition}, {row.controller}'
    color, style = f'C{list(CONDITIONS).index(row.condition)}', STYLES[controllers.index(row.controller)]
    return {'color': color, 'linestyle': style, 'linewidth': 0.9, 'label': name}

"""The plots of docs/verification.md: functions that several sections share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from evidence.verification.claims import Section
from manta_sim_ros.figures.style import MARKERS, save_png

if TYPE_CHECKING:
    from matplotlib.axes import Axes

HEIGHT = 3.0  # [in]


def save(section: Section, path: Path) -> None:
    """Draw the section's plot into a PNG file."""
    assert section.draw is not None
    save_png(section.draw, path, HEIGHT)


def draw_convergence(
    axes: Axes, sizes: ArrayLike, errors: Mapping[str, Sequence[float]], orders: Mapping[str, int], *, label: str,
) -> None:
    """Plot errors against the step or mesh width on logarithmic axes, each with a line of its expected order."""
    widths = np.asarray(sizes, dtype=float)
    for marker, (name, values) in zip(MARKERS, errors.items(), strict=False):
        order = orders[name]
        drawn = axes.loglog(widths, values, marker, label=f'{name}; dashed: order {order}')[0]
        axes.loglog(widths, values[0] * (widths / widths[0]) ** order, '--', linewidth=0.9, color=drawn.get_color())
    mark(axes, sizes)
    axes.set_xlabel(label)
    axes.figure.legend(*axes.get_legend_handles_labels(), loc='outside lower center', ncols=2)


def mark(axes: Axes, sizes: ArrayLike) -> None:
    """Set the ticks of a logarithmic horizontal axis to the sizes that were measured, as plain numbers."""
    axes.set_xticks(sizes, [f'{size:g}' for size in np.asarray(sizes)])
    axes.minorticks_off()


def fitted_order(widths: ArrayLike, errors: ArrayLike) -> float:
    """Return p of error ~ width^p, fitted to the logarithms of all points."""
    return float(np.polyfit(np.log(np.asarray(widths, dtype=float)), np.log(np.asarray(errors, dtype=float)), 1)[0])

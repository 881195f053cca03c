"""One style for all plots of docs/verification.md, and the plots that several sections share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from verification.claims import Section

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIZE, RESOLUTION = (7.2, 3.0), 130.0  # [in], [1/in]: the width of a printed page
STYLE = {
    'font.size': 9.0, 'axes.grid': True, 'grid.alpha': 0.3, 'grid.linewidth': 0.5, 'lines.linewidth': 1.4,
    'lines.markersize': 4.5, 'legend.fontsize': 8.0, 'legend.framealpha': 0.9, 'axes.spines.top': False,
    'axes.spines.right': False,
    'axes.prop_cycle': "cycler('color', ['0072b2', 'd55e00', '009e73', 'cc79a7', 'e69f00', '444444'])",
}
"""Colours that stay apart in print and for colour-blind readers (Okabe and Ito)."""
MARKERS = 'os^DvP'


def save(section: Section, path: Path) -> None:
    """Draw the section's plot into a PNG file that is the same, byte for byte, whenever the data are."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    assert section.draw is not None
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=SIZE, dpi=RESOLUTION, layout='constrained')
        FigureCanvasAgg(figure)
        section.draw(figure)
        figure.savefig(path, metadata={'Software': None})


def draw_convergence(
    axes: Axes, sizes: ArrayLike, errors: Mapping[str, Sequence[float]], orders: Mapping[str, int], *, label: str,
) -> None:
    """Plot errors against step or mesh width, both logarithmic, each beside the slope of its expected order."""
    widths = np.asarray(sizes, dtype=float)
    for marker, (name, values) in zip(MARKERS, errors.items(), strict=False):
        order = orders[name]
        drawn = axes.loglog(widths, values, marker, label=f'{name}; dashed: order {order}')[0]
        axes.loglog(widths, values[0] * (widths / widths[0]) ** order, '--', linewidth=0.9, color=drawn.get_color())
    mark(axes, sizes)
    axes.set_xlabel(label)
    axes.figure.legend(*axes.get_legend_handles_labels(), loc='outside lower center', ncols=2)


def mark(axes: Axes, sizes: ArrayLike) -> None:
    """Put the ticks of a logarithmic horizontal axis at the sizes that were measured, as plain numbers."""
    axes.set_xticks(sizes, [f'{size:g}' for size in np.asarray(sizes)])
    axes.minorticks_off()


def fitted_order(widths: ArrayLike, errors: ArrayLike) -> float:
    """Return p of error ~ width^p, fitted to all points in logarithms."""
    return float(np.polyfit(np.log(np.asarray(widths, dtype=float)), np.log(np.asarray(errors, dtype=float)), 1)[0])

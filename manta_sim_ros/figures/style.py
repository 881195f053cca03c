"""One style for every plot of the project, which is legible in print and clear for color-blind readers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, BinaryIO

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

WIDTH, RESOLUTION = 7.2, 130.0  # [in], [1/in]; the width is that of a printed page
STYLE: dict[Any, Any] = {
    'font.size': 9.0, 'axes.grid': True, 'grid.alpha': 0.3, 'grid.linewidth': 0.5, 'lines.linewidth': 1.4,
    'lines.markersize': 4.5, 'legend.fontsize': 8.0, 'legend.framealpha': 0.9, 'axes.spines.top': False,
    'axes.spines.right': False,
    'axes.prop_cycle': "cycler('color', ['0072b2', 'd55e00', '009e73', 'cc79a7', 'e69f00', '444444'])",
}
"""The colors are those of Okabe and Ito."""
LEGEND_MARGIN = 0.02  # of the figure's height
MARKERS = 'os^DvP'


def legend_below(figure: Figure, lines: Sequence[Artist], columns: int) -> None:
    """Add a legend of lines below all axes of a figure."""
    legend = figure.legend(handles=lines, loc='lower center', ncols=columns)
    canvas: Any = figure.canvas
    height = legend.get_window_extent(canvas.get_renderer()).height / figure.bbox.height + LEGEND_MARGIN
    engine: Any = figure.get_layout_engine()
    engine.set(rect=(0.0, height, 1.0, 1.0 - height))


def save_png(draw: Callable[[Figure], None], target: Path | BinaryIO, height: float, width: float = WIDTH) -> None:
    """Draw a figure of a size [in] into a PNG file, which is the same byte for byte if the data are the same."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(width, height), dpi=RESOLUTION, layout='constrained')
        FigureCanvasAgg(figure)
        draw(figure)
        figure.savefig(target, format='png', metadata={'Software': None})

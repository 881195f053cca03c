"""Plots of the results of a study over the one or two quantities that it varies."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from manta_sim_ros.figures.files import whole
from manta_sim_ros.figures.style import save_png
from manta_sim_ros.studies.arguments import check_output
from manta_sim_ros.studies.study import Study, unit_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PLOTTED = {
    'thrust': 'thrust [N]', 'speed': 'speed [m/s]', 'yaw_rate': 'yaw rate [°/s]', 'power': 'power [W]',
    'cost_of_transport': 'cost of transport', 'strouhal': 'Strouhal number'}
"""Label of each result that is plotted."""


def check_plot(study: Study, path: Path) -> None:
    """Raise a ValueError if a study cannot be plotted to this file."""
    check_output('--plot', path, '.png')
    if len(study.names) > 2:
        raise ValueError(f'--plot takes one or two quantities, but {len(study.names)} are varied: '
                         f'{", ".join(study.names)}')
    for name, value in study.inputs(0).items():
        if not isinstance(value, (int, float)) or isinstance(value, bool):
            raise ValueError(f'--plot takes numbers only, but {name} is {value!r}')


def draw(study: Study, results: Mapping[str, Sequence[Any]], path: Path) -> None:
    """Plot the columns of results of a study to a PNG file; cases without a result are left out."""
    inputs = [np.array(results[name], dtype=float) for name in study.names]
    ticks = [np.unique(values) for values in inputs]
    order = np.lexsort(inputs)
    places = set(zip(*(values.tolist() for values in inputs), strict=True))
    is_grid = len(places) == len(order) == math.prod(map(len, ticks))  # each pair of values is a case, once
    labels = [f'{name} [{unit_of(name)}]' if unit_of(name) else name for name in study.names]

    def panels(figure: Figure) -> None:
        for axes, (name, label) in zip(figure.subplots(2, 3, sharex=True).flat, PLOTTED.items(), strict=True):
            values = np.array(results[name], dtype=float)  # None becomes NaN
            if len(inputs) == 1:
                axes.plot(inputs[0][order], values[order], marker='.')
                axes.set_ylabel(label)
                continue
            if is_grid:
                colors = axes.pcolormesh(*ticks, values[order].reshape(len(ticks[1]), -1), shading='nearest')
            else:
                colors = axes.scatter(*inputs, c=values)
            figure.colorbar(colors, ax=axes, label=label)
            axes.set_ylabel(labels[1])
        figure.supxlabel(labels[0], fontsize='medium')

    with whole(path) as part:
        save_png(panels, part, height=5.0, width=10.0)

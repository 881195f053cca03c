"""The command `report`: one page or picture of a swim that was recorded in a bag."""

from __future__ import annotations

import base64
import html
import importlib.resources
import json
import math
import string
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from manta_sim_ros.dynamics import FloatArray
from manta_sim_ros.figures.files import whole
from manta_sim_ros.studies.arguments import Parser, read_settings
from manta_sim_ros.studies.bag import check_new
from manta_sim_ros.studies.curves import Panel, facts, panels
from manta_sim_ros.studies.recorded_swim import Swim, read_swim
from manta_sim_ros.studies.scene import IntArray, Part, body, fins

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from plotly.graph_objects import Figure as Page

FRAME_RATE, MOST_FRAMES = 25.0, 500
"""Frames of the robot per second of the swim, and the most of them: fewer per second in a long swim."""
MOST_POINTS = 4000
"""Most points of a curve; of more, points at equal distances are drawn."""
COLORS = ('#0072b2', '#d55e00', '#009e73', '#cc79a7')
"""Of Okabe and Ito."""
BODY_COLOR, FIN_COLOR, WATER_COLOR = '#475c73', '#a8b5c2', '#eef3f7'
BENDING_COLORS = ((0.0, '#0072b2'), (0.5, '#d3dce4'), (1.0, '#d55e00'))
"""From fins that are bent down to fins that are bent up."""
REACH = 0.85
"""Half the size of the view of the robot [m]: from its center to the tip of a fin."""
MARGIN = 1.0
"""Space around the path [m]."""
PANEL_HEIGHT = 170
"""Height of a panel [px]."""
PRINT_HEIGHT = 13.0
"""Height of the picture for print [in]."""
PRINT_LEGEND: dict[str, Any] = {
    'loc': 'lower left', 'bbox_to_anchor': (-0.02, 0.96), 'ncols': 4, 'frameon': False, 'handlelength': 1.2,
    'columnspacing': 0.8, 'fontsize': 7.0}
"""One line below the title."""


def frame_times(swim: Swim) -> FloatArray:
    """Return the times (K,) of the frames [s]: states of the swim, about `FRAME_RATE` per second."""
    wanted = math.ceil((swim.time[-1] - swim.time[0]) * FRAME_RATE) + 1
    index = np.linspace(0, len(swim.time) - 1, min(wanted, MOST_FRAMES, len(swim.time)))
    return swim.time[np.unique(index.round().astype(int))]


def notes(swim: Swim) -> list[str]:
    """Return what the page lacks because the bag has no data of it, and how to record that."""
    joints, found = swim.joints, []
    if joints is None and swim.markers is None:
        found.append('The bag has no joint_states: rods, power and fins are missing.')
    elif joints is None:
        found.append('The bag has no joint_states: rods and power are missing. The fins are those of fin_markers.')
    elif joints.joint_angles is None and swim.markers is None:
        found.append('The bag has neither the joints of the fins nor fin_markers: the fins are drawn stiff. Record '
                     'with publish_fin_joints true (simulate --fin-joints).')
    elif joints.joint_angles is None:
        found.append('The bag has no joints of the fins: they are those of fin_markers, and have no colors.')
    if not len(swim.wrench):
        found.append('The bag has no fin_wrench.')
    if not len(swim.gaits):
        found.append('The bag has no fin_command: the gait is not known.')
    return found


def html_page(swim: Swim, name: str) -> str:
    """Return a page that needs no network: the robot in space, its path, and the curves, with one cursor in time.

    `name` says what the swim was read from.
    """
    from plotly.offline import get_plotlyjs

    times = frame_times(swim)
    parts = [body(), *fins(swim, times)]
    frames = np.searchsorted(swim.time, times)
    files = importlib.resources.files('manta_sim_ros.studies')
    values = {
        'title': 'A swim of the robotic manta',
        'source': html.escape(f'{name}, from {swim.time[0]:.2f} s to {swim.time[-1]:.2f} s, {len(times)} frames'),
        'facts': ''.join(f'<div><dt>{term}</dt><dd>{value}</dd></div>' for term, value in facts(swim).items()),
        'notes': ''.join(f'<p class="note">{html.escape(note)}</p>' for note in notes(swim)),
        'last': str(len(times) - 1), 'plotly': get_plotlyjs(), 'player': files.joinpath('player.js').read_text('utf-8'),
        'robot': _div(_robot_view(parts), 'robot'),
        'path': _div(_path_view(swim, parts, frames), 'path'),
        'curves': _div(_curves(swim), 'curves', buttons=False),
        'swim': json.dumps({
            'time': times.round(6).tolist(), 'gait': [_gait_at(swim, time) for time in times],
            'position': _encoded(swim.position[frames]),
            'rotation': _encoded(Rotation.from_quat(swim.orientation[frames]).as_matrix()),
            'parts': [{
                'count': part.points.shape[1], 'fixed': len(part.points) == 1, 'points': _encoded(part.points),
                'angles': None if part.angles is None else _encoded(part.angles)} for part in parts],
        }).replace('<', '\\u003c'),
    }
    return string.Template(files.joinpath('page.html').read_text('utf-8')).substitute(values)


def _encoded(values: FloatArray) -> str:
    return base64.b64encode(np.ascontiguousarray(values, np.float32).tobytes()).decode()


def _div(figure: Page, name: str, *, buttons: bool = True) -> str:
    return str(figure.to_html(
        full_html=False, include_plotlyjs=False, div_id=name,
        config={'displaylogo': False, 'responsive': True, 'displayModeBar': 'hover' if buttons else False}))


def _gait_at(swim: Swim, time: float) -> str:
    """Return the gait in force at a time in words."""
    index = np.searchsorted(swim.gait_time, time, side='right') - 1
    if index < 0:
        return 'no gait commanded' if len(swim.gaits) else ''
    amplitudes, frequencies, phases = swim.gaits[index].reshape(3, 2)
    parts = (('A', np.degrees(amplitudes), '°'), ('f', frequencies, ' Hz'), ('φ', np.degrees(phases), '°'))
    return 'left / right: ' + ', '.join(f'{name} {left:.3g} / {right:.3g}{unit}' for name, (left, right), unit in parts)


def _meshes(parts: Sequence[Part]) -> list[Any]:
    from plotly.graph_objects import Mesh3d

    lights = {'lighting': {'ambient': 0.55, 'diffuse': 0.6, 'specular': 0.15, 'roughness': 0.6},
              'lightposition': {'x': 1000, 'y': 600, 'z': 3000}, 'hoverinfo': 'skip'}
    largest = max([1.0, *(float(np.abs(part.angles).max()) for part in parts if part.angles is not None)])
    meshes = []
    for index, part in enumerate(parts):
        (x, y, z), (i, j, k) = part.points[0].T, part.triangles.T
        color: dict[str, Any] = {'color': FIN_COLOR if index else BODY_COLOR}
        if part.angles is not None:
            color = {'intensity': part.angles[0], 'colorscale': BENDING_COLORS, 'cmin': -largest, 'cmax': largest,
                     'showscale': index == 1, 'colorbar': {
                         'title': {'text': 'bending [deg]', 'side': 'right'}, 'thickness': 10, 'len': 0.8}}
        meshes.append(Mesh3d(x=x, y=y, z=z, i=i, j=j, k=k, **color, **lights))
    return meshes


def _axis(title: str, span: Sequence[float]) -> dict[str, Any]:
    return {'title': {'text': title}, 'range': list(span), 'backgroundcolor': WATER_COLOR, 'gridcolor': '#d3dce4',
            'showspikes': False}


def _robot_view(parts: Sequence[Part]) -> Page:
    from plotly.graph_objects import Figure

    figure = Figure(_meshes(parts))
    axes = {f'{name}axis': _axis('', (-REACH, REACH)) | {'showticklabels': False, 'dtick': 0.25} for name in 'xyz'}
    figure.update_layout(
        margin={'l': 0, 'r': 0, 't': 0, 'b': 0}, paper_bgcolor=WATER_COLOR, scene={
            **axes, 'aspectmode': 'cube', 'camera': {'eye': {'x': 0.4, 'y': -0.78, 'z': 0.46}}})
    return figure


def _path_view(swim: Swim, parts: Sequence[Part], frames: IntArray) -> Page:
    from plotly.graph_objects import Figure, Scatter3d

    (x, y, z), line = swim.position[frames].T, {'color': '#e69f00', 'width': 4}
    figure = Figure([
        *[mesh.update(showscale=False) for mesh in _meshes(parts)],
        Scatter3d(x=x, y=y, z=z, mode='lines', line=line, hoverinfo='skip', showlegend=False)])
    low, high = swim.position.min(axis=0) - MARGIN, swim.position.max(axis=0) + MARGIN
    size = (high - low) / (high - low).max()
    axes = {f'{name}axis': _axis(f'{name} [m]', span) for name, *span in zip('xyz', low, high, strict=True)}
    figure.update_layout(margin={'l': 0, 'r': 0, 't': 0, 'b': 0}, paper_bgcolor=WATER_COLOR, scene={
        **axes, 'aspectmode': 'manual', 'aspectratio': dict(zip('xyz', 1.6 * size, strict=True)),
        'camera': {'eye': {'x': -0.35, 'y': -1.0, 'z': 0.8}, 'center': {'x': 0, 'y': 0, 'z': -0.1}}})
    return figure


def _curves(swim: Swim) -> Page:
    from plotly.graph_objects import Scattergl
    from plotly.subplots import make_subplots

    found = panels(swim)
    figure = make_subplots(
        rows=len(found), cols=1, shared_xaxes=True, vertical_spacing=0.22 / len(found),
        subplot_titles=[_title(panel) for panel in found])
    for row, panel in enumerate(found, start=1):
        legend = f'legend{row}' if row > 1 else 'legend'
        for color, (name, (time, values)) in zip(COLORS, panel.curves.items(), strict=False):
            kept = slice(None, None, math.ceil(len(time) / MOST_POINTS))
            figure.add_trace(Scattergl(
                x=time[kept], y=values[kept], name=name, mode='lines', legend=legend,
                line={'color': color, 'width': 1.5, 'shape': 'hv' if panel.holds else 'linear'}), row, 1)
        top = figure.layout[f'yaxis{row if row > 1 else ""}'].domain[1]
        figure.update_layout({legend: {'x': 1.0, 'xanchor': 'right', 'y': top, 'yanchor': 'bottom', 'orientation': 'h',
                                       'bgcolor': 'rgba(0,0,0,0)', 'font': {'size': 11}}})
    begin = float(swim.time[0])
    figure.add_shape(type='line', xref='x', yref='paper', x0=begin, x1=begin, y0=0, y1=1, line={
        'color': '#1f2933', 'width': 1})
    figure.update_annotations(x=0, xanchor='left', font={'size': 13})
    figure.update_xaxes(range=[begin, float(swim.time[-1])])
    figure.update_xaxes(title_text='time [s]', row=len(found))
    figure.update_layout(
        template='plotly_white', height=PANEL_HEIGHT * len(found), hovermode='x unified', hoversubplots='axis',
        margin={'l': 56, 'r': 16, 't': 34, 'b': 44})
    return figure


def _title(panel: Panel) -> str:
    return f'{panel.title} [{panel.unit}]' if panel.unit else panel.title


def draw(swim: Swim, figure: Figure) -> None:
    """Draw the path from above and the curves of a swim for print, in a figure of Matplotlib."""
    found = panels(swim)
    rows = (len(found) + 2) // 2
    axes = figure.subplots(rows, 2).ravel()
    for axis, panel in zip(axes[1:], found, strict=False):
        for name, (time, values) in panel.curves.items():
            axis.plot(time, values, label=name, drawstyle='steps-post' if panel.holds else 'default')
        axis.set(xlabel='time [s]', xlim=(swim.time[0], swim.time[-1]))
        axis.set_title(_title(panel), loc='left', pad=15.0)
        axis.legend(**PRINT_LEGEND).set_in_layout(False)  # it may be wider than the axes
    axes[0].plot(swim.position[:, 0], swim.position[:, 1])
    axes[0].plot(*swim.position[0, :2], 'o')
    axes[0].set(xlabel='x [m]', ylabel='y [m]')
    axes[0].set_title('Path from above', loc='left')
    axes[0].axis('equal')
    for axis in axes[1 + len(found):]:
        axis.remove()


def write_report(swim: Swim, path: Path, name: str, kind: str = 'html') -> None:
    """Write the report of a swim into a new file: a page (`html`), or a picture for print (`png`).

    Raises
    ------
    ValueError
        The file exists.
    OSError
        It cannot be written; then there is no file.

    """
    check_new(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole(path) as part:
        if kind == 'html':
            part.write_text(html_page(swim, name), 'utf-8')
        else:
            from manta_sim_ros.figures.style import save_png

            save_png(lambda figure: draw(swim, figure), part, PRINT_HEIGHT)


def main(args: Sequence[str] | None = None) -> None:
    """Run the command; the exit status is 0, 1 after a failure, or 2 for wrong input."""
    parser = Parser(prog='report', description='Make one page of a swim that simulate or a recorder of the node wrote '
                                               'into a bag: the robot in space, its path, and its curves over time.')
    parser.add_argument('bag', type=Path, help='the directory of the bag, or its MCAP file')
    parser.add_argument('--output', type=Path, required=True, metavar='FILE', help='the new file')
    parser.add_argument('--format', choices=('html', 'png'), default='html',
                        help='a page for a browser, which needs no network, or a picture for print (default: html)')
    parser.add_argument('--config', type=Path, metavar='FILE',
                        help='the parameter file of the node that was recorded (default: what simulate wrote into the '
                             'bag, or the built-in values)')
    parser.add_argument('--namespace', metavar='NAMESPACE', help='the robot, where the bag has several')
    options = parser.parse_args(args)
    try:
        check_new(options.output)
        settings = None if options.config is None else read_settings(options.config)
        with warnings.catch_warnings():
            warnings.showwarning = lambda message, *_, **__: print(f'{parser.prog}: {message}', file=sys.stderr)
            swim = read_swim(options.bag, settings, options.namespace)
    except (OSError, ValueError) as error:
        parser.error(str(error))
    try:
        write_report(swim, options.output, str(options.bag), options.format)
    except OSError as error:
        sys.exit(f'{parser.prog}: {error}')

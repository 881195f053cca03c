"""Animations of the paper's gaits from rest: the robot with its fins, from a fixed and from a following camera."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from scipy.spatial.transform import Rotation

from manta_sim_ros.dynamics import FinCommand
from manta_sim_ros.figures.gaits import STRAIGHT, TURNS, robot
from manta_sim_ros.figures.record import record
from manta_sim_ros.figures.scene import COLOR_MAP, HUES, Scene
from manta_sim_ros.figures.style import STYLE

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from PIL.Image import Image


@dataclasses.dataclass(frozen=True)
class Animation:
    """The gait and the view of an animation."""

    name: str
    left: FinCommand
    right: FinCommand
    samples: int
    """Frames per flapping period."""
    azimuth: float
    """Direction of the fixed camera from the middle of the path, from the world's x axis toward y [degrees]."""
    zoom: float
    """Zoom of the fixed view in matplotlib."""

    @property
    def title(self) -> str:
        """The name and the gaits, as left / right where they differ."""
        amplitude, phase = (
            ' / '.join(dict.fromkeys(f'{math.degrees(getattr(fin, name)):.0f}°' for fin in (self.left, self.right)))
            for name in ('amplitude', 'phase'))
        return f'{self.name}:  A = {amplitude},  f = {self.left.frequency:g} Hz,  φ = {phase}'


ANIMATIONS = {
    'straight': Animation('Straight', STRAIGHT, STRAIGHT, 16, -55.0, 0.9),
    'turn_set_1': Animation('Turn, set 1 (left / right)', *TURNS['set 1'], 12, -52.0, 0.85),
    'turn_set_2': Animation('Turn, set 2 (left / right)', *TURNS['set 2'], 12, -52.0, 0.85),
}
"""By file name without its ending. All have 9.6 frames per second."""

FRAMES = 144
"""Number of frames of an animation, which are 15 s."""

SIZE, RESOLUTION = (9.0, 4.1), 100.0  # [in], [1/in]
SHADOW_COLOR, PATH_COLOR, GRID_COLOR = '0.86', '#d55e00', '0.78'
DEPTH, SPACING, SIGHT = 0.4, 0.25, 0.95
"""Depth of the floor below the world's origin, spacing of its grid, and radius of the following view [m]."""


def palette(scene: Scene) -> bytes:
    """Return the palette (red, green, blue) of a GIF: robot, color scale, grays, and the path's color up to white."""
    import matplotlib as mpl

    scale = mpl.colormaps[COLOR_MAP].resampled(HUES)(np.arange(HUES))[:, :3]
    grays = np.repeat(np.linspace(0.0, 1.0, 26)[:, None], 3, axis=1)
    path = 1.0 - np.linspace(0.2, 1.0, 5)[:, None] * (1.0 - np.array(mpl.colors.to_rgb(PATH_COLOR)))
    colors = np.concatenate([scale, grays, path, scene.colors.reshape(-1, 3)])
    return np.unique(np.round(255.0 * colors), axis=0).astype(np.uint8).tobytes()


class View:
    """The robot, its path and its shadow on a floor, in one 3D axes object."""

    def __init__(self, axes: Any, floor: float) -> None:
        from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection  # type: ignore[import-untyped]

        self.axes, self.floor = axes, floor
        axes.computed_zorder = False
        empty = np.zeros((1, 4, 3))
        self.grid = axes.add_collection3d(Line3DCollection(empty, colors=GRID_COLOR, linewidths=0.6, zorder=1))
        self.shadow = axes.add_collection3d(
            Poly3DCollection(empty, facecolors=SHADOW_COLOR, linewidths=0.0, antialiaseds=False, zorder=2))
        self.path, = axes.plot([], [], [], color=PATH_COLOR, linewidth=1.6, zorder=3)
        self.robot = axes.add_collection3d(Poly3DCollection(empty, linewidths=0.4, zorder=4))

    def show(self, scene: Scene, frame: int) -> None:
        """Show the robot, its shadow and its path up to a frame."""
        self.robot.set_verts(scene.faces[frame])
        self.robot.set_facecolor(scene.colors[frame])
        self.robot.set_edgecolor(scene.colors[frame])
        self.shadow.set_verts(scene.faces[frame] * (1.0, 1.0, 0.0) + (0.0, 0.0, self.floor))
        self.path.set_data_3d(*scene.record.position[:frame + 1].T)

    def follow(self, scene: Scene, frame: int) -> None:
        """Move the camera behind the robot, a little to its left and above, and the floor's grid below the robot."""
        heading = Rotation.from_quat(scene.record.orientation[frame]).as_euler('ZYX', degrees=True)[0]
        self.axes.view_init(elev=24.0, azim=heading + 208.0)
        middle = scene.record.position[frame] * (1.0, 1.0, 0.0)
        self.axes.set(**{f'{x}lim': (at - SIGHT, at + SIGHT) for x, at in zip('xyz', middle, strict=True)})
        segments = []
        for i in (0, 1):
            lines = np.arange(np.ceil((middle[i] - SIGHT) / SPACING), (middle[i] + SIGHT) / SPACING) * SPACING
            ends = np.full((len(lines), 2, 3), self.floor)
            ends[..., i] = lines[:, None]
            half = np.sqrt(SIGHT**2 - (lines - middle[i])**2)
            ends[..., 1 - i] = middle[1 - i] + np.stack([-half, half], axis=1)
            segments.append(ends)
        self.grid.set_segments(np.concatenate(segments))


def stage(figure: Figure, animation: Animation, scene: Scene) -> tuple[View, View]:
    """Add the views, the color scale and the texts to a figure; return its fixed and its following view."""
    import matplotlib as mpl
    from matplotlib.ticker import MaxNLocator

    low, high = scene.faces.min(axis=(0, 1, 2)) - 0.1, scene.faces.max(axis=(0, 1, 2)) + 0.1
    low[2] = -DEPTH
    fixed: Any = figure.add_axes((-0.02, -0.07, 0.5, 1.10), projection='3d')
    for axis, start, end, pad in zip(
            (fixed.xaxis, fixed.yaxis, fixed.zaxis), low, high, (14.0, 8.0, 4.0), strict=True):
        axis.axes.set(**{f'{axis.axis_name}lim': (start, end)})
        axis.set_label_text(f'{axis.axis_name} [m]')
        axis.labelpad = pad
        axis.set_major_locator(MaxNLocator(3 if axis is fixed.zaxis else 6, steps=[1, 2, 5, 10]))
    fixed.set_box_aspect(high - low, zoom=animation.zoom)
    fixed.view_init(elev=30.0, azim=animation.azimuth)
    following: Any = figure.add_axes((0.5, -0.06, 0.5, 1.10), projection='3d')
    following.set_box_aspect((1.0, 1.0, 1.0), zoom=1.88)
    following.set_axis_off()
    fixed.set_zorder(1.0)  # its labels are drawn over the following view
    fixed.patch.set_visible(False)
    colors = mpl.cm.ScalarMappable(
        mpl.colors.Normalize(-scene.height, scene.height), mpl.colormaps[COLOR_MAP].resampled(HUES))
    figure.colorbar(colors, cax=figure.add_axes((0.56, 0.89, 0.16, 0.024)), orientation='horizontal')
    figure.text(0.74, 0.88, 'height of the fins, body frame [m]', fontsize=9.0)
    figure.text(0.03, 0.945, animation.title, fontsize=11.0)
    figure.text(0.03, 0.88, 'path of the center of mass', color=PATH_COLOR, fontsize=9.0)
    return View(fixed, low[2]), View(following, -DEPTH)


def pictures(animation: Animation, scene: Scene, frames: int, done: Callable[[], object]) -> Iterator[Image]:
    """Yield the frames; `done` is called after each."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    figure = Figure(figsize=SIZE, dpi=RESOLUTION)
    canvas: Any = FigureCanvasAgg(figure)
    fixed, following = stage(figure, animation, scene)
    clock = figure.text(0.96, 0.945, '', ha='right', fontsize=11.0)
    colors = Image.new('P', (1, 1))
    colors.putpalette(palette(scene))
    for frame in range(frames):
        fixed.show(scene, frame)
        following.show(scene, frame)
        following.follow(scene, frame)
        clock.set_text(f't = {scene.record.time[frame]:.2f} s')
        canvas.draw()
        picture = Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])
        yield picture.quantize(palette=colors, dither=Image.Dither.NONE)
        done()


def animate(
    name: str, target: Path | BinaryIO, done: Callable[[], object] = lambda: None, frames: int = FRAMES,
) -> None:
    """Write an animation as a GIF that plays in real time; `done` is called after each frame.

    Raises
    ------
    ValueError
        There is no animation of that name.

    """
    import matplotlib as mpl

    if name not in ANIMATIONS:
        raise ValueError(f'{name!r} is not an animation; the animations are {", ".join(ANIMATIONS)}')
    animation = ANIMATIONS[name]
    states = record(robot(), animation.left, animation.right, math.ceil(frames / animation.samples), animation.samples)
    ends = 10 * np.round(100.0 * states.time[:frames]).astype(int)  # [ms]; a GIF counts hundredths of a second
    with mpl.rc_context(STYLE):
        images = pictures(animation, Scene.of(states), frames, done)
        next(images).save(target, format='GIF', save_all=True, append_images=images, loop=0,
                          duration=np.diff(ends, prepend=0).tolist())

"""The command `paper_figures`: measures, draws and animates what the paper shows."""

from __future__ import annotations

import argparse
import errno
import functools
import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

from manta_sim_ros.dynamics import compile_kernels
from manta_sim_ros.figures import figure_8, figure_9
from manta_sim_ros.figures.animation import ANIMATIONS, FRAMES, animate
from manta_sim_ros.figures.figure_7 import Figure7
from manta_sim_ros.figures.figure_8 import Figure8
from manta_sim_ros.figures.figure_9 import Figure9
from manta_sim_ros.figures.figure_10 import Figure10
from manta_sim_ros.figures.figure_11 import Figure11
from manta_sim_ros.figures.files import clear_abandoned, whole, write_csv
from manta_sim_ros.figures.gaits import TURNS, robot
from manta_sim_ros.figures.jobs import Done, Job, run_jobs, say
from manta_sim_ros.figures.style import save_png
from manta_sim_ros.figures.turning import Turning

FIGURES = ('figure_7', 'figure_8', 'figure_9', 'figure_10', 'figure_11')
NAMES = (*FIGURES, *ANIMATIONS)
DIRECTORY = 'paper_figures'


def _figure_7(done: Done) -> dict[str, Any]:
    figure = Figure7.measure()
    done()
    return {'figure_7': figure}


def _figure_8(done: Done) -> dict[str, Any]:
    return {'figure_8': Figure8.measure(done=done)}


def _figure_9(done: Done) -> dict[str, Any]:
    return {'figure_9': Figure9.measure(done=done)}


def _turns(done: Done) -> dict[str, Any]:
    turning = Turning.measure(done=done)
    return {'figure_10': Figure10(turning), 'figure_11': Figure11(turning)}


class Measurement(NamedTuple):
    """Something that is measured at a time."""

    names: tuple[str, ...]
    """The figures that it gives."""
    parts: int
    measure: Callable[[Done], dict[str, Any]]


_MEASUREMENTS = (  # those that take longest first, or a core is idle at the end
    Measurement(
        ('figure_8',), len(figure_8.FREQUENCIES) * (len(figure_8.AMPLITUDES) + len(figure_8.PHASES)), _figure_8),
    Measurement(('figure_10', 'figure_11'), 2 * len(TURNS), _turns),
    Measurement(('figure_9',), len(figure_9.AMPLITUDES), _figure_9),
    Measurement(('figure_7',), 1, _figure_7),
)


def _write_figures(
    measure: Callable[[Done], dict[str, Any]], wanted: Sequence[str], directory: Path, done: Done,
) -> dict[str, Any]:
    figures = measure(done)
    for name in wanted:
        with whole(directory / f'{name}.csv') as path:
            write_csv(figures[name].columns(), path)
        with whole(directory / f'{name}.png') as path:
            save_png(figures[name].draw, path, figures[name].height)
    return figures


def _write_animation(name: str, directory: Path, done: Done) -> dict[str, Any]:
    with whole(directory / f'{name}.gif') as path:
        animate(name, path, done)
    return {}


def figure_jobs(directory: Path, wanted: Sequence[str] = NAMES) -> list[Job]:
    """Return the jobs that write what is `wanted` of NAMES into a directory that is there.

    Figures become a PNG and a CSV each, and are the jobs' results: a dictionary by their names. Animations become GIFs.
    A file that is there already is replaced when its like is ready.

    Raises
    ------
    ValueError
        A name is unknown.

    """
    unknown = [name for name in wanted if name not in NAMES]
    if unknown:
        raise ValueError(f'{unknown[0]!r} is no figure or animation; there are {", ".join(NAMES)}')
    jobs = [Job(f'{name}.gif', FRAMES, functools.partial(_write_animation, name, directory))
            for name in ANIMATIONS if name in wanted]
    for names, parts, measure in _MEASUREMENTS:
        asked = [name for name in names if name in wanted]
        if asked:
            files = ', '.join(f'{name}.png, {name}.csv' for name in asked)
            jobs.append(Job(files, parts, functools.partial(_write_figures, measure, asked, directory)))
    return jobs


def made_directory(path: Path) -> Path:
    """Make a directory and those above it, if need be, and return it.

    Raises
    ------
    OSError
        It cannot be made, or not be written to; names it.

    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(path)) from None
    with tempfile.TemporaryFile(dir=path):  # fails where nothing can be written, whoever runs this
        return path


def main(args: Sequence[str] | None = None) -> None:
    """Run the command; exit with status 0, 1 when something fails, 2 for wrong arguments, 130 after Ctrl-C."""
    options = _parser().parse_intermixed_args(args)
    for ending in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(ending, _interrupt)
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')  # of the processes that are started: one thread each
    start = time.monotonic()
    try:
        directory = made_directory(options.output)
        clear_abandoned(directory)
        compile_kernels(robot(), lambda line: print(line, file=sys.stderr))
        jobs = figure_jobs(directory, options.names or NAMES)
        run_jobs(jobs, options.processes)
    except KeyboardInterrupt:
        print('paper_figures: interrupted; files that were finished stay', file=sys.stderr)
        sys.exit(130)
    except BrokenExecutor:
        sys.exit('paper_figures: one of its processes was killed (out of memory?); files that were finished stay')
    except OSError as error:
        sys.exit(f'paper_figures: {error}')
    finally:
        clear_abandoned(options.output)
    count = sum(job.name.count(',') + 1 for job in jobs)
    say(f'{count} files in {directory}, {time.monotonic() - start:.0f} s')


def _interrupt(signum: int, frame: FrameType | None) -> None:
    for ending in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):  # nothing interrupts the end
        signal.signal(ending, signal.SIG_IGN)
    raise KeyboardInterrupt


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='paper_figures',
        description='Draw the results of Qu et al., J. Mar. Sci. Eng. 2024, 12, 292, as this simulator has them: '
                    'Figures 7 to 11 as PNG with their data as CSV, and an animation of each gait as GIF.')
    parser.add_argument('names', nargs='*', metavar='NAME', type=_name, help=f'what to make, by default all: '
                        f'{", ".join(NAMES)}')
    parser.add_argument('-o', '--output', type=_directory, default=Path(DIRECTORY),
                        metavar='DIRECTORY',
                        help='where to write, made if it is not there (default: %(default)s)')
    parser.add_argument('-j', '--processes', type=_count, default=None, metavar='N',
                        help='how many to make at a time (default: as many as there are cores)')
    return parser


def _name(text: str) -> str:
    if text not in NAMES:
        raise argparse.ArgumentTypeError(f'{text!r} is none of {", ".join(NAMES)}')
    return text


def _directory(text: str) -> Path:
    if not text:
        raise argparse.ArgumentTypeError('it is empty, but must be the name of a directory')
    return Path(text)


def _count(text: str) -> int:
    try:
        count = int(text)
    except ValueError:
        count = 0
    if count < 1:
        raise argparse.ArgumentTypeError(f'{text!r} is no whole number from 1')
    return count

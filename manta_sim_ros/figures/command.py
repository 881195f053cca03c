"""The command `paper_figures`: it measures, draws and animates the paper's numerical examples."""

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
from manta_sim_ros.signals import ENDING, ignore_endings, on_ending

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
    """One measurement, which gives one or more figures."""

    names: tuple[str, ...]
    """Names of the figures."""
    parts: int
    """Number of calls of `done`."""
    measure: Callable[[Done], dict[str, Any]]


_MEASUREMENTS = (  # the longest first, so that no core is idle at the end
    Measurement(
        ('figure_8',), len(figure_8.FREQUENCIES) * (len(figure_8.AMPLITUDES) + len(figure_8.PHASES)), _figure_8),
    Measurement(('figure_10', 'figure_11'), 3 * len(TURNS), _turns),
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
    """Return the jobs that write the `wanted` figures and animations of NAMES into an existing directory.

    Each figure becomes a PNG and a CSV file, and each animation becomes a GIF file. The result of a job is a dictionary
    of its figures by their names. An existing file is replaced when the new one is complete.

    Raises
    ------
    ValueError
        A name is not one of NAMES.

    """
    unknown = [name for name in wanted if name not in NAMES]
    if unknown:
        raise ValueError(f'{unknown[0]!r} is neither a figure nor an animation; the names are {", ".join(NAMES)}')
    jobs = [Job(f'{name}.gif', FRAMES, functools.partial(_write_animation, name, directory))
            for name in ANIMATIONS if name in wanted]
    for names, parts, measure in _MEASUREMENTS:
        asked = [name for name in names if name in wanted]
        if asked:
            files = ', '.join(f'{name}.png, {name}.csv' for name in asked)
            jobs.append(Job(files, parts, functools.partial(_write_figures, measure, asked, directory)))
    return jobs


def made_directory(path: Path) -> Path:
    """Make a directory and its parents where they do not exist, and return it.

    Raises
    ------
    OSError
        The directory cannot be made, or cannot be written to; the error names it.

    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(path)) from None
    with tempfile.TemporaryFile(dir=path):  # fails if the directory cannot be written to, for any user
        return path


def main(args: Sequence[str] | None = None) -> None:
    """Run the command; the exit status is 0, 1 after a failure, 2 for wrong arguments, or 130 after Ctrl-C."""
    options = _parser().parse_intermixed_args(args)
    for ending in ENDING:
        signal.signal(ending, _interrupt)
    on_ending(None)
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')  # one thread in each process that is started
    start = time.monotonic()
    try:
        directory = made_directory(options.output)
        clear_abandoned(directory)
        compile_kernels(robot(), lambda line: say(line, sys.stderr))
        jobs = figure_jobs(directory, options.names or NAMES)
        run_jobs(jobs, options.processes)
    except KeyboardInterrupt:
        say('paper_figures: interrupted; finished files are kept', sys.stderr)
        sys.exit(130)
    except BrokenExecutor:
        sys.exit('paper_figures: one of its processes was killed (out of memory?); finished files are kept')
    except OSError as error:
        sys.exit(f'paper_figures: {error}')
    finally:
        clear_abandoned(options.output)
    count = sum(job.name.count(',') + 1 for job in jobs)
    say(f'{count} files were written to {directory} in {time.monotonic() - start:.0f} s')


def _interrupt(signum: int, frame: FrameType | None) -> None:
    ignore_endings()  # further signals
    raise KeyboardInterrupt


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='paper_figures',
        description='Draw the results of Qu et al., J. Mar. Sci. Eng. 2024, 12, 292, with this simulator: Figures 7 to '
                    '11 as PNG files with their data as CSV files, and an animation of each gait as a GIF file.')
    parser.add_argument('names', nargs='*', metavar='NAME', type=_name,
                        help=f'the figures and animations to make (default: all of {", ".join(NAMES)})')
    parser.add_argument('-o', '--output', type=_directory, default=Path(DIRECTORY),
                        metavar='DIRECTORY',
                        help='the directory to write to, which is made if necessary (default: %(default)s)')
    parser.add_argument('-j', '--processes', type=_count, default=None, metavar='N',
                        help='the number of processes that run at the same time (default: the number of cores)')
    return parser


def _name(text: str) -> str:
    if text not in NAMES:
        raise argparse.ArgumentTypeError(f'{text!r} is not one of {", ".join(NAMES)}')
    return text


def _directory(text: str) -> Path:
    if not text:
        raise argparse.ArgumentTypeError('the name of the directory is empty')
    return Path(text)


def _count(text: str) -> int:
    try:
        count = int(text)
    except ValueError:
        count = 0
    if count < 1:
        raise argparse.ArgumentTypeError(f'{text!r} is not a whole number greater than 0')
    return count

"""The executables. Ctrl-C, SIGTERM and SIGHUP end them at any time without a traceback, nodes with status 0.

Signals are heard before the imports begin, which take a second or two. When the reader of the output ends first, as
`head` does, they end quietly with status 0. When the output cannot be written, one line says why, with status 1.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys

from manta_sim_ros.signals import on_ending

NEEDS_ROS = 'ROS 2, which is not installed or not sourced: source its setup file first'
NEEDS_CONTROL = "the extra 'control': pip install 'manta_sim_ros[control]'"
NEEDS_STUDIES = "the extra 'studies': pip install 'manta_sim_ros[studies]'"
NEEDS_LEARN = "the extra 'learn': pip install 'manta_sim_ros[learn]'"
NEEDS_FIGURES = "the extra 'figures': pip install 'manta_sim_ros[figures]'"


def sim_node() -> None:
    """Run the simulator."""
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')  # for small matrices, threads cost time
    _run('nodes.sim_node', NEEDS_ROS)


def gait_node() -> None:
    """Run the example controller."""
    _run('nodes.gait_node', NEEDS_ROS)


def monitor_node() -> None:
    """Run the monitor."""
    _run('nodes.monitor_node', NEEDS_ROS)


def path_follower() -> None:
    """Follow a path."""
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    _run('nodes.path_follower', NEEDS_ROS)


def mpc_follower() -> None:
    """Follow a path with a plan of the gaits."""
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    _run('nodes.mpc_follower', f'{NEEDS_CONTROL}; and {NEEDS_ROS}', packages=('casadi',))


def averaged_model() -> None:
    """Fit the averaged model of mpc_follower."""
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    _run('control.model_fit', NEEDS_STUDIES, interrupted=130)


def path_gains() -> None:
    """Compute the gains of the path follower."""
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    _run('control.design', NEEDS_STUDIES, interrupted=130)


def teleop() -> None:
    """Drive the robot by hand."""
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    _run('nodes.teleop', NEEDS_ROS)


def track_node() -> None:
    """Record and draw a swim along a path."""
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    _run('nodes.track_node', f'{NEEDS_FIGURES}; and {NEEDS_ROS}', packages=('matplotlib',))


def paper_figures() -> None:
    """Draw the figures of the paper."""
    _run('figures.command', NEEDS_FIGURES, packages=('matplotlib', 'PIL', 'tqdm'), interrupted=130)


def simulate() -> None:
    """Simulate a swim into a bag."""
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    _run('studies.simulate', f'{NEEDS_STUDIES}; and {NEEDS_ROS}', packages=('mcap', 'rosbags', 'tqdm'), interrupted=130)


def linearize() -> None:
    """Linearize the motion of the body about a cruise or a turn."""
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    _run('studies.linearize', NEEDS_STUDIES, interrupted=130)


def sweep() -> None:
    """Simulate many cases of a study."""
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    _run('studies.sweep', NEEDS_STUDIES, packages=('pyarrow', 'tqdm'), interrupted=130)


def report() -> None:
    """Make a page of a swim in a bag."""
    _run('studies.report', NEEDS_STUDIES, packages=('matplotlib', 'mcap', 'plotly', 'rosbags'), interrupted=130)


def identify() -> None:
    """Fit parameters of the model to measured runs."""
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    _run('studies.identify', NEEDS_STUDIES, packages=('matplotlib', 'mcap', 'rosbags', 'tqdm'), interrupted=130)


def train_policy() -> None:
    """Train a policy for the environment of Gymnasium."""
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    _run('learning.command', NEEDS_LEARN, packages=('cma',), interrupted=130)


def _run(module: str, needs: str, packages: tuple[str, ...] = (), interrupted: int = 0) -> None:
    """Run `main` of a module; a package that is missing ends the process with one line that says what is needed.

    `packages` are those that the module imports only when it needs them.
    """
    name = os.path.basename(sys.argv[0])
    on_ending(lambda: os._exit(interrupted))  # nothing has begun yet; `main` takes over
    try:
        for package in packages:
            if importlib.util.find_spec(package) is None:
                raise ModuleNotFoundError(name=package)
        main = importlib.import_module(f'manta_sim_ros.{module}').main
    except ModuleNotFoundError as error:
        sys.exit(f'{name}: there is no module {error.name}; {name} needs {needs}')
    try:
        try:
            main()
        finally:
            if sys.stdout is not None:  # it was closed
                sys.stdout.flush()
    except OSError as error:
        if sys.stdout is not None:
            with open(os.devnull, 'w') as nowhere:  # else Python would try again at its end, and complain
                os.dup2(nowhere.fileno(), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):
            sys.exit(f'{name}: {error}')

"""Parameters, gaits and states that several tests share, and the comparison of states bit by bit."""

import dataclasses
import math
import os
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np

import manta_sim_ros
from manta_sim_ros.dynamics import DivergenceError, FinCommand, Parameters, Simulator, StabilityWarning, State

PACKAGE_ROOT = Path(manta_sim_ros.__file__).parents[1]
"""Where this process imports the package from: the sources, or the place where it is installed."""

SWIM = FinCommand(amplitude=0.7, frequency=0.6, phase=0.7)
TURN = FinCommand(amplitude=0.35, frequency=0.8, phase=0.2, front_bias=0.1, rear_bias=-0.05)
STATE_FIELDS = tuple(field.name for field in dataclasses.fields(State))
MIRROR = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])  # of a twist or wrench at the plane y = 0


def variant(parameters=None, **groups):
    """Return `parameters` (default: the defaults) with some values replaced: `variant(fin={'chains': 4})`."""
    parameters = Parameters() if parameters is None else parameters
    return dataclasses.replace(parameters, **{
        name: dataclasses.replace(getattr(parameters, name), **values) for name, values in groups.items()})


def sized(chains, links, **groups):
    return variant(variant(**groups), fin={'chains': chains, 'links': links})


def any_moment(parameters, seed):
    """Return rod motion, joint angles and rates, body twist and acceleration, larger than a robot has them."""
    random = np.random.default_rng(seed)
    joints = (parameters.fin.chains, parameters.fin.links)
    return (
        random.uniform(-1.0, 1.0, (2, 3)) * [0.7, 4.0, 30.0],
        random.uniform(-0.6, 0.6, joints),
        random.uniform(-4.0, 4.0, joints),
        random.uniform(-1.0, 1.0, 6),
        random.uniform(-5.0, 5.0, 6),
    )


def largest_rate(parameters, time_step, left, right, duration=4.0):
    """Return the largest joint rate [rad/s] of a simulation from rest; infinite when it diverges."""
    simulator = Simulator(variant(parameters, solver={'time_step': time_step}))
    largest = 0.0
    try:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore', StabilityWarning)
            simulator.command(left=left, right=right)
        together = max(1, round(0.005 / time_step))
        for _ in range(round(duration / (together * time_step))):
            largest = max(largest, float(np.abs(simulator.advance(together * time_step).joint_rates).max()))
    except DivergenceError:
        return math.inf
    return largest


def assert_close(actual, desired, relative):
    """Compare with a tolerance relative to the largest entry."""
    np.testing.assert_allclose(actual, desired, rtol=0.0, atol=relative * np.max(np.abs(desired)))


def bits(state):
    """Return the bytes of every field of a state."""
    return {name: np.asarray(getattr(state, name)).tobytes() for name in STATE_FIELDS}


def assert_same_bits(one, other):
    different = [name for name, value in bits(one).items() if value != bits(other)[name]]
    assert not different


def run_python(code, folder, *arguments, package_root=PACKAGE_ROOT, **variables):
    """Run code in a new process whose working directory is `folder`, and return the finished process."""
    paths = [str(package_root), *filter(None, [os.environ.get('PYTHONPATH')])]
    return subprocess.run(
        [sys.executable, '-c', code, *map(str, arguments)], cwd=folder, check=True, capture_output=True, text=True,
        timeout=300, env={**os.environ, 'PYTHONPATH': os.pathsep.join(paths), **variables})

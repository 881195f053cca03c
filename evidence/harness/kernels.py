"""Compile all kernels of the installed package side by side, so that no two processes of the tests compile the same.

To be run as a file: with `-m`, Python would import the package from the source tree.
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor

import numpy as np

from manta_sim_ros.dynamics import MONOLITHIC, Parameters, State, compile_kernels, fin_dynamics, simulate_batch

SMALL = Parameters().replace(fin={'chains': 2, 'links': 1})
TOGETHER = SMALL.replace(solver={'coupling': MONOLITHIC})


def batch() -> None:
    """Compile what advances several robots together."""
    simulate_batch(SMALL, [State.at_rest(SMALL)] * 8, None, 0.01)


def advance_together() -> None:
    """Compile the monolithic coupling."""
    compile_kernels(TOGETHER, print)


def advance() -> None:
    """Compile the sequential coupling."""
    compile_kernels(SMALL, print)


def evaluate_together() -> None:
    """Compile one fin of the monolithic coupling."""
    _evaluate(TOGETHER)


def evaluate() -> None:
    """Compile one fin of the sequential coupling."""
    _evaluate(SMALL)


def _evaluate(parameters: Parameters) -> None:
    joints = np.zeros((parameters.fin.chains, parameters.fin.links))
    fin_dynamics(parameters, 0, np.zeros((2, 3)), joints, joints, np.zeros(6), np.zeros(6))


if __name__ == '__main__':
    with ProcessPoolExecutor() as pool:
        compiling = [pool.submit(each) for each in (batch, advance_together, advance, evaluate_together, evaluate)]
        for each in compiling:
            each.result()

"""Kernels are compiled once, said so once, kept on disk, and never used when any source of them has changed."""

import logging
import re
import shutil

import numba
import numpy as np
import pytest

from manta_sim_ros.dynamics import Simulator, compilation, fin_dynamics, gait, monolithic, sequential
from manta_sim_ros.dynamics.compilation import entry_kernel, source_digest
from scenarios import PACKAGE_ROOT, SWIM, TURN, run_python, sized

ANNOUNCEMENT = 'compiling the dynamics for this machine'

EVALUATE = """
import numpy as np
from manta_sim_ros.dynamics import Parameters, Simulator, fin_dynamics, simulator

moment = np.full((30, 3), 0.1)
accelerations, wrench = fin_dynamics(Parameters(), 0, np.ones((2, 3)), moment, moment, np.ones(6), np.ones(6))
Simulator().advance(0.0)
print(simulator.__file__)
print((accelerations.tobytes() + wrench.tobytes()).hex())
"""


@pytest.fixture
def copied_package(tmp_path):
    """Return the folder of a copy of the package without anything compiled."""
    shutil.copytree(
        PACKAGE_ROOT / 'manta_sim_ros', tmp_path / 'manta_sim_ros', ignore=shutil.ignore_patterns('__pycache__'))
    return tmp_path


def evaluate(folder):
    """Return the bytes that a new process computes with the package in `folder`, and how often it says it compiles."""
    process = run_python(EVALUATE, folder, package_root=folder, NUMBA_CACHE_DIR=str(folder / 'kernels'))
    path, result = process.stdout.split()
    assert path.startswith(str(folder))
    return result, process.stderr.count(ANNOUNCEMENT)


def test_kernels_are_compiled_once_and_again_only_when_a_source_has_changed(copied_package):
    first, announced = evaluate(copied_package)
    assert announced == 1  # several kernels, one line
    second, announced = evaluate(copied_package)
    assert (second, announced) == (first, 0)

    # fin.py holds no entry point: Numba alone would not look at it. One byte of it, the inertia of a rod
    source = copied_package / 'manta_sim_ros' / 'dynamics' / 'fin.py'
    text = source.read_text(encoding='utf-8')
    changed = re.sub(r'/ 12\.0', '/ 13.0', text)
    assert changed != text
    source.write_text(changed, encoding='utf-8')
    third, announced = evaluate(copied_package)
    assert third != first and announced == 1


def test_the_digest_changes_with_every_source(copied_package):
    digest_here = 'from manta_sim_ros.dynamics.compilation import source_digest; print(source_digest())'

    def digest():
        return run_python(digest_here, copied_package, package_root=copied_package).stdout.strip()

    folder = copied_package / 'manta_sim_ros' / 'dynamics'
    seen = [digest()]
    assert seen[0] == source_digest()  # it depends on contents, not on the place
    for name in ('fin.py', 'articulated.py', 'geometry.py', 'actuation.py', 'gait.py', 'body.py', 'coupling.py'):
        assert (folder / name).is_file()
        with (folder / name).open('a', encoding='utf-8') as file:
            file.write('\n')
        seen.append(digest())
    assert len(set(seen)) == len(seen)


def test_a_place_that_cannot_be_written_to_costs_a_warning_only(monkeypatch, caplog):
    compiled = numba.njit

    def no_place(*args, cache=False, **options):
        if cache:
            raise RuntimeError('cannot cache function: no locator available')
        return compiled(*args, **options)

    monkeypatch.setattr(compilation.numba, 'njit', no_place)
    with caplog.at_level(logging.WARNING, logger='manta_sim_ros'):
        double = entry_kernel(lambda x: 2.0 * x)
    assert double(1.5) == 3.0
    assert 'no locator available' in caplog.text and 'each start compiles them again' in caplog.text


@pytest.mark.parametrize('coupling', [sequential, monolithic])
def test_arrays_of_a_state_are_taken_without_compiling_anew(coupling):
    simulator = Simulator(sized(4, 2, solver={'coupling': coupling.__name__.rpartition('.')[2]}))
    simulator.command(left=SWIM, right=TURN)
    state = simulator.advance(0.2)
    kernels = (gait._transition_kernel, coupling.evaluate_kernel, coupling.advance_kernel)
    flat, still = np.zeros((4, 2)), np.zeros(6)
    fin_dynamics(simulator.parameters, 0, np.zeros((2, 3)), flat, flat, still, still)
    before = [kernel.signatures for kernel in kernels]
    assert all(before)
    fin_dynamics(
        simulator.parameters, 1, np.zeros((2, 3)), state.joint_angles[1], state.joint_rates[1], state.twist,
        state.acceleration)
    Simulator(simulator.parameters, state=state).advance(0.2)
    assert [kernel.signatures for kernel in kernels] == before

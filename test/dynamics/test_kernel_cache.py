"""Kernels are compiled once, said so once, kept on disk, and never used when any source of them has changed."""

import errno
import os
import re
import shutil
import subprocess
import sys
import threading
import time

import numba
import numpy as np
import pytest

from evidence.scenarios import PACKAGE_ROOT, SWIM, TURN, run_python, sized
from manta_sim_ros.dynamics import Simulator, fin_dynamics
from manta_sim_ros.dynamics._kernels import compilation, gait, monolithic, staggered

ANNOUNCEMENT = 'compiling the dynamics for this machine'

EVALUATE = """
import numpy as np
from manta_sim_ros.dynamics import FinCommand, Parameters, Simulator, fin_dynamics, simulator

moment = np.full((30, 3), 0.1)
accelerations, wrench = fin_dynamics(Parameters(), 0, np.ones((2, 3)), moment, moment, np.ones(6), np.ones(6))
gait = FinCommand(amplitude=0.3, frequency=0.5, phase=0.1)
Simulator().command(left=gait, right=gait)  # another kernel, which is compiled fast
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
    library = copied_package / 'manta_sim_ros' / 'dynamics'
    with (library / 'simulator.py').open('a', encoding='utf-8') as file:
        file.write('# not a kernel\n')
    second, announced = evaluate(copied_package)
    assert (second, announced) == (first, 0)

    # fin.py holds no entry point: Numba alone would not look at it. One byte of it, the inertia of a rod
    source = library / '_kernels' / 'fin.py'
    text = source.read_text(encoding='utf-8')
    changed = re.sub(r'/ 12\.0', '/ 13.0', text)
    assert changed != text
    source.write_text(changed, encoding='utf-8')
    third, announced = evaluate(copied_package)
    assert third != first and announced == 1


def test_the_digest_changes_with_every_source_of_the_kernels_and_with_no_other(copied_package):
    digest_here = 'from manta_sim_ros.dynamics._kernels.compilation import SOURCE_DIGEST; print(SOURCE_DIGEST)'

    def digest():
        return run_python(digest_here, copied_package, package_root=copied_package).stdout.strip()

    folder = copied_package / 'manta_sim_ros' / 'dynamics'
    seen = [digest()]
    assert seen[0] == compilation.SOURCE_DIGEST  # it depends on contents, not on the place
    kernels = sorted((folder / '_kernels').glob('*.py'))
    assert len(kernels) > 10
    for path in kernels:
        with path.open('a', encoding='utf-8') as file:
            file.write('\n')
        seen.append(digest())
    assert len(set(seen)) == len(seen)
    for path in folder.glob('*.py'):
        with path.open('a', encoding='utf-8') as file:
            file.write('\n')
    assert digest() == seen[-1]


def test_the_key_of_a_kernel_holds_the_digest(monkeypatch):
    signature, codegen = staggered.advance.signatures[:1], staggered.advance.targetctx.codegen()
    keys = []
    for digest in ('one', 'other'):
        monkeypatch.setattr(compilation, 'SOURCE_DIGEST', digest)
        keys.append(staggered.advance._cache._index_key(signature, codegen))
    assert keys[0] != keys[1]


def double(x):
    return 2.0 * x


@pytest.fixture
def small_kernel(monkeypatch, tmp_path):
    """Return a function that makes a small kernel as a new process would, and calls it; its files are in `tmp_path`."""
    monkeypatch.setattr(numba.config, 'CACHE_DIR', str(tmp_path))

    def start():
        for name, value in (('folder', ''), ('lost', False), ('warned', False), ('announced', False)):
            monkeypatch.setattr(compilation._Keeping, name, value)
        kernel, lines = compilation.entry_kernel(double), []
        with compilation.announced_compilation(lines.append):
            assert kernel(1.5) == 3.0
        return sum(kernel.stats.cache_hits.values()), [line for line in lines if 'kept' in line]

    return start


def files(folder, ending):
    found = list(folder.rglob(f'*{ending}'))
    assert found
    return found


def test_a_kernel_is_compiled_once_and_then_taken_from_disk(small_kernel, tmp_path, caplog):
    hits, (line,) = small_kernel()
    assert hits == 0
    assert re.fullmatch(rf'the compiled dynamics are kept in {tmp_path}\S*: later starts take them from there', line)
    assert small_kernel() == (1, [])
    assert not caplog.messages


def emptied(path):
    path.write_bytes(b'')


def cut_short(path):
    path.write_bytes(path.read_bytes()[:-20])


def replaced_by_garbage(path):
    path.write_bytes(bytes(range(256)) * 8)


def changed_in_one_byte(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def made_a_folder(path):
    path.unlink()
    (path / 'inside').mkdir(parents=True)


@pytest.mark.parametrize(('ending', 'damage'), [
    *((ending, damage) for ending in ('.nbi', '.nbc') for damage in (emptied, cut_short, replaced_by_garbage)),
    ('.nbc', changed_in_one_byte)])
def test_a_damaged_file_is_compiled_again_and_replaced_with_one_warning(small_kernel, tmp_path, caplog, ending, damage):
    small_kernel()
    for path in files(tmp_path, ending):
        damage(path)
    assert small_kernel()[0] == 0
    assert small_kernel() == (1, [])
    (message,) = caplog.messages
    assert str(tmp_path) in message and 'NUMBA_CACHE_DIR' in message and 'replaced' in message


@pytest.mark.parametrize('ending', ['.nbi', '.nbc'])
def test_a_folder_in_the_place_of_a_file_costs_a_warning_only(small_kernel, tmp_path, caplog, ending):
    small_kernel()
    for path in files(tmp_path, ending):
        made_a_folder(path)
    assert small_kernel() == (0, [])  # nothing says that it is kept
    (message,) = caplog.messages
    assert str(tmp_path) in message and 'each start compiles them again; set NUMBA_CACHE_DIR' in message


@pytest.mark.parametrize('error', [
    OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), PermissionError(errno.EACCES, os.strerror(errno.EACCES))])
def test_a_disk_that_takes_no_file_costs_a_warning_only(small_kernel, monkeypatch, caplog, error):
    def refuse(self, name, data):
        raise error

    monkeypatch.setattr(compilation._CheckedFiles, '_save_data', refuse)
    assert small_kernel() == (0, [])
    (message,) = caplog.messages
    assert error.strerror in message and 'each start compiles them again; set NUMBA_CACHE_DIR' in message


def test_a_file_of_another_user_costs_a_warning_only(small_kernel, tmp_path, monkeypatch, caplog):
    small_kernel()

    def forbidden(self):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr(compilation._CheckedFiles, '_load_index', forbidden)
    assert small_kernel() == (0, [])
    (message,) = caplog.messages
    assert 'Permission denied' in message and 'NUMBA_CACHE_DIR' in message


@pytest.mark.parametrize('error', [RuntimeError('cannot cache function: no locator available'), KeyError('HOME')])
def test_without_a_place_to_write_to_one_warning_says_so(monkeypatch, small_kernel, caplog, error):
    def no_place(function):
        raise error

    monkeypatch.setattr(compilation, '_KernelCache', no_place)
    assert small_kernel() == (0, [])
    (message,) = caplog.messages
    assert str(error) in message and 'each start compiles them again; set NUMBA_CACHE_DIR' in message


@pytest.fixture
def no_folder_can_be_written_to(monkeypatch):
    def refuse(self, *arguments):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(numba.core.caching._CacheLocator, 'ensure_cache_path', refuse)
    monkeypatch.setattr(compilation._CheckedFiles, '_open_for_write', refuse)


def test_a_kernel_is_taken_from_a_folder_that_can_only_be_read(small_kernel, request, caplog):
    small_kernel()
    request.getfixturevalue('no_folder_can_be_written_to')
    assert small_kernel() == (1, [])
    assert not caplog.messages


def test_the_folder_that_is_named_costs_one_warning_if_it_can_only_be_read(
        small_kernel, no_folder_can_be_written_to, tmp_path, caplog):
    assert small_kernel() == (0, [])
    (message,) = caplog.messages
    assert str(tmp_path) in message and os.strerror(errno.EROFS) in message
    assert 'each start compiles them again; set NUMBA_CACHE_DIR' in message


@pytest.mark.parametrize(('damage', 'hits'), [(None, 1), (replaced_by_garbage, 0)])
def test_a_kernel_in_the_folder_of_the_package_is_taken_wherever_others_are_kept(
        small_kernel, tmp_path, monkeypatch, caplog, damage, hits):
    small_kernel()
    (package,) = tmp_path.iterdir()
    for path in files(tmp_path, '.nbc') if damage else ():
        damage(path)
    monkeypatch.setattr(numba.config, 'CACHE_DIR', str(tmp_path / 'own'))
    monkeypatch.setattr(compilation, '_shared_folders', lambda function: [str(package)])
    assert small_kernel()[0] == hits
    assert not caplog.messages


@pytest.fixture
def without_rights(tmp_path):
    """The beginning of a command that cannot write where the permissions forbid it, not even as root."""
    if os.geteuid() != 0:
        return []
    command = ['setpriv', '--bounding-set=-dac_override,-dac_read_search', '--inh-caps=-dac_override,-dac_read_search']
    forbidden = tmp_path / 'forbidden'
    forbidden.mkdir(mode=0o555)
    if shutil.which('setpriv') is None or subprocess.run([*command, 'true'], check=False).returncode:
        pytest.skip('root can write anywhere, and setpriv cannot take that right away here')
    assert subprocess.run([*command, 'touch', forbidden / 'file'], capture_output=True, check=False).returncode
    return command


READ = """
import logging
logging.basicConfig(format='%(message)s')
import doubling
print(doubling.double(1.5), sum(doubling.double.stats.cache_hits.values()))
"""


def test_kernels_of_another_user_in_a_read_only_tree_are_taken_without_a_home_and_without_a_warning(
        without_rights, tmp_path):
    """As in a container: the image has the kernels, and a user without rights runs it."""
    tree = tmp_path / 'tree'
    tree.mkdir()
    (tree / 'doubling.py').write_text(
        'from manta_sim_ros.dynamics._kernels.compilation import entry_kernel\n\n\n@entry_kernel\n'
        'def double(x):\n    return 2.0 * x\n', encoding='utf-8')
    run_python(READ, tree, NUMBA_CACHE_DIR=str(tree / 'kernels'))
    for path in [*tree.rglob('*'), tree]:
        path.chmod(0o555 if path.is_dir() else 0o444)

    def read(folder):
        environment = {name: value for name, value in os.environ.items() if name != 'XDG_CACHE_HOME'}
        ended = subprocess.run(
            [*without_rights, sys.executable, '-c', READ], cwd=tree, check=True, capture_output=True, text=True,
            timeout=300, env=environment | {
                'HOME': '/proc/none', 'NUMBA_CACHE_DIR': str(tree / folder), 'PYTHONDONTWRITEBYTECODE': '1',
                'PYTHONPATH': os.pathsep.join([str(PACKAGE_ROOT), os.environ.get('PYTHONPATH', '')])})
        return ended.stdout.split(), ended.stderr.splitlines()

    assert read('kernels') == (['3.0', '1'], [])
    result, (warning,) = read('none')
    assert result == ['3.0', '0']
    assert str(tree / 'none') in warning and 'each start compiles them again; set NUMBA_CACHE_DIR' in warning


def test_other_threads_run_while_a_kernel_computes():
    simulator = Simulator(sized(30, 3))
    simulator.advance(0.0)
    thread = threading.Thread(target=simulator.advance, args=(200.0,))
    thread.start()  # one compiled call
    served = 0
    while thread.is_alive():
        time.sleep(0.005)
        served += 1
    assert served > 10  # measured: 350; 1 if the call kept the interpreter


def test_a_kernel_that_allocates_is_refused_when_it_is_compiled():
    allocating = compilation.kernel(lambda size: np.zeros(size).sum())
    with pytest.raises(Exception, match='NRT|nrt|allocat'):
        allocating(3)


@pytest.mark.parametrize(('coupling', 'kernels'), [('sequential', staggered), ('monolithic', monolithic)])
def test_arrays_of_a_state_are_taken_without_compiling_again(coupling, kernels):
    simulator = Simulator(sized(4, 2, solver={'coupling': coupling}))
    simulator.command(left=SWIM, right=TURN)
    state = simulator.advance(0.2)
    entries = (gait.largest_transition_difference, kernels.evaluate, kernels.advance)
    flat, still = np.zeros((4, 2)), np.zeros(6)
    fin_dynamics(simulator.parameters, 0, np.zeros((2, 3)), flat, flat, still, still)
    before = [entry.signatures for entry in entries]
    assert all(before)
    fin_dynamics(
        simulator.parameters, 1, np.zeros((2, 3)), state.joint_angles[1], state.joint_rates[1], state.twist,
        state.acceleration)
    Simulator(simulator.parameters, state=state).advance(0.2)
    assert [entry.signatures for entry in entries] == before

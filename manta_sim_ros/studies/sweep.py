"""The command `sweep`: many cases of a study, on all cores or on a cluster, into one Parquet file."""

from __future__ import annotations

import contextlib
import fcntl
import gc
import importlib.util
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.parquet as pq
from tqdm import tqdm

from manta_sim_ros.dynamics import compile_kernels
from manta_sim_ros.figures.files import clear_abandoned, whole
from manta_sim_ros.figures.jobs import say
from manta_sim_ros.signals import on_ending
from manta_sim_ros.studies.arguments import Parser, check_output
from manta_sim_ros.studies.cases import simulate_cases
from manta_sim_ros.studies.plot import check_plot, draw
from manta_sim_ros.studies.study import Study, read_study, unit_of

if TYPE_CHECKING:
    from distributed import Client

CASES_PER_CORE = 32
"""Cases of a part on this machine, for each core: a few seconds of computing, which are lost when it is killed."""

CASES_OF_A_TASK = 32
"""Cases of a task of a cluster."""

OUTPUTS: dict[str, tuple[Any, str]] = {
    'thrust': (pa.float64(), 'N'), 'speed': (pa.float64(), 'm/s'), 'yaw_rate': (pa.float64(), 'degrees/s'),
    'turning_radius': (pa.float64(), 'm'), 'power': (pa.float64(), 'W'), 'cost_of_transport': (pa.float64(), ''),
    'strouhal': (pa.float64(), ''), 'converged': (pa.bool_(), ''), 'step_stable': (pa.bool_(), ''),
    'warning': (pa.string(), ''), 'error': (pa.string(), ''),
}
"""Type and unit of each result of a case."""

HOLDER = '_study'
"""File of the parts' directory with the digest of the study: readers of Parquet leave out names with an underscore."""

DIGEST = b'study'
"""Key of the digest of the study in the metadata of a file."""


class OtherStudyError(ValueError):
    """The results that are there are those of another study."""


class AddressError(ValueError):
    """The address of a scheduler is malformed, or one that the configuration of Dask does not allow."""


def sweep(
    study: Study, output: Path, *, scheduler: str | None = None,
    progress: Callable[[int], object] = lambda count: None,
) -> int:
    """Simulate the cases of a study that have no results yet, and write all results to a Parquet file.

    Each part of the results is a Parquet file in the directory `output`.parts, which is there whole or not at all:
    after a kill the directory can be read, and the next call goes on after the last part. At the end the parts become
    `output`. Nothing is done when that is there already.

    Parameters
    ----------
    study
        The cases.
    output
        The file, with one row for each case: its number, its inputs and OUTPUTS. The units are in the metadata of the
        columns.
    scheduler
        The address of a scheduler of Dask, such as tcp://host:8786, whose workers have this package; by default the
        cases are simulated on all cores that this process may use.
    progress
        Is called with a number of cases that have their results, at first with that of an earlier call.

    Returns
    -------
    int
        The number of cases that were simulated now.

    Raises
    ------
    OtherStudyError
        There are results of another study, or of another version of the package.
    AddressError
        There cannot be a scheduler at this address.
    OSError
        A file cannot be written or read, the scheduler is not reached, or another process writes the same results.

    """
    parts = output.with_name(f'{output.name}.parts')
    if output.exists():
        _check_same(study, _metadata(output), output)
        if (parts / HOLDER).exists():  # killed between the two
            _remove(parts)
        progress(len(study.cases))
        return 0
    schema = _schema(study)
    with _held(study, parts):
        clear_abandoned(parts)
        done = {case for path in _part_files(parts) for case in _cases_in(path)}
        progress(len(done))
        left = [case for case in study.cases if case not in done]
        for rows in _simulated(study, left, scheduler):
            with whole(parts / f'part-{rows[0]["case"]:07}.parquet') as path:
                pq.write_table(pa.Table.from_pylist(rows, schema=schema), path)
            progress(len(rows))
        table = pa.concat_tables(pq.read_table(path) for path in _part_files(parts)).sort_by('case')
        with whole(output) as path:
            pq.write_table(table, path)
        _remove(parts)
    return len(left)


def _simulated(study: Study, cases: Sequence[int], scheduler: str | None) -> Iterator[list[dict[str, Any]]]:
    """Yield the rows of blocks of cases as they are done."""
    if scheduler is None:
        for block in _blocks(cases, CASES_PER_CORE * len(os.sched_getaffinity(0))):
            yield simulate_cases(study.part(block))
        return
    from distributed import CancelledError, KilledWorker, as_completed

    with _connected(scheduler) as client:
        tasks = [client.submit(simulate_cases, study.part(block)) for block in _blocks(cases, CASES_OF_A_TASK)]
        for task in as_completed(tasks):
            try:
                yield task.result()
            except KilledWorker as error:
                raise OSError(f'the workers were killed again and again by the same cases: {error}') from error
            except CancelledError as error:
                raise ConnectionError(
                    f'the scheduler at {scheduler} ended: the same command goes on after the last part') from error
            except Exception as error:  # of any kind, such as a package that the worker does not have
                raise ChildProcessError(f'a worker failed: {type(error).__name__}: {error}') from error


def _connected(scheduler: str) -> Client:
    from distributed import Client

    try:
        return Client(scheduler)
    except OSError as error:
        failure: Exception = ConnectionError(f'there is no scheduler at {scheduler}: {error}')
    except (TypeError, ValueError) as error:
        failure = AddressError(f'there cannot be a scheduler at {scheduler}: {error}')
    gc.collect()  # Here, not in the thread of a later client, which would wait in vain for the end of this one.
    raise failure


def _blocks(cases: Sequence[int], size: int) -> list[Sequence[int]]:
    return [cases[start:start + size] for start in range(0, len(cases), size)]


@contextlib.contextmanager
def _held(study: Study, parts: Path) -> Iterator[None]:
    """Hold the directory of the parts, for this study and this process only."""
    parts.mkdir(exist_ok=True)
    if any(parts.iterdir()) and not (parts / HOLDER).exists():
        raise FileExistsError(f'{parts} has other files than parts of a sweep: take another --output, or move them')
    with (parts / HOLDER).open('a+b') as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise BlockingIOError(f'{parts} is written by another process') from None
        file.seek(0)
        if known := file.read():
            _check_same(study, {DIGEST: known}, parts)
        else:
            file.write(study.digest.encode())
            file.flush()
            os.fsync(file.fileno())
        try:
            yield
        finally:
            if not _part_files(parts):
                _remove(parts)


def _remove(parts: Path) -> None:
    """Remove the parts and their directory, unless somebody put other files there."""
    for path in (*_part_files(parts), parts / HOLDER):
        path.unlink(missing_ok=True)
    with contextlib.suppress(OSError):
        parts.rmdir()


def _cases_in(part: Path) -> list[int]:
    """Return the numbers of the cases of a part; one that is damaged, as by a loss of power, is removed."""
    try:
        return list(pq.read_table(part)['case'].to_pylist())
    except (pa.ArrowInvalid, OSError) as error:
        if getattr(error, 'errno', None) is not None:  # the disk, not the content
            raise
        part.unlink()
        return []


def _metadata(path: Path) -> dict[bytes, bytes]:
    try:
        return pq.read_schema(path).metadata or {}
    except pa.ArrowInvalid:
        return {}  # some other file


def _check_same(study: Study, metadata: dict[bytes, bytes], path: Path) -> None:
    if metadata.get(DIGEST) != study.digest.encode():
        raise OtherStudyError(
            f'{path} has the results of another study, or of another version: take another --output, or remove it')


def _part_files(parts: Path) -> list[Path]:
    return sorted(parts.glob('part-*.parquet'))


def _schema(study: Study) -> pa.Schema:
    columns = {'case': (pa.int64(), '')}
    for index, name in enumerate(study.names):
        columns[name] = pa.array([case[index] for case in study.cases.values()]).type, unit_of(name)
    return pa.schema(
        [pa.field(name, kind, metadata={'unit': unit}) for name, (kind, unit) in (columns | OUTPUTS).items()],
        metadata={DIGEST: study.digest.encode()})


def main(args: Sequence[str] | None = None) -> None:
    """Run the command; the exit status is 0, 1 after a failure, 2 for wrong input, or 130 when it is interrupted."""
    parser = _parser()
    options = parser.parse_args(args)
    try:
        study = read_study(options.study)
        check_output('--output', options.output, inputs=[options.study])
        if options.scheduler is not None and importlib.util.find_spec('distributed') is None:
            raise ValueError("--scheduler needs the extra 'cluster': pip install 'manta_sim_ros[cluster]'")
        if options.plot is not None:
            check_plot(study, options.plot)
            if options.plot.resolve() == options.output.resolve():
                raise ValueError(f'--plot is {options.plot}, but that is --output: it would be replaced')
    except (OSError, ValueError) as error:
        parser.error(str(error))

    def interrupted() -> None:
        parts = f'{options.output}.parts'
        if os.path.isdir(parts):
            what = f'the finished parts are in {parts}: the same command goes on'
        else:
            what = f'the results are in {options.output}' if options.output.exists() else 'no part was finished'
        say(f'\n{parser.prog}: interrupted; {what}', sys.stderr)
        os._exit(130)

    on_ending(interrupted)
    try:
        compile_kernels(study.parameters, lambda line: say(line, sys.stderr))
        with tqdm(total=len(study.cases), disable=None, unit='case') as bar:
            count = sweep(study, options.output, scheduler=options.scheduler, progress=bar.update)
        results = pq.read_table(options.output)
        if options.plot is not None:
            draw(study, results.to_pydict(), options.plot)
    except (OtherStudyError, AddressError) as error:
        parser.error(str(error))
    except OSError as error:
        sys.exit(f'{parser.prog}: {" ".join(str(error).split())}')
    failed = sum(error.is_valid for error in results['error'])
    say(f'{options.output}: {len(study.cases)} cases, {count} of them simulated now, {failed} without a result')


def _parser() -> Parser:
    parser = Parser(
        prog='sweep', description='Simulate all cases of a study file, from rest, and write a Parquet file with a row '
                                  'of each: inputs, thrust, speed, turn, power, cost of transport, Strouhal number, '
                                  'and the error of a case that failed. After a kill, the same command goes on.')
    parser.add_argument('study', type=Path, metavar='STUDY.yaml', help='what is varied; see docs/sweep.md')
    parser.add_argument('-o', '--output', type=Path, default=Path('results.parquet'), metavar='FILE.parquet',
                        help='the file to write (default: %(default)s)')
    parser.add_argument('--scheduler', metavar='tcp://HOST:PORT',
                        help='simulate on the workers of this scheduler of Dask (default: on all cores of this '
                             'machine)')
    parser.add_argument('--plot', type=Path, metavar='FILE.png',
                        help='plot the results over the one or two quantities that are varied')
    return parser

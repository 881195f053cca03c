"""How the numerical kernels are compiled, and when that is announced."""

from __future__ import annotations

import contextlib
import hashlib
import logging
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numba
from numba.core import event
from numba.core.compiler import CompilerBase, DefaultPassBuilder

logger = logging.getLogger('manta_sim_ros')


class _DistinctArrays(CompilerBase):
    """Numba's own pipeline, told that the array arguments of a kernel never overlap.

    Without that the compiler must prove it at run time, which it gives up on beyond a few arrays: the loops over
    chains then stay scalar, at half the speed.
    """

    def define_pipelines(self) -> list[Any]:
        self.state.flags.noalias = True
        return [DefaultPassBuilder.define_nopython_pipeline(self.state)]


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function that other kernels call. Its array arguments must not overlap."""
    return numba.njit(error_model='numpy', pipeline_class=_DistinctArrays)(function)


def inlined_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function into each kernel that calls it: handing on tuples of arrays costs more than a loop here."""
    return numba.njit(error_model='numpy', inline='always', pipeline_class=_DistinctArrays)(function)


def entry_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function that Python calls, kept on disk from one start to the next.

    Numba looks at the file of `function` alone to tell whether what it kept is still true. The kernels that it calls
    live in other files, so it must be a closure over `source_digest()`, which is part of the key.
    """
    options: dict[str, Any] = {'error_model': 'numpy', 'pipeline_class': _DistinctArrays}
    try:
        return numba.njit(cache=True, **options)(function)
    except RuntimeError as error:  # no place that can be written to
        logger.warning('compiled kernels cannot be kept (%s): each start compiles them again', error)
        return numba.njit(**options)(function)


def source_digest() -> str:
    """Return a digest of all source files of this package."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob('*.py')):
        digest.update(path.read_bytes())
    return digest.hexdigest()


class _Announcer(event.Listener):
    """Says once in a process that something is compiled."""

    announced = False

    def __init__(self, announce: Callable[[str], object]) -> None:
        self._announce = announce

    def on_start(self, event: Any) -> None:
        if not _Announcer.announced:
            _Announcer.announced = True
            self._announce(
                'compiling the dynamics for this machine: once, about half a minute; later starts take it from disk'
            )

    def on_end(self, event: Any) -> None:
        pass


@contextlib.contextmanager
def announced_compilation(announce: Callable[[str], object] = logger.warning) -> Iterator[None]:
    """Call `announce` with one line if anything is compiled inside the block; nothing is said when it is on disk."""
    with event.install_listener('numba:compile', _Announcer(announce)):
        yield

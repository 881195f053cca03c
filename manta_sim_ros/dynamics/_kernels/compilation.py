"""How the kernels are compiled, where they are kept, and when that is announced."""

from __future__ import annotations

import contextlib
import hashlib
import logging
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numba
from numba.core import event
from numba.core.caching import FunctionCache
from numba.core.compiler import CompilerBase, DefaultPassBuilder

logger = logging.getLogger('manta_sim_ros')


class _DistinctArrays(CompilerBase):
    """Numba's own pipeline, told that the array arguments of a kernel never overlap.

    Without that the compiler must check it at run time, which it gives up beyond a few arrays: the loops over
    chains then stay scalar, at half the speed.
    """

    def define_pipelines(self) -> list[Any]:
        self.state.flags.noalias = True
        return [DefaultPassBuilder.define_nopython_pipeline(self.state)]


_OPTIONS: dict[str, Any] = {
    'error_model': 'numpy',
    'pipeline_class': _DistinctArrays,
    '_nrt': False,  # a kernel allocates nothing, else it does not compile: no references of arrays are counted
    'forceinline': True,  # a tuple of arrays is handed on as hundreds of values, if there is a call at all
}


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function that other kernels call. Its array arguments must not overlap, and it allocates nothing."""
    return numba.njit(**_OPTIONS)(function)


def rare_kernel(function: Callable[..., Any]) -> Any:
    """Compile a function that kernels call rarely, as `kernel` does, but by itself, which is faster to compile."""
    return numba.njit(**{**_OPTIONS, 'forceinline': False})(function)


def entry_kernel(function: Callable[..., Any]) -> Any:
    """Compile a function that Python calls, as `kernel` does, and keep it on disk from one start to the next.

    It must not return a named tuple: making one runs Python code, where a signal raises an exception that Numba misses.
    """
    compiled = numba.njit(**_OPTIONS)(function)
    try:
        compiled._cache = _KernelCache(function)
    except RuntimeError as error:  # no place that can be written to
        logger.warning('compiled kernels cannot be kept (%s): each start compiles them again', error)
    return compiled


SOURCE_DIGEST = hashlib.sha256(
    b''.join(path.read_bytes() for path in sorted(Path(__file__).parent.glob('*.py')))).hexdigest()
"""Of all source files of this folder."""


class _KernelCache(FunctionCache):
    """Keeps a compiled kernel on disk, under a key that changes with any source file of this folder.

    Numba itself looks at the file of the kernel alone, but the kernels that it calls are in other files.
    """

    def _index_key(self, sig: Any, codegen: Any) -> tuple[Any, ...]:
        return (*super()._index_key(sig, codegen), SOURCE_DIGEST)


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

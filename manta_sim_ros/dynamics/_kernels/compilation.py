"""How the kernels are compiled, where they are kept, and when that is announced."""

from __future__ import annotations

import contextlib
import hashlib
import inspect
import logging
import os
import pickle  # nosec B403 # see _load_data
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numba
from numba.core import config, event
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile
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


KERNEL_OPTIONS: dict[str, Any] = {
    'error_model': 'numpy',
    'pipeline_class': _DistinctArrays,
    '_nrt': False,  # a kernel allocates nothing, else it does not compile: no references of arrays are counted
    'fastmath': False,  # a kernel that is not told would take it from the kernel that it is first compiled for
    'forceinline': True,  # a tuple of arrays is handed on as hundreds of values, if there is a call at all
}


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function that other kernels call. Its array arguments must not overlap, and it allocates nothing."""
    return numba.njit(**KERNEL_OPTIONS)(function)


def rare_kernel(function: Callable[..., Any]) -> Any:
    """Compile a function that kernels call rarely, as `kernel` does, but by itself, which is faster to compile."""
    return numba.njit(**{**KERNEL_OPTIONS, 'forceinline': False})(function)


def entry_kernel(function: Callable[..., Any]) -> Any:
    """Compile a function that Python calls, as `kernel` does, and keep it on disk from one start to the next.

    Other threads run while it computes. It must not return a named tuple: making one runs Python code, where a signal
    raises an exception that Numba misses.
    """
    compiled = numba.njit(**KERNEL_OPTIONS, nogil=True)(function)
    try:
        compiled._cache = _KernelCache(function)
    except Exception as error:  # no place that can be written to, no home; a cache only saves time
        _Keeping.failed('any folder', error)
    return compiled


def machine_code(entry: Any, *arguments: Any) -> Callable[..., Any]:
    """Return the machine code of an entry kernel for arguments of the types of these, compiled or loaded if need be.

    To call it saves the look at the type of every value in every tuple, which costs more than a step of a small robot.
    Nothing checks then that the arguments of the next calls have these types.
    """
    code: Callable[..., Any] = entry.compile(tuple(map(numba.typeof, arguments)))
    return code


SOURCE_DIGEST = hashlib.sha256(
    b''.join(path.read_bytes() for path in sorted(Path(__file__).parent.glob('*.py')))).hexdigest()
"""Of all source files of this folder."""


class _Keeping:
    """Whether compiled kernels are kept on disk in this process; trouble is warned of once."""

    folder = ''
    """Where kernels were kept, empty if none was or one could not be."""
    lost = warned = announced = False

    @classmethod
    def kept(cls, folder: str) -> None:
        """Remember that a kernel is on disk."""
        cls.folder = '' if cls.lost else folder

    @classmethod
    def failed(cls, folder: str, error: Exception) -> None:
        """Warn, once, that kernels cannot be kept."""
        cls.folder, cls.lost = '', True
        cls._warn(
            'compiled kernels cannot be kept in %s (%s): each start compiles them again; set NUMBA_CACHE_DIR to a '
            'folder that can be written to', folder, error)

    @classmethod
    def replaced(cls, folder: str, error: Exception) -> None:
        """Warn, once, that a kernel on disk could not be read."""
        cls._warn(
            'a compiled kernel in %s could not be read (%s): it was compiled again and replaced; if this comes back, '
            'remove the files there, or set NUMBA_CACHE_DIR to another folder', folder, error)

    @classmethod
    def _warn(cls, message: str, folder: str, error: Exception) -> None:
        if not cls.warned:
            cls.warned = True
            logger.warning(message, folder, ' '.join(str(error).split()) or type(error).__name__)


_NAMED, _IN_PACKAGE, *_ELSEWHERE = CompileResultCacheImpl._locator_classes
"""How Numba finds the folder that `NUMBA_CACHE_DIR` names, that of the package, and others such as one at home."""


def _shared_folders(function: Callable[..., Any]) -> list[str]:
    """Return where others may have kept a kernel for all users, whether this one can write there or not."""
    locators = (_NAMED, _IN_PACKAGE) if config.CACHE_DIR else (_IN_PACKAGE,)
    return [locator(function, inspect.getfile(function)).get_cache_path() for locator in locators]


class _Unwritable:
    """Stands for the first shared folder where no folder can be written to: kernels may be there to be read."""

    @staticmethod
    def from_function(function: Callable[..., Any], file: str) -> Any:
        return (_NAMED if config.CACHE_DIR else _IN_PACKAGE)(function, file)


class _Folders(CompileResultCacheImpl):
    """Numba's own folders, and if none of them can be written to, one to read from."""

    _locator_classes = [_NAMED, _IN_PACKAGE, *_ELSEWHERE, _Unwritable]


class _CheckedFiles(IndexDataCacheFile):
    """Files of a kernel with a checksum: machine code that was changed or cut short must never run.

    They are kept in the first of the folders, and looked for in all: in others only if the first is at home or nowhere.
    """

    def __init__(self, folders: Sequence[str], *about: Any) -> None:
        super().__init__(folders[0], *about)
        self._others = [_CheckedFiles([folder], *about) for folder in folders[1:]]

    def load(self, key: Any) -> Any:
        data = super().load(key)
        for other in self._others:
            if data is None:
                with contextlib.suppress(Exception):  # nothing can be mended there
                    data = other.load(key)
        return data

    def _save_data(self, name: str, data: Any) -> None:
        content = self._dump(data)
        with self._open_for_write(self._data_path(name)) as file:
            file.write(hashlib.sha256(content).digest() + content)

    def _load_data(self, name: str) -> Any:
        content = Path(self._data_path(name)).read_bytes()
        checksum, data = content[:32], content[32:]
        if hashlib.sha256(data).digest() != checksum:
            raise ValueError(f'{name} was changed or cut short')
        return pickle.loads(data)  # nosec B301 # the folder is trusted, as machine code comes from it


class _KernelCache(FunctionCache):
    """Keeps a compiled kernel on disk, under a key that changes with any source file of this folder.

    Numba itself looks at the file of the kernel alone, but the kernels that it calls are in other files. Reading and
    writing never end anything: what cannot be read is compiled again, and what cannot be written stays in memory.
    """

    _impl_class = _Folders

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        shared = _shared_folders(function)
        own = self._cache_path in shared and os.access(self._cache_path, os.W_OK)  # then others are nobody's business
        others = [] if own else [folder for folder in shared if folder != self._cache_path]
        self._cache_file = _CheckedFiles(
            [self._cache_path, *others], self._impl.filename_base, self._impl.locator.get_source_stamp())
        self._unreadable: Exception | None = None

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(sig, target_context)
        except Exception as error:  # of files that are damaged, of another user, or no files
            self._unreadable = error
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            if self._unreadable is not None:
                self.flush()  # an index that cannot be read cannot be added to
            super().save_overload(sig, data)
        except Exception as error:
            _Keeping.failed(self._cache_path, error)
            return
        _Keeping.kept(self._cache_path)
        if self._unreadable is not None:
            _Keeping.replaced(self._cache_path, self._unreadable)
            self._unreadable = None

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
            self._announce('compiling the dynamics for this machine, which takes about half a minute')

    def on_end(self, event: Any) -> None:
        pass


@contextlib.contextmanager
def announced_compilation(announce: Callable[[str], object] = logger.warning) -> Iterator[None]:
    """Call `announce` if anything is compiled inside the block, and after it if that is kept; each once in a process.

    Nothing is said when it is on disk.
    """
    with event.install_listener('numba:compile', _Announcer(announce)):
        yield
    if _Keeping.folder and not _Keeping.announced:
        _Keeping.announced = True
        announce(f'the compiled dynamics are kept in {_Keeping.folder}: later starts take them from there')

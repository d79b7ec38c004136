"""
Compilation by numba: options, cache on disk, the number of SIMD lanes, and threads.

Kernel loops work on `LANES` pairs of samples at once: the innermost index of each scratch array is
the pair, so that the compiler turns each line of a formula into vector instructions whatever the
number of joints.

Arithmetic is that of IEEE 754, without leave to reorder sums: with it, code that has just been
compiled and the same code from the cache round differently, and fits differ.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
import fcntl
from functools import cache, wraps
from glob import escape
import hashlib
from itertools import pairwise
import logging
import os
from pathlib import Path
import re
import time
from typing import Any, cast, TypeVar

import numba
from numba.core.caching import FunctionCache
from numba.core.compiler_lock import global_compiler_lock
import numpy as np

PACKAGE = Path(__file__).parent

IMPORT = re.compile(rb'^ *(?:from|import) (lip_id_ros[.\w]*)(?: import (\([^)]*\)|.*))?', re.M)
"""A module of the package, and names in it that may be modules too."""

LANES = 32

LONGEST_WAIT_S, POLL_S = 20.0, 0.02
"""For another process to compile a function: then this one compiles it too."""

# Loops over `numba.prange` count without a sign; np.int64 of it mixes with other integers.
Index = int | np.int64

Function = TypeVar('Function', bound=Callable[..., Any])


def jit(function: Function) -> Function:
    """Compile a function of scalars and arrays to be called from other compiled functions."""
    wrap = numba.njit(error_model='numpy', nogil=True)
    return _cached(function, wrap(function))


def jit_reading(function: Function) -> Function:
    """
    Compile a function that only reads its arrays, once for those that can be written and locked.

    Arrays of data sets are locked, and numba has another type for these.
    """
    wrap = numba.njit(error_model='numpy', nogil=True)
    return _cached(function, wrap(function), reads=True)


def jit_inlined(function: Function) -> Function:
    """
    Compile a function into those that call it: for small ones, or with many arguments.

    It can be called from compiled functions alone, which leaves out half of the time to compile.
    """
    bare: Any = {'no_cpython_wrapper': True, 'no_cfunc_wrapper': True}
    wrap = numba.njit(error_model='numpy', nogil=True, forceinline=True, **bare)
    return _cached(function, wrap(function))


def jit_parallel(function: Function) -> Function:
    """Compile a function whose `numba.prange` loops run on all threads."""
    wrap = numba.njit(error_model='numpy', nogil=True, parallel=True)
    return _cached(function, wrap(function))


class _Cache(FunctionCache):
    """
    Machine code on disk that is discarded when any source that it may contain has changed.

    The cache of `numba.njit(cache=True)` depends on the file of the outermost function only, so
    that a change in another module would have no effect (numba issue 1833). Of processes that
    need the same function one compiles it, and the others wait for its code.
    """

    _lock: int | None = None  # descriptor of a file

    def _index_key(self, sig: Any, codegen: Any) -> tuple[Any, ...]:
        key = super()._index_key(sig, codegen)  # type: ignore[no-untyped-call]
        return (*key, _digest(Path(self._py_func.__code__.co_filename)))

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return cached code; None, and a lock on the function, if it has to be compiled."""
        found = self._load(sig, target_context)
        if found is None and self._lock is None:
            with suppress(OSError):  # some folders cannot be written, some have no locks
                self._impl.locator.ensure_cache_path()
                path = Path(self.cache_path, f'{self._impl.filename_base}.lock')
                self._lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
                _wait_for(self._lock)
                found = self._load(sig, target_context)
        return found

    def unlock(self) -> None:
        """Let other processes compile the function, or load what was compiled."""
        if self._lock is not None:
            with suppress(OSError):
                fcntl.flock(self._lock, fcntl.LOCK_UN)  # in processes forked meanwhile too
            os.close(self._lock)
            self._lock = None

    def save_overload(self, sig: Any, data: Any) -> None:
        """
        Keep compiled code; without it where there is no room.

        numba names code in the index before it writes the code: of a process that ends in between,
        the next would take the code that another version of the source left under that name.
        """
        with suppress(OSError):
            if not self._cache_file._load_index():  # type: ignore[no-untyped-call]
                for old in Path(self.cache_path).glob(f'{escape(self._impl.filename_base)}.*.nbc'):
                    old.unlink()
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]

    def _load(self, sig: Any, target_context: Any) -> Any:
        """Return cached code; None where there is none, it is damaged, or its types are gone."""
        try:
            return super().load_overload(sig, target_context)  # type: ignore[no-untyped-call]
        except Exception:  # a file that is cut short makes pickle raise anything
            with suppress(OSError):
                self.flush()  # type: ignore[no-untyped-call]
            return None


def _wait_for(lock: int) -> None:
    """Lock a file; give up after a while, since what holds it may stand still."""
    last = time.monotonic() + LONGEST_WAIT_S
    while time.monotonic() < last:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError:
            time.sleep(POLL_S)


@cache
def _digest(file: Path) -> str:
    """
    Return a digest of all modules whose constants the compiled code of one may hold.

    These are the modules of the package that it imports, and that they import; of a module that is
    not of the package those of its folder too.
    """
    inside = file.is_relative_to(PACKAGE)
    found: set[Path] = set()
    left = {file} if inside else set(file.parent.rglob('*.py'))
    while left:
        found |= left
        left = set().union(*map(_imported, left)) - found
    return hashlib.sha256(b''.join(path.read_bytes() for path in sorted(found))).hexdigest()


@cache
def _imported(file: Path) -> frozenset[Path]:
    """Return the modules of the package that a module names in its imports."""
    found = set()
    for module, names in IMPORT.findall(file.read_bytes()):
        folder = PACKAGE.joinpath(*module.decode().split('.')[1:])
        parts = (folder, *(folder / name for name in re.findall(r'\w+', names.decode())))
        found |= {
            place for part in parts for place in (part.with_suffix('.py'), part / '__init__.py')
        }
    return frozenset(place for place in found if place.is_file())


def _cached(function: Function, dispatcher: Any, *, reads: bool = False) -> Function:
    try:
        stored = _Cache(function)  # type: ignore[no-untyped-call]
    except RuntimeError:  # numba found no folder to write to
        _tell_no_cache()
        return cast('Function', dispatcher)
    compile_here, inserted = dispatcher.compile, set[Any]()

    @wraps(compile_here)
    def compile_once(sig: Any) -> Any:
        with global_compiler_lock:  # of threads, as that of numba itself
            try:
                if not reads:
                    return compile_here(sig)
                code = compile_here(tuple(map(_locked, sig)))
                # two threads may ask at once, and no call finds what was inserted twice
                if sig not in dispatcher.overloads and sig not in inserted:
                    dispatcher._insert([each._code for each in sig], code, False)
                    inserted.add(sig)
                return code
            finally:
                stored.unlock()

    dispatcher._cache, dispatcher.compile = stored, compile_once
    return cast('Function', dispatcher)


def _locked(kind: Any) -> Any:
    """Return the type of an array that cannot be written; other types as they are."""
    if not isinstance(kind, numba.types.Array):
        return kind
    return kind.copy(readonly=True)


@cache
def _tell_no_cache() -> None:
    logging.getLogger(__name__).warning(
        'Compiled code cannot be kept here, and each first fit compiles for half a minute: '
        'set NUMBA_CACHE_DIR to a folder that can be written.'
    )


FEW = 500
"""States that one thread evaluates; more are shared among all threads."""


def in_threads(work: Callable[[slice], None], count: int, few: int = FEW) -> None:
    """
    Call a compiled function with slices that cover so many states, in all threads.

    No more than `few` of them do not pay for a second thread.
    """
    # the number of cores is a question to the system, which takes as long as a few states
    n_threads = 1 if count <= few else os.cpu_count() or 1
    if n_threads == 1:
        work(slice(0, count))
        return
    ends = np.linspace(0, count, n_threads + 1).astype(int).tolist()
    first, *others = (slice(a, b) for a, b in pairwise(ends))
    running = [_pool(os.getpid()).submit(work, each) for each in others]
    work(first)
    for each in running:
        each.result()


@cache
def _pool(process: int) -> ThreadPoolExecutor:
    # One per process: threads do not outlive a fork.
    return ThreadPoolExecutor(max(1, (os.cpu_count() or 1) - 1), f'lip_id_ros-{process}')

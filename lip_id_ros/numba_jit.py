"""
Compilation by numba: options, cache on disk, and the number of SIMD lanes.

Kernel loops work on `LANES` pairs of samples at once: the innermost index of each scratch array is
the pair, so that the compiler turns each line of a formula into vector instructions whatever the
number of joints.

Arithmetic is that of IEEE 754, without leave to reorder sums: with it, code that has just been
compiled and the same code from the cache round differently, and fits differ.

"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
import hashlib
from pathlib import Path
from typing import Any, cast, TypeVar

import numba
from numba.core.caching import FunctionCache
import numpy as np

LANES = 32

# Loops over `numba.prange` count without a sign; np.int64 of it mixes with other integers.
Index = int | np.int64

Function = TypeVar('Function', bound=Callable[..., Any])


def jit(function: Function) -> Function:
    """Compile a function of scalars and arrays to be called from other compiled functions."""
    wrap = numba.njit(error_model='numpy', nogil=True)
    return _cached(function, wrap(function))


def jit_inlined(function: Function) -> Function:
    """Compile a function into those that call it: for small ones with many arguments."""
    wrap = numba.njit(error_model='numpy', nogil=True, forceinline=True)
    return _cached(function, wrap(function))


def jit_parallel(function: Function) -> Function:
    """Compile a function whose `numba.prange` loops run on all threads."""
    wrap = numba.njit(error_model='numpy', nogil=True, parallel=True)
    return _cached(function, wrap(function))


class _Cache(FunctionCache):
    """
    Machine code on disk that is discarded when any source that it may contain has changed.

    The cache of `numba.njit(cache=True)` depends on the file of the outermost function only, so
    that a change in another module would have no effect (numba issue 1833).

    """

    def _index_key(self, sig: Any, codegen: Any) -> tuple[Any, ...]:
        home = Path(self._py_func.__code__.co_filename).parent
        key = super()._index_key(sig, codegen)  # type: ignore[no-untyped-call]
        return (*key, _digest(Path(__file__).parent), _digest(home))

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return cached code; None where there is none, or it refers to types that are gone."""
        try:
            return super().load_overload(sig, target_context)  # type: ignore[no-untyped-call]
        except (ImportError, AttributeError):
            self.flush()  # type: ignore[no-untyped-call]
            return None


@cache
def _digest(folder: Path) -> str:
    """Return a digest of all modules below a folder that compile functions."""
    digest = hashlib.sha256()
    for path in sorted(folder.rglob('*.py')):
        source = path.read_bytes()
        if b'numba_jit' in source:
            digest.update(source)
    return digest.hexdigest()


def _cached(function: Function, dispatcher: Any) -> Function:
    dispatcher._cache = _Cache(function)  # type: ignore[no-untyped-call]
    return cast('Function', dispatcher)

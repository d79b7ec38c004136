"""
How the fused loops are compiled, and how wide they are.

Every loop works on `LANES` pairs of samples at once: the innermost index of each scratch array is
the pair, so that the compiler turns each line of a formula into vector instructions whatever the
number of joints.

"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast, TypeVar

import numba
import numpy as np

LANES = 32

# Loops over `numba.prange` count without a sign; np.int64 of it mixes with other integers.
Index = int | np.int64

# Reassociation and fused multiply-add only: not-a-number and infinity keep their meaning.
FAST_MATH = {'contract', 'reassoc', 'arcp', 'nsz'}

Function = TypeVar('Function', bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compile a function of scalars and arrays to be called from other compiled functions."""
    wrap = numba.njit(fastmath=FAST_MATH, error_model='numpy', cache=True, nogil=True)
    return cast('Function', wrap(function))


def compiled_parallel(function: Function) -> Function:
    """Compile a function whose `numba.prange` loops run on all threads."""
    wrap = numba.njit(
        fastmath=FAST_MATH, error_model='numpy', cache=True, nogil=True, parallel=True
    )
    return cast('Function', wrap(function))

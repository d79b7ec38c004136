"""Work on many states, shared among threads where that pays."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise
import os

import numpy as np

FEW = 500
"""States that one thread evaluates; more are shared among all threads."""


def in_threads(work: Callable[[slice], None], count: int, few: int = FEW) -> None:
    """
    Call a compiled function with slices that cover so many states, in all threads.

    No more than `few` of them do not pay for a second thread.
    """
    n_threads = os.cpu_count() or 1
    if count <= few or n_threads == 1:
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

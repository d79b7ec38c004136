"""How long a call takes."""

from __future__ import annotations

from collections.abc import Callable
import time


def seconds(call: Callable[[], object], repeats: int = 5) -> list[float]:
    """Return the sorted times of several calls, after one that compiles and warms up [s]."""
    call()
    times = []
    for _ in range(repeats):
        started = time.perf_counter()
        call()
        times.append(time.perf_counter() - started)
    return sorted(times)

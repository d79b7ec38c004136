"""Measure the time that a model takes per prediction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
import time

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.model import DynamicsModel
from lip_id_ros.progress import Progress, silent

Call = Callable[[Array, Array, Array], object]

WARM_UP = 300
QUERIES = 3000
DEVIATIONS = 30
BATCH = 1000
BATCH_SECONDS = 1.0
SEED = 0


@dataclass(frozen=True)
class CallTimes:
    """Times of single calls with one sample each [microseconds]."""

    median: float
    p99: float
    max: float

    @classmethod
    def of(cls, microseconds: Array) -> CallTimes:
        """Summarise the times of many calls."""
        return cls(*(float(value) for value in np.quantile(microseconds, [0.5, 0.99, 1.0])))


@dataclass(frozen=True)
class Speed:
    """
    Times of a model of n joints that was fitted to N samples.

    `one_query`: torque, kinetic and potential energy together. `parts`: the same, with the parts
    of the torque. `deviation`: standard deviations of torques and energies. `factorise_s`:
    additional time of the first deviation. `batch_per_second`: samples of one call with many, with
    parts.
    """

    one_query: CallTimes
    parts: CallTimes
    deviation: CallTimes
    factorise_s: float
    batch_per_second: float
    n_joints: int
    n_samples: int

    def to_json(self) -> dict[str, float]:
        """Return the keys of interfaces.md."""
        flat: dict[str, float] = {}
        for name, value in vars(self).items():
            if isinstance(value, CallTimes):
                flat |= {f'{name}_us_{which}': each for which, each in vars(value).items()}
            else:
                flat[name] = value
        return flat


def measure(model: DynamicsModel, n_samples: int, progress: Progress = silent) -> Speed:
    """Time a model on states within the range of its `n_samples` training samples."""
    low, high = model.training_range
    states = np.random.default_rng(SEED).uniform(low, high, (BATCH, *low.shape))
    one_query = _times('one query', model.query, states, QUERIES, progress)
    parts = _times('with parts', _one(model.predict), states, QUERIES, progress)
    deviate = _one(partial(model.predict, return_std=True))
    progress('factorisation', 0, 0)
    first = _seconds(deviate, *states[0])
    deviation = _times('standard deviations', deviate, states, DEVIATIONS, progress)
    return Speed(
        one_query=one_query,
        parts=parts,
        deviation=deviation,
        factorise_s=max(0.0, first - 1e-6 * deviation.median),
        batch_per_second=_batch_rate(model, states, progress),
        n_joints=int(low.shape[1]),
        n_samples=n_samples,
    )


def _one(call: Call) -> Call:
    return lambda q, dq, ddq: call(q[None], dq[None], ddq[None])


def _seconds(call: Call, q: Array, dq: Array, ddq: Array) -> float:
    begin = time.perf_counter()
    call(q, dq, ddq)
    return time.perf_counter() - begin


def _times(what: str, call: Call, states: Array, calls: int, progress: Progress) -> CallTimes:
    for q, dq, ddq in states[: min(WARM_UP, calls // 10)]:
        call(q, dq, ddq)
    seconds = np.empty(calls)
    for number in range(calls):
        seconds[number] = _seconds(call, *states[number % BATCH])
        if number % 500 == 0:
            progress(what, number, calls)
    progress(what, calls, calls)
    return CallTimes.of(1e6 * seconds)


def _batch_rate(model: DynamicsModel, states: Array, progress: Progress) -> float:
    q, dq, ddq = (np.ascontiguousarray(states[:, order]) for order in range(3))
    model.predict(q, dq, ddq)
    begin, n_answered, elapsed = time.perf_counter(), 0, 0.0
    while elapsed < BATCH_SECONDS:
        model.predict(q, dq, ddq)
        n_answered += len(q)
        elapsed = time.perf_counter() - begin
        progress('batch', round(100 * min(1.0, elapsed / BATCH_SECONDS)), 100)
    return n_answered / elapsed

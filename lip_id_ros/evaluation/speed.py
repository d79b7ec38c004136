"""How fast a predictor answers on this machine."""

from __future__ import annotations

from dataclasses import dataclass
import time

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.evaluation.estimator import Answering
from lip_id_ros.progress import Progress, silent

Floats = NDArray[np.float64]

WARM_UP = 300
QUERIES = 3000
BATCH = 1000
BATCH_SECONDS = 1.0
SEED = 0


@dataclass(frozen=True)
class Speed:
    """
    Times of a predictor.

    Attributes
    ----------
    one_query_us_median, one_query_us_p99, one_query_us_max : float
        One call with one sample: torque, kinetic and potential energy [microseconds].
    batch_per_second : float
        Samples per second where many are asked at once.
    n_joints, n_samples : int
        Size of the model.

    """

    one_query_us_median: float
    one_query_us_p99: float
    one_query_us_max: float
    batch_per_second: float
    n_joints: int
    n_samples: int

    def to_json(self) -> dict[str, float]:
        """Return the keys of docs/interfaces.md."""
        return dict(vars(self))


def measure(predictor: Answering, n_samples: int, progress: Progress = silent) -> Speed:
    """
    Time a predictor on states within the range of its training data.

    Parameters
    ----------
    predictor : Answering
        Such as a `Predictor`.
    n_samples : int
        Training samples of the model, for the record.
    progress : Progress

    Returns
    -------
    Speed

    """
    low, high = predictor.training_range
    states = np.random.default_rng(SEED).uniform(low, high, (BATCH, *low.shape))
    microseconds = _query_times(predictor, states, progress)
    median, p99, longest = np.quantile(microseconds, [0.5, 0.99, 1.0])
    return Speed(
        one_query_us_median=float(median),
        one_query_us_p99=float(p99),
        one_query_us_max=float(longest),
        batch_per_second=_batch_rate(predictor, states, progress),
        n_joints=int(low.shape[1]),
        n_samples=n_samples,
    )


def _query_times(predictor: Answering, states: Floats, progress: Progress) -> Floats:
    nanoseconds = np.empty(QUERIES)
    for call in range(-WARM_UP, QUERIES):
        q, dq, ddq = states[call % BATCH]
        begin = time.perf_counter_ns()
        predictor.query(q, dq, ddq)
        nanoseconds[max(call, 0)] = time.perf_counter_ns() - begin
        if call % 500 == 0:
            progress('one query', max(call, 0), QUERIES)
    progress('one query', QUERIES, QUERIES)
    return nanoseconds / 1e3


def _batch_rate(predictor: Answering, states: Floats, progress: Progress) -> float:
    q, dq, ddq = (np.ascontiguousarray(states[:, order]) for order in range(3))
    predictor.predict(q, dq, ddq)
    begin, n_answered, elapsed = time.perf_counter(), 0, 0.0
    while elapsed < BATCH_SECONDS:
        predictor.predict(q, dq, ddq)
        n_answered += len(q)
        elapsed = time.perf_counter() - begin
        progress('batch', round(100 * min(1.0, elapsed / BATCH_SECONDS)), 100)
    return n_answered / elapsed

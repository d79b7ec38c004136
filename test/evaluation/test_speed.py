"""Times are those of the calls that are meant."""

from __future__ import annotations

import time

from evaluation.stubs import Knowing
import numpy as np
from numpy.typing import NDArray
import pytest

from lip_id_ros.evaluation import speed
from lip_id_ros.serving import Prediction, Query

Floats = NDArray[np.float64]


class Sleeper(Knowing):
    """Takes a known time for a query and for a batch."""

    training_range = (-np.ones((3, 3)), np.array([[1.0] * 3, [2.0] * 3, [3.0] * 3]))

    def __init__(self) -> None:
        super().__init__()
        self.queries: list[Floats] = []

    def query(self, q: Floats, dq: Floats, ddq: Floats) -> Query:
        self.queries.append(np.array([q, dq, ddq]))
        time.sleep(0.002)
        return Query(q, 0.0, 0.0, q)

    def predict(self, q: Floats, dq: Floats, ddq: Floats) -> Prediction:
        time.sleep(0.02)
        return super().predict(q, dq, ddq)


def test_times_and_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(speed, 'QUERIES', 40)
    monkeypatch.setattr(speed, 'WARM_UP', 5)
    monkeypatch.setattr(speed, 'BATCH_SECONDS', 0.1)
    sleeper, reports = Sleeper(), []

    found = speed.measure(sleeper, 123, lambda *report: reports.append(report))

    assert len(sleeper.queries) == 45
    assert 2000 <= found.one_query_us_median <= found.one_query_us_p99 <= found.one_query_us_max
    assert 0 < found.batch_per_second <= speed.BATCH / 0.02
    assert (found.n_joints, found.n_samples) == (3, 123)
    assert ('one query', 40, 40) in reports
    low, high = sleeper.training_range
    assert np.all((low <= sleeper.queries) & (sleeper.queries <= high))


def test_json_keys() -> None:
    figures = speed.Speed(1.0, 2.0, 3.0, 4.0, 5, 6).to_json()
    assert figures == {
        'one_query_us_median': 1.0,
        'one_query_us_p99': 2.0,
        'one_query_us_max': 3.0,
        'batch_per_second': 4.0,
        'n_joints': 5,
        'n_samples': 6,
    }

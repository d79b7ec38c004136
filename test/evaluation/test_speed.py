"""Times are those of the calls that are meant."""

from __future__ import annotations

import time

from evaluation.stubs import Knowing
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.evaluation import speed
from lip_id_ros.model import Prediction, Query, StandardDeviation


class Sleeper(Knowing):
    """Takes a known time for a query and for a batch."""

    training_range = (-np.ones((3, 3)), np.array([[1.0] * 3, [2.0] * 3, [3.0] * 3]))

    def __init__(self) -> None:
        super().__init__()
        self.queries: list[Array] = []
        self.factorised = False

    def query(self, q: Array, dq: Array, ddq: Array) -> Query:
        self.queries.append(np.array([q, dq, ddq]))
        time.sleep(0.002)
        return Query(q, 0.0, 0.0, q)

    def predict(self, q: Array, dq: Array, ddq: Array) -> Prediction:
        time.sleep(0.02)
        return super().predict(q, dq, ddq)

    def standard_deviation(self, q: Array, dq: Array, ddq: Array) -> StandardDeviation:
        self.factorised, wait = True, 0.005 if self.factorised else 0.105
        time.sleep(wait)
        return super().standard_deviation(q, dq, ddq)


def test_times_and_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(speed, 'QUERIES', 40)
    monkeypatch.setattr(speed, 'DEVIATIONS', 3)
    monkeypatch.setattr(speed, 'BATCH_SECONDS', 0.1)
    sleeper, reports = Sleeper(), []

    found = speed.measure(sleeper, 123, lambda *report: reports.append(report))

    assert len(sleeper.queries) == 44  # with a tenth to warm up
    assert 2_000 <= found.one_query.median <= found.one_query.p99 <= found.one_query.max
    assert 20_000 <= found.parts.median <= found.parts.p99 <= found.parts.max
    assert 5_000 <= found.deviation.median < 20_000
    assert 0.09 < found.factorise_s < 0.5
    assert 0 < found.batch_per_second <= speed.BATCH / 0.02
    assert (found.n_joints, found.n_samples) == (3, 123)
    assert ('one query', 40, 40) in reports
    low, high = sleeper.training_range
    assert np.all((low <= sleeper.queries) & (sleeper.queries <= high))


def test_json_keys() -> None:
    times = speed.CallTimes.of(np.arange(101.0))
    figures = speed.Speed(times, times, times, 0.5, 4.0, 5, 6).to_json()
    assert figures == {
        **{
            f'{what}_us_{which}': value
            for what in ('one_query', 'parts', 'deviation')
            for which, value in (('median', 50.0), ('p99', 99.0), ('max', 100.0))
        },
        'factorise_s': 0.5,
        'batch_per_second': 4.0,
        'n_joints': 5,
        'n_samples': 6,
    }

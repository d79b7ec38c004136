"""Times are those of the calls that are meant."""

from __future__ import annotations

from dataclasses import astuple
import time

from evaluation.stubs import Knowing
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.evaluation import speed
from lip_id_ros.model import Prediction, Query


class Clock:
    def __init__(self) -> None:
        self.now = 0.0

    def read(self) -> float:
        return self.now

    def wait(self, seconds: float) -> None:
        self.now += seconds


class Sleeper(Knowing):
    def __init__(self, clock: Clock) -> None:
        super().__init__()
        self.wait = clock.wait
        self.queries: list[Array] = []
        self.factorised = False

    def query(self, q: Array, dq: Array, ddq: Array) -> Query:
        self.queries.append(np.array([q, dq, ddq]))
        self.wait(0.002 if len(self.queries) % 10 else 0.003)
        return Query(q, 0.0, 0.0, q)

    def predict(
        self, q: Array, dq: Array, ddq: Array, t: Array | None = None, *, return_std: bool = False
    ) -> Prediction:
        if return_std:
            self.factorised, wait = True, 0.005 if self.factorised else 0.105
        else:
            wait = 0.02
        self.wait(wait)
        return super().predict(q, dq, ddq, t, return_std=return_std)


def test_times_and_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(speed, 'QUERIES', 40)
    monkeypatch.setattr(speed, 'DEVIATIONS', 3)
    monkeypatch.setattr(speed, 'BATCH_SECONDS', 0.1)
    clock = Clock()
    monkeypatch.setattr(time, 'perf_counter', clock.read)
    sleeper, reports = Sleeper(clock), []

    found = speed.measure(sleeper, 123, lambda *report: reports.append(report))

    assert len(sleeper.queries) == 44  # with a tenth to warm up
    assert astuple(found.one_query) == pytest.approx((2_000, 3_000, 3_000))
    assert astuple(found.parts) == pytest.approx((20_000, 20_000, 20_000))
    assert astuple(found.deviation) == pytest.approx((5_000, 5_000, 5_000))
    assert found.factorise_s == pytest.approx(0.1)
    assert found.batch_per_second == pytest.approx(speed.BATCH / 0.02)
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

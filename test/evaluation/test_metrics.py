"""Error measures against sums done by hand and against their defining properties."""

from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.errors import DataError
from lip_id_ros.evaluation import evaluate, metrics
from lip_id_ros.model.proof import not_positive_definite_percent

columns = arrays(np.float64, (12, 2), elements=st.floats(-1e3, 1e3, width=32))


def test_nmse_by_hand() -> None:
    truth = np.array([[0.0, 1.0], [2.0, 3.0]])
    estimate = truth + np.array([[0.5, 0.0], [-0.5, 2.0]])

    np.testing.assert_allclose(metrics.nmse_percent(estimate, truth), [25.0, 200.0])


def test_rmse_by_hand() -> None:
    np.testing.assert_allclose(metrics.rmse(np.array([3.0, 4.0]), np.zeros(2)), np.sqrt(12.5))


def test_what_does_not_vary_has_no_nmse() -> None:
    truth = np.array([[1.0, 1.0], [1.0, 2.0]])
    nmse = metrics.nmse_percent(truth, truth)

    assert np.isnan(nmse[0])
    assert nmse[1] == 0.0
    rounded = 0.1 + np.array([0.0, 1e-17, 2e-17, 0.0]) + np.finfo(float).eps * np.arange(4.0)
    assert np.isnan(metrics.nmse_percent(np.zeros(4), rounded))


@given(columns, st.floats(-100, 100))
def test_an_offset_counts_only_where_it_is_known(truth: Array, offset: float) -> None:
    truth[0] = (0.0, 0.0)
    truth[1] = (100.0, -100.0)  # so that it varies

    without = metrics.nmse_percent_without_offset(truth + offset, truth)
    with_it = metrics.nmse_percent(truth + offset, truth)

    np.testing.assert_allclose(without, 0.0, atol=1e-9)
    np.testing.assert_allclose(with_it, 100 * offset**2 / truth.var(axis=0), atol=1e-6)


@given(columns)
def test_the_mean_as_an_estimate_has_a_hundred_percent(truth: Array) -> None:
    truth[0] = (0.0, 0.0)
    truth[1] = (1.0, 1.0)
    estimate = np.broadcast_to(truth.mean(axis=0), truth.shape)

    np.testing.assert_allclose(metrics.nmse_percent(estimate, truth), 100.0)


def test_an_eigenvalue_of_zero_is_not_positive() -> None:
    smallest = np.array([0.1, 0.0, -0.1, 2.0])
    assert not_positive_definite_percent(smallest) == pytest.approx(50.0)


@pytest.mark.parametrize(('model', 'data'), [(None, None), ('arm.npz', 'data.npz')])
def test_what_is_no_model_or_data_set_is_refused(model: Any, data: Any) -> None:
    with pytest.raises(
        DataError, match=r'^evaluate needs a model and a Dataset, not \w+ and \w+; '
    ):
        evaluate(model, data)

"""Error measures against sums done by hand and against their defining properties."""

from __future__ import annotations

from dataclasses import replace
import math
from pathlib import Path
from typing import Any

from evaluation.models import small_model, training
from evaluation.stubs import Knowing
from gp.processes import process_of
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest
from simulation.pendulums import swing

from lip_id_ros.arrays import Array
from lip_id_ros.errors import DataError
from lip_id_ros.evaluation import evaluate, metrics
from lip_id_ros.evaluation.metrics import merged
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.proof import not_positive_definite_percent, with_checks

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
    with pytest.raises(DataError, match=r'^evaluate needs a model and a Dataset, not \w+ and \w+'):
        evaluate(model, data)


DATA = replace(swing(2, duration=5.0), tau_noiseless=None, kinetic=None, potential=None)
MODEL = Knowing(torque_error=0.3, inertia=np.array([1.0, -1e-3, 2.0]))


@given(st.lists(st.integers(1, DATA.n_samples - 1), min_size=1, max_size=4, unique=True))
def test_errors_of_parts_are_those_of_the_joined_samples(cuts: list[int]) -> None:
    parts = np.split(np.arange(DATA.n_samples), sorted(cuts))
    found = merged([evaluate(MODEL, DATA.select(rows)) for rows in parts])
    whole = evaluate(MODEL, DATA)
    for name in ('nmse_percent', 'rmse', 'torque_mean', 'torque_std'):
        np.testing.assert_allclose(getattr(found, name), getattr(whole, name), rtol=1e-9)
    assert found.n_samples == whole.n_samples
    assert found.inertia_not_pd_percent == pytest.approx(100.0)
    assert found.inertia_min_eigenvalue == whole.inertia_min_eigenvalue == -1e-3


def test_one_evaluation_stays_as_it_is() -> None:
    only = evaluate(MODEL, swing(2))
    assert merged([only]) is only


def test_what_does_not_add_up_is_left_out_and_cautions_are_given_once() -> None:
    one = replace(evaluate(MODEL, swing(2)), cautions=('Beware.',))
    other = replace(one, within_two_std_percent=(90.0,) * 3, cautions=('Beware.', 'Careful.'))
    found = merged([one, other])
    assert one.kinetic_nmse_percent is not None
    assert found.kinetic_nmse_percent is None
    assert found.within_two_std_percent is None
    assert found.cautions == ('Beware.', 'Careful.')


def test_a_constant_torque_has_no_share() -> None:
    still = np.array(DATA.tau)
    still[:, 1] = 2.0
    some = evaluate(MODEL, replace(DATA, tau=still))
    found = merged([some, some])
    assert math.isnan(found.nmse_percent[1])
    assert found.nmse_percent[0] == pytest.approx(some.nmse_percent[0])


def test_the_coverage_is_that_of_all_samples_where_each_part_has_one() -> None:
    one = replace(evaluate(MODEL, DATA.select(range(30))), within_two_std_percent=(90.0,) * 3)
    other = replace(evaluate(MODEL, DATA.select(range(10))), within_two_std_percent=(50.0,) * 3)
    assert merged([one, other]).within_two_std_percent == (80.0,) * 3


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_the_summary_has_what_an_evaluation_finds(sign: float, tmp_path: Path) -> None:
    """Weights of the other sign turn the inertia around: positive definite nowhere."""
    process = process_of(small_model())
    model = replace(small_model(), process=replace(process, alpha=sign * process.alpha))
    own = [np.flatnonzero((training().q == q).all(axis=1))[0] for q in process.states.q]
    data = training().select(np.array(own))
    with_checks(model, data.q, data.tau).save(tmp_path / 'model.npz')
    summary = InverseDynamicsModel.load(tmp_path / 'model.npz').summary
    expected = evaluate(model, data)
    assert summary['inertia_not_pd_percent'] == pytest.approx(expected.inertia_not_pd_percent)
    assert summary['inertia_min_eigenvalue'] == pytest.approx(expected.inertia_min_eigenvalue)
    assert (summary['inertia_not_pd_percent'] > 50.0) == (sign < 0)

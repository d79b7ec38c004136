"""Errors in motion and near rest are those of the samples on either side of a speed."""

from __future__ import annotations

from dataclasses import replace
import math

from evaluation.stubs import Knowing
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from simulation.pendulums import swing

from lip_id_ros.evaluation import evaluate
from lip_id_ros.evaluation.metrics import NEAR_REST, near_rest, RestErrors
from lip_id_ros.evaluation.tables import error_table, notes


def test_errors_are_of_the_samples_on_either_side() -> None:
    dq = np.array([[1.0], [-1.0], [0.5 * NEAR_REST], [0.0]])
    found = RestErrors.of(np.array([[1.0], [3.0], [0.5], [0.5]]), dq)
    assert found.near_rest_percent == (50.0,)
    assert found.in_motion == pytest.approx((math.sqrt(5.0),))
    assert found.near_rest == pytest.approx((0.5,))


def test_a_joint_that_never_moves_is_near_rest() -> None:
    found = RestErrors.of(np.ones((3, 2)), np.column_stack([np.zeros(3), np.ones(3)]))
    assert found.near_rest_percent == (100.0, 0.0)
    assert math.isnan(found.in_motion[0])
    assert math.isnan(found.near_rest[1])


@given(st.integers(1, 40), st.integers(1, 40), st.integers(0, 2**32 - 1))
def test_merged_errors_are_those_of_all_samples(first: int, second: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    error, dq = rng.standard_normal((2, first + second, 2))
    dq[rng.random(dq.shape) < 0.4] = 0.0
    parts = [slice(0, first), slice(first, None)]
    found = RestErrors.merged(
        [RestErrors.of(error[rows], dq[rows]) for rows in parts], np.array([first, second])
    )
    rests = np.concatenate([near_rest(dq[rows]) for rows in parts])
    np.testing.assert_allclose(found.near_rest_percent, 100.0 * rests.mean(axis=0))
    for joint in range(2):
        for values, some in ((found.in_motion, ~rests), (found.near_rest, rests)):
            own = error[some[:, joint], joint]
            expected = np.sqrt(np.mean(own**2)) if own.size else math.nan
            np.testing.assert_allclose(values[joint], expected)


def test_an_evaluation_has_both_in_its_figures_and_its_table() -> None:
    data = swing(1)
    resting = replace(data, dq=np.where(np.arange(data.n_samples)[:, None] % 2, data.dq, 0.0))
    evaluation = evaluate(Knowing(torque_error=0.3), resting)
    assert evaluation.rest is not None
    figures = evaluation.to_json()
    assert figures['rmse_near_rest'] == list(evaluation.rest.near_rest)
    assert min(figures['near_rest_percent']) >= 50.0
    table = error_table(evaluation)
    assert table.header[3:5] == ['in motion', 'near rest']
    assert table.rows[0][4] == f'{evaluation.rest.near_rest[0]:.3g} N m'
    assert any(text.startswith('In motion, near rest') for text in notes(evaluation))

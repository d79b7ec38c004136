"""Statistics of one recording: its own friction is eliminated, and nothing else is lost."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
import pickle

from fleet.fleets import arm_of, friction_of, recording, regression_of
from hypothesis import given, settings, strategies
import numpy as np
from numpy.testing import assert_allclose
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import DataError
from lip_id_ros.fleet.recording_statistics import (
    empty_statistics,
    friction_blocks,
    link_triangles,
    packed,
    Regression,
    statistics_of,
    updated,
)
from lip_id_ros.fleet.results import RecordingStatistics, Survey
from lip_id_ros.fleet.survey import survey_of
from lip_id_ros.identification.sample_selection import measured

ARM = arm_of()
FRICTION = friction_of(ARM, np.random.default_rng(0), 0.3)
DATA = recording(ARM, FRICTION, seed=1)
REGRESSION = regression_of(ARM, DATA)


def dense(data: Dataset, regression: Regression) -> tuple[list[Array], Array]:
    """Weighted rows [own friction, links, torque] of every joint."""
    features = regression.rows(data)
    root = np.sqrt(regression.noise.weights(data.dq))
    return [
        np.column_stack([each, data.tau[:, joint]]) * root[:, joint, None]
        for joint, each in enumerate(features)
    ], root


def test_squares_are_those_of_all_samples() -> None:
    found_of = statistics_of(DATA, REGRESSION)
    tops = friction_blocks(found_of.friction_rows, REGRESSION)
    rests = link_triangles(found_of.link_factors, REGRESSION)
    rows, _ = dense(DATA, REGRESSION)
    rng = np.random.default_rng(2)
    for joint, each in enumerate(rows):
        x = np.append(rng.standard_normal(each.shape[1] - 1), -1.0)
        size = len(tops[joint])
        found = np.sum((tops[joint] @ x) ** 2) + np.sum((rests[joint] @ x[size:]) ** 2)
        assert_allclose(found, np.sum((each @ x) ** 2), rtol=1e-11)


def test_the_rest_is_what_links_explain_with_the_best_friction() -> None:
    rests = link_triangles(statistics_of(DATA, REGRESSION).link_factors, REGRESSION)
    rows, _ = dense(DATA, REGRESSION)
    for joint, (own, _) in enumerate(REGRESSION.columns()):
        friction, others = rows[joint][:, : own.size], rows[joint][:, own.size :]
        projected = others - friction @ np.linalg.lstsq(friction, others, rcond=None)[0]
        expected = projected.T @ projected
        found = rests[joint].T @ rests[joint]
        assert_allclose(found, expected, atol=1e-10 * np.abs(expected).max())


@settings(max_examples=10, deadline=None)
@given(strategies.lists(strategies.integers(1, DATA.n_samples - 1), max_size=4))
def test_a_recording_may_be_read_in_any_blocks(ends: list[int]) -> None:
    whole = packed(updated(empty_statistics(REGRESSION), DATA, REGRESSION), REGRESSION)
    statistics = empty_statistics(REGRESSION)
    cuts = np.unique([0, *ends, DATA.n_samples])
    for first, last in pairwise(cuts):
        statistics = updated(statistics, DATA.select(np.arange(first, last)), REGRESSION)
    split = packed(statistics, REGRESSION)
    scale = np.abs(whole.link_factors).max()
    for mine, its in zip(grams(whole), grams(split), strict=True):
        assert_allclose(mine, its, atol=1e-12 * scale**2)


def grams(statistics: RecordingStatistics) -> list[Array]:
    return [rest.T @ rest for rest in link_triangles(statistics.link_factors, REGRESSION)]


def test_bad_samples_are_left_out() -> None:
    tau = DATA.tau.copy()
    tau[[10, 200], 0] += 80.0 * DATA.tau.std()
    found = statistics_of(replace(DATA, tau=tau), REGRESSION)
    clean = np.setdiff1d(np.arange(DATA.n_samples), [10, 200])
    expected = statistics_of(DATA.select(clean), REGRESSION)
    assert_allclose(found.counts, expected.counts)
    assert_allclose(found.link_factors, expected.link_factors, atol=1e-9)


def test_torques_of_drives_that_are_off_are_left_out() -> None:
    tau = DATA.tau.copy()
    tau[100:300] = 0.0
    off = replace(DATA, tau=tau)
    kept = np.flatnonzero(measured(off))
    assert not set(range(100, 300)) & set(kept)
    expected = statistics_of(DATA.select(kept), REGRESSION)
    assert_allclose(statistics_of(off, REGRESSION).link_factors, expected.link_factors, atol=1e-9)
    assert np.all(survey_of(off, 'off', 'robot').tau.any(axis=1))


def test_a_recording_of_seven_joints_takes_less_than_200_kilobytes() -> None:
    arm = arm_of(1, ('revolute',) * 7)
    data = recording(arm, friction_of(arm, np.random.default_rng(0), 0.1), seed=1, count=3000)
    regression = regression_of(arm, data)
    for kept in (statistics_of(data, regression), survey_of(data, 'name', 'robot')):
        assert len(pickle.dumps(kept)) < 200_000
    assert len(regression.friction.coefficients) == 21


def test_what_is_stored_comes_back() -> None:
    survey = survey_of(DATA, 'name', 'robot', ('warning: one',))
    back = Survey.from_bytes(survey.to_bytes())
    for name, value in vars(survey).items():
        np.testing.assert_array_equal(getattr(back, name), value)
        assert type(getattr(back, name)) is type(value)


@pytest.mark.parametrize('cut', [0, 10, 1000, -1])
def test_damaged_bytes_are_refused(cut: int) -> None:
    content = statistics_of(DATA, REGRESSION).to_bytes()
    with pytest.raises(DataError, match='a RecordingStatistics with all of its entries was exp'):
        RecordingStatistics.from_bytes(content[:cut])


def test_bytes_of_another_kind_are_refused() -> None:
    with pytest.raises(DataError, match='a Survey with all of its entries was expected'):
        Survey.from_bytes(statistics_of(DATA, REGRESSION).to_bytes())


def test_residuals_are_torques_minus_features_times_parameters() -> None:
    arm = arm_of(1, ('revolute', 'prismatic', 'revolute'))
    data = recording(arm, friction_of(arm, np.random.default_rng(0), 0.1), seed=1)
    regression = regression_of(arm, data)
    parts = zip(regression.rows(data), regression.columns(), strict=True)
    coefficients, links = regression.friction.coefficients, regression.links.ravel()
    torque = [rows @ np.append(coefficients[own], links[column]) for rows, (own, column) in parts]
    assert_allclose(regression.residual(data), data.tau - np.stack(torque, axis=1), atol=1e-10)

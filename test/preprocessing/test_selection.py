"""Fewer samples out of many: those near rest, and those that cover the motion."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from preprocessing.motions import recording, uniform
import pytest

from lip_id_ros.dataset import Dataset
from lip_id_ros.dataset.subsets import farthest_points
from lip_id_ros.preprocessing import for_training, preprocess
from lip_id_ros.preprocessing.pipeline import at_most, stride
from lip_id_ros.settings import PreprocessingSettings

DATA = preprocess(recording(uniform(2000, 100.0)), PreprocessingSettings(decimate=1))


def with_velocity(dq: list[list[float]]) -> Dataset:
    values = np.array(dq)
    return Dataset(
        t=np.arange(len(values), dtype=float),
        q=values,
        dq=values,
        ddq=values,
        tau=values,
        joint_names=('a', 'b'),
        joint_types=('revolute', 'revolute'),
        segment=np.zeros(len(values)),  # type: ignore[arg-type]
    )


@pytest.mark.parametrize(
    ('share', 'kept'),
    [
        (0.1, [0, 1, 2, 3, 4, 5]),
        (0.21, [0, 1, 3, 4, 5]),  # 0.42 rad/s of the first joint
        (0.26, [0, 1, 3, 5]),  # 1.04 rad/s of the second
        (0.6, [0, 5]),  # 1.2 rad/s of the first
    ],
)
def test_samples_at_which_a_joint_is_slow_are_left_out(share: float, kept: list[int]) -> None:
    # root mean squares of 2 and 4 rad/s
    fast = [[3.0, 6.0], [-1.0, 4.0], [0.4, -2.0], [1.0, -4.0], [2.0, 1.0], [-2.9732, -4.7958]]
    data = with_velocity(fast)
    np.testing.assert_allclose(np.sqrt(np.mean(data.dq**2, axis=0)), [2.0, 4.0], rtol=1e-3)
    chosen = for_training(data, PreprocessingSettings(min_velocity=share), 'articulated')
    np.testing.assert_array_equal(chosen.t, kept)
    left = chosen.provenance.get('moving', {'samples': 6, 'of': 6})
    assert left == {'samples': len(kept), 'of': 6}


@pytest.mark.parametrize(
    ('rate_hz', 'cutoff_hz', 'kept'), [(100.0, 9.0, 2), (1000.0, 12.5, 20), (1000.0, 12.9, 19)]
)
def test_four_samples_are_kept_a_period(rate_hz: float, cutoff_hz: float, kept: int) -> None:
    found = stride(rate_hz, PreprocessingSettings(cutoff_hz=cutoff_hz))
    assert found == kept
    assert rate_hz / found >= 4 * cutoff_hz


def test_a_joint_that_never_moves_is_not_asked() -> None:
    data = with_velocity([[1.0, 0.0], [0.01, 0.0], [-1.0, 0.0]])
    np.testing.assert_array_equal(
        for_training(data, PreprocessingSettings(), 'recursive').t, [0.0, 2.0]
    )


def test_joints_that_move_one_after_another_keep_their_samples() -> None:
    data = with_velocity([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]])
    assert for_training(data, PreprocessingSettings(), 'recursive') is data


def test_nothing_is_left_out_where_nothing_is_asked() -> None:
    assert for_training(DATA, PreprocessingSettings(min_velocity=0.0), 'recursive') is DATA


def test_coverage_takes_what_time_passes_over() -> None:
    q, far = DATA.q.copy(), 777
    ddq = DATA.ddq.copy()
    ddq[far] = 100.0
    data = replace(DATA, q=q, ddq=ddq)
    settings = PreprocessingSettings(max_samples=5, selection='coverage')
    chosen = at_most(data, settings)
    assert data.t[far] in chosen.t
    assert data.t[far] not in at_most(data, replace(settings, selection='time')).t
    assert chosen.provenance['selected'] == {'samples': 5, 'of': data.n_samples}


@given(st.integers(1, 60))
def test_coverage_leaves_no_sample_far_from_those_taken(count: int) -> None:
    """Farthest points: what is left out is nearer to them than they are to each other."""
    points = np.random.default_rng(0).normal(size=(60, 3))
    rows = farthest_points(points, count)
    assert len(rows) == count
    scaled = points / points.std(axis=0)
    apart = np.linalg.norm(scaled[rows][:, None] - scaled[rows], axis=2)
    nearest = np.linalg.norm(scaled[:, None] - scaled[rows], axis=2).min(axis=1)
    smallest = (apart + np.diag(np.full(count, np.inf))).min()
    assert nearest.max() <= smallest + 1e-12


def test_repeated_points_are_taken_once() -> None:
    points = np.repeat([[0.0], [1.0]], 5, axis=0)
    assert sorted(points[farthest_points(points, 6), 0]) == [0.0, 1.0]


@pytest.mark.parametrize('selection', ['time', 'coverage'])
def test_order_of_time_stays(selection: str) -> None:
    chosen = at_most(DATA, PreprocessingSettings(max_samples=50, selection=selection))
    assert np.all(np.diff(chosen.t) > 0)
    assert chosen.n_samples == 50

"""How far states are from the training data, in distances of left-out training states."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.identification.folds import motion_s, new_motion_s, recurrent_folds
from lip_id_ros.identification.novelty import BLOCKS, known_states, MOST_KEPT, TOLERANCE
from lip_id_ros.joint_types import PRISMATIC, REVOLUTE
from lip_id_ros.model.known_states import KnownStates, nearest, novelty_in_words

RATE_HZ = 20.0
JOINTS = 3
ROUNDING = 2e-3  # of states in a file


def moved(
    seconds: float, seed: int = 0, period_s: float | None = None, size: float = 1.0
) -> Dataset:
    """Return a sum of sinusoids per joint, periodic where a period is given."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 1.0 / RATE_HZ)
    omega = rng.uniform(0.3, 4.0, (4, 1, JOINTS))
    if period_s is not None:
        omega = 2.0 * np.pi / period_s * np.arange(1.0, 5.0)[:, None, None] * np.ones((1, JOINTS))
    amplitude, phase = size * rng.uniform(0.2, 0.5, omega.shape), rng.uniform(0, 6, omega.shape)
    angle = omega * t[:, np.newaxis] + phase
    parts = amplitude * np.sin(angle), omega * amplitude * np.cos(angle)
    q, dq = (each.sum(axis=0) for each in parts)
    ddq = -(omega**2 * amplitude * np.sin(angle)).sum(axis=0)
    return Dataset.from_arrays(q, dq, ddq, np.zeros_like(q), t=t)


def joined(data: Dataset) -> Array:
    return np.hstack([data.q, data.dq, data.ddq])


def novelty(known: KnownStates, data: Dataset) -> Array:
    return known.novelty(data.q, data.dq, data.ddq)


def test_distances_are_those_of_a_loop() -> None:
    rng = np.random.default_rng(0)
    known = KnownStates(rng.normal(size=(30, 6)), rng.uniform(0.1, 9.0, 6), 0.7)
    states = 3.0 * rng.normal(size=(20, 6))
    plain = [
        min(float(np.linalg.norm(each / known.scale - other)) for other in known.states)
        for each in states
    ]
    np.testing.assert_allclose(known.distances(states), plain, rtol=1e-12)
    by_three = (states[:, at : at + 2] for at in (0, 2, 4))
    np.testing.assert_allclose(known.novelty(*by_three), np.array(plain) / 0.7, rtol=1e-12)


def test_training_states_are_known() -> None:
    data = moved(40.0, period_s=5.0)
    known = known_states(data)
    assert len(known.states) < min(data.n_samples, MOST_KEPT)
    assert novelty(known, data).max() <= TOLERANCE + ROUNDING / known.left_out


def test_few_states_stand_for_a_long_recording() -> None:
    data, other = moved(120.0), moved(30.0, seed=4)
    known = known_states(data)
    assert len(known.states) == MOST_KEPT < data.n_samples
    every, fold = joined(data) / known.scale, recurrent_folds(data, BLOCKS)
    left_out = [nearest(every[fold == k], every[fold != k]) for k in range(BLOCKS)]
    exact = nearest(joined(other) / known.scale, every) / np.median(np.concatenate(left_out))
    assert np.median(novelty(known, other) / exact) == pytest.approx(1.0, abs=0.1)


@settings(max_examples=10, deadline=None)
@given(st.floats(1e-3, 1e3), st.floats(1e-3, 1e3), st.integers(0, 9))
def test_units_do_not_matter(length: float, time: float, seed: int) -> None:
    def in_units(data: Dataset) -> Dataset:
        slope = length / time
        own: dict[str, Any] = {
            'q': data.q * length,
            'dq': data.dq * slope,
            'ddq': data.ddq * slope / time,
        }
        return replace(data, **own, t=data.t)

    data, other = moved(8.0, seed), moved(3.0, seed + 1)
    same = novelty(known_states(data), other)
    np.testing.assert_allclose(
        novelty(known_states(in_units(data)), in_units(other)), same, rtol=5e-3
    )


def test_a_joint_that_hardly_moves_is_as_far_as_one_of_its_kind() -> None:
    data = moved(10.0)
    held = np.array([1.0, 1.0, 1e-6])
    states: Any = {name: getattr(data, name) * held for name in ('q', 'dq', 'ddq')}
    still = replace(data, **states)
    alike = known_states(still).scale.reshape(3, JOINTS)
    largest = alike[:, :2].max(axis=1)
    np.testing.assert_allclose(alike[:, 2], 0.05 * largest, rtol=1e-9)
    slide = known_states(replace(still, joint_types=(REVOLUTE, REVOLUTE, PRISMATIC)))
    assert np.all(slide.scale.reshape(3, JOINTS)[:, 2] < 1e-4)


@pytest.mark.parametrize('wobble', [0.0, 1e-16, 1e-6, 1e-4])
def test_a_slide_that_rests_away_from_zero(wobble: float) -> None:
    """Its deviation is rounding, or noise; whole positions in units of that are lost in a file."""
    data = moved(40.0, period_s=5.0)
    moves = np.array([1.0, 1.0, 0.0])
    states: Any = {name: getattr(data, name) * moves for name in ('q', 'dq', 'ddq')}
    noise = wobble * np.random.default_rng(0).standard_normal(data.n_samples)
    states['q'][:, 2] = 0.3 + noise
    rested = replace(data, **states, joint_types=(REVOLUTE, REVOLUTE, PRISMATIC))
    known = known_states(rested)
    assert novelty(known, rested).max() < 0.5
    there = replace(rested, q=rested.q + [0.0, 0.0, 0.1])
    assert novelty(known, there).min() > 5.0


def test_an_arm_that_stands_has_a_novelty_too() -> None:
    still = np.zeros((50, 2))
    data = Dataset.from_arrays(still, still, still, still, t=np.arange(50) / RATE_HZ)
    known = known_states(data)
    assert np.isfinite(novelty(known, data)).all()
    assert novelty(known, replace(data, q=still + 1.0)).min() > 1e3


def test_new_motion_is_counted_once() -> None:
    every, new = motion_s(moved(30.0, period_s=5.0))
    assert every == pytest.approx(30.0, rel=0.02)
    assert new == pytest.approx(5.0, rel=0.15)
    every, new = motion_s(moved(30.0))
    assert new > 0.9 * every


def test_motion_of_another_recording_is_new_where_the_first_lacks_it() -> None:
    known = moved(20.0, period_s=5.0)
    assert new_motion_s(known, known) == 0.0
    assert new_motion_s(known, moved(10.0, seed=3, period_s=5.0)) == pytest.approx(5.0, rel=0.2)
    assert new_motion_s(known, moved(10.0, seed=3)) > 8.0


def test_rests_and_gaps_are_no_motion() -> None:
    data = moved(10.0)
    t = np.where(data.t > 5.0, data.t + 100.0, data.t)
    segment = (data.t > 5.0).astype(np.int64)
    assert motion_s(replace(data, t=t, segment=segment))[0] == pytest.approx(10.0, rel=0.02)
    rest = (data.t > 5.0)[:, None]
    states: Any = {n: np.where(rest, 0.0, getattr(data, n)) for n in ('q', 'dq', 'ddq')}
    stopped = replace(data, **states)
    assert motion_s(stopped)[0] == pytest.approx(5.0, rel=0.05)


@pytest.mark.parametrize(
    ('value', 'words'),
    [
        (0.2, 'much nearer to the training data than new motion'),
        (1.0, 'like the recording'),
        (1.5, '1.5 times as far from the training data'),
        (2.01, 'twice as far from the training data'),
        (12.34, '12 times as far from the training data'),
    ],
)
def test_a_number_has_words(value: float, words: str) -> None:
    assert novelty_in_words(value) == words

"""Copies and overlaps of recordings are recognised by their contents."""

from __future__ import annotations

from pathlib import Path
import shutil

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from simulation.pendulums import swing

from lip_id_ros.arrays import Array
from lip_id_ros.loading import load_dataset
from lip_id_ros.recording.joint_samples import content_digest, RepeatedSamples, WINDOW
from lip_id_ros.simulation import write_bag

NAMES = ('a', 'b')


def recording(seed: int, size: int = 200) -> tuple[Array, Array]:
    q, tau = np.random.default_rng(seed).standard_normal((2, size, 2)).cumsum(axis=1)
    return q, tau


@given(st.integers(0, 150), st.integers(WINDOW, 200))
def test_the_common_part_is_found_and_nothing_else(start: int, size: int) -> None:
    (q, tau), (other_q, other_tau) = recording(1), recording(2)
    part = slice(start, start + size)
    mixed = [
        np.concatenate([x[:50], y[part], x[50:]]) for x, y in ((other_q, q), (other_tau, tau))
    ]
    seen = RepeatedSamples()
    assert not seen.repeated(NAMES, q, tau).any()
    found = np.flatnonzero(seen.repeated(NAMES, *mixed))
    n_common = len(q[part])
    expected = np.arange(50, 50 + n_common) if n_common >= WINDOW else np.arange(0)
    np.testing.assert_array_equal(found, expected)


def test_the_order_of_the_joints_is_of_no_importance() -> None:
    q, tau = recording(1)
    seen = RepeatedSamples()
    seen.repeated(NAMES, q, tau)
    assert seen.repeated(NAMES[::-1], q[:, ::-1], tau[:, ::-1]).all()
    assert content_digest(NAMES, q, tau) == content_digest(NAMES[::-1], q[:, ::-1], tau[:, ::-1])
    assert content_digest(NAMES, q, tau) != content_digest(NAMES, tau, q)


def test_arms_at_rest_are_no_copies() -> None:
    q, tau = recording(1)
    still = np.repeat(q[:1], 100, axis=0), np.repeat(tau[:1], 100, axis=0)
    seen = RepeatedSamples()
    seen.repeated(NAMES, *(np.concatenate(pair) for pair in zip(still, (q, tau), strict=True)))
    assert not seen.repeated(NAMES, *still).any()


def test_a_short_recording_is_no_copy() -> None:
    q, tau = recording(1)
    seen = RepeatedSamples()
    seen.repeated(NAMES, q, tau)
    for size in (0, 1, WINDOW - 1):
        assert not seen.repeated(NAMES, q[:size], tau[:size]).any()


def test_a_copy_is_left_out_whatever_its_name(tmp_path: Path) -> None:
    write_bag(tmp_path / 'run', swing(1, rate=50.0), start=1.7e9)
    write_bag(tmp_path / 'other', swing(2, rate=50.0), start=1.7e9)
    shutil.copytree(tmp_path / 'run', tmp_path / 'renamed')
    one = load_dataset(tmp_path / 'run')
    twice = load_dataset([tmp_path / 'run', tmp_path / 'renamed', tmp_path / 'other'])
    both = load_dataset([tmp_path / 'run', tmp_path / 'other'])
    assert 'copies' not in both.provenance
    np.testing.assert_array_equal(twice.q, both.q)
    assert both.n_samples > one.n_samples
    (copy,) = twice.provenance['copies']
    assert copy['source'].endswith('renamed')
    assert copy['repeated'] == copy['samples'] > 0


def test_data_sets_that_overlap_are_joined_once(tmp_path: Path) -> None:
    data = swing(1)
    data.select(range(100)).save(tmp_path / 'a.npz')
    data.select(range(60, 160)).save(tmp_path / 'b.npz')
    joined = load_dataset([tmp_path / 'a.npz', tmp_path / 'b.npz'])
    np.testing.assert_array_equal(joined.q, data.q[:160])
    assert joined.provenance['copies'] == [
        {'source': str(tmp_path / 'b.npz'), 'samples': 100, 'repeated': 40}
    ]


@pytest.mark.parametrize('share', [0.3, 0.5])
def test_no_copy_is_on_both_sides_of_a_split(tmp_path: Path, share: float) -> None:
    write_bag(tmp_path / 'run', swing(1, rate=50.0))
    shutil.copytree(tmp_path / 'run', tmp_path / 'copy')
    training, held_out = load_dataset([tmp_path / 'run', tmp_path / 'copy']).split(1 - share)
    assert not {q.tobytes() for q in training.q} & {q.tobytes() for q in held_out.q}

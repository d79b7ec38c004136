"""A model that is evaluated on its own training data is recognised."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from evaluation.models import small_model, training
import numpy as np
import pytest
from simulation.pendulums import swing

from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation import evaluate
from lip_id_ros.evaluation.prediction import training_data_warnings as warnings
from lip_id_ros.loading import load_dataset
from lip_id_ros.preprocessing import preprocess
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.sketch import SKETCH

RECORDING = {'source': 'a', 'topic': '/joint_states', 'content': '0123', 'samples': 900}


def from_recording(data: Dataset, **changes: Any) -> Dataset:
    return replace(data, provenance={'sources': [{**RECORDING, **changes}]})


def test_training_data_are_recognized() -> None:
    (warning,) = warnings(small_model(), training())

    assert warning.startswith('These are training data: 50 of the 50 samples')


def test_some_of_the_training_data_are_enough() -> None:
    half, _ = training().split(0.5)
    (warning,) = warnings(small_model(), half)

    assert warning.startswith('These are training data: ')
    assert ' of the 50 samples' in warning


def test_another_motion_is_not() -> None:
    assert warnings(small_model(), swing(2)) == []


def test_other_samples_of_the_same_recording_are_told_apart() -> None:
    model = replace(small_model(), provenance=from_recording(training()).provenance)

    moved = from_recording(swing(2), source='elsewhere/renamed')
    (warning,) = warnings(model, moved)

    assert 'on samples of the same recording' in warning
    assert warnings(model, from_recording(swing(2), content='4567')) == []


def recorded(data: Dataset, every: int = 1, kind: type = np.float64) -> JointSamples:
    """Return raw samples of a motion, of which a copy keeps some, in fewer digits."""
    signals = (data.t, data.q, data.dq, data.tau)
    t, q, dq, tau = (x[::every].astype(kind).astype(np.float64) for x in signals)
    return JointSamples(t, q, dq, tau, data.joint_names)


@pytest.mark.parametrize(('every', 'kind'), [(1, np.float32), (2, np.float64), (4, np.float32)])
def test_a_thinned_or_rounded_copy_is_told_apart(every: int, kind: type) -> None:
    data = swing(1, rate=200.0)
    model = replace(small_model(), provenance=preprocess(recorded(data)).provenance)
    (warning,) = evaluate(model, preprocess(recorded(data, every, kind))).cautions
    assert 'or of a copy of it' in warning
    other = recorded(swing(2, rate=200.0), every, kind)
    assert evaluate(model, preprocess(other)).cautions == ()


@pytest.mark.parametrize(('every', 'kind'), [(1, np.float32), (2, np.float64)])
def test_a_copy_of_a_data_set_is_told_apart(tmp_path: Path, every: int, kind: type) -> None:
    data = swing(1, rate=200.0)
    for name, some in (('own', data), ('other', swing(2, rate=200.0))):
        some.save(tmp_path / f'{name}.npz')
    bare = {name: getattr(data, name)[::every].astype(kind) for name in ('q', 'dq', 'ddq', 'tau')}
    np.savez(tmp_path / 'copy.npz', joint_names=np.array(data.joint_names), **bare)
    provenance = load_dataset(tmp_path / 'own.npz').provenance
    model = replace(small_model(), provenance=provenance)
    assert len(warnings(model, load_dataset(tmp_path / 'copy.npz'))) == 1
    assert warnings(model, load_dataset(tmp_path / 'other.npz')) == []


def test_two_recordings_that_begin_at_rest_are_not_one() -> None:
    """In one place efforts in coarse steps are often the same, and so are whole samples."""

    def standing(seed: int) -> JointSamples:
        moving = swing(seed, rate=100.0)
        rest, rng = np.zeros((4000, moving.n_joints)), np.random.default_rng(seed)
        q, dq = (
            np.vstack([rest, x - first])
            for x, first in ((moving.q, moving.q[0]), (moving.dq, 0.0))
        )
        tau = np.vstack([rest, moving.tau]) + rng.normal(0.0, 0.05, q.shape)
        t = np.arange(len(q)) / 100.0
        return JointSamples(t, q, dq, np.round(tau / 0.02) * 0.02, moving.joint_names)

    model = replace(small_model(), provenance=preprocess(standing(1)).provenance)
    assert len(warnings(model, preprocess(standing(1)))) == 1
    assert warnings(model, preprocess(standing(2))) == []


def test_a_data_set_is_known_by_one_sketch_however_many_sources_it_has(tmp_path: Path) -> None:
    some = [{'source': 'a'}, {'source': 'b'}]
    for provenance in ({}, {'sources': ['a']}, {'sources': some}):
        replace(swing(1), provenance=provenance).save(tmp_path / 'a.npz')
        once = load_dataset(tmp_path / 'a.npz')
        once.save(tmp_path / 'a.npz')
        again = load_dataset(tmp_path / 'a.npz')
        assert [SKETCH in source for source in once.provenance['sources']][:2] in (
            [True],
            [True, False],
        )
        assert again.provenance == once.provenance


def test_provenance_that_says_nothing_is_no_reason_to_warn() -> None:
    model = replace(small_model(), provenance={'sources': ['somewhere']})
    assert warnings(model, replace(swing(2), provenance={'sources': ['somewhere']})) == []

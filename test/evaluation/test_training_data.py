"""A model that is evaluated on its own training data is recognised."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from evaluation.models import small_model, training
from simulation.pendulums import swing

from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation.cautions import training_data_warnings as warnings

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


def test_provenance_that_says_nothing_is_no_reason_to_warn() -> None:
    model = replace(small_model(), provenance={'sources': ['somewhere']})
    assert warnings(model, replace(swing(2), provenance={'sources': ['somewhere']})) == []

"""A model that is judged by held-out samples says so."""

from __future__ import annotations

from dataclasses import replace

from evaluation.models import small_model, training
import pytest
from simulation.pendulums import swing

from lip_id_ros.evaluation import evaluate
from lip_id_ros.model.proof import missing_proof
from lip_id_ros.workflow.fit import judged


def test_errors_on_held_out_samples_are_in_the_model() -> None:
    data = swing(7)
    model, evaluation = judged(small_model(), training(), data.with_joints(data.joint_names[::-1]))
    assert evaluation.nmse_percent == evaluate(small_model(), data).nmse_percent
    noted = model.summary['held_out']
    assert noted['nmse_percent'] == list(evaluation.nmse_percent)
    assert noted['new_motion_s'] == pytest.approx(20.0, rel=0.1)


def test_held_out_motion_proves_a_model_where_it_is_new() -> None:
    short = replace(small_model(), summary={**small_model().summary, 'new_motion_s': 1.0})
    assert missing_proof(short) is not None
    assert missing_proof(judged(short, training(), swing(7))[0]) is None
    for known in (training(), training().split(0.5)[0]):  # what the fit has more of is not new
        repeated, _ = judged(short, training(), known)
        assert repeated.summary['held_out']['new_motion_s'] == 0.0
        assert missing_proof(repeated) is not None

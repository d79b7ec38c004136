"""What a model's file says of its inertia matrix is what an evaluation on its samples finds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from evaluation.models import small_model, training
from gp.processes import process_of
import numpy as np
import pytest

from lip_id_ros.evaluation import evaluate
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.proof import with_checks


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

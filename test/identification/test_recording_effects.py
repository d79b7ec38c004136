"""Friction that differs between recordings."""

from __future__ import annotations

from dataclasses import replace

from identification.drives import N_JOINTS, recording
import numpy as np
import pytest

from lip_id_ros.dataset import concatenate
from lip_id_ros.identification.friction_deviations import NestedEffects
from lip_id_ros.identification.identify import identify
from lip_id_ros.identification.posterior import widening

COUNT = 8


@pytest.mark.parametrize('count', [3, 5, 12])
def test_a_recording_that_is_not_known_is_covered(count: int) -> None:
    """By two widened deviations, from three recordings on; their variance has no bias."""
    rng = np.random.default_rng(0)
    truth, covered, variances = 0.5, [], []
    for _ in range(300):
        rows = rng.standard_normal((count, 100, 2))
        effects = truth * rng.standard_normal((count, 2))
        values = np.einsum('rti,ri->rt', rows, effects) + rng.standard_normal((count, 100))
        normal = np.einsum('rti,rtj->rij', rows, rows)
        right = np.einsum('rti,rt->ri', rows, values)
        mean = np.linalg.solve(normal.sum(axis=0), right.sum(axis=0))
        nested = NestedEffects(normal, right - normal @ mean, np.arange(count))
        found = nested.estimated(np.full(2, 0.05)).recordings
        variances.append(found**2)
        error = truth * rng.standard_normal(2) - mean
        of_mean = found / np.sqrt(count)
        covered.append(np.abs(error) < 2.0 * np.hypot(widening(count) * found, of_mean))
    assert np.sqrt(np.mean(variances)) == pytest.approx(truth, rel=0.1)
    assert 0.9 < np.mean(covered) < 0.99


@pytest.mark.slow
def test_offsets_that_drift_widen_the_prediction() -> None:
    arm, dataset = recording(0, [])
    size = arm.torque(dataset.q, dataset.dq, dataset.ddq).std(axis=0)
    parts = np.array_split(np.arange(dataset.n_samples), COUNT)
    drift = 0.15 * size * np.random.default_rng(3).standard_normal((COUNT, N_JOINTS))
    drift[:, 1:] = 0.0
    drift[:, 0] -= drift[:, 0].mean()
    same = [replace(dataset.select(rows), recording=np.zeros(0, np.int64)) for rows in parts]
    apart = [replace(part, tau=part.tau + by) for part, by in zip(same, drift, strict=True)]
    found, still = identify(concatenate(apart)), identify(concatenate(same))
    terms = found.arm.friction.names()[0]
    offset = found.solution.deviations.recordings[terms.index('offset')]
    np.testing.assert_allclose(offset, drift[:, 0].std(ddof=1), rtol=0.4)
    assert still.solution.deviations.recordings[terms.index('offset')] < 0.1 * offset
    state = dataset.q, dataset.dq, dataset.ddq
    widened = found.arm.torque_std(*state) / still.arm.torque_std(*state)
    assert np.median(widened[:, 0]) > 5.0

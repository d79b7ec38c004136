"""Friction that differs between recordings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks._drives import N_JOINTS, recording
from lip_id_ros.dataset import concatenate
from lip_id_ros.identification.identify import identify
from lip_id_ros.identification.recording_effects import variance_components

COUNT = 8


def test_deviations_of_many_groups_are_recovered() -> None:
    rng = np.random.default_rng(0)
    truth = np.array([0.5, 0.1, 0.0])
    rows = rng.standard_normal((300, 40, 3))
    effects = truth * rng.standard_normal((300, 3))
    values = np.einsum('rti,ri->rt', rows, effects) + rng.standard_normal((300, 40))
    normal = np.einsum('rti,rtj->rij', rows, rows)
    right = np.einsum('rti,rt->ri', rows, values)
    got = variance_components(normal, right, np.full(3, 0.3))
    np.testing.assert_allclose(got[:2], truth[:2], rtol=0.25)
    assert got[2] < 0.06


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
    offset = found.recording_deviations[terms.index('offset')]
    np.testing.assert_allclose(offset, drift[:, 0].std(), rtol=0.4)
    assert still.recording_deviations[terms.index('offset')] < 0.1 * offset
    state = dataset.q, dataset.dq, dataset.ddq
    widened = found.arm.torque_std(*state) / still.arm.torque_std(*state)
    assert np.median(widened[:, 0]) > 5.0

"""Distances between axes count as identified where the torques depend on them, and only there."""

from __future__ import annotations

from dataclasses import replace

from gp.arms import dataset_of, noise_of, random_motion, TwoLinks
import pytest

from lip_id_ros.evaluation import with_checks
from lip_id_ros.evaluation.cautions import identified_distances
from lip_id_ros.identification import fit
from lip_id_ros.settings import FitSettings

QUICK = FitSettings(subset=100, iterations=5)


@pytest.mark.slow
@pytest.mark.parametrize(('noise', 'identified'), [(0.001, True), (3.0, False)])
def test_noise_decides_what_is_identified(noise: float, identified: bool) -> None:
    arm = TwoLinks(length=0.5)
    motion = random_motion(arm, 200, seed=4)
    tau = arm.torque(*motion)
    data = dataset_of(arm, motion, tau + noise_of(tau, 0.001))
    model = fit(data, QUICK)
    assert model.arm is not None
    noisy = replace(data, tau=data.tau + noise_of(tau, noise))
    found = identified_distances(model.arm.chain, noisy, noise * tau.std(axis=0))
    assert found.tolist() == [identified]
    if identified:
        checked = with_checks(model, data)
        assert checked.summary['identified_distances'] == [True]

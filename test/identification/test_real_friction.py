"""Selected friction and the diagnosis of efforts on real recordings."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.friction.basis import plain_friction
from lip_id_ros.health.effort_meaning import diagnose_effort
from lip_id_ros.identification.arm_fit import ArmFitter
from lip_id_ros.identification.arm_search import ArmSearch
from lip_id_ros.identification.friction_selection import SelectedFriction
from lip_id_ros.loading import load_dataset
from lip_id_ros.progress import silent
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.regressor import torque_regressor
from lip_id_ros.settings import Config, RecordingSettings

pytestmark = pytest.mark.slow

UR10 = 'unisa_ros2_bags/ur10/ur10_exciting_trajectory.db3'
UR10_JOINTS = (
    *('shoulder_pan_joint', 'shoulder_lift_joint', 'elbow_joint'),
    *('wrist_1_joint', 'wrist_2_joint', 'wrist_3_joint'),
)
PANDA = 'panda_gaz2019/exciting.csv'


@cache
def loaded(path: Path, joints: tuple[str, ...]) -> Dataset:
    return load_dataset(path, Config(recording=RecordingSettings(joints=joints)))


def torque(dataset: Dataset, chain: Chain, got: SelectedFriction) -> Array:
    state = (np.ascontiguousarray(x) for x in (dataset.q, dataset.dq, dataset.ddq))
    links = torque_regressor(chain, *state) @ got.link_parameters.ravel()
    return np.asarray(links + got.friction.torque(dataset.q, dataset.dq, dataset.ddq, links))


def test_predicts_unseen_motion_of_a_ur10(shared_data: Path) -> None:
    training, unseen = loaded(shared_data / UR10, UR10_JOINTS).split(0.7)
    fitter = ArmFitter(training)
    chain = ArmSearch(fitter).calibrated(0, silent).placements.chain
    got = fitter.selected(chain)
    error = np.mean((torque(unseen, chain, got) - unseen.tau) ** 2, axis=0)
    share = error / unseen.tau.var(axis=0)
    assert np.exp(np.mean(np.log(share))) < 0.009
    assert share.max() < 0.04
    # its Coulomb and its viscous form predict nearly alike
    assert any('load-dependent' in name for name in got.friction.names()[1])
    assert got.friction.basis.size > plain_friction(6, np.ones(6)).size
    assert got.noise.ratio[5] > 4.0  # its last joint sticks twice for a second


def test_no_false_alarm(shared_data: Path) -> None:
    """`python -m benchmarks selections --only alarms` looks at the other recordings too."""
    assert diagnose_effort(loaded(shared_data / PANDA, ())) == ()

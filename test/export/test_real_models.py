"""Models of real recordings in all formats, read by other programs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from export.readers import difference, MISSING, states_of
import numpy as np
import pytest

from benchmarks._real import ARMS
from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.description.robot import RobotDescription
from lip_id_ros.description.urdf import load_description
from lip_id_ros.export.arm import describe
from lip_id_ros.export.formats import FORMATS, formatted
from lip_id_ros.identification.arm_fit import ArmFitter
from lip_id_ros.identification.arm_prior import DescriptionSettings
from lip_id_ros.identification.posterior import posterior
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.effort_calibration import EffortCalibration

pytest.importorskip('pinocchio')
pytest.importorskip('mujoco')
pytestmark = pytest.mark.slow
SAMPLES = 200


def fitted(data: Dataset, description: RobotDescription) -> InverseDynamicsModel:
    """Fit links and friction near a URDF, which saves the search; no format has a residual GP."""
    fitter = ArmFitter(data, (description, DescriptionSettings()))
    start = fitter.best_start([description.chain], fitter.selected(description.chain))
    states = np.stack([data.q, data.dq, data.ddq])
    return InverseDynamicsModel(
        joint_names=data.joint_names,
        joint_types=data.joint_types,
        potential_reference=data.q.mean(axis=0),
        training_range=(states.min(axis=1), states.max(axis=1)),
        largest_torque=np.abs(data.tau).max(axis=0),
        n_samples=data.n_samples,
        effort_calibrations=(EffortCalibration.identity(data.n_joints),),
        arm=posterior(fitter, fitter.converged(data, start))[1],
    )


@pytest.mark.skipif(MISSING['c'], reason='needs a C compiler')
@pytest.mark.parametrize('name', ['UR10', 'Panda, 30 Hz', 'TIAGo'])
def test_all_formats_give_the_torques_of_the_model(name: str, shared_data: Path) -> None:
    arm = ARMS[name]
    data = concatenate(arm.datasets(shared_data))
    rows = np.linspace(0, data.n_samples - 1, SAMPLES).astype(np.intp)
    data = replace(data.select(rows), joint_names=arm.joints)
    model = fitted(data, load_description(shared_data / arm.urdf, arm.joints, data.joint_types))
    exported = describe(model, 'arm')
    states = states_of(exported.arm, 10_000)
    tau = model.predict(*states).tau
    for form in FORMATS:
        text = formatted(form, exported).text
        assert difference(form, text, exported.arm, states, tau) < 1e-9

"""Friction that answers late is selected where a body would need less inertia than it can have."""

from __future__ import annotations

from dataclasses import replace

from identification import springs
import numpy as np
import pytest

from benchmarks._arms import random_arm
from lip_id_ros.dataset import Dataset
from lip_id_ros.friction.terms import lag
from lip_id_ros.identification import lag_selection
from lip_id_ros.identification.arm_fit import ArmFit, ArmFitter, ROUND
from lip_id_ros.identification.arm_prior import links_torque
from lip_id_ros.identification.lag_selection import with_lags
from lip_id_ros.identification.sample_selection import remembering
from lip_id_ros.rigid_body.chain import ROTOR

pytestmark = pytest.mark.slow

JOINT, SIZE = 1, 0.1
"""Where friction is late, and by how much of the joint's torque."""


def recorded(late: bool) -> tuple[Dataset, Dataset]:
    """Return parts of a motion of an arm, without a rotor where friction may be late."""
    data, arm = springs.simulated('none'), random_arm(springs.N_JOINTS, 0)
    ddq = data.ddq[:, JOINT]
    lag = SIZE * data.tau[:, JOINT].std() / ddq.std()
    tau = data.tau.copy()
    tau[:, JOINT] -= (arm.links[JOINT, ROTOR] + late * lag) * ddq
    return remembering(replace(data, tau=tau, tau_noiseless=None)).split(0.7)


def without_motion(joint: int) -> Dataset:
    """Return the motion but for that of a joint, where the friction of another is late."""
    data, arm = springs.simulated('none'), random_arm(springs.N_JOINTS, 0)
    moves = np.arange(springs.N_JOINTS) != joint
    state = data.q * moves, data.dq * moves, data.ddq * moves
    tau = arm.torque(*state) + 0.5 * state[1]
    tau[:, JOINT] -= (arm.links[JOINT, ROTOR] + SIZE * tau[:, JOINT].std()) * state[2][:, JOINT]
    tau += 0.01 * tau.std(axis=0) * np.random.default_rng(0).standard_normal(tau.shape)
    return remembering(Dataset.from_arrays(*state, tau, t=data.t))


def fitted(dataset: Dataset) -> tuple[ArmFitter, ArmFit]:
    fitter = ArmFitter(dataset)
    chain = random_arm(springs.N_JOINTS, 0).chain
    start = fitter.best_start([chain], fitter.selected(chain))
    return fitter, fitter.refined(fitter.some(400), start, ROUND)


def late_joints(fit: ArmFit) -> list[int]:
    terms = fit.friction.basis.terms
    return [part.drive.joints[0] for part in terms if part.term.kind is lag]


def test_a_joint_that_stands_still_has_no_late_friction() -> None:
    """It got one of a million kilogram square metres."""
    found = late_joints(with_lags(*fitted(without_motion(3))))
    assert JOINT in found
    assert 3 not in found


def error(fit: ArmFit, dataset: Dataset) -> float:
    """Return the error of the joint's torques [N m]."""
    state, load = (dataset.q, dataset.dq, dataset.ddq), links_torque(fit.chain, fit.links, dataset)
    residual = dataset.tau - load - fit.friction.torque(*state, load)
    return float(residual[:, JOINT].std())


def test_late_friction_is_found_and_predicts_better() -> None:
    seen, unseen = recorded(late=True)
    fitter, fit = fitted(seen)
    found = with_lags(fitter, fit)
    assert JOINT in late_joints(found)
    assert error(found, unseen) < 0.5 * error(fit, unseen)


def test_a_fit_of_friction_that_is_not_late_stays_as_it_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Also where late friction is on offer at joints with rotors, which stand in for it."""
    fitter, fit = fitted(recorded(late=False)[0])
    assert with_lags(fitter, fit) is fit
    monkeypatch.setattr(lag_selection, 'NO_ROTOR', 100.0)
    assert with_lags(fitter, fit) is fit


def test_nothing_is_selected_where_too_little_is_new(monkeypatch: pytest.MonkeyPatch) -> None:
    fitter, fit = fitted(recorded(late=True)[0])
    few = np.arange(fitter.dataset.n_samples) % (lag_selection.LEAST_FOLDS - 1)
    monkeypatch.setattr(lag_selection, 'recurrent_folds', lambda *_: few)
    assert with_lags(fitter, fit) is fit

"""What changes while an arm is recorded is told by the residuals, and what is sound is not."""

from __future__ import annotations

from dataclasses import replace

from gp.arms import noise_of
from gp.chains import ChainArm
from identification.test_disturbances import calibrated, NOISE, recorded
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation.cautions import summary_cautions
from lip_id_ros.identification.suspicions import suspicions
from lip_id_ros.progress import silent


def suspected(arm: ChainArm, dataset: Dataset) -> list[str]:
    return suspicions(*calibrated(arm, dataset), 0, silent)


def with_torques(dataset: Dataset, change: Array) -> Dataset:
    return replace(dataset, tau=dataset.tau + change)


@pytest.mark.parametrize('friction', [0.0, 0.3])
@pytest.mark.parametrize('seed', range(4))
def test_nothing_is_suspected_of_a_sound_recording(seed: int, friction: float) -> None:
    assert suspected(*recorded(seed, friction=friction)) == []


@pytest.mark.parametrize('n_joints', range(1, 5))
@pytest.mark.parametrize('seed', range(2))
def test_errors_of_the_model_that_last_are_not_suspected(seed: int, n_joints: int) -> None:
    """Any features of half a second explain them, those of few joints most."""
    arm, dataset = recorded(seed, n_joints=n_joints)
    ripple = 0.1 * dataset.tau.std(axis=0) * np.sin(5.0 * dataset.q)
    assert suspected(arm, with_torques(dataset, ripple)) == []


@pytest.mark.parametrize('friction', [0.0, 0.3])
def test_offsets_that_drift_are_told_with_their_size(friction: float) -> None:
    arm, dataset = recorded(0, friction=friction)
    drift = np.zeros(3)
    drift[1] = -dataset.tau[:, 1].std()
    (text,) = suspected(arm, with_torques(dataset, np.outer(dataset.t / dataset.t[-1], drift)))
    name, value = text.split(': ')[1].split(' N m')[0].split()
    assert name == dataset.joint_names[1]
    assert float(value) == pytest.approx(drift[1], rel=0.1)


def test_the_drift_of_a_joint_that_stands_is_told_with_its_size() -> None:
    """Near rest samples count for less."""
    arm, dataset = recorded(0)
    moves = np.array([1.0, 0.0, 1.0])
    states = [moves * each for each in (dataset.q, dataset.dq, dataset.ddq)]
    tau = arm.torque(*states)
    drift = np.array([0.0, -tau[:, 1].std(), 0.0])
    tau += noise_of(tau, NOISE) + np.outer(dataset.t / dataset.t[-1], drift)
    q, dq, ddq = states
    (text,) = suspected(arm, replace(dataset, q=q, dq=dq, ddq=ddq, tau=tau))
    name, value = text.split(': ')[1].split(' N m')[0].split()
    assert name == dataset.joint_names[1]
    assert float(value) == pytest.approx(drift[1], rel=0.1)


@pytest.mark.parametrize('share', [0.3, 1.0])
@pytest.mark.parametrize('n_joints', [3, 4, 6])
def test_a_payload_that_comes_and_goes_is_suspected(n_joints: int, share: float) -> None:
    arm, dataset = recorded(0, n_joints=n_joints)
    states = dataset.q, dataset.dq, dataset.ddq
    body = np.outer(share * np.eye(n_joints)[-1], arm.parameters[-1])
    change = replace(arm, parameters=arm.parameters + body).torque(*states) - arm.torque(*states)
    loaded = (dataset.t % 8.0 < 4.0)[:, None]
    (text,) = suspected(arm, with_torques(dataset, loaded * change))
    assert 'a payload that was taken up and put down' in text


def test_a_base_that_rocks_is_suspected() -> None:
    arm, dataset = recorded(0)
    tilted = replace(arm, chain=arm.chain._replace(gravity=np.array([0.4, 0.0, 0.0])))
    sway = np.sin(2.0 * np.pi * 0.45 * dataset.t)[:, None]
    (text,) = suspected(arm, with_torques(dataset, sway * tilted.gravity(dataset.q)))
    assert text.startswith('A base that tilts')


def test_efforts_in_percent_of_different_ratings_are_suspected() -> None:
    arm, dataset = recorded(0)
    scaled = replace(dataset, tau=100.0 * dataset.tau / np.array([30.0, 90.0, 60.0]))
    (text,) = suspected(arm, scaled)
    assert 'give recording.effort_scale' in text


def test_suspicions_are_cautions_of_a_fit() -> None:
    assert summary_cautions((), {'suspicions': ['The base rocks.']}) == ['The base rocks.']

"""Placements of arms with springs that are as strong as gravity, and of torques that none make."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gp.arms import dataset_of, noise_of
from gp.chains import ChainArm, R, random_arm
import numpy as np
import pytest

from lip_id_ros.dataset import Dataset
from lip_id_ros.friction.conservative_terms import spring
from lip_id_ros.identification.arm_fit import ArmFitter
from lip_id_ros.identification.arm_search import ArmSearch, find_placements
from lip_id_ros.identification.identify import FRICTION, identify
from lip_id_ros.identification.placement_search import Calibration
from lip_id_ros.progress import Progress, silent
from lip_id_ros.rigid_body.chain import NO_COUPLINGS

NOISE = 0.01
STIFFNESS = (0.0, 30.0, -20.0)


def sprung(
    arm: ChainArm, count: int, seed: int, stiffness: Sequence[float] = STIFFNESS
) -> Dataset:
    motion = arm.motion(count, seed)
    tau = arm.torque(*motion) + np.array(stiffness) * motion[0]
    return dataset_of(arm, motion, tau + noise_of(tau, NOISE))


@pytest.mark.slow
def test_strong_springs_do_not_mislead_the_search(monkeypatch: pytest.MonkeyPatch) -> None:
    arm = random_arm((R, R, R), seed=1)
    train, unseen = sprung(arm, 200, seed=0), sprung(arm, 100, seed=1)
    places: list[tuple[ArmSearch, Calibration]] = []

    def noted(fitter: ArmFitter, seed: int, progress: Progress) -> tuple[ArmSearch, Calibration]:
        places.append(find_placements(fitter, seed, progress))
        return places[-1]

    monkeypatch.setattr('lip_id_ros.identification.identify.find_placements', noted)
    arm_found = identify(train, couplings=NO_COUPLINGS, terms=FRICTION)
    ((search, calibration),) = places
    assert search.terms
    assert (calibration.noise_std < 2.0 * NOISE * search.fitter.torque_std).all()
    terms = arm_found.arm.friction.basis.terms
    assert {each.drive.joints for each in terms if each.term.kind is spring} == {(1,), (2,)}
    error = arm_found.torque(unseen.q, unseen.dq, unseen.ddq) - unseen.tau
    assert (error.std(axis=0) < 2.0 * NOISE * unseen.tau.std(axis=0)).all()


def test_a_spring_that_explains_nothing_at_the_places_found_is_found_by_a_descent() -> None:
    fitter = ArmFitter(sprung(random_arm((R, R), seed=8), 200, 0, stiffness=(0.0, 20.0)))
    search = ArmSearch(fitter)
    wrong = search.calibrated(0, silent)
    assert wrong.noise_std[1] > 0.1 * fitter.torque_std[1]
    there = search.log_residuals(wrong.placements.chain)
    assert there[1] - search.with_springs().log_residuals(wrong.placements.chain)[1] < 0.1
    _, found = find_placements(fitter, 0, silent)
    assert (found.noise_std < 2.0 * NOISE * fitter.torque_std).all()


def test_torques_that_springs_do_not_explain_leave_the_search_as_it_is() -> None:
    arm = random_arm((R, R, R), seed=1)
    motion = arm.motion(150, seed=0)
    tau = arm.torque(*motion)
    tau[:, 2] = np.random.default_rng(0).standard_normal(len(tau))
    search, calibration = find_placements(ArmFitter(dataset_of(arm, motion, tau)), 0, silent)
    assert not search.terms
    assert calibration.noise_std[2] > 0.9 * tau[:, 2].std()


@pytest.mark.parametrize('stiffness', [0.0, 0.05])
def test_torques_that_links_nearly_explain_are_searched_once(stiffness: float) -> None:
    arm = random_arm((R, R), seed=1)
    data = dataset_of(arm, arm.motion(150, seed=0))
    tau = data.tau + np.array([stiffness, 0.0]) * data.q
    fitter, stages = ArmFitter(replace(data, tau=tau)), list[str]()

    def note(stage: str, done: int, total: int) -> None:
        stages.extend([stage] if done == 0 else [])

    search, _ = find_placements(fitter, 0, note)
    assert not search.terms
    assert len(stages) == 1

"""Episodes of contact are left out of an identification, and what changed meanwhile is told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gp.arms import noise_of
from gp.chains import ChainArm, contiguous, R, random_arm
import numpy as np
import pytest

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.evaluation import fit_cautions
from lip_id_ros.evaluation.cautions import summary_cautions
from lip_id_ros.identification import fit
from lip_id_ros.identification.arm_fit import ArmFitter
from lip_id_ros.identification.arm_search import ArmSearch
from lip_id_ros.identification.disturbances import (
    disturbed_blocks,
    halves_agree,
    time_blocks,
    without_disturbances,
)
from lip_id_ros.identification.left_out import Gain
from lip_id_ros.identification.placement_search import Calibration, calibration_at
from lip_id_ros.identification.sample_selection import remembering
from lip_id_ros.identification.suspicions import suspicions
from lip_id_ros.progress import silent

RATE, SECONDS, NOISE = 25.0, 40.0, 0.02
PUSHES = ((6.0, 8.0), (25.0, 27.0))


def recorded(
    seed: int, push: float = 0.0, friction: float = 0.0, n_joints: int = 3
) -> tuple[ChainArm, Dataset]:
    """Record an arm in smooth motion that is pushed twice, by a share of the torques."""
    rng = np.random.default_rng(seed)
    arm = random_arm((R,) * n_joints, seed=2)
    t = np.arange(0.0, SECONDS, 1.0 / RATE)
    shape = 6, n_joints
    rate, phase = rng.uniform(0.3, 2.0, shape), rng.uniform(0.0, 6.28, shape)
    angle = t[:, None, None] * rate + phase
    size = rng.standard_normal(shape) / np.sqrt(6.0)
    q, dq, ddq = contiguous(
        np.sum(size * np.sin(angle), axis=1),
        np.sum(size * rate * np.cos(angle), axis=1),
        -np.sum(size * rate**2 * np.sin(angle), axis=1),
    )
    tau = arm.torque(q, dq, ddq)
    tau += noise_of(tau, NOISE) + friction * tau.std(axis=0) * np.tanh(50.0 * dq) ** 3
    tau[pushed(t)] += push * tau.std(axis=0) * np.resize([1.0, -1.0], n_joints)
    return arm, Dataset.from_arrays(q, dq, ddq, tau, joint_types=arm.joint_types, t=t)


def pushed(t: Array) -> BoolArray:
    marks = [(t >= start) & (t < end) for start, end in PUSHES]
    return np.any(marks, axis=0)


def calibrated(arm: ChainArm, dataset: Dataset) -> tuple[ArmSearch, Calibration]:
    search = ArmSearch(ArmFitter(dataset))
    return search, calibration_at(arm.chain, search.samples(search.fitter.some(500)))


@pytest.mark.parametrize('push', [0.2, 0.5, 3.0])
def test_pushes_are_left_out(push: float) -> None:
    arm, dataset = recorded(0, push)
    search, _, episodes = without_disturbances(*calibrated(arm, dataset))
    rest = search.fitter.dataset
    assert not pushed(rest.t).any()
    assert rest.n_samples > dataset.n_samples - pushed(dataset.t).sum() - 4 * 0.5 * RATE
    assert [(each.start_s, each.end_s) for each in episodes] == [
        pytest.approx(each, abs=0.51) for each in PUSHES
    ]
    assert {joint for each in episodes for joint in each.joints} == {0, 1, 2}


@pytest.mark.parametrize('friction', [0.0, 0.3])
@pytest.mark.parametrize('seed', range(4))
def test_nothing_is_left_out_of_a_sound_recording(seed: int, friction: float) -> None:
    arm, dataset = recorded(seed, friction=friction)
    search, calibration = calibrated(arm, dataset)
    assert without_disturbances(search, calibration) == (search, calibration, [])


@pytest.mark.parametrize('seed', range(3))
def test_friction_that_turns_slowly_is_no_contact(seed: int) -> None:
    """Half of a recording was left out, and then nothing showed the memory: errors of 113 %."""
    arm, plain = recorded(seed)
    dataset = remembering(plain)
    assert dataset.dahl_states is not None
    friction = plain.tau.std(axis=0) * dataset.dahl_states[:, :, -1]
    search, calibration = calibrated(arm, replace(dataset, tau=plain.tau + friction))
    assert without_disturbances(search, calibration) == (search, calibration, [])


def test_a_large_residual_that_spoils_nothing_is_kept() -> None:
    """A candidate is left out only where the rest is predicted far better without it."""
    arm, dataset = recorded(0)
    tau = dataset.tau.copy()
    tau[300:310] += 0.1 * tau.std(axis=0) * np.resize([1.0, -1.0], 10)[:, None]
    changed = Dataset.from_arrays(
        dataset.q, dataset.dq, dataset.ddq, tau, joint_types=arm.joint_types, t=dataset.t
    )
    search, calibration = calibrated(arm, changed)
    assert not disturbed_blocks(search, calibration, time_blocks(changed)).any()


@pytest.mark.parametrize(('joints', 'is_left_out'), [((0, 1), True), ((0, 1, 2), False)])
def test_what_is_usual_is_no_exception(joints: Sequence[int], is_left_out: bool) -> None:
    """Joints are pushed in turn, a quarter of the time each: of most of it nobody knows."""
    arm, dataset = recorded(0)
    tau = dataset.tau.copy()
    for joint in joints:
        on = (dataset.t / 8.0 + joint / 3.0) % 1.0 < 0.25
        tau[on, joint] += 3.0 * tau[:, joint].std()
    changed = replace(dataset, tau=tau)
    marks = disturbed_blocks(*calibrated(arm, changed), time_blocks(changed))
    assert marks.any() == is_left_out


@pytest.mark.parametrize(
    ('share', 'agree'), [(0.0, True), (0.3, False), (0.5, False), (0.7, False)]
)
def test_a_load_in_about_half_of_the_samples_is_noticed(share: float, agree: bool) -> None:
    arm, dataset = recorded(0)
    loaded = replace(arm, parameters=arm.parameters + np.outer([0, 0, 1], arm.parameters[2]))
    change = (loaded.torque if share else arm.torque)(dataset.q, dataset.dq, dataset.ddq)
    change -= arm.torque(dataset.q, dataset.dq, dataset.ddq)
    is_late = dataset.t >= (1.0 - share) * SECONDS
    mixed = replace(dataset, tau=dataset.tau + is_late[:, None] * change)
    assert halves_agree(*calibrated(arm, mixed)) == agree


def test_the_error_of_a_gain_is_that_of_judged_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of six parts of the time, three have no samples of the half that is judged."""
    gains: list[tuple[Array, Gain]] = []

    class Seen(Gain):
        @classmethod
        def between(cls, now: Sequence[Array], other: Sequence[Array]) -> Gain:
            gains.append((now[0], Gain.between(now, other)))
            return gains[-1][1]

    monkeypatch.setattr('lip_id_ros.identification.linear_problem.Gain', Seen)
    arm, dataset = recorded(0)
    loaded = replace(arm, parameters=arm.parameters + np.outer([0, 0, 0.05], arm.parameters[2]))
    state = dataset.q, dataset.dq, dataset.ddq
    change = loaded.torque(*state) - arm.torque(*state)
    is_late = dataset.t >= 0.5 * SECONDS
    halves_agree(*calibrated(arm, replace(dataset, tau=dataset.tau + is_late[:, None] * change)))
    for squares, gain in gains:
        assert len(squares) == 3
        assert gain.error < 0.15 * gain.mean


def test_blocks_are_contiguous_times_of_one_segment() -> None:
    _, dataset = recorded(0)
    both = concatenate([dataset.select(np.arange(310)), dataset.select(np.arange(290))])
    block = time_blocks(both)
    assert block[0] == 0
    assert set(np.diff(block)) == {0, 1}
    assert block[310] > block[309]
    for number in range(int(block[-1]) + 1):
        rows = np.flatnonzero(block == number)
        assert np.unique(both.segment[rows]).size == 1
        assert np.ptp(both.t[rows]) < 0.5


@pytest.mark.slow
def test_a_fit_does_not_suffer_from_pushes_and_names_them() -> None:
    _, dataset = recorded(0, push=1.0)
    _, sound = recorded(0)
    _, unseen = recorded(7)
    errors = []
    for each in (dataset, sound):
        model = fit(each)
        torque = model.predict(unseen.q, unseen.dq, unseen.ddq).tau
        errors.append(np.mean((torque - unseen.tau) ** 2, axis=0))
        for said in ('touched', 'Over all samples, those left out included'):
            texts = [text for text in fit_cautions(model) if said in text]
            assert len(texts) == (each is dataset)
    assert (errors[0] < 1.2 * errors[1]).all()
    assert texts == []


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

"""The posterior of an arm where samples do not show all of it, and where recordings differ."""

from __future__ import annotations

from dataclasses import replace

from fleet.fleets import arm_of, friction_of, linearisation_of, recording, WIDTH
from identification.drives import N_JOINTS
from identification.drives import recording as driven
import numpy as np
import pytest

from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.identification.arm_fit import ArmFitter
from lip_id_ros.identification.friction_deviations import NestedEffects
from lip_id_ros.identification.identify import identify
from lip_id_ros.identification.posterior import posterior_of, widening
from lip_id_ros.identification.simple_geometry import Geometry
from lip_id_ros.identification.solution import Known, solve
from lip_id_ros.identification.total import FOLDS, FrictionDeviations, gather, Total
from lip_id_ros.model.arm_posterior import ArmPosterior

ARM = arm_of(3, ('revolute',) * 3)
FREE = Geometry.free(3)


def at_rest(data: Dataset, joint: int) -> Dataset:
    q, dq, ddq = (getattr(data, name).copy() for name in ('q', 'dq', 'ddq'))
    q[:, joint], dq[:, joint], ddq[:, joint] = 0.3, 0.0, 0.0
    noise = np.zeros_like(q) if data.tau_noiseless is None else data.tau - data.tau_noiseless
    tau = ARM.torque(q, dq, ddq) + 0.8 * np.tanh(dq / WIDTH) + noise
    return replace(data, q=q, dq=dq, ddq=ddq, tau=tau, tau_noiseless=None)


def test_what_samples_do_not_show_is_not_taken_for_known() -> None:
    """A joint that rested has torques of its own on a motion in which it moves."""
    friction = np.tile([0.0, 0.8, 0.0], (3, 1))
    data = at_rest(recording(ARM, friction, 1, count=300), 1)
    around = linearisation_of(ARM, data)
    fitter = ArmFitter(data)
    known = Known(fitter.torque_std, fitter.prior, FREE)
    found = solve(Total(around, [gather(data, around, FOLDS)]), known, replace(FREE, rigid=True))
    arm = posterior_of(around, found, data)
    root = found.covariance_root
    whole = ArmPosterior(around.chain, around.links, around.friction, arm.noise, root)
    unseen = recording(ARM, friction, 2, count=200)
    state = unseen.q, unseen.dq, unseen.ddq
    sizes = [np.sqrt(np.mean(each.torque_std(*state) ** 2, axis=0)) for each in (arm, whole)]
    assert sizes[1][1] > 10.0 * found.noise_std[1]
    np.testing.assert_allclose(sizes[0], sizes[1], rtol=0.25)


@pytest.mark.parametrize(('groups', 'factor'), [('aabbcc', 2.26), ('abcdef', 1.32)])
def test_deviations_between_robots_grow_certain_with_them(groups: str, factor: float) -> None:
    arm = arm_of()
    rng = np.random.default_rng(0)
    data = [recording(arm, friction_of(arm, rng, 0.0), k) for k in range(len(groups))]
    around = linearisation_of(arm, data[0])
    fitter = ArmFitter(concatenate(data))
    free = Geometry.free(2)
    total = Total(around, [gather(each, around) for each in data], list(groups))
    known = Known(fitter.torque_std, fitter.prior, free)
    found = solve(total, known, replace(free, rigid=True))
    between = FrictionDeviations(np.zeros(6), np.full(6, 0.1))
    arms = [
        posterior_of(around, replace(found, deviations=each), data[0])
        for each in (between, FrictionDeviations.none(6))
    ]
    columns = arms[0].covariance_root[:, arms[1].covariance_root.shape[1] :]
    np.testing.assert_allclose(columns[columns > 0.0], 0.1 * factor, rtol=0.01)


@pytest.mark.parametrize('counts', [(600, 20), (20, 600), (20, 600, 20)])
def test_a_short_recording_does_not_predict_a_long_one(counts: tuple[int, ...]) -> None:
    """The noise of a Panda was ten times too large where one of two recordings was short."""
    friction = np.tile([0.2, 0.8, 0.1], (3, 1))
    data = [recording(ARM, friction, k, count=count) for k, count in enumerate(counts)]
    around = linearisation_of(ARM, data[0])
    total = Total(around, [gather(each, around, FOLDS) for each in data])
    parts = total.folds(np.ones(3), FrictionDeviations.none(around.n_friction))
    shares = np.array([part.counts[0] for part in parts]) / sum(counts)
    assert shares.max() < 0.5
    np.testing.assert_allclose(shares.sum(), 1.0)
    whole = total.merged(np.ones(3), FrictionDeviations.none(around.n_friction))
    for joint in range(3):
        squares = [part.factors[joint].T @ part.factors[joint] for part in parts]
        expected = whole.factors[joint].T @ whole.factors[joint]
        np.testing.assert_allclose(sum(squares), expected, atol=1e-9 * np.abs(expected).max())


def test_recordings_of_one_length_are_left_out_whole() -> None:
    data = [recording(ARM, np.zeros((3, 3)), k) for k in range(2)]
    around = linearisation_of(ARM, data[0])
    total = Total(around, [gather(each, around, FOLDS) for each in data])
    parts = total.folds(np.ones(3), FrictionDeviations.none(around.n_friction))
    assert [part.counts[0] for part in parts] == [400, 400]


PARTS = 8


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
    arm, dataset = driven(0, [])
    size = arm.torque(dataset.q, dataset.dq, dataset.ddq).std(axis=0)
    parts = np.array_split(np.arange(dataset.n_samples), PARTS)
    drift = 0.15 * size * np.random.default_rng(3).standard_normal((PARTS, N_JOINTS))
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

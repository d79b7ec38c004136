"""Friction terms are elected where they are, and not where they are not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from gp.chains import ChainArm, contiguous, R, random_arm
import numpy as np
import pytest

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.friction.model import Drive, DriveTerm, FrictionBasis, FrictionModel
from lip_id_ros.friction.terms import (
    Asymmetric,
    Coulomb,
    FrictionTerm,
    LoadCoulomb,
    LoadViscous,
    Offset,
    PositionCoulomb,
    QuadraticViscous,
    Ripple,
    SaturatingViscous,
    Spring,
    Stribeck,
    Viscous,
)
from lip_id_ros.identification.friction_election import elect_friction, ElectedFriction
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.regressor import torque_regressor

N_JOINTS, JOINT = 3, 1
NOISE, WIDTH = 0.02, 0.05
LINK_STD = np.tile([5.0, *[2.0] * 3, *[1.0] * 7], (N_JOINTS, 1))
PLAIN = {'viscous', 'Coulomb', 'offset'}
COUPLED = Drive((2, 1), (1.0, 1.0))

PRESENT: dict[str, tuple[FrictionTerm, list[float]]] = {
    'Stribeck': (Stribeck(WIDTH), [0.0, 0.1, 0.0]),
    'saturating viscous': (SaturatingViscous(WIDTH), [0.0, 0.4, 0.0]),
    'quadratic viscous': (QuadraticViscous(), [0.1]),
    'load-dependent Coulomb': (LoadCoulomb(WIDTH), [0.15]),
    'load-dependent viscous': (LoadViscous(), [0.15]),
    'asymmetric': (Asymmetric(WIDTH), [0.1, 0.1, 0.0, 0.0]),
    'position-dependent Coulomb': (PositionCoulomb(WIDTH), [0.1, 0.0, 0.0, 0.0]),
    'periodic once a turn': (Ripple(1), [0.1, 0.1]),
    'periodic twice a turn': (Ripple(2), [0.1, 0.1]),
    'joint spring': (Spring(), [0.1]),
}
"""Terms of the second joint, with coefficients in standard deviations of the links' torque."""


def motion(rng: np.random.Generator) -> tuple[Array, Array, Array, Array]:
    """Sample a minute of slow sines that reach about half a turn to both sides, at 16 Hz."""
    t = np.arange(960) / 16.0
    q, dq, ddq = np.zeros((3, t.size, N_JOINTS))
    for j in range(N_JOINTS):
        w = 2.0 * np.pi * rng.uniform(0.03, 0.35, 6)
        a = rng.standard_normal(6) / (1.0 + 3.0 * w)
        phase = np.outer(t, w) + rng.uniform(0.0, 2.0 * np.pi, 6)
        size = 3.5 / np.abs(np.sin(phase) @ a).max()
        q[:, j], dq[:, j] = size * np.sin(phase) @ a, size * np.cos(phase) @ (a * w)
        ddq[:, j] = -size * np.sin(phase) @ (a * w**2)
    return t, q, dq, ddq


def recording(seed: int, extra: list[tuple[DriveTerm, list[float]]]) -> tuple[ChainArm, Dataset]:
    """Simulate an arm with plain friction of every joint and some terms more."""
    rng = np.random.default_rng(seed)
    arm = random_arm((R,) * N_JOINTS, seed)
    t, q, dq, ddq = motion(rng)
    links = arm.torque(q, dq, ddq)
    size = links.std(axis=0)
    parts = [
        (DriveTerm(Drive.of_joint(j), term), [0.1])
        for j in range(N_JOINTS)
        for term in (Viscous(), Coulomb(WIDTH), Offset())
    ]
    scaled = []
    for part, values in [*parts, *extra]:
        loaded = part.term.name.startswith('load')
        scaled.append(np.array(values) * (1.0 if loaded else size[part.drive.joints[0]]))
    basis = FrictionBasis(N_JOINTS, tuple(part for part, _ in [*parts, *extra]))
    friction = FrictionModel(basis, np.concatenate(scaled))
    clean = links + friction.torque(q, dq, links)
    dataset = Dataset(
        t=t,
        q=q,
        dq=dq,
        ddq=ddq,
        tau=clean + NOISE * size * rng.standard_normal(clean.shape),
        joint_names=('a', 'b', 'c'),
        joint_types=(R,) * N_JOINTS,
        segment=np.zeros(t.size, dtype=np.int64),
        tau_noiseless=clean,
    )
    return arm, dataset


def elected(arm: ChainArm, dataset: Dataset) -> tuple[ElectedFriction, list[set[str]]]:
    got = elect_friction(dataset, Chain(*arm.chain), LINK_STD)
    return got, [set(names) - PLAIN for names in got.friction.names()]


def error(arm: ChainArm, dataset: Dataset, got: ElectedFriction) -> Array:
    """Return the error of the noiseless torque, in units of the measurement's noise."""
    state = contiguous(dataset.q, dataset.dq, dataset.ddq)
    links = torque_regressor(arm.chain, *state) @ got.link_parameters.ravel()
    assert dataset.tau_noiseless is not None
    tau = links + got.friction.torque(dataset.q, dataset.dq, links)
    off = np.sqrt(np.mean((tau - dataset.tau_noiseless) ** 2, axis=0))
    return np.asarray(off / (NOISE * arm.torque(*state).std(axis=0)))


Terms = list[tuple[DriveTerm, list[float]]]


def count(extra: Terms, expected: list[set[str]], n_seeds: int) -> tuple[int, float]:
    """Return how often all that is there was elected, and the mean number of wrong elections."""
    recovered, wrong = 0, 0
    for seed in range(n_seeds):
        arm, dataset = recording(seed, extra)
        got, names = elected(arm, dataset)
        pairs = list(zip(names, expected, strict=True))
        wrong += sum(len(mine - there) for mine, there in pairs)
        if all(there <= mine for mine, there in pairs):
            recovered += 1
            assert np.all(error(arm, dataset, got) < 1.0)
    return recovered, wrong / n_seeds


FEW_OR_MANY = [(2, 2), pytest.param(20, 17, marks=pytest.mark.slow)]


@pytest.mark.parametrize(('n_seeds', 'least'), FEW_OR_MANY)
@pytest.mark.parametrize('name', PRESENT)
def test_elected_where_it_is(name: str, n_seeds: int, least: int) -> None:
    term, values = PRESENT[name]
    extra = [(DriveTerm(Drive.of_joint(JOINT), term), values)]
    recovered, wrong = count(extra, [set(), {name}, set()], n_seeds)
    assert recovered >= least
    assert wrong <= 0.5


@pytest.mark.parametrize(('n_seeds', 'least'), FEW_OR_MANY)
def test_coupled_motors(n_seeds: int, least: int) -> None:
    extra = [(DriveTerm(COUPLED, term), [0.1]) for term in (Viscous(), Coulomb(WIDTH))]
    expected = [
        set(),
        {'viscous coupled with joint 3', 'Coulomb coupled with joint 3'},
        {'viscous coupled with joint 2', 'Coulomb coupled with joint 2'},
    ]
    recovered, wrong = count(extra, expected, n_seeds)
    assert recovered >= least
    assert wrong <= 0.5


@pytest.mark.parametrize('n_seeds', [3, pytest.param(20, marks=pytest.mark.slow)])
def test_nothing_is_elected_where_there_is_nothing(n_seeds: int) -> None:
    assert count([], [set()] * N_JOINTS, n_seeds)[1] <= 0.1


def test_sticking_near_rest_spoils_nothing() -> None:
    """Samples near rest are off by the Coulomb torque: they count for less, not the others."""
    arm, dataset = recording(0, [])
    near = np.abs(dataset.dq) < 0.1
    rng = np.random.default_rng(1)
    size = arm.torque(dataset.q, dataset.dq, dataset.ddq).std(axis=0)
    off = np.where(near, 0.3 * size * rng.choice([-1.0, 1.0], near.shape), 0.0)
    got, names = elected(arm, replace(dataset, tau=dataset.tau + off))
    assert names == [set()] * N_JOINTS
    assert np.all(got.noise.ratio >= 4.0)
    assert np.all(error(arm, dataset, got) < 1.0)
    plain, _ = elected(arm, dataset)
    np.testing.assert_array_equal(plain.noise.ratio, 0.0)


def test_a_joint_that_nothing_explains_spoils_no_other() -> None:
    arm, dataset = recording(0, [])
    tau = dataset.tau.copy()
    walk = np.cumsum(np.random.default_rng(2).standard_normal(dataset.n_samples))
    tau[:, 2] += 2.0 * tau[:, 2].std() * walk / walk.std()
    clean, _ = elected(arm, dataset)
    spoilt, _ = elected(arm, replace(dataset, tau=tau))
    before, after = (error(arm, dataset, got)[:2] for got in (clean, spoilt))
    assert np.all(after < 1.5 * before)


def with_spikes(dataset: Dataset) -> tuple[Dataset, BoolArray]:
    """Let 2 % of the torques be off by ten standard deviations of the torque."""
    rng = np.random.default_rng(9)
    bad = rng.random(dataset.tau.shape) < 0.02
    off = 10.0 * dataset.tau.std(axis=0) * rng.choice([-1.0, 1.0], bad.shape)
    return replace(dataset, tau=dataset.tau + np.where(bad, off, 0.0)), bad


def with_absurd_accelerations(dataset: Dataset) -> tuple[Dataset, BoolArray]:
    """Let one in 200 accelerations be a hundred times too large."""
    bad = np.arange(dataset.n_samples) % 200 == 0
    ddq = np.where(bad[:, None], 100.0 * dataset.ddq, dataset.ddq)
    return replace(dataset, ddq=ddq), np.broadcast_to(bad[:, None], ddq.shape)


@pytest.mark.parametrize('spoil', [with_spikes, with_absurd_accelerations])
def test_bad_samples_change_little(
    spoil: Callable[[Dataset], tuple[Dataset, BoolArray]],
) -> None:
    arm, dataset = recording(0, [])
    bad_dataset, bad = spoil(dataset)
    clean, _ = elected(arm, dataset)
    got, names = elected(arm, bad_dataset)
    assert names == [set()] * N_JOINTS
    assert np.all(error(arm, dataset, got) < 1.1 * error(arm, dataset, clean) + 0.01)
    weights = got.weights(bad_dataset, Chain(*arm.chain))
    assert np.mean(weights[~bad] > 0.9) > 0.99
    assert np.median(weights[bad]) < 0.01

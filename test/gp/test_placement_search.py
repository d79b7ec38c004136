"""Placements found in torques, and the models that are made of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import product
from typing import Any

from gp.arms import dataset_of, noise_of
from gp.chains import ChainArm, P, R, random_arm
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import FitError
from lip_id_ros.gp import fit
from lip_id_ros.gp.placement_search import find_links, FINEST, Samples
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.progress import silent
from lip_id_ros.settings import FitSettings

NOISE = 1e-3
ARMS = [*product((R, P), repeat=2), (R, P, R), (P, R, R), (R, R, P), (P, P, R), (R, R, R, R)]
ARMS += [(R, P, R, P), (P, R, R, R)]
VISCOUS, COULOMB = 0.8, 1.5


def samples_of(arm: ChainArm, n_samples: int = 120, noise: float = NOISE) -> Dataset:
    motion = arm.motion(n_samples, seed=0)
    tau = arm.torque(*motion)
    return dataset_of(arm, motion, tau + noise_of(tau, noise))


def learned(dataset: Dataset, **settings: Any) -> InverseDynamicsModel:
    return fit(dataset, FitSettings(iterations=25, **settings))


def energies(model: InverseDynamicsModel) -> str:
    """Return the name of the energies beside the links."""
    assert len(model.process.prior.kernel.links) == 1
    return model.process.prior.kernel.energy.name


def assert_close(got: Array | None, expected: Array, share: float = 3e-3) -> None:
    """Within a share of the largest value."""
    assert got is not None
    np.testing.assert_allclose(got, expected, rtol=0.0, atol=share * np.abs(expected).max())


@pytest.mark.parametrize('joint_types', ARMS, ids=lambda kinds: ''.join(k[0] for k in kinds))
def test_random_arms(joint_types: tuple[str, ...]) -> None:
    """Only noise is left, and unseen torques and energies are the true ones, wherever is down."""
    arm = random_arm(joint_types, seed=11)
    dataset = samples_of(arm)
    model = learned(dataset, friction=False)
    assert energies(model) == 'none'
    assert model.has_potential
    noise = NOISE * arm.torque(dataset.q, dataset.dq, dataset.ddq).std(axis=0)
    np.testing.assert_allclose(model.noise_std, noise, rtol=0.25)
    q, dq, ddq = arm.motion(100, seed=1)
    predictor = model
    got = predictor.predict(q, dq, ddq)
    assert_close(got.tau, arm.torque(q, dq, ddq))
    assert_close(got.gravity, arm.gravity(q))
    assert_close(got.kinetic, arm.kinetic(q, dq))
    reference = arm.potential(model.potential_reference[None])
    assert_close(got.potential, arm.potential(q) - reference)
    found = predictor.inertia_matrix(q)
    assert_close(found, arm.inertia(q))
    assert np.linalg.eigvalsh(found).min() > 0.0


@cache
def with_friction() -> Dataset:
    dataset = samples_of(random_arm((R, R, R), seed=2))
    friction = VISCOUS * dataset.dq + COULOMB * np.tanh(dataset.dq / 0.05)
    return replace(dataset, tau=dataset.tau + friction)


def test_friction_is_told_from_the_links() -> None:
    arm = random_arm((R, R, R), seed=2)
    model = learned(with_friction())
    assert energies(model) == 'none'
    q, dq, ddq = arm.motion(100, seed=1)
    got = model.predict(q, dq, ddq)
    assert_close(got.tau - got.friction, arm.torque(q, dq, ddq), 0.01)
    assert_close(got.kinetic, arm.kinetic(q, dq), 0.01)


def found(dataset: Dataset, seed: int) -> Any:
    nothing = np.zeros((*dataset.tau.shape, 0))
    return find_links(Samples(dataset, nothing), 60, seed, silent)


def test_a_seed_says_all() -> None:
    dataset = samples_of(random_arm((R, P, R), seed=5))
    first, second, other = (found(dataset, seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(first.links.chain.rotations, second.links.chain.rotations)
    np.testing.assert_array_equal(first.links.chain.translations, second.links.chain.translations)
    np.testing.assert_array_equal(first.left_over, second.left_over)
    assert not np.array_equal(first.links.chain.rotations, other.links.chain.rotations)


@pytest.mark.parametrize('seed', range(4))
def test_what_is_left_over_is_the_noise(seed: int) -> None:
    arm = random_arm((R, R, R), seed=20 + seed)
    dataset = samples_of(arm)
    noise = NOISE * arm.torque(dataset.q, dataset.dq, dataset.ddq).std(axis=0)
    np.testing.assert_allclose(found(dataset, seed).left_over, noise, rtol=0.25)


def test_nothing_is_left_over_without_noise() -> None:
    """Down to what is told at all."""
    dataset = samples_of(random_arm((R, P, R), seed=5), noise=0.0)
    np.testing.assert_allclose(found(dataset, 0).left_over, FINEST * dataset.tau.std(axis=0))


def test_torques_without_gravity() -> None:
    arm = random_arm((R, P, R), seed=9, gravity=0.0)
    dataset = replace(samples_of(arm), gravity_compensated=True)
    model = learned(dataset)
    assert energies(model) == 'none'
    assert not model.has_potential
    q, dq, ddq = arm.motion(100, seed=1)
    got = model.predict(q, dq, ddq)
    assert got.potential is None
    assert_close(got.tau, arm.torque(q, dq, ddq))
    assert_close(model.inertia_matrix(q), arm.inertia(q))


@pytest.mark.parametrize('gravity', [1.62, 24.8])
def test_gravity_of_another_size(gravity: float) -> None:
    """Links of other lengths have the same torques and energies on the Earth."""
    arm = random_arm((R, R, R), seed=6, gravity=gravity)
    model = learned(samples_of(arm), friction=False)
    assert energies(model) == 'none'
    q, dq, ddq = arm.motion(100, seed=1)
    got = model.predict(q, dq, ddq)
    assert_close(got.tau, arm.torque(q, dq, ddq))
    assert_close(got.kinetic, arm.kinetic(q, dq))
    reference = arm.potential(model.potential_reference[None])
    assert_close(got.potential, arm.potential(q) - reference)


def test_energies_are_kept_where_no_links_explain_the_torques() -> None:
    """A spring between two joints is no rigid link, and a function of their angles."""
    arm = random_arm((R, R), seed=4)

    def torque(q: Array, dq: Array, ddq: Array) -> Array:
        spring = -10.0 * np.sin(q[:, 0] - q[:, 1])
        return arm.torque(q, dq, ddq) + spring[:, None] * (1.0, -1.0)

    motion, unseen = arm.motion(120, seed=0), arm.motion(100, seed=1)
    tau = torque(*motion)
    model = learned(dataset_of(arm, motion, tau + noise_of(tau)), friction=False)
    assert energies(model) == 'recursive'
    assert model.has_potential
    assert_close(model.predict(*unseen).tau, torque(*unseen))


def resting(q: Array, dq: Array, ddq: Array) -> None:
    q[:, 1], dq[:, 1], ddq[:, 1] = 0.3, 0.0, 0.0


def at_rest(q: Array, dq: Array, ddq: Array) -> None:
    dq[:], ddq[:] = 0.0, 0.0


def slow(q: Array, dq: Array, ddq: Array) -> None:
    dq *= 1e-3
    ddq *= 1e-6


def violent(q: Array, dq: Array, ddq: Array) -> None:
    dq *= 1e3
    ddq *= 1e6


def far_away(q: Array, dq: Array, ddq: Array) -> None:
    q += 1e4


def repeated(q: Array, dq: Array, ddq: Array) -> None:
    half = len(q) // 2
    for x in (q, dq, ddq):
        x[half:] = x[:half]


@pytest.mark.parametrize('change', [resting, at_rest, slow, violent, far_away, repeated])
def test_unusual_motions(change: Callable[[Array, Array, Array], None]) -> None:
    """The torques of more such motions are known."""
    arm = random_arm((R, R, R), seed=1)
    motion, unseen = arm.motion(120, seed=0), arm.motion(100, seed=1)
    change(*motion)
    change(*unseen)
    tau = arm.torque(*motion)
    model = learned(dataset_of(arm, motion, tau + noise_of(tau)))
    assert_close(model.predict(*unseen).tau, arm.torque(*unseen), 0.01)


@pytest.mark.parametrize('size', [1e-3, 1e4])
def test_torques_of_any_size(size: float) -> None:
    """Only numbers change with their unit, and where rounding lets a descent end."""
    dataset = with_friction()
    motion = random_arm((R, R, R), seed=2).motion(100, seed=1)
    expected = learned(dataset).predict(*motion)
    got = learned(replace(dataset, tau=size * dataset.tau)).predict(*motion)
    assert_close(got.tau, size * expected.tau)
    assert_close(got.kinetic, size * expected.kinetic)


@pytest.mark.parametrize('reach', [0.01, 30.0])
def test_slides_of_any_length(reach: float) -> None:
    """A few millimetres, or ten metres."""
    arm = random_arm((P, R, P), seed=5)
    motion, unseen = arm.motion(120, seed=0), arm.motion(100, seed=1)
    for x in (*motion, *unseen):
        x[:, (0, 2)] *= reach
    tau = arm.torque(*motion)
    model = learned(dataset_of(arm, motion, tau + noise_of(tau)))
    assert_close(model.predict(*unseen).tau, arm.torque(*unseen), 0.01)


def test_ten_samples() -> None:
    """Too few for a good model, enough for a usable one."""
    arm = random_arm((R, R), seed=4)
    model = learned(samples_of(arm, 10))
    tau = arm.torque(*arm.motion(100, seed=1))
    got = model.predict(*arm.motion(100, seed=1)).tau
    assert (np.mean((got - tau) ** 2, axis=0) < tau.var(axis=0)).all()


def test_too_few_samples_for_placements() -> None:
    """As if links had not been asked for."""
    dataset = samples_of(random_arm((R,) * 7, seed=4), 13)
    model, expected = learned(dataset), learned(dataset, kernel='recursive')
    assert model.process.prior.kernel.links == ()
    np.testing.assert_array_equal(model.process.alpha, expected.process.alpha)


def test_three_samples_per_joint() -> None:
    """Fewer torques than there are unknowns, and yet a model."""
    arm = random_arm((R, R, R, R), seed=4)
    model = learned(samples_of(arm, 12))
    assert energies(model) == 'none'
    motion = arm.motion(100, seed=1)
    tau = arm.torque(*motion)
    error = np.mean((model.predict(*motion).tau - tau) ** 2, axis=0)
    assert (error < 0.05 * tau.var(axis=0)).all()


@pytest.mark.parametrize('friction', [True, False])
def test_exact_torques(friction: bool) -> None:
    """Without noise a likelihood has no maximum; a fit ends all the same."""
    arm = random_arm((R, R, R), seed=1)
    model = learned(samples_of(arm, noise=0.0), friction=friction)
    unseen = arm.motion(100, seed=1)
    assert_close(model.predict(*unseen).tau, arm.torque(*unseen), 1e-6)


def test_a_torque_of_noise_alone() -> None:
    """Does not spoil what is known of the other joints."""
    arm = random_arm((R, R, R), seed=1)
    dataset = samples_of(arm)
    tau = dataset.tau.copy()
    tau[:, 2] = np.random.default_rng(0).standard_normal(len(tau))
    model = learned(replace(dataset, tau=tau))
    unseen = arm.motion(100, seed=1)
    expected = arm.torque(*unseen)[:, :2]
    assert_close(model.predict(*unseen).tau[:, :2], expected, 0.01)


@pytest.mark.filterwarnings('ignore::RuntimeWarning')
@pytest.mark.parametrize('name', ['dq', 'ddq', 'tau'])
def test_numbers_too_large_are_refused(name: str) -> None:
    dataset = samples_of(random_arm((R, R), seed=4), 20)
    values = getattr(dataset, name).copy()
    values[3] = 1e200
    with pytest.raises(FitError, match=r'expected to be finite but is not: check the data'):
        learned(replace(dataset, **{name: values}))

"""What is attached to the last link, on simulated arms."""

from __future__ import annotations

from dataclasses import replace

from export.arms import model_of, random_arm, residual_gp_of
from identification.arms import assert_gradient
from model.models import torque_of_processes
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import DataError
from lip_id_ros.export.arm import ArmDescription
from lip_id_ros.export.payload import payload_in_flange
from lip_id_ros.friction.basis import plain_friction
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.identification import payload_problem
from lip_id_ros.identification.arm_fit import ArmFitter
from lip_id_ros.identification.payload import identify_payload, Payload
from lip_id_ros.identification.payload_problem import PayloadProblem, WeightedTorques
from lip_id_ros.identification.posterior import posterior, ranges_of
from lip_id_ros.model.arm_posterior import ArmPosterior, compacted
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.pseudo_inertia import pseudo_inertia
from lip_id_ros.rigid_body.regressor import torque_regressor

MASS, CENTRE, GYRATION = 1.0, np.array([0.01, -0.02, 0.05]), 0.03
NOISE = 0.05

Learned = list[tuple[ArmPosterior, tuple[Array, Array]]]


def body() -> Array:
    inertia = MASS * (
        GYRATION**2 * np.eye(3) + CENTRE @ CENTRE * np.eye(3) - np.outer(CENTRE, CENTRE)
    )
    return np.array([MASS, *(MASS * CENTRE), *inertia[np.triu_indices(3)]])


def arm_of(kinds: str, seed: int = 5) -> ArmDescription:
    arm = random_arm(kinds, seed)
    coefficients = 0.1 * arm.friction.coefficients
    return replace(arm, friction=FrictionModel(arm.friction.basis, coefficients))


def payload_of(arm: ArmDescription, dataset: Dataset) -> Payload:
    return payload_in_flange(identify_payload(model_of(arm), dataset), 0.0, 0.0)


def loaded(arm: ArmDescription, payload: Array | None = None) -> Array:
    """Return its links (n, 11) with what is attached, the usual body by default."""
    links = arm.links.copy()
    links[-1, :10] += body() if payload is None else payload
    return links


def recorded(
    arm: ArmDescription, payload: Array, seed: int, noise: float, correlated: int = 1
) -> Dataset:
    rng = np.random.default_rng(seed)
    n, t = len(arm.links), np.arange(0.0, 20.0, 0.02)
    w = 2.0 * np.pi * rng.uniform(0.1, 0.5, (5, n))
    a, phase = rng.uniform(-0.3, 0.3, (5, n)), rng.uniform(0.0, 6.0, (5, n))
    angle = w * t[:, None, None] + phase
    q, dq = (a * np.sin(angle)).sum(1), (a * w * np.cos(angle)).sum(1)
    ddq = -(a * w**2 * np.sin(angle)).sum(1)
    links = loaded(arm, payload)
    load = torque_regressor(arm.chain, q, dq, ddq) @ links.ravel()
    white = rng.standard_normal((len(t) // correlated, n))
    tau = (
        load + arm.friction.torque(q, dq, ddq, load) + noise * np.repeat(white, correlated, axis=0)
    )
    types = tuple('prismatic' if slides else 'revolute' for slides in arm.chain.prismatic)
    return Dataset.from_arrays(q, dq, ddq, tau, joint_types=types, t=t)


@pytest.mark.parametrize('kinds', ['PRRRR', 'RRRRRRR'])
@pytest.mark.slow
def test_one_kilogram_at_five_centimetres(kinds: str) -> None:
    arm = arm_of(kinds)
    found = payload_of(arm, recorded(arm, body(), 0, NOISE))
    assert found.mass == pytest.approx(MASS, rel=0.01)
    np.testing.assert_allclose(found.centre, CENTRE, atol=2e-3)
    assert abs(found.mass - MASS) < 4.0 * found.mass_std
    assert (np.abs(found.centre - CENTRE) < 4.0 * found.centre_std).all()
    np.testing.assert_allclose(found.inertia, GYRATION**2 * MASS * np.eye(3), atol=5e-3)


@pytest.mark.slow
def test_a_process_beside_links_is_no_payload() -> None:
    """What it was learned to correct of the bare arm is not explained by the payload."""
    arm = arm_of('RRRRRR')
    first = residual_gp_of(arm)  # at two joints, here the last ones
    residual_gp = replace(
        first,
        replaces=np.zeros(6, dtype=bool),
        lengths=np.roll(first.lengths, 4, axis=0),
        alpha=10.0 * np.roll(first.alpha, 4, axis=1),
    )
    data = recorded(arm, body(), 0, NOISE)
    rest = torque_of_processes(residual_gp, data.q, data.dq, data.ddq)
    assert rest.std(axis=0).max() > 10.0 * NOISE
    model, data = model_of(arm), replace(data, tau=data.tau + rest)
    found, ignorant = (
        payload_in_flange(identify_payload(each, data), 0.0, 0.0)
        for each in (replace(model, residual_gp=residual_gp), model)
    )
    assert found.mass == pytest.approx(MASS, rel=0.001)
    np.testing.assert_allclose(found.centre, CENTRE, atol=5e-4)
    assert np.abs(ignorant.centre - CENTRE).max() > 1e-3


def learned(data: Dataset, chain: Chain) -> ArmPosterior:
    """Fit an arm whose placements need not be searched for."""
    fitter = ArmFitter(data)
    fit = fitter.best_start([chain], fitter.selected(chain))
    arm = posterior(fitter, fitter.converged(data, fit))[1]
    return compacted(arm, ranges_of(data))


def plain_arm() -> ArmDescription:
    friction = FrictionModel(plain_friction(4, np.full(4, 0.05)), np.full(12, 0.2))
    return replace(arm_of('RRRR'), friction=friction)


@pytest.fixture(scope='module')
def learned_arms() -> Learned:
    """Return eight arms, each learned from a recording of its own, and its ranges."""
    arm, out = plain_arm(), []
    for seed in range(8):
        bare = recorded(arm, np.zeros(10), 100 + seed, NOISE).select(np.arange(0, 1000, 3))
        out.append((learned(bare, arm.chain), ranges_of(bare)))
    return out


@pytest.mark.slow
def test_deviations_cover_the_truth_on_learned_arms(learned_arms: Learned) -> None:
    """With noise that is correlated over a tenth of a second."""
    scores, some = [], np.arange(0, 1000, 3)
    for seed, (arm, ranges) in enumerate(learned_arms):
        dataset = recorded(plain_arm(), body(), seed, NOISE, correlated=5).select(some)
        model = replace(model_of(plain_arm()), arm=arm, training_range=ranges)
        found = payload_in_flange(identify_payload(model, dataset), 0.0, 0.0)
        scores.append((found.parameters - body()) / np.sqrt(np.diagonal(found.covariance)))
    assert np.mean(np.abs(scores) < 2.0) > 0.9
    assert 0.6 < np.sqrt(np.mean(np.square(scores))) < 1.4


@pytest.mark.slow
def test_deviations_grow_with_those_of_the_arm_and_with_noise_that_lasts(
    learned_arms: Learned,
) -> None:
    (arm, ranges), some = learned_arms[0], np.arange(0, 1000, 3)
    unsure = replace(arm, covariance_root=5.0 * arm.covariance_root)
    white = recorded(plain_arm(), body(), 0, NOISE).select(some)
    lasting = recorded(plain_arm(), body(), 0, NOISE, correlated=50).select(some)
    std = []
    for own, data in ((arm, white), (unsure, white), (arm, lasting)):
        model = replace(model_of(plain_arm()), arm=own, training_range=ranges)
        found = payload_in_flange(identify_payload(model, data), 0.0, 0.0)
        std.append(np.sqrt(np.diagonal(found.covariance)[:4]))
    assert (np.median(np.divide(std[1:], std[0]), axis=1) > 1.5).all()


@pytest.mark.slow
def test_deviations_of_energies_cover_the_truth(learned_arms: Learned) -> None:
    """At states of an unseen motion; the potential energy relative to its reference."""
    arm, scores = plain_arm(), []
    true = model_of(arm)
    unseen = recorded(arm, np.zeros(10), 500, 0.0)
    expected = true.predict(unseen.q, unseen.dq, unseen.ddq)
    for posterior_arm, _ in learned_arms:
        model = replace(true, arm=posterior_arm)
        found = model.predict(unseen.q, unseen.dq, unseen.ddq, return_std=True)
        for name in ('kinetic', 'potential'):
            error = getattr(found, name) - getattr(expected, name)
            scores.append(error / getattr(found.std, name))
    inside = np.abs(scores).reshape(len(learned_arms), 2, -1) < 2.0
    assert 0.9 < inside.mean() <= 0.99
    assert 0.7 < np.sqrt(np.mean(np.square(scores))) < 1.3


def test_what_the_motion_does_not_show_is_uncertain() -> None:
    """Arms with parallel vertical axes feel neither a height nor a mass alone."""
    arm = arm_of('RRR')
    chain = arm.chain._replace(rotations=np.stack([np.eye(3)] * 3))
    scara = replace(arm, chain=chain)
    found = payload_of(scara, recorded(scara, body(), 0, NOISE))
    assert found.centre_std[2] > 1.0
    assert found.centre_std[:2].max() < 0.1


def test_nothing_attached_is_a_body_of_no_mass() -> None:
    arm = arm_of('RRRRRR')
    found = payload_of(arm, recorded(arm, np.zeros(10), 1, NOISE))
    assert 0.0 < found.mass < 0.02
    assert np.linalg.eigvalsh(pseudo_inertia(found.parameters))[0] > -1e-12


def test_an_arm_lighter_than_its_model_is_refused() -> None:
    arm = arm_of('RRRRRR')
    with pytest.raises(DataError, match=r'lighter by 0\.[12].* fit the arm without its tool'):
        payload_of(arm, recorded(arm, -0.2 * body(), 1, NOISE))


def test_joints_that_stick_say_little() -> None:
    """A third of the samples are at rest, where friction is anything within its bounds."""
    arm = arm_of('RRRRRR')
    moving = recorded(arm, body(), 0, NOISE).select(np.arange(0, 1000, 2))
    resting = moving.select(np.arange(0, 500, 2))
    still = np.zeros_like(resting.dq)
    load = torque_regressor(arm.chain, resting.q, still, still) @ loaded(arm).ravel()
    friction = arm.friction.torque(resting.q, still, still, load)
    stuck = np.full(6, 2.0)
    both = Dataset.from_arrays(
        np.concatenate([moving.q, resting.q]),
        np.concatenate([moving.dq, still]),
        np.concatenate([moving.ddq, still]),
        np.concatenate([moving.tau, load + friction + stuck]),
        joint_types=moving.joint_types,
    )
    model = model_of(arm)
    assert model.arm is not None
    noise = replace(model.arm.noise, stuck=stuck, width=np.full(6, 0.01))
    sticking = replace(model, arm=replace(model.arm, noise=noise))
    found = payload_in_flange(identify_payload(sticking, both), 0.0, 0.0)
    assert found.mass == pytest.approx(MASS, rel=0.02)
    np.testing.assert_allclose(found.centre, CENTRE, atol=4e-3)


def test_too_few_samples() -> None:
    arm = arm_of('RRR')
    with pytest.raises(DataError, match='at least 50 samples were expected to find a payload'):
        payload_of(arm, recorded(arm, body(), 0, NOISE).select(np.arange(49)))


def test_the_centre_has_the_deviation_of_its_ratio() -> None:
    rng = np.random.default_rng(0)
    factor = 0.01 * rng.standard_normal((10, 10))
    payload = Payload(body(), factor @ factor.T)
    draws = body() + rng.standard_normal((200_000, 10)) @ factor.T
    centres = draws[:, 1:4] / draws[:, :1]
    np.testing.assert_allclose(payload.centre_std, centres.std(axis=0), rtol=0.05)


def test_the_gradient_of_a_payload_by_differences() -> None:
    """The prior's share too, which matters where the torques show nothing."""
    arm = model_of(arm_of('RRR')).arm
    assert arm is not None
    rng = np.random.default_rng(0)
    q, dq, ddq, *tau = rng.standard_normal((5, 30, 3))
    std = np.full((30, 3), 20.0)
    bare, loaded = (WeightedTorques(q, dq, ddq, each, std) for each in tau)
    problem = PayloadProblem(arm, bare, loaded)
    step = rng.standard_normal(problem.size)
    at = problem.stepped(problem.start(), 0.1 * step)
    assert_gradient(problem, at, rtol=1e-3, atol=1e-5)


def test_the_prior_of_a_payload_has_the_units_of_its_body() -> None:
    """A point mass of one deviation, one deviation away, is one deviation off in every entry."""
    mass, length = payload_problem.MASS, payload_problem.LENGTH
    for axis in range(3):
        body = np.zeros(10)
        body[0], body[1 + axis] = mass, mass * length
        body[np.delete([4, 7, 9], axis)] = mass * length**2
        shown = body * payload_problem.BODY_PRECISION
        np.testing.assert_allclose(shown[shown != 0.0], 1.0)

"""Single-output estimators and the one on the Lagrangian."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from simulation.panda_runs import runs
from torch_later import Later, NEEDS_TORCH, torch

from benchmarks._arms import JointFriction
from benchmarks.baselines import method
from lip_id_ros.evaluation import metrics
from lip_id_ros.kernels import JointBasis
from lip_id_ros.progress import silent
from lip_id_ros.settings import FitSettings
from lip_id_ros.simulation import panda

pytest.importorskip('pinocchio')

pytestmark = NEEDS_TORCH

lse: Any = Later('benchmarks.baselines.lse')
single: Any = Later('benchmarks.baselines.single_output')

FRICTION = JointFriction(np.array([2.0, 1.0]), np.array([3.0, 2.0]))


def gram(term: Any, motion: Any) -> np.ndarray:
    x = term.features(motion)
    theta = torch.tensor(term.initial_guess(x))
    return np.asarray(term.gram(theta, torch.tensor(x), torch.tensor(x)))


def test_covariances_are_symmetric_and_positive_semidefinite() -> None:
    data, _ = runs(2, 60)
    basis = JointBasis.of(data.joint_types, data.q)
    for term in (
        single.SquaredExponential(basis),
        single.GeometricPolynomial(basis),
        single.friction(1),
    ):
        K = gram(term, single.Motion.of(data))
        np.testing.assert_allclose(K, K.T, rtol=1e-12)
        assert np.linalg.eigvalsh(K)[0] > -1e-9 * np.trace(K)


def test_squared_exponential_is_its_formula() -> None:
    data, _ = runs(2, 5)
    term = single.SquaredExponential(JointBasis.of(data.joint_types, data.q))
    x = term.features(single.Motion.of(data))
    theta = np.random.default_rng(1).standard_normal(1 + x.shape[1])
    found = term.gram(*(torch.tensor(a) for a in (theta, x, x)))
    scaled = (x[:, None] - x) / np.exp(theta[1:])
    expected = np.exp(theta[0]) * np.exp(-0.5 * np.square(scaled).sum(axis=2))
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_the_geometric_polynomial_holds_the_torques_of_rigid_bodies() -> None:
    # finitely many functions: given more samples than functions, unseen motions hold no surprise
    arm, rng = panda(2), np.random.default_rng(0)
    seen, unseen = (single.Motion(*rng.uniform(-2, 2, (3, 300, 2))) for _ in range(2))
    term = single.GeometricPolynomial(JointBasis.of(arm.joint_types, seen.q))
    x, z = (torch.tensor(term.features(motion)) for motion in (seen, unseen))
    theta = torch.tensor(term.initial_guess(x.numpy()))
    K, k = (term.gram(theta, a, x).numpy() for a in (x, z))
    assert np.linalg.matrix_rank(K, rtol=1e-12) == 5 * 5 * (1 + 2 + 3)
    estimate = k @ (np.linalg.pinv(K, rcond=1e-12, hermitian=True) @ arm.inverse_dynamics(*seen))
    assert metrics.nmse_percent(estimate, arm.inverse_dynamics(*unseen)).max() < 1e-6


@pytest.mark.slow
def test_gip_learns_friction_and_se_something() -> None:
    data, unseen = runs(2, 120, FRICTION, noise=0.05)
    errors = {}
    for name, settings in (
        ('gip', FitSettings(iterations=15)),
        ('gip without friction', FitSettings(friction=False, iterations=15)),
        ('se', FitSettings(iterations=15)),
    ):
        method_ = method(name.split()[0])
        assert isinstance(method_, single.SingleOutput)
        found = method_.fit(data, settings, silent).predict(unseen.q, unseen.dq, unseen.ddq)
        assert unseen.tau_noiseless is not None
        assert found.kinetic is None
        errors[name] = float(metrics.nmse_percent(found.tau, unseen.tau_noiseless).max())
    assert errors['gip'] < 0.1 * errors['gip without friction']
    assert errors['gip'] < errors['se'] < 60


def test_lse_learns_torques_and_friction() -> None:
    data, unseen = runs(2, 100, FRICTION, noise=0.05)
    assert unseen.tau_noiseless is not None
    learned = lse.Lse(iterations=30).fit(data, FitSettings(subset=60), silent)
    found = learned.predict(unseen.q, unseen.dq, unseen.ddq)
    assert metrics.nmse_percent(found.tau, unseen.tau_noiseless).max() < 1
    assert found.potential is not None
    assert unseen.potential is not None
    assert metrics.nmse_percent_without_offset(found.potential, unseen.potential) < 1
    without = lse.Lse(iterations=30).fit(data, FitSettings(subset=60, friction=False), silent)
    worse = without.predict(unseen.q, unseen.dq, unseen.ddq)
    assert metrics.nmse_percent(worse.tau, unseen.tau_noiseless).max() > 1


def test_lse_energies_are_those_of_its_torques() -> None:
    # along a motion without friction, T + V changes by the work of the torques
    data, unseen = runs(2, 150)
    learned = lse.Lse(iterations=30).fit(data, FitSettings(friction=False, subset=60), silent)
    found = learned.predict(unseen.q, unseen.dq, unseen.ddq)
    assert found.kinetic is not None
    assert found.potential is not None
    assert unseen.kinetic is not None
    assert metrics.nmse_percent(found.kinetic, unseen.kinetic) < 1
    step = 1e-4
    earlier, later = (
        learned.predict(
            unseen.q + s * unseen.dq + 0.5 * s**2 * unseen.ddq,
            unseen.dq + s * unseen.ddq,
            unseen.ddq,
        )
        for s in (-step, step)
    )
    assert later.kinetic is not None
    assert later.potential is not None
    assert earlier.kinetic is not None
    assert earlier.potential is not None
    change = later.kinetic + later.potential - earlier.kinetic - earlier.potential
    power = (found.tau * unseen.dq).sum(axis=1)
    assert metrics.nmse_percent(change / (2 * step), power) < 1

"""Deviations of friction between recordings and between robots, against the dense formulas."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose
import pytest
from scipy.linalg import block_diag

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.identification.friction_deviations import NestedEffects

K = 2
WITHIN, BETWEEN = np.array([0.3, 0.05]), np.array([0.8, 0.4])


def simulated(
    seed: int, n_groups: int, per_group: int
) -> tuple[list[Array], list[Array], IntArray, Array]:
    """Features, residuals, groups and true effects of recordings with noise of one."""
    rng = np.random.default_rng(seed)
    group = np.repeat(np.arange(n_groups), per_group)
    u = BETWEEN * rng.standard_normal((n_groups, K))
    total = u[group] + WITHIN * rng.standard_normal((group.size, K))
    features = [rng.standard_normal((30, K)) * [3.0, 5.0] for _ in group]
    residuals = [f @ x + rng.standard_normal(30) for f, x in zip(features, total, strict=True)]
    return features, residuals, group, total


def effects_of(features: list[Array], residuals: list[Array], group: IntArray) -> NestedEffects:
    normal = np.array([f.T @ f for f in features])
    right = np.array([f.T @ r for f, r in zip(features, residuals, strict=True)])
    return NestedEffects(normal, right, group)


def test_deviations_are_recovered() -> None:
    found = effects_of(*simulated(0, 60, 4)[:3]).estimated(np.ones(K))
    assert_allclose(found.recordings, WITHIN, rtol=0.15, atol=0.02)
    assert_allclose(found.groups, BETWEEN, rtol=0.25)


@pytest.mark.parametrize('deviations', [(WITHIN, BETWEEN), (WITHIN, 0.0 * BETWEEN)])
def test_effects_are_those_of_the_dense_mixed_model(deviations: tuple[Array, Array]) -> None:
    features, residuals, group, _ = simulated(1, 4, 3)
    found = effects_of(features, residuals, group).given(*deviations)
    design, y, covariance = dense_model(features, residuals, group, deviations)
    cross = covariance @ design.T
    whole = design @ cross + np.eye(len(y))
    mean = np.vstack(features)
    precision = mean.T @ np.linalg.solve(whole, mean)
    centre = np.linalg.solve(precision, mean.T @ np.linalg.solve(whole, y))
    assert_allclose(found.centre, centre, atol=1e-10)
    effect = cross @ np.linalg.solve(whole, y - mean @ centre)
    assert_allclose(found.mean.ravel(), effect, atol=1e-10)
    gain = cross @ np.linalg.inv(whole)
    follow = np.tile(np.eye(K), (len(group), 1)) - gain @ mean
    variance = covariance - gain @ cross.T + follow @ np.linalg.solve(precision, follow.T)
    assert_allclose(found.std.ravel(), np.sqrt(np.diagonal(variance)), rtol=1e-8)


def dense_model(
    features: list[Array], residuals: list[Array], group: IntArray, deviations: tuple[Array, Array]
) -> tuple[Array, Array, Array]:
    """Design of all effects u_g + v_r, residuals, and the covariance of the effects."""
    within, between = (np.diag(each**2) for each in deviations)
    same = (group[:, None] == group).astype(float)
    covariance = np.asarray(np.kron(np.eye(len(group)), within) + np.kron(same, between), float)
    design: Array = np.zeros((sum(map(len, features)), K * len(group)))
    row = 0
    for k, each in enumerate(features):
        design[row : row + len(each), K * k : K * (k + 1)] = each
        row += len(each)
    torque: Array = np.concatenate(residuals)
    return design, torque, covariance


@pytest.mark.parametrize('deviates', [True, False])
def test_the_restricted_likelihood_is_largest(deviates: bool) -> None:
    features, residuals, group, _ = simulated(2, 8, 3)
    for f, r in zip(features, residuals, strict=True):
        if not deviates:  # the second coefficient is the same everywhere, noise included
            r -= f[:, 1] * np.linalg.lstsq(f, r)[0][1]
    found = effects_of(features, residuals, group).estimated(np.ones(K))
    variances = np.concatenate([found.recordings, found.groups]) ** 2
    assert np.array_equal(variances > 0.0, [True, deviates] * 2)

    def likelihood(variances: Array) -> float:
        parts = np.sqrt(variances[:K]), np.sqrt(variances[K:])
        design, y, covariance = dense_model(features, residuals, group, parts)
        whole = design @ covariance @ design.T + np.eye(len(y))
        mean = np.vstack(features)
        solved = np.linalg.solve(whole, np.column_stack([mean, y]))
        precision = mean.T @ solved[:, :K]
        residual = y - mean @ np.linalg.solve(precision, mean.T @ solved[:, -1])
        size = np.linalg.slogdet(whole)[1] + np.linalg.slogdet(precision)[1]
        return -0.5 * float(size + residual @ np.linalg.solve(whole, residual))

    best = likelihood(variances)
    for k, variance in enumerate(variances):
        step = 1e-4 * np.eye(2 * K)[k] * (variance or 1e-2)
        gain = likelihood(variances + step) - best
        loss = best - likelihood(variances - step) if variance else 0.0
        # the slope is zero inside, and negative at the bound
        assert gain < 0.0
        assert abs(gain + loss) < 1e-6 or not variance


@pytest.mark.parametrize('start', [1e-4, 1e-2, 10.0])
def test_the_start_does_not_matter(start: float) -> None:
    equations = effects_of(*simulated(2, 12, 3)[:3])
    one, other = equations.estimated(np.ones(K)), equations.estimated(np.full(K, start))
    for name, values in vars(one).items():
        assert_allclose(getattr(other, name), values, rtol=1e-9, atol=1e-12)


def test_single_recordings_of_robots_deviate_as_recordings() -> None:
    features, residuals, group, _ = simulated(4, 40, 1)
    found = effects_of(features, residuals, group).estimated(np.ones(K))
    assert not found.groups.any()
    assert_allclose(found.recordings, np.hypot(WITHIN, BETWEEN), rtol=0.3)


def joint_equations(seed: int, size: int, group: IntArray) -> NestedEffects:
    """Equations of one joint with effects in its first two coefficients."""
    rng = np.random.default_rng(seed)
    features = [rng.standard_normal((20, size)) for _ in group]
    effects = np.zeros((group.size, size))
    effects[:, :K] = WITHIN * rng.standard_normal((group.size, K))
    effects[:, :K] += (BETWEEN * rng.standard_normal((group.size, K)))[group]
    residuals = [f @ x + rng.standard_normal(20) for f, x in zip(features, effects, strict=True)]
    return effects_of(features, residuals, group)


def test_joints_of_different_sizes_are_estimated_as_each_alone() -> None:
    group = np.random.default_rng(5).permutation(np.repeat(np.arange(7), [1, 2, 3, 4, 5, 6, 7]))
    sizes = (2, 4, 3)
    joints = [joint_equations(k, size, group) for k, size in enumerate(sizes)]
    starts = [np.where(np.arange(size) < K, 0.5, 0.0) for size in sizes]
    order = np.random.default_rng(6).permutation(sum(sizes))
    normal = np.array(
        [block_diag(*each) for each in zip(*(j.normal for j in joints), strict=True)]
    )
    right = np.hstack([joint.right for joint in joints])
    whole = NestedEffects(normal[:, order[:, None], order], right[:, order], group)
    found = whole.estimated(np.concatenate(starts)[order])
    alone = [joint.estimated(start) for joint, start in zip(joints, starts, strict=True)]
    for name, values in vars(found).items():
        expected = np.concatenate([getattr(each, name) for each in alone], axis=-1)
        assert_allclose(values, expected[..., order], rtol=1e-9, atol=1e-12)

"""Gaussian processes beside links, or instead of them, where left-out samples ask for them."""

from __future__ import annotations

from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from model.models import torque_of_processes
import numpy as np
import pytest
from torch_later import needs_torch, torch

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.identification.process_parameters import (
    negative_log_posterior,
    sparse_weights,
    TYPICAL,
)
from lip_id_ros.identification.residual_gp_selection import (
    Fold,
    fold_masks,
    ResidualGPSelection,
    Targets,
)
from lip_id_ros.model.residual_gp import (
    correlation,
    Inputs,
    near_and_beyond,
    ResidualGP,
    stored_inputs,
)

N = 240


def motion() -> tuple[Array, Array, Array]:
    t = np.linspace(0.0, 30.0, N)[:, None]
    rates = np.array([1.0, 1.7])
    return np.sin(rates * t), rates * np.cos(rates * t), -(rates**2) * np.sin(rates * t)


def masks_of(q: Array, dq: Array | None = None) -> list[tuple[BoolArray, int]]:
    dq = np.random.default_rng(3).standard_normal(q.shape) if dq is None else dq
    data = Dataset.from_arrays(q, dq, np.zeros_like(q), q, t=np.arange(len(q)) / 8.0)
    return fold_masks(data, np.arange(len(q)))


def selected(residual: Array, tau: Array) -> ResidualGP | None:
    """Of a model without parameters, which leaves the same residual whatever is left out."""
    state = motion()
    masks = masks_of(*state[:2])
    folds = [Fold(out, residual, joint) for out, joint in masks]
    inputs = Inputs.of(np.ones(2, dtype=bool), *state)
    targets = Targets(
        inputs, stored_inputs(inputs(*state)), inputs.friction(state[1]), tau, residual
    )
    return targets.conditioned(ResidualGPSelection(targets, folds).select())


@pytest.mark.slow
def test_noise_has_no_process() -> None:
    for seed in range(5):
        noise = np.random.default_rng(seed).standard_normal((N, 2))
        assert selected(noise, 10.0 * noise + motion()[0]) is None


def test_a_function_of_the_state_is_learned_beside_the_links() -> None:
    q, dq, ddq = motion()
    rng = np.random.default_rng(0)
    residual = 0.01 * rng.standard_normal((N, 2))
    residual[:, 1] += 0.3 * np.sin(2.0 * q[:, 1])
    tau = residual + 20.0 * rng.standard_normal((N, 2))
    found = selected(residual, tau)
    assert found is not None
    np.testing.assert_array_equal(found.joints, [False, True])
    assert not found.replaces.any()
    learned = torque_of_processes(found, q, dq, ddq)
    assert not learned[:, 0].any()
    assert np.std(learned[:, 1] - 0.3 * np.sin(2.0 * q[:, 1])) < 0.03


def test_links_that_explain_nothing_are_replaced() -> None:
    q, dq, ddq = motion()
    tau = np.sin(q + 0.5 * q[:, ::-1]) + 0.2 * np.tanh(20.0 * dq)
    residual = tau.copy()
    residual[:, 0] += 5.0 * np.sin(9.0 * q[:, 0] * q[:, 1])
    residual[:, 1] = 1e-3 * np.random.default_rng(0).standard_normal(N)
    found = selected(residual, tau)
    assert found is not None
    np.testing.assert_array_equal(found.replaces, [True, False])
    error = torque_of_processes(found, q, dq, ddq)[:, 0] - tau[:, 0]
    assert np.mean(error**2) < 0.05 * tau[:, 0].var()


@needs_torch
def test_length_scales_by_automatic_differentiation() -> None:
    rng = np.random.default_rng(0)
    x, y, known = rng.standard_normal((30, 4)), rng.standard_normal(30), np.full((30, 30), 0.7)
    theta = rng.normal(size=5)

    def density(theta: Any) -> Any:
        scaled = torch.from_numpy(x) / torch.exp(theta[:-1])
        squares = ((scaled[:, None] - scaled) ** 2).sum(dim=2)
        noise = torch.exp(theta[-1]) * torch.eye(30)
        gram = torch.exp(-0.5 * squares) + torch.from_numpy(known) + noise
        explained = torch.from_numpy(y) @ torch.linalg.solve(gram, torch.from_numpy(y))
        prior = ((theta[:-1] - np.log(TYPICAL * 2.0)) ** 2).sum()
        return 0.5 * (torch.logdet(gram) + 30 * torch.log(explained / 30) + prior)

    at = torch.tensor(theta, requires_grad=True)
    expected = density(at)
    expected.backward()
    value, gradient = negative_log_posterior(theta, x, y, known)
    np.testing.assert_allclose(value, expected.item(), rtol=1e-7)
    np.testing.assert_allclose(gradient, at.grad.numpy(), rtol=1e-6)


def test_a_torque_of_few_inputs_is_learned_from_them() -> None:
    """One length scale for all inputs would need many more samples."""
    rng = np.random.default_rng(2)
    q, dq, ddq = (rng.uniform(-1.0, 1.0, (2 * N, 5)) for _ in range(3))
    tau = np.sin(3.0 * q) + 0.5 * ddq
    tau += 0.02 * rng.standard_normal(tau.shape)
    inputs = Inputs.of(np.ones(5, dtype=bool), q, dq, ddq)
    state = q[:N], dq[:N], ddq[:N]
    targets = Targets(
        inputs, inputs(*state), inputs.friction(dq[:N]), tau[:N], 3.0 * rng.standard_normal((N, 5))
    )
    folds = [Fold(out, targets.residual, k) for out, k in masks_of(q[:N], dq[:N])]
    found = targets.conditioned(ResidualGPSelection(targets, folds).select())
    assert found is not None
    assert found.replaces.all()
    error = torque_of_processes(found, q[N:], dq[N:], ddq[N:]) - tau[N:]
    assert (np.mean(error**2, axis=0) < 0.02 * tau.var(axis=0)).all()


def test_both_ends_of_each_joint_are_left_out_beside_blocks_of_time() -> None:
    """A process has to predict positions that it was not trained at."""
    q = np.random.default_rng(0).permuted(
        np.linspace(-1.0, 1.0, 600)[:, None].repeat(2, 1), axis=0
    )
    masks = masks_of(q)
    of_time = [mask for mask, joint in masks if joint < 0]
    np.testing.assert_array_equal(np.sum(of_time, axis=0), 1)
    for joint in range(2):
        low, high = (mask for mask, place in masks if place == joint)
        assert low.sum() == high.sum() == 100
        assert q[low, joint].max() < q[~low & ~high, joint].min()
        assert q[high, joint].min() > q[~low & ~high, joint].max()


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(2, 200),
    length=st.floats(0.3, 6.0),
    share=st.floats(1e-3, 1.0),
)
def test_means_are_those_of_all_samples(
    seed: int, count: int, length: float, share: float
) -> None:
    rng = np.random.default_rng(seed)
    x, lengths = rng.standard_normal((count, 4)), np.full(4, length)
    gram = correlation(x, x, lengths) + 0.1 * np.eye(count)
    alpha = np.linalg.solve(gram, rng.standard_normal((count, 2)) * [1.0, 100.0])
    means = correlation(near_and_beyond(x), x, lengths) @ alpha
    tolerance = share * means.std(axis=0) + 1e-300
    few = sparse_weights(x, lengths, alpha, tolerance)
    got = correlation(near_and_beyond(x), x, lengths) @ few
    assert np.all(np.abs(got - means) <= 1.001 * tolerance)

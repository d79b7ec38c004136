"""Every fused loop of the energy kernels against nested automatic differentiation."""

from __future__ import annotations

from kernels.cases import ARMS, MEMBERS, random_basis, random_states, random_weights
from kernels.reference import EnergyReference, State
import numpy as np
import pytest
from torch_later import needs_torch, torch

from lip_id_ros.arrays import Array
from lip_id_ros.kernels import EnergyKernel, FAMILY, JointBasis, Weights
from lip_id_ros.kernels.gram import (
    contracted_gradient,
    cross_gram,
    energy_covariance,
    gram,
    prior_blocks,
)
from lip_id_ros.kernels.program import with_potential_after

CASES = [(member, arm) for member in MEMBERS for arm in ARMS]


def setting(
    member: str, types: tuple[str, ...], n_samples: int, seed: int = 0
) -> tuple[EnergyKernel, JointBasis, Weights, tuple[Array, Array, Array]]:
    rng = np.random.default_rng(seed)
    kernel = FAMILY[member](len(types))
    basis = random_basis(types, rng)
    return kernel, basis, random_weights(kernel, rng), random_states(n_samples, len(types), rng)


def tensors(states: tuple[Array, Array, Array], t: int) -> State:
    q, dq, ddq = states
    return State(torch.tensor(q[t]), torch.tensor(dq[t]), torch.tensor(ddq[t]))


@needs_torch
@pytest.mark.slow
@pytest.mark.parametrize(('member', 'types'), CASES)
def test_torque_blocks(member: str, types: tuple[str, ...]) -> None:
    """The closed-form Gram matrix is the Euler-Lagrange operator applied to both sides."""
    kernel, basis, weights, x = setting(member, types, 3)
    z = random_states(2, len(types), np.random.default_rng(1))
    reference = EnergyReference(kernel, basis, Weights(*map(torch.tensor, weights)))
    expected = np.block(
        [
            [reference.torque_block(tensors(x, t), tensors(z, u)).numpy() for u in range(2)]
            for t in range(3)
        ]
    )
    got = cross_gram(kernel, weights, basis.pack(*x), basis.pack(*z))
    np.testing.assert_allclose(got, expected, rtol=1e-11, atol=1e-11 * abs(expected).max())


@needs_torch
@pytest.mark.parametrize('links', [(), (1,), (0, 1, 2)])
@pytest.mark.parametrize('member', MEMBERS)
def test_every_potential_with_every_member(member: str, links: tuple[int, ...]) -> None:
    """Any kinetic energy goes with any potential energy."""
    rng = np.random.default_rng(5)
    types = ('prismatic', 'revolute', 'revolute')
    kernel = with_potential_after(FAMILY[member](3), links)
    basis, weights = random_basis(types, rng), random_weights(kernel, rng)
    x, z = random_states(1, 3, rng), random_states(1, 3, rng)
    reference = EnergyReference(kernel, basis, Weights(*map(torch.tensor, weights)))
    expected = reference.torque_block(tensors(x, 0), tensors(z, 0)).numpy()
    got = cross_gram(kernel, weights, basis.pack(*x), basis.pack(*z))
    np.testing.assert_allclose(got, expected, rtol=1e-11, atol=1e-11 * abs(expected).max())


@needs_torch
@pytest.mark.parametrize(('member', 'types'), CASES)
def test_energy_covariances(member: str, types: tuple[str, ...]) -> None:
    """Covariances of energies and torques, the sign of the potential included."""
    kernel, basis, weights, x = setting(member, types, 2)
    z = random_states(3, len(types), np.random.default_rng(1))
    reference = EnergyReference(kernel, basis, Weights(*map(torch.tensor, weights)))
    pairs = [[(tensors(x, t), tensors(z, u)) for u in range(3)] for t in range(2)]
    kinetic = np.block([[reference.kinetic_row(*pair).numpy() for pair in row] for row in pairs])
    potential = np.block(
        [[reference.potential_row(*pair).numpy() for pair in row] for row in pairs]
    )
    got = energy_covariance(kernel, weights, basis.pack(*x), basis.pack(*z))
    np.testing.assert_allclose(got[0], kinetic, rtol=1e-11, atol=1e-11 * abs(kinetic).max())
    np.testing.assert_allclose(got[1], potential, rtol=1e-11, atol=1e-11 * abs(potential).max())


@pytest.mark.parametrize('member', MEMBERS)
def test_gram_is_the_symmetric_cross_gram(member: str) -> None:
    """The half-filled and mirrored Gram matrix is the whole one, past the width of the lanes."""
    kernel, basis, weights, x = setting(member, ('revolute', 'prismatic', 'revolute'), 71)
    packed = basis.pack(*x)
    whole = cross_gram(kernel, weights, packed, packed)
    half = gram(kernel, weights, packed)
    np.testing.assert_allclose(half, whole, rtol=1e-12, atol=1e-12 * abs(whole).max())
    np.testing.assert_array_equal(half, half.T)
    blocks = prior_blocks(kernel, weights, packed)
    expected = [whole[3 * t : 3 * t + 3, 3 * t : 3 * t + 3] for t in range(71)]
    np.testing.assert_allclose(blocks, expected, rtol=1e-12, atol=1e-12)


@needs_torch
@pytest.mark.slow
@pytest.mark.parametrize('member', MEMBERS)
def test_gradient_against_autograd(member: str) -> None:
    """Derivatives by every weight, against automatic differentiation through the reference."""
    kernel, basis, weights, x = setting(member, ('revolute', 'prismatic', 'revolute'), 2)
    rng = np.random.default_rng(2)
    contraction = rng.normal(size=(6, 6))
    contraction += contraction.T
    leaves = [torch.tensor(w, requires_grad=True) for w in weights]
    reference = EnergyReference(kernel, basis, Weights(*leaves))
    total = torch.stack([
        (torch.tensor(contraction[3 * t : 3 * t + 3, 3 * u : 3 * u + 3])
         * reference.torque_block(tensors(x, t), tensors(x, u))).sum()
        for t in range(2) for u in range(2)
    ]).sum()  # fmt: skip
    total.backward()
    got = contracted_gradient(kernel, weights, basis.pack(*x), contraction)
    for name, leaf, derivative in zip(Weights._fields, leaves, got, strict=True):
        expected = np.zeros_like(derivative) if leaf.grad is None else leaf.grad.numpy()
        scale = max(abs(expected).max(), 1e-12)
        np.testing.assert_allclose(derivative, expected, atol=1e-11 * scale, err_msg=name)


@pytest.mark.parametrize('n_samples', [1, 2, 33, 40])
@pytest.mark.parametrize('member', MEMBERS)
def test_gradient_against_differences(member: str, n_samples: int) -> None:
    """The same for sample numbers around the width of the lanes, by central differences."""
    kernel, basis, weights, x = setting(member, ('revolute', 'revolute', 'prismatic'), n_samples)
    packed = basis.pack(*x)
    contraction = np.random.default_rng(3).normal(size=(3 * n_samples,) * 2)
    contraction += contraction.T
    got = contracted_gradient(kernel, weights, packed, contraction)
    direction = random_weights(kernel, np.random.default_rng(4))

    def moved(step: float) -> float:
        shifted = Weights(*(w + step * d for w, d in zip(weights, direction, strict=True)))
        return float((contraction * gram(kernel, shifted, packed)).sum())

    expected = (moved(1e-5) - moved(-1e-5)) / 2e-5
    along = sum((g * d).sum() for g, d in zip(got, direction, strict=True))
    scale = abs(contraction * gram(kernel, weights, packed)).sum()
    assert along == pytest.approx(expected, abs=1e-7 * scale)

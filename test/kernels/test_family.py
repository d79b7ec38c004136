"""The programs follow docs/explanation/maths.md: sums over the entries of the inertia matrix."""

from __future__ import annotations

from itertools import product
from pathlib import Path
import re

from kernels.cases import MEMBERS, random_basis, random_states, random_weights
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.kernels import EnergyKernel, FAMILY, Weights
from lip_id_ros.kernels.program import factor, kinetic_covariance, potential_covariance

TYPES = ('revolute', 'prismatic', 'revolute', 'revolute')
N = len(TYPES)


class Pair:
    """Two random joint states and the factors between them."""

    def __init__(self, member: str) -> None:
        rng = np.random.default_rng(0)
        self.kernel: EnergyKernel = FAMILY[member](N)
        self.weights: Weights = random_weights(self.kernel, rng)
        basis = random_basis(TYPES, rng)
        (q, self.dq, _), (z, self.dz, _) = random_states(1, N, rng), random_states(1, N, rng)
        self.f, self.fz = basis.features(q)[0], basis.features(z)[0]
        self.dq, self.dz = self.dq[0], self.dz[0]

    def a(self, link: int, b: int) -> float:
        """Factor of joint b in the kinetic energy of a link."""
        weights = self.weights.factors[link % self.kernel.n_factor_sets, b]
        return float(factor(weights, self.f, self.fz, b)[0])

    def v(self, link: int, b: int) -> float:
        """Velocity term of joint b in the kinetic energy of a link."""
        weights = self.weights.velocities[link % self.kernel.n_factor_sets]
        return float(weights[b] * self.dq[b] * self.dz[b])

    def kinetic(self) -> float:
        """Return what the program computes."""
        f, fz = self.f[:, :, 0], self.fz[:, :, 0]
        return float(kinetic_covariance(self.kernel, self.weights, f, self.dq, fz, self.dz))


def degree(member: str, j: int, k: int, b: int) -> int:
    """Return the degree in which joint b enters the entry (j, k): the table of section 3."""
    near, far = min(j, k), max(j, k)
    return {
        'lip': 2,
        'recursive': (b > near) + (b > far),
    }[member]


@pytest.mark.parametrize('member', MEMBERS)
def test_kinetic_energy_by_entries(member: str) -> None:
    """k_T = sum_i lambda_i sum_jk v_j v_k prod_b a_b^degree."""
    pair = Pair(member)
    total = 0.0
    for i in range(N):
        for j, k in product(range(i + 1), repeat=2):
            powers = [pair.a(i, b) ** degree(member, j, k, b) for b in range(i + 1)]
            velocities = pair.v(i, j) * pair.v(i, k)
            total += pair.weights.kinetic_scales[i] * velocities * np.prod(powers)
    assert pair.kinetic() == pytest.approx(total, rel=1e-12)


@pytest.mark.parametrize('member', MEMBERS)
def test_kinetic_energy_as_squares_of_velocity_kernels(member: str) -> None:
    """k_T = sum_i lambda_i y_i^2 with y_i = sum_j v_j prod_{b in B_ij} a_b."""
    pair = Pair(member)
    total = 0.0
    for i in range(N):
        y = 0.0
        for j in range(i + 1):
            within = range(i + 1) if member == 'lip' else range(j + 1, i + 1)
            y += pair.v(i, j) * np.prod([pair.a(i, b) for b in within])
        total += pair.weights.kinetic_scales[i] * y**2
    assert pair.kinetic() == pytest.approx(total, rel=1e-12)


@pytest.mark.parametrize('member', MEMBERS)
def test_potential_energy_by_products(member: str) -> None:
    """k_V = sum over links of lambda_i prod_{b<=i} a_b; the paper's has the last link only."""
    pair = Pair(member)
    links = [N - 1] if member == 'lip' else range(N)
    weights, total = pair.weights, 0.0
    for scale, i in zip(weights.potential_scales, links, strict=True):
        factors: list[Array] = [
            factor(weights.potential_factors[b], pair.f, pair.fz, b) for b in range(i + 1)
        ]
        total += scale * float(np.prod(factors))
    got = potential_covariance(pair.kernel, weights, pair.f[:, :, 0], pair.fz[:, :, 0])
    assert got == pytest.approx(total, rel=1e-12)


ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / 'docs' / 'explanation' / 'maths.md'


def sources(folder: str) -> str:
    return '\n'.join(
        path.read_text(encoding='utf-8') for path in sorted((ROOT / folder).rglob('*.py'))
    )


def test_named_sections_exist() -> None:
    sections = re.findall(r'^## (\d+)\.', PAGE.read_text(encoding='utf-8'), re.MULTILINE)
    assert sections == [str(number) for number in range(1, len(sections) + 1)]
    named = re.findall(r'maths\.md,\s+section (\d+)', sources('lip_id_ros'))
    assert named
    assert set(named) <= set(sections)

"""What each member of the family promises about the arm, whatever the weights."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st
from kernels.cases import MEMBERS, random_basis, random_states, random_weights
import numpy as np
import pytest

from lip_id_ros.errors import ShapeError
from lip_id_ros.kernels import FAMILY, JointBasis
from lip_id_ros.kernels.gram import cross_gram, gram
from lip_id_ros.kernels.program import without_potential

TYPES = st.lists(st.sampled_from(['revolute', 'prismatic']), min_size=1, max_size=5).map(tuple)


@pytest.mark.parametrize('member', MEMBERS)
@given(types=TYPES, seed=st.integers(0, 2**32 - 1))
@settings(max_examples=25)
def test_gram_is_positive_semidefinite(member: str, types: tuple[str, ...], seed: int) -> None:
    rng = np.random.default_rng(seed)
    kernel = FAMILY[member](len(types))
    basis = random_basis(types, rng)
    x = basis.pack(*random_states(6, len(types), rng))
    matrix = gram(kernel, random_weights(kernel, rng), x)
    eigenvalues = np.linalg.eigvalsh(matrix)
    assert eigenvalues[0] > -1e-12 * eigenvalues[-1]


@pytest.mark.parametrize('member', [m for m in MEMBERS if m != 'lip'])
def test_inertia_does_not_depend_on_the_first_joint(member: str) -> None:
    """Turning the whole arm about its first joint changes no inertial torque."""
    rng = np.random.default_rng(0)
    kernel = without_potential(FAMILY[member](4))
    weights = random_weights(kernel, rng)
    basis = JointBasis(('revolute',) * 4, np.zeros(4), np.ones(4))
    q, dq, ddq = random_states(5, 4, rng)
    turned = q + np.array([1.3, 0.0, 0.0, 0.0])
    z = basis.pack(*random_states(3, 4, rng))
    before = cross_gram(kernel, weights, basis.pack(q, dq, ddq), z)
    after = cross_gram(kernel, weights, basis.pack(turned, dq, ddq), z)
    np.testing.assert_allclose(after, before, rtol=1e-12)


def test_lip_depends_on_the_first_joint() -> None:
    """The paper's kernel does not know that; what the test above holds is not trivial."""
    rng = np.random.default_rng(0)
    kernel = without_potential(FAMILY['lip'](2))
    weights = random_weights(kernel, rng)
    basis = JointBasis(('revolute',) * 2, np.zeros(2), np.ones(2))
    q, dq, ddq = random_states(5, 2, rng)
    z = basis.pack(*random_states(3, 2, rng))
    before = cross_gram(kernel, weights, basis.pack(q, dq, ddq), z)
    after = cross_gram(kernel, weights, basis.pack(q + [1.3, 0.0], dq, ddq), z)
    assert abs(after - before).max() > 1e-2 * abs(before).max()


def test_prismatic_unit_and_origin_only_change_the_conditioning() -> None:
    """The functions that a prismatic joint can be part of are the same in any unit."""
    rng = np.random.default_rng(0)
    kernel = FAMILY['recursive'](2)
    weights = random_weights(kernel, rng)
    q, dq, ddq = random_states(60, 2, rng)
    ranks = []
    for centre, half in ((0.0, 1.0), (0.7, 2.5)):
        basis = JointBasis(('revolute', 'prismatic'), np.full(2, centre), np.full(2, half))
        matrix = gram(kernel, weights, basis.pack(q, dq, ddq))
        ranks.append(np.linalg.matrix_rank(matrix, tol=1e-9 * matrix.trace()))
    assert ranks[0] == ranks[1] < 60


def test_wrong_shapes_are_refused() -> None:
    basis = JointBasis(('revolute',) * 3, np.zeros(3), np.ones(3))
    good, bad = np.zeros((4, 3)), np.zeros((4, 2))
    with pytest.raises(ShapeError, match=r'dq must have shape \(N, 3\).*has shape \(4, 2\)'):
        basis.pack(good, bad, good)

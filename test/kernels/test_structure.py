"""What each member of the family promises about the arm; its parameters as a vector."""

from __future__ import annotations

from gp.cases import P, R, random_hyperparameters, random_kernel
from hypothesis import given, settings
from hypothesis import strategies as st
from kernels.cases import MEMBERS, random_basis, random_states, random_weights
import numpy as np
import pytest

from lip_id_ros.errors import ShapeError
from lip_id_ros.kernels import FAMILY, FrictionKernel, Hyperparameters, JointBasis
from lip_id_ros.kernels.gram import cross_gram, gram
from lip_id_ros.kernels.program import without_potential
from lip_id_ros.kernels.torque_process import friction_covariance, friction_gradient

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


@st.composite
def hyperparameters(draw: st.DrawFn) -> Hyperparameters:
    """Of any member of the family, any arm, with or without friction."""
    types = tuple(draw(st.lists(st.sampled_from([R, P]), min_size=1, max_size=4)))
    member, friction = draw(st.sampled_from(MEMBERS)), draw(st.booleans())
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return random_hyperparameters(random_kernel(member, types, friction, rng), rng)


@given(at=hyperparameters())
def test_round_trip(at: Hyperparameters) -> None:
    vector = at.vector()
    back = at.with_vector(vector)
    for (name, expected), (same, values) in zip(
        at.groups().items(), back.groups().items(), strict=True
    ):
        assert name == same
        np.testing.assert_allclose(values, expected, rtol=1e-14, err_msg=name)
    np.testing.assert_allclose(back.vector(), vector, atol=1e-14)


def test_a_name_tells_the_entry() -> None:
    rng = np.random.default_rng(0)
    at = random_hyperparameters(random_kernel('lip', (R, P), True, rng), rng)
    place = at.names().index('velocities[1, 0]')
    assert at.vector()[place] == np.log(at.weights.velocities[1, 0])
    assert at.names()[-1] == 'noise_variance[1]'


@given(at=hyperparameters())
def test_derivatives_by_logarithms(at: Hyperparameters) -> None:
    """The sum of squares of the parameters has the derivative 2 p by p, 2 p^2 by log p."""
    gradient = at.with_vector(at.vector() + np.log(2.0))
    got = at.log_gradient(gradient)
    np.testing.assert_allclose(got, 2.0 * np.exp(2.0 * at.vector()), rtol=1e-13)


def test_friction_by_definition() -> None:
    """The kernel is linear in velocity, smooth sign and a constant."""
    rng = np.random.default_rng(1)
    kernel, parameters = FrictionKernel(np.full(3, 0.2)), rng.random((3, 3))
    (_, dq, _), (_, dp, _) = random_states(2, 3, rng), random_states(4, 3, rng)
    got = friction_covariance(parameters, kernel.features(dq), kernel.features(dp))
    for i in range(3):
        a, b, c = parameters[i]
        for t in range(2):
            for u in range(4):
                signs = np.tanh(dq[t, i] / 0.2) * np.tanh(dp[u, i] / 0.2)
                expected = a * dq[t, i] * dp[u, i] + b * signs + c
                assert got[i, t, u] == pytest.approx(expected)


def test_gradient_of_the_friction_kernel() -> None:
    """The derivative by each parameter is the central difference."""
    rng = np.random.default_rng(0)
    x = FrictionKernel(0.1 + rng.random(3)).features(rng.normal(size=(7, 3)))
    parameters, contraction = rng.random((3, 3)), rng.normal(size=(3, 7, 7))
    contraction += contraction.transpose(0, 2, 1)
    got = friction_gradient(x, contraction)
    for index in np.ndindex(parameters.shape):
        step = np.zeros_like(parameters)
        step[index] = 1e-6
        up = (contraction * friction_covariance(parameters + step, x, x)).sum()
        down = (contraction * friction_covariance(parameters - step, x, x)).sum()
        assert got[index] == pytest.approx((up - down) / 2e-6, rel=1e-6, abs=1e-7)

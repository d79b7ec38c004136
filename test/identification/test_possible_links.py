"""Bodies and links that can exist and explain torques best, beside plain statements of both."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.identification.possible_links import BarrierProblem
from lip_id_ros.rigid_body.pseudo_inertia import BODY, pseudo_inertia, scale_of

BARRIERS = (1.0, 1e-2, 1e-4, 1e-6)
UNIT = np.array([1.0, 0.0, 0.0, 0.0, 0.02, 0.0, 0.0, 0.02, 0.0, 0.02])


def quadratic(rng: np.random.Generator, centre: Array) -> tuple[Array, Array]:
    """Return H and b of a cost whose minimum without bounds is at a centre."""
    root = rng.standard_normal((2 * centre.size, centre.size)) / np.abs(centre).max()
    return root.T @ root, root.T @ root @ centre


def random_body(rng: np.random.Generator, share: float) -> Array:
    """Return a body that can exist, or cannot where `share` is large."""
    return np.asarray(UNIT + share * rng.standard_normal(BODY) * UNIT.max())


@given(st.integers(0, 10_000), st.sampled_from([1e-3, 0.1, 1.0]))
@settings(max_examples=40, deadline=None)
def test_no_possible_body_explains_more(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    hessian, right = quadratic(rng, random_body(rng, share))
    found = BarrierProblem.of_body(hessian, right).minimised(UNIT, BARRIERS)
    assert np.linalg.eigvalsh(pseudo_inertia(found))[0] > 0.0
    slope = hessian @ found - right
    # a convex cost is least where no way to a possible body leads down
    roots = rng.standard_normal((200, 4, 4))
    others = np.array([_parameters(root @ root.T) for root in roots])
    assert (others @ slope >= found @ slope - 1e-4).all()
    assert found @ slope == pytest.approx(0.0, abs=1e-4)


def _parameters(inertia: Array) -> Array:
    """Return parameters by solving for them."""
    units = pseudo_inertia(np.eye(BODY)).reshape(BODY, -1)
    return np.linalg.lstsq(units.T, inertia.ravel(), rcond=None)[0]


@given(st.integers(0, 10_000))
@settings(max_examples=20, deadline=None)
def test_bodies_that_can_exist_are_left_as_they_are(seed: int) -> None:
    rng = np.random.default_rng(seed)
    body = random_body(rng, 0.002)
    hessian, right = quadratic(rng, body)
    found = BarrierProblem.of_body(1e6 * hessian, 1e6 * right).minimised(UNIT, BARRIERS)
    np.testing.assert_allclose(found, body, atol=1e-5)


@given(st.integers(0, 10_000), st.integers(1, 3))
@settings(max_examples=20, deadline=None)
def test_links_rotors_and_friction_are_bounded_together(seed: int, n: int) -> None:
    """One that is bound does not keep the others from their minimum, in units of any scale."""
    rng = np.random.default_rng(seed)
    scale = scale_of(2.0, 0.1)
    links = np.column_stack([np.tile(UNIT, (n, 1)), np.full(n, 0.1)])
    centre = np.append(links, [0.3, -0.3, -0.3])
    centre[BODY] = -0.1  # the first rotor
    positive = np.array([True, True, False])
    hessian, right = 1e4 * np.eye(centre.size), 1e4 * centre
    start = np.append(links, [1.0, 1.0, 0.0]) * rng.uniform(0.5, 2.0)
    problem = BarrierProblem.of_arm(hessian, right, scale, (np.ones(3), positive))
    found = problem.minimised(start, BARRIERS)
    expected = centre.copy()
    expected[BODY] = expected[-2] = 0.0
    np.testing.assert_allclose(found, expected, atol=1e-3)
    assert (found[[BODY, -2]] > 0.0).all()


@given(st.floats(0.1, 10.0), st.floats(-5.0, 5.0), st.floats(0.01, 10.0))
@settings(max_examples=20, deadline=None)
def test_the_barrier_of_a_positive_number_in_closed_form(h: float, b: float, mu: float) -> None:
    """The minimum of h x^2 / 2 - b x + mu (x / 2 - log x), of friction beside a link."""
    link = np.append(UNIT, 0.1)
    hessian = np.diag(np.append(np.ones(11), h))
    right = np.append(link, b)
    friction = np.array([2.0]), np.array([True])
    problem = BarrierProblem.of_arm(hessian, right, scale_of(2.0, 0.1), friction)
    found = problem.minimised(np.append(link, 1.0), (mu,))[-1]
    b -= 0.5 * mu
    assert found == pytest.approx((b + np.sqrt(b**2 + 4.0 * h * mu)) / (2.0 * h), rel=1e-3)

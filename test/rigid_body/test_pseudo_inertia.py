"""Links that can exist, by log-Cholesky factors."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.rigid_body.pseudo_inertia import (
    link_parameter_jacobian,
    link_parameters,
    LinkScale,
    log_cholesky,
    moved,
    pseudo_inertia,
    scale_of,
)

SCALE = scale_of(3.0, 0.3)
NUMBERS = arrays(np.float64, (2, 11), elements=st.floats(-3.0, 2.0))


def test_the_scale_is_that_of_a_link_of_its_mass_and_size() -> None:
    (link,) = link_parameters(np.zeros((1, 11)), scale_of(4.0, 0.3))
    assert link[0] == pytest.approx(4.0)
    assert link[[4, 7, 9]] == pytest.approx([2 * 4.0 * 0.3**2] * 3)
    assert link[10] == pytest.approx(4.0 * 0.3**2)


@given(NUMBERS)
def test_every_vector_is_a_link_that_can_exist(numbers: Array) -> None:
    parameters = link_parameters(numbers, SCALE)
    assert (np.linalg.eigvalsh(pseudo_inertia(parameters[:, :10])) > 0.0).all()
    assert (parameters[:, 10] > 0.0).all()


@given(NUMBERS)
def test_numbers_come_back(numbers: Array) -> None:
    back = log_cholesky(link_parameters(numbers, SCALE), SCALE, least=1e-300)
    assert link_parameters(back, SCALE) == pytest.approx(
        link_parameters(numbers, SCALE), rel=1e-6, abs=1e-9
    )


@given(NUMBERS, st.booleans())
def test_jacobian_by_differences(numbers: Array, each: bool) -> None:
    """With the usual scale, and with one of each link."""
    factors = np.tril(0.3 * np.random.default_rng(0).standard_normal((2, 4, 4))) + np.eye(4)
    scale, step = LinkScale(factors, np.array([0.1, 0.2])) if each else SCALE, 1e-6
    found = link_parameter_jacobian(numbers, scale)
    for k, away in enumerate(step * np.eye(11)):
        up, down = (link_parameters(numbers + sign * away, scale) for sign in (1.0, -1.0))
        expected = (up - down) / (2.0 * step)
        assert found[:, :, k] == pytest.approx(expected, rel=1e-5, abs=1e-6)


def test_a_point_mass_and_its_parameters() -> None:
    """A kilogram at (0.1, 0.2, 0.3) has the inertia that the parallel axis theorem gives."""
    r = np.array([0.1, 0.2, 0.3])
    inertia = (r @ r) * np.eye(3) - np.outer(r, r)
    parameters = np.array([1.0, *r, *inertia[np.triu_indices(3)]])
    assert pseudo_inertia(parameters) == pytest.approx(np.outer([*r, 1.0], [*r, 1.0]))


@given(NUMBERS)
def test_a_scale_of_each_link(numbers: Array) -> None:
    """Zeros are the links of the scale, and all else is relative to them."""
    own = link_parameters(numbers, SCALE)
    scale = LinkScale(np.linalg.cholesky(pseudo_inertia(own[:, :10])), own[:, 10])
    assert link_parameters(np.zeros((2, 11)), scale) == pytest.approx(own, rel=1e-6, abs=1e-9)
    assert log_cholesky(own, scale) == pytest.approx(np.zeros((2, 11)), abs=1e-5)


def test_links_move_along_straight_lines() -> None:
    """As far as they exist; beyond that they go on to exist."""
    rng = np.random.default_rng(0)
    numbers, scale = rng.uniform(-1.0, 1.0, (20, 11)), scale_of(2.0, 0.3)
    step = 0.02 * rng.normal(size=(20, 11))
    change = np.einsum('nkl,nl->nk', link_parameter_jacobian(numbers, scale), step)
    got = link_parameters(moved(numbers, step), scale)
    straight = np.isclose(got, link_parameters(numbers, scale) + change, rtol=1e-9).all(axis=1)
    assert straight.mean() > 0.8
    far = link_parameters(moved(numbers, 1.5 * rng.normal(size=(20, 11))), scale)
    assert np.linalg.eigvalsh(pseudo_inertia(far[:, :10])).min() > 0.0
    assert far[:, 10].min() > 0.0

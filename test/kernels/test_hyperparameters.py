"""Hyperparameters as a vector of logarithms, there and back."""

from __future__ import annotations

from gp.cases import P, R, random_hyperparameters, random_kernel
from hypothesis import given
from hypothesis import strategies as st
from kernels.cases import MEMBERS
import numpy as np

from lip_id_ros.kernels import Hyperparameters


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


@given(at=hyperparameters())
def test_every_entry_has_a_name_of_its_own(at: Hyperparameters) -> None:
    labels = at.names()
    assert len(labels) == len(set(labels)) == len(at.vector())


@given(at=hyperparameters())
def test_cosines_and_sines_are_those_of_the_factors(at: Hyperparameters) -> None:
    labels = np.array(at.names())
    for places, end in zip(at.cosines_and_sines(), ('1]', '2]'), strict=True):
        expected = [x for x in labels if 'factors' in x and x.endswith(end)]
        assert sorted(labels[places]) == sorted(expected)


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

"""The nearest arm that can exist."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
from rigid_body.arms import random_bodies

from lip_id_ros.adaptation.possible import can_exist, least_distance, PossibleArms
from lip_id_ros.arrays import Array

NONE = np.empty(0)


def of_links(links: Array) -> PossibleArms:
    return PossibleArms(links, NONE, NONE)


@given(seed=st.integers(0, 10_000), share=st.floats(0.0, 2.0))
@settings(max_examples=25, deadline=None)
def test_any_numbers_lead_to_an_arm_that_can_exist(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    links = random_bodies(2, rng)
    wanted = links + share * np.abs(links) * rng.normal(size=links.shape)
    arms = PossibleArms(links, np.array([0.0, -1.0]), np.array([1.0, 1.0]))
    root = rng.normal(size=(24, 24)) * np.append(np.abs(links), [0.1, 10.0])[:, None]
    found = arms.nearest(np.append(wanted, rng.normal(scale=3.0, size=2)), root)
    assert can_exist(found[:22].reshape(2, 11))
    assert (found[22:] >= [0.0, -1.0]).all()
    assert (found[22:] <= 1.0).all()


def test_no_arm_that_can_exist_is_nearer() -> None:
    """Along every line to another arm that can exist, the distance grows."""
    rng = np.random.default_rng(3)
    links = random_bodies(2, rng)
    root = 0.3 * np.abs(links.ravel())[:, None] * rng.normal(size=(22, 22))
    wanted = links.ravel() + 4.0 * root @ rng.normal(size=22)
    assert not can_exist(wanted.reshape(2, 11))
    found = of_links(links).nearest(wanted, root)
    step = np.linalg.solve(root, found - wanted)
    others = [link_like(links, rng) for _ in range(500)]
    slopes = [step @ np.linalg.solve(root, other - found) for other in others]
    assert min(slopes) > -0.02 * (step @ step)


def link_like(links: Array, rng: np.random.Generator) -> Array:
    return (random_bodies(2, rng) * rng.uniform(0.1, 3.0) + 0.01 * links).ravel()


@given(seed=st.integers(0, 1000))
@settings(max_examples=20, deadline=None)
def test_the_shortest_of_all_that_satisfy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    slopes, inside = rng.normal(size=(6, 4)), rng.normal(size=4)
    least = slopes @ inside - rng.uniform(0.0, 2.0, 6)
    nearest = least_distance(slopes, least)
    assert nearest is not None
    found, touched = nearest
    # the conditions of Karush, Kuhn and Tucker
    multipliers, *_ = np.linalg.lstsq(slopes[touched].T, found, rcond=None)
    np.testing.assert_allclose(slopes[touched].T @ multipliers, found, atol=1e-9)
    assert (multipliers >= 0.0).all()
    assert (slopes @ found >= least - 1e-9).all()
    np.testing.assert_allclose((slopes @ found)[touched], least[touched], atol=1e-8)


def test_half_spaces_without_a_common_point_have_no_nearest() -> None:
    assert least_distance(np.array([[1.0], [-1.0]]), np.array([1.0, 1.0])) is None
    assert least_distance(np.zeros((1, 2)), np.array([1.0])) is None


def test_inertias_whose_sum_is_no_number_cannot_exist() -> None:
    assert not can_exist(np.full((1, 11), 1e308))

"""The nearest arm that can exist."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
from rigid_body.arms import random_bodies

from lip_id_ros.adaptation.possible import can_exist, NearestLinks, scale_of_links


@given(seed=st.integers(0, 10_000), share=st.floats(0.0, 2.0))
@settings(max_examples=25, deadline=None)
def test_any_parameters_lead_to_links_that_can_exist(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    links = random_bodies(2, rng)
    wanted = links + share * np.abs(links) * rng.normal(size=links.shape)
    found = NearestLinks(wanted, rng.normal(size=(40, links.size)), scale_of_links(links)).found()
    assert np.isfinite(found).all()
    assert can_exist(found)


def test_links_that_torques_do_not_show_make_up_for_what_cannot_be() -> None:
    """Torques of the mass alone: an impossible inertia is repaired, and the mass stays."""
    rng = np.random.default_rng(0)
    links = random_bodies(1, rng)
    wanted = links.copy()
    wanted[0, 0] *= 1.3
    wanted[0, 4] = -1.0
    slopes = np.zeros((20, links.size))
    slopes[:, 0] = 1e3
    found = NearestLinks(wanted, slopes, scale_of_links(links)).found()
    assert can_exist(found)
    np.testing.assert_allclose(found[0, 0], wanted[0, 0], rtol=1e-3)


def test_bodies_can_exist_and_their_negatives_cannot() -> None:
    links = random_bodies(3, np.random.default_rng(1))
    assert can_exist(links)
    assert not can_exist(-links)

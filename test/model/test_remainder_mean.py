"""Compiled means of processes against their definition."""

from __future__ import annotations

from dataclasses import replace

from kernels.cases import P, R, random_states
from model.models import random_remainder, torque_of_processes
import numpy as np
import pytest

from lip_id_ros.model.remainder import correlation, Remainder, set_correlations
from lip_id_ros.model.remainder_mean import RemainderMean


def several(types: tuple[str, ...], seed: int) -> Remainder:
    """Return processes of two kinds, in place of all links but the first, few with weights."""
    rng = np.random.default_rng(seed)
    one, n = random_remainder(types, rng), len(types)
    lengths = np.outer(1.0 + np.arange(n) % 2, one.lengths[0])
    weighted = rng.uniform(size=(len(one.x), 1)) < 0.5
    return replace(
        one,
        lengths=lengths,
        alpha=weighted * rng.standard_normal(one.alpha.shape),
        replaces=np.arange(n) > 0,
        friction=rng.standard_normal((n, 3)) * (np.arange(n) > 0)[:, None],
    )


@pytest.mark.parametrize('types', [(R,), (P, P), (R, P, R, R)])
@pytest.mark.parametrize('seed', [0, 1])
def test_means_are_as_defined(types: tuple[str, ...], seed: int) -> None:
    for remainder in (random_remainder(types, np.random.default_rng(seed)), several(types, seed)):
        state = random_states(700, len(types), np.random.default_rng(seed + 2))
        expected = torque_of_processes(remainder, *state)
        found = RemainderMean(remainder).torque(*state)
        np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-12)
        links = np.random.default_rng(seed).standard_normal(expected.shape)
        tau = links.copy()
        RemainderMean(remainder).add_to(tau, *state)
        np.testing.assert_allclose(tau, links * ~remainder.replaces + found, rtol=1e-12)


def test_correlations_at_every_distance() -> None:
    x = np.zeros((1, 2))
    at = np.concatenate([np.linspace(0.0, 11.0, 500), [100.0, 1e6, 1e200]])
    z = np.column_stack([at, np.zeros_like(at)])
    found = np.empty(len(z))
    set_correlations(found, x[0], z.T.ravel(), np.ones(2))
    expected = correlation(x, z[:-1], np.ones(2))[0]
    np.testing.assert_allclose(found[:500], expected[:500], rtol=1e-12)
    assert np.all(found[500:] < 1e-27)

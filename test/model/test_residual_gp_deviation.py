"""Standard deviations of processes from few of their samples, against the textbook's formula."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st
from kernels.cases import P, R, random_states
from model.models import random_residual_gp, torque_of_processes
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.model.residual_gp import (
    correlation,
    FRICTION_VARIANCE,
    Inputs,
    ResidualGP,
    ResidualGPMean,
    set_correlations,
    stored_inputs,
)
from lip_id_ros.model.residual_gp_deviation import compacted, ResidualGPDeviation

TYPES = (R, P, R)
States = tuple[Array, Array, Array]


def motion(n_samples: int, rng: np.random.Generator) -> States:
    t = np.linspace(0.0, 20.0, n_samples)[:, None, None]
    rate, size, phase = rng.uniform(0.2, 2.0, (3, 3, 3))
    angle = rate * t + 3.0 * phase
    q, dq, ddq = (
        np.sum(size * values, axis=2)
        for values in (np.sin(angle), rate * np.cos(angle), -(rate**2) * np.sin(angle))
    )
    return q, dq, ddq


def residual_gp_of(states: States, length: float, noise: float, seed: int = 0) -> ResidualGP:
    """Return equal processes at the first two joints and another at the last, all in place."""
    inputs = Inputs.of(np.array([kind == R for kind in TYPES]), *states)
    x = stored_inputs(inputs(*states))
    rng, (count, width) = np.random.default_rng(seed), x.shape
    lengths = np.full((3, width), length * np.sqrt(width))
    lengths[2] *= rng.uniform(0.3, 3.0, width)
    return ResidualGP(
        inputs=inputs,
        x=x,
        lengths=lengths,
        noise=np.array([noise, noise, 0.3 * noise]),
        variance=np.array([1.0, 4.0, 0.25]),
        left_out_std=np.ones(3),
        replaces=np.ones(3, dtype=bool),
        alpha=np.zeros((count, 3)),
        friction=np.zeros((3, 3)),
    )


def deviations_of(residual_gp: ResidualGP, states: States) -> Array:
    """Return the deviations of processes in place of all links, shape (N, n)."""
    out = np.zeros_like(states[0])
    ResidualGPDeviation(residual_gp).add_to(out, *states)
    return out


def textbook(residual_gp: ResidualGP, states: States) -> Array:
    """
    Return deviations from all samples (Rasmussen and Williams 2006, equation 2.26).

    Friction with unknown coefficients is a part of the covariance.

    """
    x, z = residual_gp.x, residual_gp.inputs(*states)
    friction = residual_gp.inputs.friction_at(x), residual_gp.inputs.friction(states[1])
    out = np.zeros_like(states[0])
    for joint in np.flatnonzero(residual_gp.joints):
        lengths = residual_gp.lengths[joint]
        size = np.sqrt(FRICTION_VARIANCE * residual_gp.replaces[joint])
        of_samples, of_states = (size * each[:, joint] for each in friction)
        gram = correlation(x, x, lengths) + of_samples @ of_samples.T
        gram += residual_gp.noise[joint] * np.eye(len(x))
        cross = correlation(x, z, lengths) + of_samples @ of_states.T
        prior = 1.0 + np.sum(of_states**2, axis=1)
        known = np.sum(cross * np.linalg.solve(gram, cross), axis=0)
        out[:, joint] = np.sqrt(residual_gp.variance[joint] * (prior - known))
    return out


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(2, 250),
    length=st.floats(0.3, 5.0),
    noise=st.floats(1e-3, 1.0),
    replaces=st.booleans(),
)
def test_deviations_are_those_of_all_samples(
    seed: int, count: int, length: float, noise: float, replaces: bool
) -> None:
    rng = np.random.default_rng(seed)
    samples = motion(count, rng)
    residual_gp = residual_gp_of(samples, length, noise, seed)
    residual_gp = replace(residual_gp, replaces=np.array([replaces, True, replaces]))
    at = np.stack(samples)
    states = np.concatenate(
        [
            at,
            0.5 * (at[:, 1:] + at[:, :-1]),
            at + 0.05 * at.std(axis=1, keepdims=True) * rng.standard_normal(at.shape),
            np.stack(motion(100, rng)),
            at.mean(axis=1, keepdims=True) + rng.uniform(-3.0, 3.0, (3, 100, 3)),
        ],
        axis=1,
    )
    q, dq, ddq = states
    ratio = deviations_of(residual_gp, (q, dq, ddq)) / textbook(residual_gp, (q, dq, ddq))
    assert ratio.max() < 1.04
    assert ratio.min() > 0.99


def test_a_smooth_process_needs_few_of_its_samples() -> None:
    residual_gp = residual_gp_of(motion(500, np.random.default_rng(0)), 1.0, 0.1)
    x, lengths = residual_gp.x, residual_gp.lengths[0]
    few, root, _ = compacted(x, lengths, residual_gp.noise[0], residual_gp.inputs.friction_at(x))
    assert len(few) < 150
    assert root.shape == (len(few), len(few))
    np.testing.assert_array_equal(root, np.triu(root))


def test_many_states_are_evaluated_as_one_by_one() -> None:
    samples = motion(40, np.random.default_rng(2))
    residual_gp = residual_gp_of(samples, 1.0, 0.1)
    q, dq, ddq = motion(1200, np.random.default_rng(3))
    whole = deviations_of(residual_gp, (q, dq, ddq))
    for t in (0, 599, 600, 1199):
        one = deviations_of(residual_gp, (q[t : t + 1], dq[t : t + 1], ddq[t : t + 1]))
        np.testing.assert_array_equal(one[0], whole[t])


@pytest.mark.parametrize('part', range(3))
def test_a_state_that_is_not_a_number_has_no_deviation(part: int) -> None:
    samples = motion(40, np.random.default_rng(4))
    states = [each[:1].copy() for each in samples]
    states[part][0, 0] = np.nan
    q, dq, ddq = states
    std = deviations_of(residual_gp_of(samples, 1.0, 0.1), (q, dq, ddq))
    assert np.isnan(std).all()


def test_variances_add_up_beside_links_and_replace_theirs_otherwise() -> None:
    samples, rng = motion(40, np.random.default_rng(6)), np.random.default_rng(7)
    of_links = rng.uniform(0.5, 2.0, samples[0].shape)
    residual_gp = residual_gp_of(samples, 1.0, 0.1)
    residual_gp = replace(
        residual_gp,
        lengths=residual_gp.lengths * np.array([[1.0], [0.0], [1.0]]),
        replaces=np.array([False, False, True]),
    )
    std = of_links.copy()
    ResidualGPDeviation(residual_gp).add_to(std, *samples)
    own = deviations_of(residual_gp, samples)
    np.testing.assert_allclose(std[:, 0], np.hypot(of_links[:, 0], own[:, 0]), rtol=1e-12)
    np.testing.assert_array_equal(std[:, 1], of_links[:, 1])
    np.testing.assert_array_equal(std[:, 2], own[:, 2])


def several(types: tuple[str, ...], seed: int) -> ResidualGP:
    """Return processes of two kinds, in place of all links but the first, few with weights."""
    rng = np.random.default_rng(seed)
    one, n = random_residual_gp(types, rng), len(types)
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
    for residual_gp in (
        random_residual_gp(types, np.random.default_rng(seed)),
        several(types, seed),
    ):
        state = random_states(700, len(types), np.random.default_rng(seed + 2))
        expected = torque_of_processes(residual_gp, *state)
        found = ResidualGPMean(residual_gp).torque(*state)
        np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-12)
        links = np.random.default_rng(seed).standard_normal(expected.shape)
        tau = links.copy()
        ResidualGPMean(residual_gp).add_to(tau, *state)
        np.testing.assert_allclose(tau, links * ~residual_gp.replaces + found, rtol=1e-12)


def test_correlations_at_every_distance() -> None:
    x = np.zeros((1, 2))
    at = np.concatenate([np.linspace(0.0, 11.0, 500), [100.0, 1e6, 1e200]])
    z = np.column_stack([at, np.zeros_like(at)])
    found = np.empty(len(z))
    set_correlations(found, x[0], z.T.ravel(), np.ones(2))
    expected = correlation(x, z[:-1], np.ones(2))[0]
    np.testing.assert_allclose(found[:500], expected[:500], rtol=1e-12)
    assert np.all(found[500:] < 1e-27)

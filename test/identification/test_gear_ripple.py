"""The harmonic of a gear ripple is found beside links and friction."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from benchmarks._drives import JOINT, N_JOINTS, recording
from lip_id_ros.arrays import Array
from lip_id_ros.identification.friction_shapes import (
    FIRST,
    LAST,
    resolved_harmonics,
    strongest_harmonic,
)


def sweep(reach: float, count: int = 3000) -> Array:
    """Return positions of a joint that swings slowly."""
    t = np.linspace(0.0, 1.0, count)
    return reach * np.sin(7.0 * t) * np.sin(2.9 * t + 0.3)


@given(harmonic=st.integers(FIRST, 200), phase=st.floats(0.0, 6.0), seed=st.integers(0, 100))
def test_the_strongest_harmonic(harmonic: int, phase: float, seed: int) -> None:
    """Half as large as the noise, and next to other features that are a hundred times as large."""
    rng, q = np.random.default_rng(seed), sweep(3.0)
    root = rng.uniform(0.5, 1.0, q.size)
    features = root[:, None] * np.column_stack([np.cos(q), np.sin(q), q, np.ones_like(q)])
    torque = np.cos(harmonic * q + phase) + 2.0 * rng.standard_normal(q.size)
    torque = root * torque + features @ (100.0 * rng.standard_normal(4))
    harmonics = np.arange(FIRST, LAST + 1)
    assert abs(strongest_harmonic(q, torque, features, harmonics) - harmonic) <= 1


def test_harmonics_of_which_the_recording_shows_a_period() -> None:
    _, dataset = recording(0, [])
    q = np.tile(sweep(0.25)[:960, None], N_JOINTS)
    slow = replace(dataset, q=q)
    found = resolved_harmonics(slow, JOINT)
    assert found[0] == np.ceil(2.0 * np.pi / np.ptp(q[:, JOINT]))
    assert found[-1] == LAST
    fast = resolved_harmonics(dataset, JOINT)
    step = np.median(np.abs(np.diff(dataset.q[:, JOINT])))
    assert fast[0] == FIRST
    assert fast[-1] < LAST
    assert fast[-1] * step < 0.5 * np.pi


def test_a_prismatic_joint_has_no_turns() -> None:
    _, dataset = recording(0, [])
    sliding = replace(dataset, joint_types=('prismatic',) * N_JOINTS)
    assert resolved_harmonics(sliding, JOINT).size == 0


@pytest.mark.parametrize('features', [np.zeros((500, 0)), np.ones((500, 3))])
def test_features_that_depend_on_each_other(features: Array) -> None:
    q = sweep(2.0, 500)
    rows = np.column_stack([features, np.ones_like(q)])
    assert strongest_harmonic(q, np.sin(20.0 * q), rows, np.arange(FIRST, 40)) == 20

"""The state of Dahl's friction, and which rows are one motion."""

from __future__ import annotations

from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.friction.dahl import (
    _compared,
    AGREE,
    ALIGNED,
    AT_REST,
    BEFORE_S,
    begins_of_states,
    begins_of_times,
    dahl_states,
    Steps,
    unknown_share,
    unwrapped,
)
from lip_id_ros.joint_types import DISPLACEMENTS


def path(seed: int, samples: int = 300, joints: int = 3) -> tuple[Array, Array, Array, Array]:
    rng = np.random.default_rng(seed)
    t = 0.05 * np.arange(float(samples))
    rate = rng.uniform(0.3, 3.0, (4, 1, joints))
    angle = rate * t[:, None] + rng.uniform(0.0, 6.0, (4, 1, joints))
    size = rng.uniform(0.1, 0.5, (4, 1, joints))
    parts = size * np.sin(angle), size * rate * np.cos(angle), -size * rate**2 * np.sin(angle)
    q, dq, ddq = (each.sum(axis=0) for each in parts)
    return t, q, dq, ddq


def only_first(count: int) -> BoolArray:
    return np.asarray(np.arange(count) == 0)


def turning(joints: int) -> BoolArray:
    return np.ones(joints, dtype=np.bool_)


def steps_of(q: Array, begins: BoolArray | None = None, dq: Array | None = None) -> Steps:
    """Return the steps of joints that begin at rest, unless velocities are given."""
    begins = only_first(len(q)) if begins is None else begins
    return Steps.of(q, np.zeros_like(q) if dq is None else dq, begins, turning(q.shape[1]))


def test_the_state_is_that_of_the_differential_equation() -> None:
    t = np.linspace(0.0, 3.0, 3000)
    q = 0.004 * np.sin(2.0 * t) + 0.001 * np.sin(7.0 * t)
    states = dahl_states(steps_of(q[:, None]))[:, 0]
    for displacement, found in zip(DISPLACEMENTS, states.T, strict=True):

        def slope(s: float, z: Array, d: float = displacement) -> Array:
            speed = 0.008 * np.cos(2.0 * s) + 0.007 * np.cos(7.0 * s)
            return np.asarray((speed - z * abs(speed)) / d)

        exact = solve_ivp(slope, (0.0, 3.0), [0.0], t_eval=t, max_step=1e-3, rtol=1e-8)
        np.testing.assert_allclose(found, exact.y[0], atol=0.02)


@given(st.integers(0, 1000))
@settings(max_examples=20)
def test_samples_between_two_of_one_direction_change_nothing(seed: int) -> None:
    steps = np.random.default_rng(seed).uniform(0.0, 0.01, 40)
    q = np.cumsum(steps)[:, None]
    some = np.r_[0, 5:40:5]
    dense, thin = (dahl_states(steps_of(x)) for x in (q, q[some]))
    np.testing.assert_allclose(dense[some], thin, atol=1e-12)


@given(st.integers(0, 1000))
@settings(max_examples=20)
def test_what_is_not_known_is_what_another_start_would_change(seed: int) -> None:
    q = np.cumsum(np.random.default_rng(seed).normal(0.0, 0.003, (60, 2)), axis=0)
    known, share = dahl_states(steps_of(q)), unknown_share(steps_of(q))
    # a start after a long motion forwards, whose state is 1
    before = np.vstack([q[:1] - 3.0, q])
    started = dahl_states(steps_of(before))[1:]
    np.testing.assert_allclose(started, known + share, atol=1e-9)
    assert np.abs(known).max() <= 1.0


def test_a_path_that_begins_in_motion_has_moved_before() -> None:
    _, q, dq, _ = path(0)
    begins = only_first(len(q))
    begins[100] = True
    started = Steps.of(q, dq, begins, turning(3))
    moved = np.vstack([q[100] - BEFORE_S * dq[100], q[100:]])
    np.testing.assert_allclose(
        dahl_states(started)[100:], dahl_states(steps_of(moved))[1:], atol=1e-12
    )
    share = unknown_share(steps_of(moved))[1:]
    np.testing.assert_allclose(unknown_share(started)[100:], share, atol=1e-12)
    fast = np.abs(dq[100]) > 0.1
    np.testing.assert_allclose(dahl_states(started)[100, fast, 0], np.sign(dq[100, fast]))


@given(st.integers(0, 1000))
@settings(max_examples=20)
def test_whole_turns_of_reported_angles_change_nothing(seed: int) -> None:
    _, q, dq, ddq = path(seed)
    q = 6.0 * q
    wrapped = (q + np.pi) % (2.0 * np.pi) - np.pi
    assert np.abs(np.diff(wrapped, axis=0)).max() > 3.0
    plain, same = (Steps.of(x, dq, only_first(len(x)), turning(3)) for x in (q, wrapped))
    np.testing.assert_allclose(dahl_states(same), dahl_states(plain), atol=1e-9)
    np.testing.assert_allclose(unknown_share(same), unknown_share(plain), atol=1e-9)
    rates = 6.0 * dq, 6.0 * ddq
    begins = begins_of_states(wrapped, *rates, turning(3))
    expected = begins_of_states(q, *rates, turning(3))
    assert begins is not None
    assert expected is not None
    assert np.array_equal(begins, expected)


def test_slides_have_no_turns() -> None:
    q = np.array([[3.0, 3.0], [-3.0, -3.0]])
    slides = Steps.of(q, 0.0 * q, only_first(2), np.array([True, False]))
    np.testing.assert_allclose(slides.size[1], [2.0 * np.pi - 6.0, -6.0])


@pytest.mark.parametrize('joints', [1, 2, 6])
def test_rows_that_follow_from_velocities_are_one_motion(joints: int) -> None:
    _, q, dq, ddq = path(1, joints=joints)
    begins = begins_of_states(q, dq, ddq, turning(q.shape[1]))
    assert begins is not None
    assert np.flatnonzero(begins).tolist() == [0]


@given(st.integers(0, 10_000), st.integers(2, 40), st.integers(1, 8), st.floats(0.0, 0.2))
def test_rows_are_compared_as_in_numpy(seed: int, count: int, joints: int, noise: float) -> None:
    rng = np.random.default_rng(seed)
    _, q, dq, ddq = path(seed, count, joints)
    dq = dq + noise * rng.standard_normal(dq.shape)
    q[rng.uniform(size=q.shape) < 0.05] += 2.0 * np.pi
    q[rng.uniform(size=q.shape) < 0.01] = np.nan
    dq[count // 3 : count // 2], dq[:, rng.integers(joints)] = 0.0, 0.0
    speed, revolute = np.sqrt(np.mean(dq**2, axis=0)), rng.uniform(size=joints) < 0.7
    scale = np.where(speed > 0.0, speed, np.inf)
    dx, dv = unwrapped(np.diff(q, axis=0), revolute) / scale, np.diff(dq, axis=0) / scale
    v, a = (0.5 * (x[1:] + x[:-1]) / scale for x in (dq, ddq))
    rests = np.abs(v).max(axis=1) < AT_REST
    with np.errstate(divide='ignore', invalid='ignore'):
        step = np.sum(dx * v, axis=1) / np.sum(v**2, axis=1)
        follows = norm(dx - v * step[:, None]) <= ALIGNED * norm(dx)
        agrees = norm(dv - a * step[:, None]) <= AGREE * (norm(dv) + norm(a) * step)
    leads = np.where(~rests & follows & agrees, step, np.nan)
    every: Any = zip(
        _compared(q, dq, ddq, scale, revolute),
        (leads, norm(dx), rests, norm(dq / scale)),
        strict=True,
    )
    for found, plain in every:
        np.testing.assert_allclose(found, plain, rtol=1e-9, atol=1e-12)


def norm(rows: Array) -> Array:
    return np.asarray(np.linalg.norm(rows, axis=1))


def test_a_motion_ends_where_positions_jump() -> None:
    first, second = path(2), path(3)
    q, dq, ddq = (np.vstack([a, b]) for a, b in zip(first[1:], second[1:], strict=True))
    begins = begins_of_states(q, dq, ddq, turning(3))
    assert begins is not None
    assert np.flatnonzero(begins).tolist() == [0, 300]


@pytest.mark.parametrize('joints', [1, 2, 6])
def test_states_in_no_order_are_single(joints: int) -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        _, q, dq, ddq = path(seed, joints=joints)
        order = rng.permutation(300)
        assert begins_of_states(q[order], dq[order], ddq[order], turning(joints)) is None
        q, dq, ddq = rng.standard_normal((3, 300, joints))
        assert begins_of_states(q, dq, ddq, turning(joints)) is None


def test_an_arm_that_stands_goes_on() -> None:
    _, q, dq, ddq = path(4)
    held = np.tile(q[-1:], (50, 1)), np.zeros((50, 3)), np.zeros((50, 3))
    q, dq, ddq = (np.vstack([a, b]) for a, b in zip((q, dq, ddq), held, strict=True))
    begins = begins_of_states(q, dq, ddq, turning(3))
    assert begins is not None
    assert begins.sum() == 1


def test_a_gap_in_time_or_a_new_segment_ends_a_motion() -> None:
    t = np.array([0.0, 0.1, 0.2, 0.9, 1.0, 0.5, 0.6])
    segment = np.array([0, 0, 1, 1, 1, 1, 1])
    assert np.flatnonzero(begins_of_times(t, segment)).tolist() == [0, 2, 3, 5]


def test_equal_stamps_of_a_coarse_clock_end_no_motion() -> None:
    t = np.floor(0.1 * np.arange(100.0)) * 0.01
    assert np.flatnonzero(begins_of_times(t, np.zeros(100))).tolist() == [0]

"""A motion state by state: no jump, along its path, and to rest."""

from __future__ import annotations

from excitation.cases import random_motions, SEEDS
from hypothesis import given
from hypothesis import strategies as st
import numpy as np

from lip_id_ros.excitation.streaming import StreamedMotion
from lip_id_ros.excitation.trajectory_file import sampled, Trajectory

RAMP = 0.2
STEP = 1e-5


def planned(seed: int) -> tuple[Trajectory, np.ndarray]:
    """Return a motion, and a position near its start."""
    rng = np.random.default_rng(seed)
    _, motions = random_motions(rng)
    motion = motions.motion(motions.random(rng))
    names = [f'joint_{k}' for k in range(motion.n_joints)]
    path = sampled(motion, names, 2000.0)
    return path, path.q[0] + 0.02 * rng.uniform(-1.0, 1.0, motion.n_joints)


@given(SEEDS, st.none() | st.floats(0.0, 1.0))
def test_states_are_derivatives_of_one_another(seed: int, halted: float | None) -> None:
    path, position = planned(seed)
    stream, end = StreamedMotion(path, position, RAMP), path.t[-1]
    if halted is not None:
        stream.halt(halted * end)
    scale = 1.0 + np.abs(path.ddq).max() / end
    for t in np.random.default_rng(seed).uniform(STEP, end + RAMP, 20):
        corners = np.array([end, stream.closing, *([] if halted is None else [halted * end])])
        if np.abs(t - np.append(corners, corners[-1] + RAMP)).min() < 3 * STEP:
            continue
        (q0, dq0, _), (q1, dq1, _) = stream.state(t - STEP), stream.state(t + STEP)
        _, dq, ddq = stream.state(t)
        np.testing.assert_allclose(dq, (q1 - q0) / (2 * STEP), atol=1e-3 * scale)
        np.testing.assert_allclose(ddq, (dq1 - dq0) / (2 * STEP), atol=0.1 * scale)


@given(SEEDS)
def test_it_begins_where_the_arm_is_and_then_follows_the_motion(seed: int) -> None:
    path, position = planned(seed)
    stream = StreamedMotion(path, position, RAMP)
    q, dq, _ = stream.state(0.0)
    np.testing.assert_allclose(q, position, atol=1e-12)
    np.testing.assert_allclose(dq, 0.0, atol=1e-9)
    for k in np.flatnonzero(path.t >= stream.closing)[::50]:
        q, dq, ddq = stream.state(path.t[k])
        np.testing.assert_allclose(q, path.q[k], atol=1e-9)
        np.testing.assert_allclose(dq, path.dq[k], atol=1e-9)
        np.testing.assert_allclose(ddq, path.ddq[k], atol=1e-6 * (1 + np.abs(path.ddq).max()))


def test_a_short_stop_does_not_hurry_the_beginning() -> None:
    t = np.linspace(0.0, 2.0, 201)
    still = Trajectory(('a',), t, *np.zeros((3, 201, 1)))
    stream = StreamedMotion(still, np.array([0.02]), 0.01)
    states = np.abs([stream.state(each) for each in t]).max(axis=0)
    assert states[1] < 0.04
    assert states[2] < 0.12


@given(SEEDS, st.floats(0.0, 1.0))
def test_halted_it_rests_on_its_path_within_the_ramp(seed: int, share: float) -> None:
    path, _ = planned(seed)
    stream, at = StreamedMotion(path, path.q[0], RAMP), share * path.t[-1]
    stream.halt(at)
    stream.halt(at + 1.0)  # a later halt changes nothing
    assert not stream.is_over(at - 1e-6)
    assert stream.is_over(at + RAMP)
    q, dq, ddq = stream.state(at + RAMP)
    assert not dq.any()
    assert not ddq.any()
    along = min(at + 0.5 * RAMP, path.t[-1])
    expected = [np.interp(along, path.t, way) for way in path.q.T]
    np.testing.assert_allclose(q, expected, atol=1e-3 * (1.0 + np.abs(path.ddq).max()))
    np.testing.assert_array_equal(stream.state(at + 5.0)[0], q)

"""Exciting motions: exact derivatives, limits kept and reached, chance only from the generator."""

from __future__ import annotations

import numpy as np
import pytest

from lip_id_ros.errors import DataError, ShapeError
from lip_id_ros.simulation import MotionLimits, SinusoidTrajectory
from lip_id_ros.simulation.arm import MOTION


def random(seed: int) -> SinusoidTrajectory:
    return SinusoidTrajectory.random(MOTION, np.random.default_rng(seed))


def test_velocity_and_acceleration_are_the_derivatives() -> None:
    t, step = np.linspace(0, 50, 40), 1e-6
    q_after, dq_after, _ = random(1).sample(t + step)
    q_before, dq_before, _ = random(1).sample(t - step)
    _, dq, ddq = random(1).sample(t)

    np.testing.assert_allclose((q_after - q_before) / (2 * step), dq, atol=1e-7)
    np.testing.assert_allclose((dq_after - dq_before) / (2 * step), ddq, atol=1e-7)


def test_is_the_sum_of_the_paper() -> None:
    a, b = np.array([[0.3, 0.1]]), np.array([[-0.2, 0.4]])
    omega = 2 * np.pi * 0.02
    trajectory = SinusoidTrajectory(np.array([0.7]), a, b)

    q, _, _ = trajectory.sample(np.array([3.0]))

    first = 0.3 / omega * np.sin(3 * omega) + 0.2 / omega * np.cos(3 * omega)
    second = (0.1 * np.sin(6 * omega) - 0.4 * np.cos(6 * omega)) / (2 * omega)
    assert q[0, 0] == pytest.approx(0.7 + first + second, rel=1e-14)
    assert trajectory.period == 50.0


@pytest.mark.parametrize('seed', range(6))
def test_limits_are_kept_and_one_of_each_joint_is_reached(seed: int) -> None:
    q, dq, ddq = random(seed).sample(np.linspace(0, 50, 20_001))
    reach = np.array(
        [
            np.abs(q - MOTION.centre).max(axis=0) / (MOTION.q_max - MOTION.q_min) * 2,
            np.abs(dq).max(axis=0) / MOTION.dq_max,
            np.abs(ddq).max(axis=0) / MOTION.ddq_max,
        ]
    )

    assert np.all(reach <= 1)
    assert np.all(reach.max(axis=0) > 0.99)


def test_limits_of_the_first_joints() -> None:
    first = MOTION.first(3)
    for name in ('q_min', 'q_max', 'dq_max', 'ddq_max'):
        np.testing.assert_array_equal(getattr(first, name), getattr(MOTION, name)[:3])
    trajectory = SinusoidTrajectory.random(first, np.random.default_rng(0))
    q, dq, ddq = trajectory.sample(np.linspace(0.0, trajectory.period, 5000))
    assert q.shape == (5000, 3)
    assert np.all((first.q_min <= q) & (q <= first.q_max))
    assert np.all(np.abs(dq) <= first.dq_max)
    assert np.all(np.abs(ddq) <= first.ddq_max)


def test_limits_of_different_lengths() -> None:
    with pytest.raises(ShapeError, match='one number per joint'):
        MotionLimits(np.zeros(2), np.ones(2), np.ones(3), np.ones(2))


def test_limits_without_room() -> None:
    with pytest.raises(DataError, match='leave joint 2 no room'):
        MotionLimits(np.zeros(2), np.array([1.0, 0.0]), np.ones(2), np.ones(2))

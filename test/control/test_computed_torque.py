"""The control law, its feedforwards and the paper's reference."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.control import (
    ComputedTorque,
    Gains,
    LearnedFeedforward,
    NoFeedforward,
)
from lip_id_ros.model import DynamicsModel, Query
from lip_id_ros.simulation import GrowingCosine

GAINS = Gains(np.array([100.0, 50.0]), np.array([10.0, 5.0]))
CENTRE = np.array([0.3, -1.0])


class Doubling:
    """A model whose torque is twice the acceleration."""

    def query(self, q: Array, dq: Array, ddq: Array) -> Query:
        return Query(2 * ddq, 0.0, 0.0, 0.0 * q)


def test_command_is_feedforward_plus_feedback() -> None:
    reference = (np.array([1.0, 2.0]), np.array([0.5, 0.0]), np.array([3.0, -4.0]))

    torques = ComputedTorque(LearnedFeedforward(cast('DynamicsModel', Doubling())), GAINS).torques(
        reference, np.array([0.9, 2.2]), np.array([0.4, 0.2])
    )

    np.testing.assert_allclose(torques.feedforward, [6.0, -8.0])
    np.testing.assert_allclose(torques.feedback, [100 * 0.1 + 10 * 0.1, -50 * 0.2 - 5 * 0.2])
    np.testing.assert_allclose(torques.command, torques.feedforward + torques.feedback)


def test_without_feedforward_there_is_feedback_only() -> None:
    still = np.zeros(2)
    torques = ComputedTorque(NoFeedforward(), GAINS).torques(
        (CENTRE, still, np.ones(2)), still, still
    )
    np.testing.assert_array_equal(torques.command, GAINS.stiffness * CENTRE)


def test_reference_is_the_papers() -> None:
    reference = GrowingCosine(CENTRE, 0.5, 10.0)
    q, _, _ = reference.sample(np.array([0.0, 3.0, 9.5]))
    np.testing.assert_allclose(q[0], CENTRE)
    np.testing.assert_allclose(q[1], CENTRE - 0.05 * 3.0)
    np.testing.assert_allclose(q[2], CENTRE + 0.05 * 9.5 * np.cos(9.5 * np.pi), atol=1e-12)


def test_velocity_and_acceleration_are_the_derivatives() -> None:
    reference, step = GrowingCosine(CENTRE, 0.6, 10.0), 1e-6
    t = np.linspace(0.1, 9.9, 30)
    before, at, after = (reference.sample(t + shift) for shift in (-step, 0.0, step))
    np.testing.assert_allclose((after[0] - before[0]) / (2 * step), at[1], atol=1e-8)
    np.testing.assert_allclose((after[1] - before[1]) / (2 * step), at[2], atol=1e-8)


def test_one_time_and_many_agree() -> None:
    reference = GrowingCosine(CENTRE, 0.5, 10.0)
    many = reference.sample(np.array([1.0, 2.5]))
    for one, rows in zip(reference.sample(2.5), many, strict=True):
        assert one.shape == (2,)
        np.testing.assert_array_equal(one, rows[1])


@pytest.mark.parametrize('amplitude', [0.5, 0.6])
def test_amplitude_is_reached_at_the_horizon(amplitude: float) -> None:
    q, _, _ = GrowingCosine(CENTRE, amplitude, 10.0).sample(10.0)
    np.testing.assert_allclose(q - CENTRE, amplitude)

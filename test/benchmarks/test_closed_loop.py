"""An arm under a controller: the better the feedforward, the smaller the feedback."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest

from benchmarks._closed_loop import (
    ComputedTorque,
    Feedforward,
    FrictionalArm,
    LearnedFeedforward,
    NominalFeedforward,
    placed,
    track,
    Tracking,
)
from lip_id_ros.arrays import Array
from lip_id_ros.control.settings import Gains
from lip_id_ros.model import DynamicsModel, Query
from lip_id_ros.simulation import Drives, GrowingCosine, JointFriction, panda, SimulatedArm

pytest.importorskip('pinocchio', reason='needs pinocchio (the extra sim)')

REFERENCE = GrowingCosine(np.array([0.0, -0.8, 0.0]), 0.5, 2.0)
TWO = Gains(np.array([100.0, 50.0]), np.array([10.0, 5.0]))
GAINS = Gains(np.full(3, 400.0), np.full(3, 40.0))
DRIVES = Drives(
    np.full(3, 0.1),
    JointFriction(np.full(3, 0.5), np.full(3, 0.6), 0.01),
    velocity_noise=1e-3,
)


@pytest.fixture(scope='module')
def arm() -> SimulatedArm:
    return panda(3)


def follow(arm: SimulatedArm, feedforward: Feedforward, contact: float = 0.0) -> Tracking:
    simulated = placed(arm, DRIVES, REFERENCE, np.random.default_rng(0))

    def push(t: float) -> Array:
        return np.array([contact if t >= 1.0 else 0.0, 0.0, 0.0])

    return track(simulated, ComputedTorque(feedforward, GAINS), REFERENCE, 2.0, push)


def exact(arm: SimulatedArm) -> NominalFeedforward:
    rotors = arm.with_rotor_inertia(DRIVES.rotor_inertia)
    return NominalFeedforward(FrictionalArm(rotors, DRIVES.friction))


def test_better_feedforward_leaves_less_to_the_feedback(arm: SimulatedArm) -> None:
    runs = [
        follow(arm, feedforward)
        for feedforward in (exact(arm), NominalFeedforward(arm), Nothing())
    ]
    error = [np.mean(np.square(run.error)) for run in runs]
    feedback = [np.mean(np.square(run.feedback)) for run in runs]
    assert error[0] < error[1] / 20 < error[2] / 400
    assert feedback[0] < feedback[1] / 20 < feedback[2] / 400


def test_what_is_recorded_is_consistent(arm: SimulatedArm) -> None:
    run = follow(arm, exact(arm))
    assert run.t.shape == (2000,)
    assert run.q.shape == run.tau.shape == run.feedback.shape == (2000, 3)
    np.testing.assert_allclose(run.t, np.arange(2000) * 1e-3)
    np.testing.assert_array_equal(run.error, REFERENCE.sample(run.t)[0] - run.q)
    # without delay the torque of a step is the command of the step before
    commands = run.feedforward + run.feedback
    np.testing.assert_allclose(run.tau[1:], commands[:-1])
    bodies = arm.with_rotor_inertia(DRIVES.rotor_inertia)
    np.testing.assert_allclose(run.potential, bodies.potential(run.q), atol=1e-3)
    np.testing.assert_allclose(run.kinetic, bodies.kinetic(run.q, run.dq), atol=0.05)


def test_a_contact_pushes_the_joint_it_acts_on(arm: SimulatedArm) -> None:
    run = follow(arm, exact(arm), contact=5.0)
    before, after = run.error[500:1000, 0], run.error[1700:, 0]
    assert np.abs(before).max() < 1e-3
    # the feedback's stiffness holds against the contact
    assert after.mean() == pytest.approx(-5.0 / 400, rel=0.05)


class Nothing:
    """Leaves all the work to the feedback."""

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        return np.zeros_like(q)


class Doubling:
    """A model whose torque is twice the acceleration."""

    def query(self, q: Array, dq: Array, ddq: Array) -> Query:
        return Query(2 * ddq, 0.0, 0.0, 0.0 * q)


def test_command_is_feedforward_plus_feedback() -> None:
    reference = (np.array([1.0, 2.0]), np.array([0.5, 0.0]), np.array([3.0, -4.0]))

    torques = ComputedTorque(LearnedFeedforward(cast('DynamicsModel', Doubling())), TWO).torques(
        reference, np.array([0.9, 2.2]), np.array([0.4, 0.2])
    )

    np.testing.assert_allclose(torques.feedforward, [6.0, -8.0])
    np.testing.assert_allclose(torques.feedback, [100 * 0.1 + 10 * 0.1, -50 * 0.2 - 5 * 0.2])
    np.testing.assert_allclose(torques.command, torques.feedforward + torques.feedback)

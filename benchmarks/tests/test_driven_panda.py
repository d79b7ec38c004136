"""The Panda under torques keeps the laws of mechanics; drives and sensors add what they should."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import _driven_panda
from benchmarks._driven_panda import DrivenPanda, move
from lip_id_ros.arrays import Array
from lip_id_ros.simulation import panda, SinusoidTrajectory

pytest.importorskip('pinocchio', reason='needs pinocchio (the extra sim)')

N = 3
POSTURE, STILL = np.array([0.1, -0.8, 0.2]), np.zeros((1, N))
REST = SinusoidTrajectory(POSTURE, np.zeros((N, 1)), np.zeros((N, 1)))


def at_rest() -> DrivenPanda:
    return DrivenPanda(REST, N, np.random.default_rng(0))


@pytest.fixture
def exact(monkeypatch: pytest.MonkeyPatch) -> DrivenPanda:
    """Without ripple, and with sensors of torque that are exact."""
    monkeypatch.setattr(_driven_panda, 'RIPPLE', 0.0)
    monkeypatch.setattr(_driven_panda, 'TORQUE_NOISE', 0.0)
    return at_rest()


def energy(driven: DrivenPanda) -> float:
    q, dq = driven.q[None], driven.dq[None]
    return float((driven.bodies.kinetic(q, dq) + driven.bodies.potential(q))[0])


def friction(dq: Array) -> Array:
    sign = np.tanh(dq / _driven_panda.SIGN_WIDTH)
    return np.asarray(_driven_panda.VISCOUS[:N] * dq + _driven_panda.COULOMB[:N] * sign)


def test_energy_changes_by_the_work_of_torques_contact_and_friction(exact: DrivenPanda) -> None:
    """A command acts a step later, and is what the sensor of torque has then."""
    rng, before = np.random.default_rng(1), energy(exact)
    work, acting = 0.0, exact.measure()[2]
    for _ in range(500):
        command, contact = rng.normal(0, 5, (2, N))
        q, rubbing = exact.q, friction(exact.dq)
        exact.step(command, contact)
        np.testing.assert_array_equal(exact.measure()[2], acting)
        rubbing = (rubbing + friction(exact.dq)) / 2
        work += float((acting + contact - rubbing) @ (exact.q - q))
        acting = command
    change = energy(exact) - before
    assert abs(change) > 0.5
    assert work == pytest.approx(change, rel=0.02)


def test_the_right_torque_holds_the_arm_still(exact: DrivenPanda) -> None:
    gravity = panda(N).inverse_dynamics(POSTURE[None], STILL, STILL)[0]
    for _ in range(200):
        exact.step(gravity)
    np.testing.assert_allclose(exact.q, POSTURE, atol=1e-9)


def test_sensors_are_as_noisy_as_they_are_said_to_be() -> None:
    driven = at_rest()
    noises = [
        _driven_panda.POSITION_NOISE,
        _driven_panda.VELOCITY_NOISE,
        _driven_panda.TORQUE_NOISE,
    ]
    measured = np.array([driven.measure() for _ in range(2000)])
    np.testing.assert_allclose(measured.std(axis=0).mean(axis=1), noises, rtol=0.05)
    np.testing.assert_allclose(measured[:, 0].mean(axis=0), POSTURE, atol=1e-5)
    torques = []
    for _ in range(2000):
        driven.step(np.zeros(N))
        torques.append(driven.measure()[2])
    both = np.hypot(_driven_panda.RIPPLE, _driven_panda.TORQUE_NOISE)
    assert np.std(torques[1:]) == pytest.approx(both, rel=0.05)


def test_a_contact_is_held_by_the_stiffness_of_the_feedback() -> None:
    pushed = np.array([5.0, 0.0, 0.0])
    free, held = (
        move(panda(N), np.random.default_rng(0), 2.0, lambda t: push * (t >= 1.0))  # noqa: B023
        for push in (0.0 * pushed, pushed)
    )
    away = (held.position - free.position)[-300:].mean(axis=0)
    np.testing.assert_array_equal(held.position[:1000], free.position[:1000])
    assert away[0] == pytest.approx(5.0 / _driven_panda.STIFFNESS[0], rel=0.1)
    assert np.abs(away[1:]).max() < 0.1 * away[0]

"""The simulated arm keeps the laws of mechanics; drives and sensors add what they should."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from benchmarks._changed_arms import with_wrong_masses
from lip_id_ros.arrays import Array
from lip_id_ros.simulation import Drives, JointFriction, panda, SimulatedArm, TorqueControlledArm

pytest.importorskip('pinocchio', reason='needs pinocchio (the extra sim)')

POSTURE = np.array([0.1, -0.8, 0.2, -2.3, 0.3, 1.5, 0.7])
ROTORS = np.linspace(0.05, 0.2, 7)
FREE = JointFriction(np.zeros(7), np.zeros(7), 0.01)
STICKY = JointFriction(np.full(7, 0.4), np.full(7, 0.5), 0.01)


@pytest.fixture(scope='module')
def arm() -> SimulatedArm:
    return panda()


def at_rest(arm: SimulatedArm, drives: Drives, seed: int = 0) -> TorqueControlledArm:
    return TorqueControlledArm(arm, drives, POSTURE, np.zeros(7), np.random.default_rng(seed))


def energy(simulated: TorqueControlledArm) -> float:
    q, dq = simulated.q[None], simulated.dq[None]
    return float((simulated.bodies.kinetic(q, dq) + simulated.bodies.potential(q))[0])


def test_energy_changes_by_the_work_of_torques_contact_and_friction(arm: SimulatedArm) -> None:
    simulated = at_rest(arm, Drives(ROTORS, STICKY))
    rng, work, before = np.random.default_rng(1), 0.0, energy(simulated)

    for _ in range(500):
        command, contact = rng.normal(0, 5, (2, 7))
        friction, q = STICKY.torque(simulated.dq), simulated.q
        simulated.step(command, contact)
        friction = (friction + STICKY.torque(simulated.dq)) / 2
        work += float((command + contact - friction) @ (simulated.q - q))

    change = energy(simulated) - before
    assert abs(change) > 1.0
    assert work == pytest.approx(change, rel=0.02)


def test_forward_dynamics_invert_the_inverse_with_rotors(arm: SimulatedArm) -> None:
    q, dq, ddq = np.random.default_rng(2).normal(size=(3, 1, 7))
    turning = arm.with_rotor_inertia(ROTORS)

    tau = turning.inverse_dynamics(q, dq, ddq)

    np.testing.assert_allclose(turning.forward_dynamics(q[0], dq[0], tau[0]), ddq[0])
    np.testing.assert_allclose(tau - arm.inverse_dynamics(q, dq, ddq), ROTORS * ddq, atol=1e-12)
    np.testing.assert_allclose(
        turning.kinetic(q, dq) - arm.kinetic(q, dq), 0.5 * np.square(dq) @ ROTORS
    )
    np.testing.assert_allclose(
        turning.inertia_matrix(q) - arm.inertia_matrix(q), [np.diag(ROTORS)], atol=1e-12
    )


def test_commands_act_after_the_delay(arm: SimulatedArm) -> None:
    simulated = at_rest(arm, Drives(ROTORS, FREE, delay=2))
    acted = []
    for k in range(5):
        simulated.step(np.full(7, float(k + 1)))
        acted.append(simulated.measure().tau[0])
    assert acted == [0.0, 0.0, 1.0, 2.0, 3.0]


def test_a_stopped_arm_has_no_torque_under_way(arm: SimulatedArm) -> None:
    simulated = at_rest(arm, Drives(ROTORS, FREE, delay=2))
    simulated.hold(np.full(7, 5.0))
    simulated.stop(POSTURE)
    for _ in range(3):
        assert not simulated.measure().tau.any()
        simulated.step(np.zeros(7))


def test_sensors_are_as_noisy_as_they_are_said_to_be(arm: SimulatedArm) -> None:
    drives = Drives(
        ROTORS, FREE, position_noise=1e-4, velocity_noise=1e-2, torque_noise=0.3, ripple=0.4
    )
    simulated = at_rest(arm, drives)
    simulated.step(np.zeros(7))
    measured = [simulated.measure() for _ in range(500)]
    tau = np.array([each.tau for each in measured])

    assert np.std([each.q - simulated.q for each in measured]) == pytest.approx(1e-4, rel=0.1)
    assert np.std([each.dq - simulated.dq for each in measured]) == pytest.approx(1e-2, rel=0.1)
    assert np.std(tau - tau.mean(axis=0)) == pytest.approx(0.3, rel=0.1)

    ripples = []
    for _ in range(300):
        simulated.step(np.zeros(7))
        ripples.append(simulated.measure().tau)
    assert np.std(ripples) == pytest.approx(0.5, rel=0.1)  # both noises together


class Bodies(NamedTuple):
    mass: Array
    centre: Array
    inertia: Array


def bodies(arm: SimulatedArm) -> Bodies:
    """Masses (n,), centres of mass (n, 3) and inertias (n, 3, 3) of the moving bodies."""
    each = list(arm._model.inertias)[1:]
    return Bodies(
        np.array([body.mass for body in each]),
        np.array([body.lever for body in each]),
        np.array([body.inertia for body in each]),
    )


def test_wrong_masses_are_wrong_within_bounds(arm: SimulatedArm) -> None:
    still, down = np.zeros((1, 7)), np.array([[0.0, 1.5, 0, 0, 0, 0, 0]])
    right = arm.inverse_dynamics(down, still, still)
    wrong = with_wrong_masses(arm, 0.2, 0.0, np.random.default_rng(3))
    moved = with_wrong_masses(arm, 0.0, 0.02, np.random.default_rng(3))

    exact, heavy, shifted = (bodies(each) for each in (arm, wrong, moved))
    share = heavy.mass / exact.mass - 1.0
    assert 0.1 < np.abs(share).max() <= 0.2
    np.testing.assert_allclose(heavy.inertia, (1.0 + share)[:, None, None] * exact.inertia)
    np.testing.assert_array_equal(heavy.centre, exact.centre)
    assert 0.015 < np.abs(shifted.centre - exact.centre).max() <= 0.02
    np.testing.assert_array_equal(shifted.mass, exact.mass)
    np.testing.assert_array_equal(shifted.inertia, exact.inertia)
    np.testing.assert_array_equal(arm.inverse_dynamics(down, still, still), right)
    with_same_seed = with_wrong_masses(arm, 0.2, 0.0, np.random.default_rng(3))
    np.testing.assert_array_equal(
        with_same_seed.inverse_dynamics(down, still, still),
        wrong.inverse_dynamics(down, still, still),
    )

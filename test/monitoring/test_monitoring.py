"""Observers against textbook mechanics: nothing is flagged but what really acts."""

from __future__ import annotations

import re
from typing import cast

from evaluation.stubs import Knowing
from model.models import random_model
import numpy as np
import pytest
from simulation.pendulums import INERTIA, Pendulums, swing, WEIGHT

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import DataError
from lip_id_ros.model import DynamicsModel
from lip_id_ros.monitoring import (
    ContactMonitor,
    ContactObserver,
    EnergyMonitor,
    external_torques,
    Thresholds,
)
from lip_id_ros.monitoring.detection import CUTOFF_HZ, step_response_peak
from lip_id_ros.monitoring.observers import DisturbanceObserver, GAIN, momentum_and_rate
from lip_id_ros.signals.filters import high_pass

CONTACT = np.array([1.0, -2.0, 0.5])


def motion(rate: float = 200.0) -> Dataset:
    return swing(3, duration=10.0, rate=rate, noise=0.0)


def knowing(torque_error: float = 0.0, offset: float | None = 0.0) -> DynamicsModel:
    """Return the pendulums' own formulas, of which a monitor only predicts."""
    return cast('DynamicsModel', Knowing(torque_error, offset=offset))


def pushed(data: Dataset) -> Array:
    """Torques of the drives where a contact does a part of the work in the second half."""
    late = data.t >= 5.0
    return data.tau - np.outer(late, CONTACT)


@pytest.mark.parametrize('step', [1e-3, 1e-2, 1.0])
def test_observer_follows_what_is_not_explained(step: float) -> None:
    observer, gain = DisturbanceObserver(20.0), 20.0
    t = np.arange(0.0, 3.0 + step, step)
    found = [observer.update(time, np.array([5.0 + 4.0 * time]), np.array([1.0])) for time in t]
    assert found[0] == 0
    assert found[-1] == pytest.approx(3.0, rel=0.05)
    if step == 1e-3:
        np.testing.assert_allclose(np.ravel(found), 3 * (1 - np.exp(-gain * t)), atol=0.05)


@pytest.mark.parametrize('member', ['recursive', 'lip'])
def test_momentum_and_rate_are_those_of_the_learned_energies(member: str) -> None:
    predictor = random_model(member)
    n = predictor.n_joints
    rng = np.random.default_rng(4)
    q, dq, tau = 0.5 * rng.normal(size=(3, 5, n))

    momentum, rate = momentum_and_rate(predictor, q, dq, tau)

    inertia = predictor.inertia_matrix(q)
    np.testing.assert_allclose(momentum, np.einsum('tij,tj->ti', inertia, dq), rtol=1e-8)
    slope = np.empty_like(q)
    still = np.zeros_like(q)
    for joint in range(n):
        step = np.zeros(n)
        step[joint] = 1e-5
        after = predictor.predict(q + step, dq, still).kinetic
        slope[:, joint] = (after - predictor.predict(q - step, dq, still).kinetic) / 2e-5
    parts = predictor.predict(q, dq, still)
    expected = tau + slope - parts.gravity - parts.friction
    np.testing.assert_allclose(rate, expected, rtol=1e-4, atol=1e-5 * np.abs(expected).max())


def test_free_motion_shows_no_contact() -> None:
    data = motion()
    found = external_torques(knowing(), data.t, data.q, data.dq, data.tau)
    assert np.abs(found).max() < 0.02


def test_a_contact_is_found_in_size_and_time() -> None:
    data = motion()
    found = external_torques(knowing(), data.t, data.q, data.dq, pushed(data))
    np.testing.assert_allclose(found[data.t > 5.2], np.tile(CONTACT, (960, 1))[1:], atol=0.02)
    assert np.abs(found[data.t < 5.0]).max() < 0.02


def test_sample_by_sample_is_the_same_as_the_whole() -> None:
    data = motion()
    observer = ContactObserver(knowing())
    rows = zip(data.t, data.q, data.dq, pushed(data), strict=True)
    np.testing.assert_allclose(
        [observer.update(*row) for row in rows],
        external_torques(knowing(), data.t, data.q, data.dq, pushed(data)),
    )


def test_energy_is_that_of_the_arm_and_its_change_is_explained() -> None:
    data = motion()
    monitor = EnergyMonitor(knowing(torque_error=0.0))
    rows = zip(data.t, data.q, data.dq, data.tau, strict=True)
    found = [monitor.update(*row) for row in rows]
    arm = Pendulums()
    total = arm.kinetic(data.q, data.dq) + arm.potential(data.q)
    np.testing.assert_allclose([each.total for each in found], total)
    assert np.abs([each.unexplained for each in found]).max() < 0.05
    power = np.einsum('ti,ti->t', data.dq, INERTIA * data.ddq + WEIGHT * np.sin(data.q))
    np.testing.assert_allclose([each.supplied for each in found], power, atol=1e-12)
    assert np.abs(power).max() > 2.0


def test_power_of_a_contact_is_what_is_not_explained() -> None:
    data = motion()
    monitor = EnergyMonitor(knowing(), gain=200.0)
    rows = zip(data.t, data.q, data.dq, pushed(data), strict=True)
    found = np.array([monitor.update(*row).unexplained for row in rows])
    expected = np.where(data.t >= 5.0, data.dq @ CONTACT, 0.0)
    late = data.t > 5.1
    assert np.std(expected[late]) > 0.5
    np.testing.assert_allclose(found[late], expected[late], atol=0.2)


def test_friction_takes_its_share_of_the_power() -> None:
    rough = EnergyMonitor(knowing(torque_error=0.7))
    still = np.zeros(3)
    balance = rough.update(0.0, still, np.ones(3), np.array([1.0, 2.0, 3.0]))
    assert balance.supplied == pytest.approx(6.0 - 3 * 0.7)


def test_without_gravity_the_energy_is_kinetic() -> None:
    monitor = EnergyMonitor(knowing(offset=None))
    balance = monitor.update(0.0, np.ones(3), np.ones(3), np.zeros(3))
    assert balance.total == pytest.approx(INERTIA.sum() / 2)


def test_slow_errors_are_left_out_and_a_step_is_not() -> None:
    t = np.arange(0.0, 20.0, 0.01)
    slow = 3.0 * np.sin(2 * np.pi * 0.05 * t)[:, np.newaxis]
    step = np.where(t[:, np.newaxis] >= 10.0, 5.0, 0.0)
    assert np.abs(high_pass(t, slow, CUTOFF_HZ)).max() < 0.1
    shown = high_pass(t, slow + step, CUTOFF_HZ)
    assert shown[t < 10.0].max() < 0.1
    assert shown[np.searchsorted(t, 10.0), 0] == pytest.approx(5.0, abs=0.1)
    assert np.abs(shown[t > 11.0]).max() < 0.1  # what lasts is taken for normal


@pytest.mark.parametrize(('gain', 'cutoff_hz'), [(50.0, 2.0), (20.0, 8.0)])
def test_a_step_shows_as_much_as_computed(gain: float, cutoff_hz: float) -> None:
    t = np.arange(0.0, 1.0, 1e-4)
    observed = 1.0 - np.exp(-gain * t)[:, np.newaxis]
    largest = high_pass(t, observed, cutoff_hz).max()
    assert largest == pytest.approx(step_response_peak(gain, cutoff_hz), rel=1e-2)


def test_thresholds_lie_between_free_motion_and_contact() -> None:
    free = np.array([[0.1, -0.4], [-0.3, 0.2]])
    thresholds = Thresholds.between(('a', 'b'), free, 5.0)
    shown = 5.0 * step_response_peak()
    np.testing.assert_allclose(np.sqrt(thresholds.torque / [0.3, 0.4]), shown / thresholds.torque)
    above = thresholds.torque + 1e-6
    np.testing.assert_array_equal(thresholds.exceeded(above * [-1, 0.5]), [True, False])
    assert not thresholds.exceeded(free).any()


def test_a_contact_that_free_motion_hides_is_refused() -> None:
    expected = (
        'a contact of 0.5 N m or N at elbow shows as 0.249, but the free motion went up to 0.4; '
        'ask for a larger contact, or learn from more motion.'
    )
    with pytest.raises(DataError, match=f'^{re.escape(expected)}$'):
        Thresholds.between(('shoulder', 'elbow'), np.array([[0.1, -0.4]]), [5.0, 0.5])
    for value in (0.0, np.nan):  # no contact at all, and a motion of no numbers
        with pytest.raises(DataError, match='went up to'):
            Thresholds.between(('elbow',), np.full((1, 1), value), 0.0 if value == 0.0 else 5.0)


def test_the_monitor_estimates_the_torque_and_its_high_pass() -> None:
    data = motion()
    monitor = ContactMonitor(knowing())
    rows = zip(data.t, data.q, data.dq, pushed(data), strict=True)
    found = [monitor.update(*row) for row in rows]
    torque = external_torques(knowing(), data.t, data.q, data.dq, pushed(data))
    np.testing.assert_allclose([each.torque for each in found], torque)
    fast = np.array([each.high_pass for each in found])
    settled = int(fast.any(axis=1).argmax()) - 1
    assert 0 < settled <= np.ceil(np.log(100.0) / np.log1p(GAIN * (data.t[1] - data.t[0])))
    np.testing.assert_allclose(
        fast[settled:], high_pass(data.t[settled:], torque[settled:], CUTOFF_HZ)
    )

"""Observers against textbook mechanics: nothing is flagged but what really acts."""

from __future__ import annotations

from dataclasses import replace
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
from lip_id_ros.model import DynamicsModel, Prediction
from lip_id_ros.model.inverse_dynamics_model import ARTICULATED
from lip_id_ros.monitoring import (
    Calibration,
    Contact,
    ContactDetector,
    Deviation,
    EnergyMonitor,
    external_torques,
    ExternalTorque,
)
from lip_id_ros.monitoring.external_torque import BANDWIDTH

CONTACT = np.array([1.0, -2.0, 0.5])


def motion(rate: float = 200.0) -> Dataset:
    return swing(3, duration=10.0, rate=rate, noise=0.0)


def knowing(torque_error: float = 0.0, offset: float | None = 0.0) -> DynamicsModel:
    """Return the pendulums' own formulas, of which a monitor only predicts."""
    return cast('DynamicsModel', Knowing(torque_error, offset=offset))


class Rough(Knowing):
    """Pendulums with viscous friction [N m s/rad], and Coulomb's within 1e-3 rad/s [N m]."""

    def __init__(self, viscous: float = 0.0, coulomb: float = 0.0) -> None:
        super().__init__()
        self._viscous, self._coulomb = viscous, coulomb

    def predict(
        self, q: Array, dq: Array, ddq: Array, t: Array | None = None, *, return_std: bool = False
    ) -> Prediction:
        found = super().predict(q, dq, ddq, t, return_std=return_std)
        friction = self._viscous * dq + self._coulomb * np.tanh(dq / 1e-3)
        return replace(found, tau=found.tau + friction, friction=friction)


def pushed(data: Dataset) -> Array:
    """Torques of the drives where a contact does a part of the work in the second half."""
    late = data.t >= 5.0
    return data.tau - np.outer(late, CONTACT)


class Filling:
    """A model whose energy is its position."""

    training_range = (np.zeros((3, 1)), np.zeros((3, 1)))

    def predict(self, q: Array, dq: Array, ddq: Array) -> Prediction:
        still = np.zeros_like(q)
        return Prediction(still, q[:, 0], None, still, still, still, still)


@pytest.mark.parametrize('step', [1e-3, 1e-2, 1.0])
def test_observer_follows_what_is_not_explained(step: float) -> None:
    """The energy rises by 4 W, of which the drive supplies 1 W."""
    monitor, gain, one = EnergyMonitor(Filling(), 20.0), 20.0, np.ones(1)
    t = np.arange(0.0, 3.0 + step, step)
    found = [monitor.update(x, np.array([5.0 + 4.0 * x]), one, one).unexplained for x in t]
    assert found[0] == 0
    assert found[-1] == pytest.approx(3.0, rel=0.05)
    if step == 1e-3:
        np.testing.assert_allclose(found, 3 * (1 - np.exp(-gain * t)), atol=0.05)


def estimates(data: Dataset, tau: Array, model: DynamicsModel | None = None) -> Array:
    found = external_torques(model or knowing(), data.t, data.q, data.dq, tau)
    return np.array([each.torque for each in found])


def test_free_motion_shows_no_contact() -> None:
    data = motion()
    assert np.abs(estimates(data, data.tau)[data.t > 0.2]).max() < 0.03


@pytest.mark.parametrize('rate', [50.0, 200.0, 1000.0])
def test_a_contact_is_found_in_size_and_time(rate: float) -> None:
    data = motion(rate)
    found = estimates(data, pushed(data))
    late = data.t > 5.3
    np.testing.assert_allclose(found[late], np.tile(CONTACT, (int(late.sum()), 1)), atol=0.05)
    assert np.abs(found[(data.t > 0.2) & (data.t < 5.0)]).max() < 0.03
    half = np.argmax(np.abs(found) > 0.5 * np.abs(CONTACT), axis=0)
    np.testing.assert_allclose(data.t[half], 5.0 + 2.7 / BANDWIDTH, atol=0.01 + 1.0 / rate)


def test_estimates_of_a_learned_arm_are_those_of_its_equations_of_motion() -> None:
    """Off-diagonal inertia too: a contact at one joint is none at the others."""
    arm = random_model(ARTICULATED, residual_gp=False)
    n, rate = arm.n_joints, 500.0
    rng = np.random.default_rng(4)
    t = np.arange(0.0, 2.0, 1.0 / rate)[:, np.newaxis]
    speed, phase = rng.uniform(1.0, 2.0, n), rng.uniform(0.0, 6.0, n)
    q, dq = 0.3 * np.sin(speed * t + phase), 0.3 * speed * np.cos(speed * t + phase)
    tau = arm.predict(q, dq, -(speed**2) * q).tau
    assert abs(arm.inertia_matrix(q[:1])[0, 0, 1]) > 0.01
    contact = np.linspace(0.5, -1.0, n) * np.abs(tau).max(axis=0)
    found = external_torques(cast('DynamicsModel', arm), t[:, 0], q, dq, tau - contact)
    shown = np.array([each.torque for each in found[500:]])
    np.testing.assert_allclose(
        shown, np.tile(contact, (len(shown), 1)), atol=0.03 * np.abs(tau).max()
    )
    begins = tau - contact * [1.0, 0.0, 0.0] * (t > 1.0)
    found = external_torques(cast('DynamicsModel', arm), t[:, 0], q, dq, begins)
    others = np.array([each.torque[1:] for each in found[500:]])
    assert np.abs(others).max() < 0.05 * abs(contact[0])


def test_viscous_friction_of_light_links_leaves_the_observer_stable() -> None:
    """At 50 Hz an explicit step would overshoot four times what friction takes of a velocity."""
    data, thick = motion(50.0), Rough(viscous=50.0)
    tau = thick.predict(data.q, data.dq, data.ddq).tau - CONTACT
    found = external_torques(cast('DynamicsModel', thick), data.t, data.q, data.dq, tau)
    shown = np.array([each.torque for each in found[100:]])
    np.testing.assert_allclose(
        shown, np.tile(CONTACT, (len(shown), 1)), atol=1.5
    )  # of some 100 N m


def test_an_arm_that_stands_may_be_held_by_any_of_its_friction() -> None:
    data, rough = motion(100.0), Rough(coulomb=1.0)
    still, q = np.zeros((200, 3)), np.tile(data.q[0], (200, 1))
    tau = rough.predict(q, still, still).tau + 0.5
    found = external_torques(cast('DynamicsModel', rough), np.arange(200) / 100.0, q, still, tau)
    np.testing.assert_allclose(found[-1].torque, -0.5, atol=0.1)
    np.testing.assert_allclose(found[-1].terms[3], 1.0, rtol=0.2)


class Indefinite(Knowing):
    """Pendulums whose inertia in a direction that turns swings through zero with position."""

    def predict(
        self, q: Array, dq: Array, ddq: Array, t: Array | None = None, *, return_std: bool = False
    ) -> Prediction:
        found = super().predict(q, dq, ddq, t, return_std=return_std)
        direction = np.stack([np.zeros(len(q)), np.sin(q[:, 1]), np.cos(q[:, 1])], axis=1)
        along = np.sum(direction * ddq, axis=1) * np.sin(3.0 * q[:, 0])
        more = along[:, np.newaxis] * direction
        return replace(found, tau=found.tau + more, inertial=found.inertial + more)


@pytest.mark.parametrize('rate', [100.0, 1000.0])
def test_a_model_with_an_indefinite_inertia_shows_no_more_than_its_own_error(rate: float) -> None:
    data, model = motion(rate), Indefinite()
    error = model.predict(data.q, data.dq, data.ddq).tau - data.tau
    at = np.broadcast_to(data.q[:, np.newaxis], (len(data.t), 3, 3)).reshape(-1, 3)
    unit = np.tile(np.eye(3), (len(data.t), 1))
    inertia = model.predict(at, np.zeros_like(at), unit).inertial.reshape(-1, 3, 3)
    assert np.linalg.eigvalsh(inertia).min() < -0.5
    found = estimates(data, data.tau, cast('DynamicsModel', model))
    assert np.abs(found[data.t > 0.3]).max() < np.abs(error).max()


def test_stamps_and_velocities_that_jitter_show_a_fraction_of_what_differences_would() -> None:
    data, rng = motion(500.0), np.random.default_rng(0)
    t = data.t + rng.uniform(-5e-4, 5e-4, len(data.t))
    dq = np.diff(data.q, axis=0, prepend=data.q[:1]) / np.diff(t, prepend=t[0] - 2e-3)[:, None]
    found = external_torques(knowing(), t, data.q, dq, data.tau)
    shown = np.std([each.torque for each in found[100:]], axis=0)
    of_differences = INERTIA * np.std(np.diff(dq[1:], axis=0) / np.diff(t[1:])[:, None], axis=0)
    assert np.all(shown < 0.01 * of_differences)


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


def free_estimates(rng: np.random.Generator, n: int = 4000) -> list[ExternalTorque]:
    """Estimates whose deviations are 0.2 and 0.3 of the torque at one joint, 0.1 at the other."""
    terms = np.stack([np.ones((n, 2)), *rng.uniform(0.0, 2.0, (3, n, 2)) ** 2], axis=1)
    std = np.stack([np.sqrt(0.04 + 0.09 * terms[:, 1, 0]), np.full(n, 0.1)], axis=1)
    torque = std * rng.standard_normal((n, 2))
    return [ExternalTorque(*each, True) for each in zip(torque, terms, strict=True)]


def calibrated(smallest: float | list[float], error: float = 0.0) -> ContactDetector:
    free = free_estimates(np.random.default_rng(3))
    return Calibration.of(free, error).detector(('shoulder', 'elbow'), smallest)


def test_deviations_are_those_of_the_free_motion() -> None:
    shares = calibrated(10.0).deviation.shares
    np.testing.assert_allclose(shares[:, 0], [0.2, 0.3, 0.0, 0.5], atol=0.06)
    np.testing.assert_allclose(shares[:, 1], [0.1, 0.0, 0.0, 0.5], atol=0.03)
    np.testing.assert_array_equal(calibrated(20.0, error=0.4).deviation.shares[1], 0.4)


def test_large_torques_do_not_hide_the_deviation_at_small_ones() -> None:
    rng = np.random.default_rng(4)
    terms = np.zeros((4000, 4, 1))
    terms[:, 0], terms[:, 1, 0] = 1.0, 10.0 ** rng.uniform(-2.0, 3.0, 4000)
    std = np.sqrt(0.04 + 0.09 * terms[:, 1])
    shares = Deviation.fitted(std * rng.standard_normal(std.shape), terms, 0.0).shares
    np.testing.assert_allclose(shares[:2, 0], [0.2, 0.3], rtol=0.1)


def test_a_contact_exceeds_deviations_and_a_fifth_of_the_smallest_of_interest() -> None:
    detector = ContactDetector(Deviation(np.array([[0.1], [0.0], [0.0], [0.0]])), np.array([1.0]))
    terms = np.ones((4, 1))

    def judge(torque: float, settled: bool = True) -> Contact:
        return detector.judge(ExternalTorque(np.array([torque]), terms, settled))

    assert judge(-0.351).touched.all()
    assert not judge(0.349).touched.any()
    assert judge(0.0).std == pytest.approx(0.1)
    assert not judge(0.351).blind.any()
    at_first = judge(0.351, settled=False)
    assert at_first.blind.all()
    assert not at_first.touched.any()
    large = ContactDetector(detector.deviation, np.array([5.0]))
    touched = [
        large.judge(ExternalTorque(np.array([each]), terms, True)).touched for each in (0.9, 1.1)
    ]
    assert [bool(each.any()) for each in touched] == [False, True]


def test_a_joint_is_blind_where_its_deviation_hides_the_smallest_contact() -> None:
    detector = calibrated(3.0)
    terms = np.ones((4, 2))
    terms[1, 0] = 9.0  # a torque of 3 N m: a deviation of about 1.05
    found = detector.judge(ExternalTorque(np.array([50.0, 50.0]), terms, True))
    assert found.blind.tolist() == [True, False]
    assert found.touched.tolist() == [False, True]


def test_a_contact_that_free_motion_hides_is_refused_with_the_smallest_that_shows() -> None:
    found = Calibration.of(free_estimates(np.random.default_rng(3)), 0.0)
    least = found.least
    assert 2.0 < least[0] < 3.0
    named = f'shoulder {least[0]:g}, elbow {least[1]:g} N m or N'
    assert found.in_words(('shoulder', 'elbow')) == named
    expected = (
        'contacts at shoulder 0.3 N m or N would not show in half of the free motion, but '
        f'{named} would; set smallest_contact to these or more, '
    )
    with pytest.raises(DataError, match=f'^{re.escape(expected)}'):
        calibrated([0.3, 10.0])
    calibrated(least.tolist())
    with pytest.raises(DataError, match='contacts at elbow'):
        calibrated([least[0], 0.99 * least[1]])
    for value in (0.0, np.nan):  # no contact at all, and none that is known
        with pytest.raises(DataError, match=f'contacts at shoulder {value:g}, elbow {value:g} '):
            calibrated(value)
    unsettled = [ExternalTorque(np.zeros(1), np.ones((4, 1)), False)] * 3
    with pytest.raises(DataError, match=r'must last longer .* but its 3 samples do not'):
        Calibration.of(unsettled)


def test_an_estimate_is_settled_once_the_beginning_is_forgotten() -> None:
    data = motion(1000.0)
    wrong = data.dq + [0.3, -0.3, 0.3]
    found = external_torques(knowing(), data.t, data.q, wrong, data.tau)
    at = [each.settled for each in found].index(True)
    assert data.t[at] == pytest.approx(8.0 / BANDWIDTH, abs=2e-3)
    began = np.abs([each.torque for each in found[:at]]).max()
    assert began > 1.0
    assert np.abs([each.torque for each in found[at:]]).max() < 0.05 * began

"""Noise that grows near rest."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from lip_id_ros.friction.basis import FrictionBasis
from lip_id_ros.friction.dahl_friction import DahlFriction
from lip_id_ros.friction.drives import Drive, DriveTerm
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.noise import (
    estimate_noise,
    leverage_weights,
    outlier_weights,
    sticking_noise,
    TorqueNoise,
)
from lip_id_ros.friction.terms import coulomb, dahl, load_coulomb, saturating

TRUTH = TorqueNoise(np.array([0.5, 2.0]), np.array([0.0, 8.0]), np.array([1.0, 0.1]))


def test_recovered_where_it_is_and_only_there() -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        dq = rng.standard_normal((800, 2))
        residuals = TRUTH.std_at(dq) * rng.standard_normal(dq.shape)
        got = estimate_noise(residuals, dq)
        np.testing.assert_allclose(got.std, TRUTH.std, rtol=0.15)
        assert got.ratio[0] == 0.0
        assert 4.0 <= got.ratio[1] <= 16.0
        np.testing.assert_allclose(got.std_at(np.zeros((1, 2)))[0, 1], 16.0, rtol=0.7)


@given(seed=st.integers(0, 1000), sticks=st.booleans())
def test_noise_of_measured_torques_is_the_same_as_in_numpy(seed: int, sticks: bool) -> None:
    rng = np.random.default_rng(seed)
    std, ratio, velocity, *stuck = rng.uniform(0.01, 9.0, (5, 3))
    noise = TorqueNoise(std, ratio, velocity, *(stuck if sticks else []))
    tau, dq = rng.uniform(0.0, 9.0, (4, 3)), rng.standard_normal((3, 4)).T
    dq[0, 0], dq[1, 1], dq[2, 2] = 0.0, np.inf, np.nan
    expected = np.hypot(tau, noise.std_at(dq))
    np.testing.assert_allclose(noise.measured_std(tau, dq), expected, rtol=1e-12)


def test_a_joint_at_rest_may_have_any_friction_between_the_coulomb_torques() -> None:
    terms = coulomb(0.05), load_coulomb(0.05)
    basis = FrictionBasis(2, tuple(DriveTerm(Drive.of_joint(0), term) for term in terms))
    friction = FrictionModel(basis, np.array([3.0, 0.1]))
    q, load = np.zeros((4, 2)), np.full((4, 2), -20.0)
    noise = sticking_noise(TorqueNoise.constant(np.array([0.1, 0.1])), friction, q, q, load)
    at_rest, moving = noise.std_at(np.array([[0.0, 0.0], [0.5, 0.5]]))
    uniform = np.random.default_rng(0).uniform(-5.0, 5.0, 10**6)
    np.testing.assert_allclose(at_rest, [uniform.std(), 0.1], rtol=0.05)
    np.testing.assert_allclose(moving, 0.1)


def test_saturating_viscous_friction_holds_a_joint_that_sticks() -> None:
    terms = coulomb(0.05), saturating(0.05)
    basis = FrictionBasis(1, tuple(DriveTerm(Drive.of_joint(0), term) for term in terms))
    friction = FrictionModel(basis, np.array([1.0, 4.0, 0.0, 0.0]))
    zero = np.zeros((1, 1))
    noise = sticking_noise(TorqueNoise.constant(np.array([0.1])), friction, zero, zero, zero)
    np.testing.assert_allclose(noise.std_at(zero), 5.0 / np.sqrt(3.0), rtol=0.05)


@pytest.mark.parametrize(('width', 'velocity'), [(0.05, 1.0), (0.5, 0.05)])
def test_a_joint_sticks_within_the_width_of_its_sign_and_near_rest(
    width: float, velocity: float
) -> None:
    """However wide the velocities with a little more noise, or however wide the sign."""
    basis = FrictionBasis(1, (DriveTerm(Drive.of_joint(0), coulomb(width)),))
    seen = TorqueNoise(np.array([0.1]), np.array([2.0]), np.array([velocity]))
    zero, slow = np.zeros((1, 1)), np.full((1, 1), 0.2)
    got = sticking_noise(seen, FrictionModel(basis, np.array([10.0])), zero, zero, zero)
    np.testing.assert_allclose(got.std_at(zero), 10.0 / np.sqrt(3.0), rtol=0.04)
    np.testing.assert_allclose(got.std_at(slow), seen.std_at(slow), rtol=1e-3)


def test_a_joint_may_stick_while_a_low_pass_blurs_the_sign_of_its_friction() -> None:
    basis = FrictionBasis(1, (DriveTerm(Drive.of_joint(0), coulomb(0.001)),), 0.05)
    friction, zero, slow = (
        FrictionModel(basis, np.ones(1)),
        np.zeros((1, 1)),
        np.full((1, 1), 0.02),
    )
    noise = TorqueNoise.constant(np.array([0.01]))
    got = sticking_noise(noise, friction, zero, np.full((1, 1), 2.0), zero)
    assert got.std_at(slow) > 0.5
    np.testing.assert_allclose(
        sticking_noise(noise, friction, zero, zero, zero).std_at(slow), 0.01
    )


def test_what_a_joint_remembers_of_its_friction_is_no_noise() -> None:
    drives = [Drive.of_joint(0), Drive.of_joint(1)]
    terms = tuple(
        DriveTerm(drive, term) for drive in drives for term in (coulomb(0.01), dahl(0.01, 0.01))
    )
    friction = FrictionModel(FrictionBasis(2, terms), np.array([3.0, 2.0, 3.0, 4.0]))
    past = DahlFriction.of(friction, np.zeros(2, dtype=bool))
    remembered = past.largest(2)
    np.testing.assert_array_equal(remembered, [2.0, 4.0])
    zero, noise = np.zeros((1, 2)), TorqueNoise.constant(np.full(2, 0.1))
    got = sticking_noise(noise, friction, zero, zero, zero, remembered)
    whole = sticking_noise(noise, friction, zero, zero, zero)
    # the Coulomb torque of its smooth sign, without what is remembered
    dry = np.sqrt(3.0) * whole.stuck
    np.testing.assert_allclose(got.stuck, [(dry[0] - 2.0) / np.sqrt(3.0), 0.0], rtol=1e-2)
    np.testing.assert_allclose(dry, 3.0, rtol=0.1)
    # nothing is known of single states
    np.testing.assert_allclose(past.single_std(zero, zero)[0], remembered)


def test_sample_selection_count_for_less_the_farther_out() -> None:
    residuals = np.array([[0.0, 3.9, -4.0, 6.0, -8.0, 80.0]]).T
    got = outlier_weights(residuals, np.ones_like(residuals))[:, 0]
    np.testing.assert_allclose(got, [1.0, 1.0, 1.0, 2.0 / 3.0, 0.5, 0.005])


def test_absurd_features_have_little_leverage() -> None:
    rng = np.random.default_rng(0)
    features = [rng.standard_normal((400, k)) for k in (6, 3)]
    for rows in features:
        rows[::200] *= 1e5
    weights = leverage_weights(features)
    assert np.all(np.delete(weights, [0, 200], axis=0) == 1.0)
    for rows, weight in zip(features, weights.T, strict=True):
        assert np.abs(rows * np.sqrt(weight)[:, None])[::200].max() < 0.1


@pytest.mark.parametrize('unit', [1.0, 1e-3])
def test_noise_of_few_samples_near_rest_is_no_outlier(unit: float) -> None:
    rng = np.random.default_rng(0)
    dq = rng.uniform(-2.0, 2.0, (6000, 1))
    residuals = unit * rng.standard_normal(dq.shape) * np.where(np.abs(dq) < 0.06, 4.0, 1.0)
    found = estimate_noise(residuals, dq)
    assert found.std[0] == pytest.approx(unit, rel=0.05)
    assert found.std_at(np.zeros((1, 1)))[0, 0] == pytest.approx(4.0 * unit, rel=0.15)

"""Limits hold at every time, and what leaves no motion is refused by name."""

from __future__ import annotations

from dataclasses import replace

from excitation.cases import ARM, random_limits, random_motions, SEEDS
from hypothesis import given
import numpy as np
import pytest

from lip_id_ros.errors import ConfigError
from lip_id_ros.excitation.joint_limits import JointLimits, limits_from, posture_from
from lip_id_ros.excitation.series import at_rest, FourierMotion, LimitedMotions, peaks
from lip_id_ros.excitation.settings import MotionSettings

TEN_KHZ = 1e4
NAMES = ('turn', 'lift', 'slide')


def used(motion: FourierMotion, limits: JointLimits) -> np.ndarray:
    """Return the shares of the four limits that a motion uses at most, at 10 kHz, (4, n)."""
    t = motion.times(TEN_KHZ)
    q, *others = (motion.derivative(t, order) for order in range(4))
    middle, half = 0.5 * (limits.lower + limits.upper), 0.5 * (limits.upper - limits.lower)
    shares = [np.abs(q - middle).max(axis=0) / half]
    for values, largest in zip(others, limits.derivatives, strict=True):
        shares.append(np.abs(values).max(axis=0) / largest)
    return np.array(shares)


@given(SEEDS)
def test_no_limit_is_passed_at_any_time_and_one_is_touched(seed: int) -> None:
    rng = np.random.default_rng(seed)
    limits, motions = random_motions(rng)
    motion = motions.random(rng)
    shares = used(motion, limits)
    assert shares.max() <= 1.0
    assert np.all(shares.max(axis=0) > 0.999)


@given(SEEDS)
def test_peaks_are_bounds_that_are_nearly_reached(seed: int) -> None:
    rng = np.random.default_rng(seed)
    _, motions = random_motions(rng)
    motion = motions.random(rng)
    t = motion.times(TEN_KHZ)
    found = [np.abs(motion.derivative(t, order)).max(axis=0) for order in (1, 2, 3)]
    away = np.abs(motion.derivative(t, 0) - motion.posture).max(axis=0)
    ratio = np.array([away, *found]) / peaks(motion)
    assert np.all(ratio <= 1.0)
    assert np.all(ratio > 0.999)


@given(SEEDS)
def test_motions_start_and_end_at_rest_at_the_posture(seed: int) -> None:
    rng = np.random.default_rng(seed)
    limits, motions = random_motions(rng)
    motion = motions.random(rng)
    q, dq, ddq = motion.sample(np.array([0.0, motion.duration]))
    ends = np.broadcast_to(motion.posture, q.shape)
    np.testing.assert_allclose(q, ends, atol=1e-11 * np.abs(limits.upper - limits.lower).max())
    np.testing.assert_allclose(dq / limits.velocity, 0.0, atol=1e-10)
    np.testing.assert_allclose(ddq / limits.acceleration, 0.0, atol=1e-10)


@given(SEEDS)
def test_derivatives_follow_from_each_other(seed: int) -> None:
    rng = np.random.default_rng(seed)
    _, motions = random_motions(rng)
    motion = motions.random(rng)
    t, h = rng.uniform(0.0, motion.duration, 5), 1e-4 * motion.duration / motion.harmonics
    for order, size in zip(range(3), peaks(motion)[1:], strict=True):
        slope = (motion.derivative(t + h, order) - motion.derivative(t - h, order)) / (2.0 * h)
        np.testing.assert_allclose(slope / size, motion.derivative(t, order + 1) / size, atol=1e-5)


def test_shapes_at_rest_are_all_that_there_are() -> None:
    found = at_rest(5)
    assert found.shape == (10, 8)
    np.testing.assert_allclose(found.T @ found, np.eye(8), atol=1e-14)


def test_a_joint_without_numbers_stays() -> None:
    limits, motions = random_motions(np.random.default_rng(1))
    motion = motions.motion(np.zeros((len(limits.lower), motions.free)))
    np.testing.assert_array_equal(motion.coefficients, 0.0)


def test_scaled_motions_go_less_far() -> None:
    _, motions = random_motions(np.random.default_rng(2))
    motion = motions.random(np.random.default_rng(3))
    np.testing.assert_allclose(peaks(motion.scaled(0.25)), 0.25 * peaks(motion))


def test_limits_come_from_the_urdf_where_the_settings_have_none() -> None:
    settings = MotionSettings(share=0.5, velocity=(3.0, 2.0, 1.0), upper=(1.5,))
    found = limits_from(settings, NAMES, (ARM, 'arm.urdf'))
    np.testing.assert_allclose(found.lower, [-np.pi / 2, -0.25, 0.2])
    np.testing.assert_allclose(found.upper, 1.5)
    np.testing.assert_allclose(found.velocity, [3.0, 2.0, 1.0])
    np.testing.assert_allclose(found.acceleration, [12.0, 8.0, 4.0])
    np.testing.assert_allclose(found.jerk, [120.0, 80.0, 40.0])
    assert found.torque is not None
    np.testing.assert_allclose(found.torque, [15.0, 10.0, 25.0])
    np.testing.assert_allclose(
        posture_from(replace(settings, posture=(0.3,)), found), [0.3, 0.3, 0.3]
    )


def test_without_a_urdf_there_is_no_limit_of_torque() -> None:
    settings = MotionSettings(lower=(-1.0,), upper=(1.0,), velocity=(1.0,))
    found = limits_from(settings, NAMES)
    assert found.torque is None
    np.testing.assert_allclose(posture_from(settings, found), 0.0)


REFUSED: dict[str, tuple[MotionSettings, str]] = {
    'no limit': (
        MotionSettings(lower=(-1.0,), upper=(1.0,)),
        r'motion\.velocity is needed, because no URDF has that limit of every joint; give it',
    ),
    'too few numbers': (
        MotionSettings(lower=(-1.0, -1.0), upper=(1.0,), velocity=(1.0,)),
        r'motion\.lower needs one number, or one for each of 3 joints, but has 2; correct it',
    ),
    'no range': (
        MotionSettings(lower=(1.0,), upper=(1.0, 2.0, 1.0), velocity=(1.0,)),
        r"joint 'turn' needs a range of positions, but its lower limit is 1 and its upper limit 1",
    ),
    'no velocity': (
        MotionSettings(lower=(-1.0,), upper=(1.0,), velocity=(1.0, 0.0, 1.0)),
        "the velocity of joint 'lift' needs a limit above 0, but it is 0; correct it",
    ),
    'no torque': (
        MotionSettings(lower=(-1.0,), upper=(1.0,), velocity=(1.0,), torque_limits=(-1.0,)),
        "the torque of joint 'turn' needs a limit above 0, but it is -1; correct it",
    ),
    'posture outside': (
        MotionSettings(lower=(-1.0,), upper=(1.0,), velocity=(1.0,), posture=(0.0, 0.0, 1.0)),
        "the posture of joint 'slide' must be between its position limits -1 and 1, and 0.002 fr",
    ),
    'posture at a limit': (
        MotionSettings(lower=(-1.0,), upper=(1.0,), velocity=(1.0,), posture=(0.0, -0.9999, 0.0)),
        r"the posture of joint 'lift' .*, and 0\.002 from each, but is -0\.9999; move it, or w",
    ),
}


@pytest.mark.parametrize('case', REFUSED)
def test_what_leaves_no_motion_is_refused_by_name(case: str) -> None:
    settings, sentence = REFUSED[case]
    with pytest.raises(ConfigError, match=sentence):
        posture_from(settings, limits_from(settings, NAMES))


def test_a_posture_outside_is_refused_by_motions_too() -> None:
    limits = random_limits(np.random.default_rng(0), 2)
    with pytest.raises(ConfigError, match="the posture of joint 'joint_0' must be between"):
        LimitedMotions(limits, limits.lower, 1.0, 5)

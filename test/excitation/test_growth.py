"""Motions grow as far as a model can vouch for their torques."""

from __future__ import annotations

from dataclasses import replace

from excitation.cases import random_limits, random_posture, SEEDS
from excitation.test_next_motion import found, model
from hypothesis import given
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ConfigError
from lip_id_ros.excitation.growth import FIRST_SIZE, LARGEST_GROWTH, next_size, shrunk
from lip_id_ros.excitation.joint_limits import JointLimits
from lip_id_ros.excitation.scaling import LimitedMotions
from lip_id_ros.excitation.torque_limits import TorqueLimits
from lip_id_ros.model import InverseDynamicsModel


@given(SEEDS)
def test_smaller_limits_are_within_larger_ones(seed: int) -> None:
    rng = np.random.default_rng(seed)
    limits = random_limits(rng, 4)
    posture = random_posture(rng, limits)
    small, large = (shrunk(limits, posture, size) for size in np.sort(rng.uniform(0.1, 1.0, 2)))
    assert np.all((limits.lower <= large.lower) & (large.lower <= small.lower))
    assert np.all((small.lower < posture) & (posture < small.upper))
    assert np.all((small.upper <= large.upper) & (large.upper <= limits.upper + 1e-12))
    for little, much, most in zip(
        small.derivatives, large.derivatives, limits.derivatives, strict=True
    ):
        assert np.all((little <= much) & (much <= most))


def uncertain(factor: float) -> InverseDynamicsModel:
    """Return the model of the tests with deviations so many times as large."""
    arm = model().arm
    assert arm is not None
    return replace(model(), arm=replace(arm, covariance_root=factor * arm.covariance_root))


def limits_and_posture(share: float) -> tuple[JointLimits, Array]:
    """Return limits of torque that are a share of what large motions need."""
    limits, posture = found().limits, found().motion.posture
    wide = replace(limits, torque=np.ones(3))
    need = TorqueLimits(uncertain(0.0), wide).use(found().motion, 50.0)
    return replace(limits, torque=share * need), posture


def test_a_motion_grows_step_by_step_to_all_that_the_limits_allow() -> None:
    limits, posture = limits_and_posture(100.0)
    sizes = [FIRST_SIZE]
    while sizes[-1] < 1.0:
        sizes.append(next_size(model(), limits, posture, sizes[-1]))
        assert sizes[-1] <= LARGEST_GROWTH * sizes[-2]
    assert len(sizes) == 4


def test_less_certainty_gives_less_growth() -> None:
    limits, posture = limits_and_posture(0.8)
    sizes = [next_size(uncertain(x), limits, posture, 0.3) for x in (0.0, 0.1, 0.3)]
    assert 0.3 > sizes[0] > sizes[1] > sizes[2] > 0.0


def test_what_a_model_vouches_for_keeps_the_limits() -> None:
    limits, posture = limits_and_posture(0.8)
    size = next_size(uncertain(0.1), limits, posture, 0.1)
    assert 0.1 < size < 0.2
    motions = LimitedMotions(shrunk(limits, posture, size), posture, 20.0, 5)
    torques = TorqueLimits(uncertain(0.1), limits)
    rng = np.random.default_rng(0)
    for _ in range(12):
        assert torques.is_kept(motions.motion(motions.random(rng)), fine=False)


def test_without_limits_of_torque_a_motion_doubles() -> None:
    limits, posture = limits_and_posture(1.0)
    assert next_size(model(), replace(limits, torque=None), posture, 0.2) == pytest.approx(0.4)
    assert next_size(model(), replace(limits, torque=None), posture, 0.9) == 1.0


def test_a_posture_that_the_model_cannot_hold_is_refused() -> None:
    limits, posture = limits_and_posture(1.0)
    with pytest.raises(ConfigError, match='at the posture by the model, more than its limit'):
        next_size(uncertain(100.0), limits, posture, 0.3)

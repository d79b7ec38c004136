"""What a motion is designed for: of an arm that is not known, or of one with a model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lip_id_ros.excitation.design import Criterion
from lip_id_ros.excitation.expected_error import (
    ExpectedError,
    Information,
    MeanCriterion,
    States,
)
from lip_id_ros.excitation.joint_limits import JointLimits
from lip_id_ros.excitation.known_arm import KnownArm
from lip_id_ros.excitation.scaling import LimitedMotions
from lip_id_ros.excitation.settings import ExcitationConfig, INFORMATION
from lip_id_ros.excitation.unknown_arms import unknown_arm

ARMS = 4
"""That an unknown arm may be, over which the criterion is averaged."""

INDEPENDENT_HZ = 100.0
"""Rate of independent measurements of torques; noise of drives is seldom white beyond."""

MOTIONS, STATES_EACH = 12, 50
"""Random motions, and their states, at which torques will be wanted where no others are given."""

LEAST_SAMPLES, SAMPLES_PER_HARMONIC = 120, 24
"""States at which a criterion is evaluated."""


def first_criterion(
    config: ExcitationConfig,
    motions: LimitedMotions,
    limits: JointLimits,
    joint_types: Sequence[str],
) -> Criterion:
    """Return the mean expected error over some arms that an unknown one may be."""
    rng = _generator(config)
    targets = _random_targets(motions, rng)
    arms = [unknown_arm(limits, joint_types, targets, rng) for _ in range(ARMS)]
    return MeanCriterion(
        [ExpectedError(arm, targets, measurements(config), _samples(config)) for arm in arms]
    )


def next_criterion(config: ExcitationConfig, learner: KnownArm, targets: States) -> Criterion:
    """Return the criterion of the settings for an arm that has been learned."""
    if config.search.criterion == INFORMATION:
        return Information(learner, measurements(config), _samples(config))
    return ExpectedError(learner, targets, measurements(config), _samples(config))


def usual_targets(config: ExcitationConfig, motions: LimitedMotions) -> States:
    """Return states of random motions within the limits, where no others are given."""
    return _random_targets(motions, _generator(config))


def measurements(config: ExcitationConfig) -> float:
    """Return how many states with independent noise a motion has."""
    return config.motion.duration_s * INDEPENDENT_HZ


def _generator(config: ExcitationConfig) -> np.random.Generator:
    return np.random.default_rng([config.search.seed, 1])


def _samples(config: ExcitationConfig) -> int:
    return max(LEAST_SAMPLES, SAMPLES_PER_HARMONIC * config.motion.harmonics)


def _random_targets(motions: LimitedMotions, rng: np.random.Generator) -> States:
    found = []
    for _ in range(MOTIONS):
        motion = motions.motion(motions.random(rng))
        found.append(motion.sample(rng.uniform(0.0, motion.duration, STATES_EACH)))
    q, dq, ddq = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return q, dq, ddq

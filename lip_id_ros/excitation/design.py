"""What a motion is chosen for, and the best of random ones within limits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.excitation.arms import unknown_arm
from lip_id_ros.excitation.constraints import Constraints
from lip_id_ros.excitation.expected_error import ExpectedError, States
from lip_id_ros.excitation.joint_limits import JointLimits
from lip_id_ros.excitation.series import evenly, FourierMotion, LimitedMotions
from lip_id_ros.excitation.settings import ExcitationConfig, SearchSettings
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.progress import Progress, silent

ARMS = 4
"""That an unknown arm may be, over which the criterion is averaged."""

INDEPENDENT_HZ = 100.0
"""Rate of independent measurements of torques; noise of drives is seldom white beyond."""

MOTIONS, STATES_EACH = 12, 50
"""Random motions, and their states, at which torques will be wanted where no others are given."""

LEAST_SAMPLES, SAMPLES_PER_HARMONIC = 120, 24
"""States at which a criterion is evaluated."""

Criterion = Callable[[States], float]
"""What the states of a motion are judged by; smaller is better."""


@dataclass(frozen=True, eq=False)
class Design:
    """The best of random motions, its criterion, and those (draws,) of all within the limits."""

    motion: FourierMotion
    criterion: float
    drawn: Array


def design(
    motions: LimitedMotions,
    criterion: Criterion,
    settings: SearchSettings | None = None,
    progress: Progress = silent,
    constraints: Constraints | None = None,
) -> Design:
    """Return the best of so many random motions; the same seed gives the same motion."""
    chosen, limits = settings or SearchSettings(), constraints or Constraints()
    rng = np.random.default_rng(chosen.seed)

    def judged(motion: FourierMotion) -> float:
        count = max(LEAST_SAMPLES, SAMPLES_PER_HARMONIC * motion.harmonics)
        return criterion(motion.sample(evenly(motion.duration, count)))

    draws, values = [], []
    for number in range(chosen.draws):
        draws.append(motions.random(rng))
        values.append(judged(limits.nearly_held(draws[-1])))
        progress('design', number + 1, chosen.draws)
    best = limits.held(draws[int(np.argmin(values))])
    return Design(best, judged(best), np.array(values))


def first_criterion(
    config: ExcitationConfig,
    wanted: LimitedMotions,
    limits: JointLimits,
    joint_types: Sequence[str],
) -> Criterion:
    """Return the mean expected error, in wanted motions, over arms that an unknown one may be."""
    rng = _generator(config)
    targets = _random_targets(wanted, rng)
    arms = [unknown_arm(limits, joint_types, targets, rng) for _ in range(ARMS)]
    errors = [ExpectedError(arm, targets, measurements(config)) for arm in arms]
    return lambda states: float(np.mean([error(states) for error in errors]))


def usual_targets(config: ExcitationConfig, motions: LimitedMotions) -> States:
    """Return states of random motions within the limits, where no others are given."""
    return _random_targets(motions, _generator(config))


def measurements(config: ExcitationConfig, model: InverseDynamicsModel | None = None) -> float:
    """
    Return how many states with independent noise a motion has.

    After a model, as many a second as its fit has found: samples, less what its covariance was
    inflated for because the noise of neighbours is alike.
    """
    rate, known = INDEPENDENT_HZ, {} if model is None else model.summary
    if model is not None and known.get('motion_s') and 'covariance_inflation' in known:
        rate = min(rate, model.n_samples / known['motion_s'] / known['covariance_inflation'])
    return config.motion.duration_s * rate


def _generator(config: ExcitationConfig) -> np.random.Generator:
    return np.random.default_rng([config.search.seed, 1])


def _random_targets(motions: LimitedMotions, rng: np.random.Generator) -> States:
    found = []
    for _ in range(MOTIONS):
        motion = motions.random(rng)
        found.append(motion.sample(rng.uniform(0.0, motion.duration, STATES_EACH)))
    q, dq, ddq = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return q, dq, ddq

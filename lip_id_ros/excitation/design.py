"""What a motion is designed for, and the search for the best one within limits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.excitation.arms import KnownArm, unknown_arm
from lip_id_ros.excitation.constraints import Constraints
from lip_id_ros.excitation.expected_error import (
    ExpectedError,
    Information,
    MeanCriterion,
    States,
)
from lip_id_ros.excitation.joint_limits import JointLimits
from lip_id_ros.excitation.series import basis, evenly, FourierMotion, LimitedMotions
from lip_id_ros.excitation.settings import ExcitationConfig, INFORMATION, SearchSettings
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.progress import Progress, silent

RATE, DECAY, SQUARE_DECAY = 0.08, 0.8, 0.95
"""Of the ascent (Kingma and Ba, Adam, ICLR 2015), in standard deviations of random numbers."""


class Criterion(Protocol):
    """What a motion is judged by; smaller is better."""

    @property
    def n_samples(self) -> int:
        """States, evenly spaced over a motion, that it needs."""

    def __call__(self, q: Array, dq: Array, ddq: Array) -> tuple[float, Array]:
        """Return the criterion at states (N, n), and its gradient by them, shape (3, N, n)."""


@dataclass(frozen=True, eq=False)
class Design:
    """A designed motion, its criterion, and those (draws,) of random ones in the same limits."""

    motion: FourierMotion
    criterion: float
    random_criteria: Array


class _Problem:
    """Criterion of a motion as a function of the free numbers of its shape."""

    def __init__(
        self, motions: LimitedMotions, criterion: Criterion, constraints: Constraints
    ) -> None:
        self._motions, self._criterion, self._constraints = motions, criterion, constraints
        self.projected = motions.projected
        example = motions.motion(np.zeros(motions.shape))
        duration, harmonics = example.duration, example.harmonics
        times = evenly(duration, criterion.n_samples)
        self._basis = [basis(times, duration, harmonics, order) for order in range(3)]

    def criterion_of(self, motion: FourierMotion) -> float:
        """Return the criterion of a motion, without penalties."""
        q, dq, ddq = (each @ motion.coefficients.T for each in self._basis)
        return self._criterion(q + motion.posture, dq, ddq)[0]

    def value_and_gradient(self, x: Array) -> tuple[float, Array]:
        motion, pullback = self._motions.with_pullback(x)
        q, dq, ddq = (each @ motion.coefficients.T for each in self._basis)
        value, slopes = self._criterion(q + motion.posture, dq, ddq)
        for one in self._constraints.each:
            more, by_states = one.penalty(q + motion.posture, dq, ddq)
            value, slopes = value + more, slopes + by_states
        by_coefficients = sum(
            slope.T @ each for slope, each in zip(slopes, self._basis, strict=True)
        )
        return value, pullback(np.asarray(by_coefficients))


def design(
    motions: LimitedMotions,
    criterion: Criterion,
    settings: SearchSettings | None = None,
    progress: Progress = silent,
    constraints: Constraints | None = None,
) -> Design:
    """
    Return the best motion that the search finds; the same seed gives the same motion.

    Random motions are drawn, and the best of them are improved by the gradient.
    """
    chosen = settings or SearchSettings()
    limits = constraints or Constraints()
    problem = _Problem(motions, criterion, limits)
    rng = np.random.default_rng(chosen.seed)
    draws = [motions.random(rng) for _ in range(chosen.draws)]
    values = np.array([problem.value_and_gradient(x)[0] for x in draws])
    order = np.argsort(values)[: chosen.starts]
    total, found = len(order) * chosen.steps, []
    for number, row in enumerate(order):

        def report(step: int, before: int = number * chosen.steps) -> None:
            progress('design', before + step, total)

        found.append(_improved(problem, draws[row], chosen.steps, report))
    _, x = min(found, key=lambda each: each[0])
    motion = limits.held(motions.motion(x))
    drawn = (limits.nearly_held(motions.motion(x)) for x in draws)
    return Design(
        motion, problem.criterion_of(motion), np.array([problem.criterion_of(x) for x in drawn])
    )


def _improved(
    problem: _Problem, x: Array, steps: int, report: Callable[[int], None]
) -> tuple[float, Array]:
    """Return the best numbers on the way down, whose `report` takes the steps that are done."""
    value, slope = problem.value_and_gradient(x)
    best = value, x
    mean, square = np.zeros_like(x), np.zeros_like(x)
    for step in range(1, steps + 1):
        mean = DECAY * mean + (1.0 - DECAY) * slope
        square = SQUARE_DECAY * square + (1.0 - SQUARE_DECAY) * slope**2
        ahead = mean / (1.0 - DECAY**step)
        size = np.sqrt(square / (1.0 - SQUARE_DECAY**step)) + 1e-12
        x = problem.projected(x - RATE * _slowing(step, steps) * ahead / size)
        value, slope = problem.value_and_gradient(x)
        if value < best[0]:
            best = value, x
        report(step)
    return best


def _slowing(step: int, steps: int) -> float:
    """Return the share of the rate: it falls to zero at the end, along a cosine."""
    return 0.5 + 0.5 * float(np.cos(np.pi * (step - 1) / steps))


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
    wanted: LimitedMotions,
    limits: JointLimits,
    joint_types: Sequence[str],
) -> Criterion:
    """Return the mean expected error, in wanted motions, over arms that an unknown one may be."""
    rng = _generator(config)
    targets = _random_targets(wanted, rng)
    arms = [unknown_arm(limits, joint_types, targets, rng) for _ in range(ARMS)]
    return MeanCriterion(
        [ExpectedError(arm, targets, measurements(config), _samples(config)) for arm in arms]
    )


def next_criterion(
    config: ExcitationConfig, learner: KnownArm, targets: States, count: float
) -> Criterion:
    """Return the criterion of the settings for an arm that has been learned; of `measurements`."""
    if config.search.criterion == INFORMATION:
        return Information(learner, count, _samples(config))
    return ExpectedError(learner, targets, count, _samples(config))


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


def _samples(config: ExcitationConfig) -> int:
    return max(LEAST_SAMPLES, SAMPLES_PER_HARMONIC * config.motion.harmonics)


def _random_targets(motions: LimitedMotions, rng: np.random.Generator) -> States:
    found = []
    for _ in range(MOTIONS):
        motion = motions.motion(motions.random(rng))
        found.append(motion.sample(rng.uniform(0.0, motion.duration, STATES_EACH)))
    q, dq, ddq = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return q, dq, ddq

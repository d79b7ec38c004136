"""What a torque must satisfy before it leaves, per joint of the model, and what is doubtful."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ConfigError
from lip_id_ros.feedforward.settings import ServeSettings
from lip_id_ros.signals.joints import by_joint, require_unique

SMALLEST = 1e-12
"""In place of a range or a standard deviation of zero: whatever differs is beyond it."""

DEFAULT_RATE = 20.0
"""Rate limit by torque limit [1/s], where none is given: a full swing takes 0.1 s at least."""


class Policy(StrEnum):
    """What is done with a reference that a check finds doubtful."""

    OFF = 'off'
    WARN = 'warn'
    SCALE = 'scale'
    ZERO = 'zero'


class SafeValue(StrEnum):
    """What is published when references stop."""

    ZERO = 'zero'
    GRAVITY = 'gravity'


@dataclass(frozen=True, eq=False)
class Rules:
    """
    The settings that hold for every torque, in the order of a model's joints.

    Attributes
    ----------
    limits : ndarray, shape (n,)
        Largest magnitude [N m or N], infinite where there is none.
    rates : ndarray, shape (n,)
        Largest change [N m/s or N/s], infinite where there is none.
    scale : float
        Factor on every torque.
    ramp_s : float
        Time to blend from the torque sent before to the one asked for [s].
    safe_ramp_s : float
        Time to reach the safe torque once references have stopped [s].
    gravity : bool
        Whether torques include gravity.
    stale_timeout_s : float
        Longest silence of a stream [s], infinite for any.
    safe_value : SafeValue
        What follows it.
    max_plan_points : int
        Longest plan that is answered.
    range_policy, std_policy : Policy
        What is done outside the training range, and beyond `std_limits`.
    margins : ndarray, shape (n,)
        How far a joint may leave its training range, as a share of half of it.
    std_limits : ndarray, shape (n,)
        Largest standard deviation of a torque [N m or N].

    """

    limits: Array
    rates: Array
    scale: float
    ramp_s: float
    safe_ramp_s: float
    gravity: bool
    stale_timeout_s: float
    safe_value: SafeValue
    max_plan_points: int
    range_policy: Policy
    margins: Array
    std_policy: Policy
    std_limits: Array

    def same_torque(self, other: Rules) -> bool:
        """Whether both make the same torque of one reference, but for limits and rates."""
        return (
            self.scale == other.scale
            and self.gravity == other.gravity
            and self.range_policy == other.range_policy
            and self.std_policy == other.std_policy
            and np.array_equal(self.margins, other.margins)
            and np.array_equal(self.std_limits, other.std_limits)
        )


def make_rules(settings: ServeSettings, joint_names: Sequence[str]) -> Rules:
    """
    Bring the settings into the order of a model's joints.

    Raises
    ------
    ConfigError
        If a joint is named twice, a list has not one value per joint, or the check of standard
        deviations has no limits.

    """
    require_consistent(settings)

    def per_joint(name: str, default: float) -> Array:
        values = getattr(settings, name)
        return by_joint(name, values, settings.joints, joint_names, default)

    limits = per_joint('torque_limits', np.inf)
    rates = per_joint('rate_limits', np.inf) if settings.rate_limits else DEFAULT_RATE * limits
    return Rules(
        limits=limits,
        rates=rates,
        scale=settings.output_scale,
        ramp_s=settings.ramp_s,
        safe_ramp_s=settings.safe_ramp_s,
        gravity=settings.gravity,
        stale_timeout_s=settings.stale_timeout_s or np.inf,
        safe_value=SafeValue(settings.stale_policy),
        max_plan_points=settings.max_plan_points,
        range_policy=Policy(settings.range_policy),
        margins=per_joint('range_margin', 0.0),
        std_policy=Policy(settings.std_policy),
        std_limits=per_joint('std_limits', np.inf),
    )


def require_consistent(settings: ServeSettings) -> None:
    """
    Refuse settings that contradict each other for any arm.

    Raises
    ------
    ConfigError
        If a joint is named twice, or the check of standard deviations has no limits.

    """
    require_unique('joints', settings.joints)
    if settings.std_policy != Policy.OFF and not settings.std_limits:
        raise ConfigError(
            'std_limits must hold a largest standard deviation where std_policy is '
            f'{settings.std_policy}, but it is empty; give one per joint or one for all.'
        )


def unbounded(settings: ServeSettings) -> str | None:
    """Return the warning that is due where nothing bounds the size or the step of a torque."""
    if settings.torque_limits:
        return None
    steps = '' if settings.rate_limits else ', and neither are their steps: rate_limits is empty'
    return f'torque_limits is empty: torques are not limited{steps}; set both for a real arm'


class TrainingRange:
    """
    Smallest box around the training samples.

    Parameters
    ----------
    low, high : ndarray, shape (3, n)
        Positions, velocities, accelerations.

    """

    def __init__(self, low: Array, high: Array) -> None:
        self._low, self._high = low, high
        self._centre = 0.5 * (low + high)
        self._edge = np.maximum(0.5 * (high - low), SMALLEST)

    def widened(self, margins: Array) -> TrainingRange:
        """
        Return the range with something added to each side.

        Parameters
        ----------
        margins : ndarray, shape (n,)
            As a share of half the range.

        """
        more = 0.5 * margins * (self._high - self._low)
        return TrainingRange(self._low - more, self._high + more)

    def excess(self, states: Array) -> Array:
        """
        Compute how far outside samples are.

        Parameters
        ----------
        states : ndarray, shape (3, n) or (3, N, n)
            Positions, velocities, accelerations.

        Returns
        -------
        ndarray, shape () or (N,)
            For the worst joint, its distance from the centre by that of the edge: 1 at the edge.

        """
        shape = (3, *[1] * (states.ndim - 2), -1)
        distance = np.abs(states - self._centre.reshape(shape)) / self._edge.reshape(shape)
        return np.asarray(distance.max(axis=(0, -1)))


def std_excess(std: Array, limits: Array) -> Array:
    """Return the standard deviation of the worst joint by its limit, 1 at the limit."""
    return np.asarray((std / np.maximum(limits, SMALLEST)).max(axis=-1))


def factors(policy: Policy, excess: Array, counts: Counter[str], key: str) -> Array:
    """
    Apply a policy.

    Parameters
    ----------
    policy : Policy
    excess : ndarray
        Above 1 where a sample is doubtful.
    counts : Counter
        Gets the number of doubtful samples.
    key : str
        Under this key.

    Returns
    -------
    ndarray, shape as excess
        Factor on the torques of all joints. With `scale` it falls from 1 at the edge to 0 at
        twice its distance, with `zero` at once.

    """
    counts[key] += int(np.count_nonzero(excess > 1.0))
    if policy is Policy.SCALE:
        return np.clip(2.0 - excess, 0.0, 1.0)
    if policy is Policy.ZERO:
        return np.where(excess > 1.0, 0.0, 1.0)
    return np.ones_like(excess)

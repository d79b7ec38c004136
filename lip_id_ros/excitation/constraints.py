"""
Limits beside those of the joints, such as of torques, as far as a model can vouch for them.

Nothing is known before the first motion, not even the torques that it needs. So motions grow from
a small and slow one to what the limits allow: each next one is as large as the model that was
learned from the last ones can vouch for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ConfigError
from lip_id_ros.excitation.joint_limits import JointLimits
from lip_id_ros.excitation.series import FourierMotion, LimitedMotions
from lip_id_ros.model import InverseDynamicsModel

HALVINGS, SHRINK = 8, 0.97

LEAST_SHARE = 0.01
"""Of a motion that is made smaller: less teaches nothing."""


class Constraint(Protocol):
    """A limit that a motion keeps or not."""

    @property
    def settings(self) -> str:
        """Where it is from."""

    def require_posture(self, posture: Array) -> None:
        """Refuse a posture at which the limit cannot be kept, by a ConfigError that names it."""

    def is_kept(self, motion: FourierMotion, fine: bool) -> bool:
        """Whether a motion keeps it: at every time, or, if not `fine`, at some times."""


@dataclass(frozen=True)
class Constraints:
    """Some limits, all of which a motion keeps."""

    each: Sequence[Constraint] = ()

    def require_posture(self, posture: Array) -> None:
        """Refuse a posture at which one of them cannot be kept, by a ConfigError."""
        for one in self.each:
            one.require_posture(posture)

    def held(self, motion: FourierMotion) -> FourierMotion:
        """
        Return the motion, or one around the same posture that goes less far.

        ConfigError, with the limit, if hardly anything of it is left.
        """
        if self._are_kept(motion, fine=True):
            return motion
        share = self._nearly_held_share(motion)
        while share >= LEAST_SHARE and not self._are_kept(motion.scaled(share), fine=True):
            share *= SHRINK
        if share < LEAST_SHARE:
            raise self._error(motion.scaled(LEAST_SHARE))
        return motion.scaled(share)

    def _error(self, motion: FourierMotion) -> ConfigError:
        broken = [one.settings for one in self.each if not one.is_kept(motion, fine=True)]
        return ConfigError(
            f'{" and ".join(broken) or "the limits"} must leave more than {LEAST_SHARE:.0%} of '
            'the motion that the joints may make, but leave less: the posture is too near; choose '
            'another posture, or widen them.'
        )

    def nearly_held(self, motion: FourierMotion) -> FourierMotion:
        """Return what `held` does, as far as few samples show, in a fraction of the time."""
        share = self._nearly_held_share(motion)
        return motion if share == 1.0 else motion.scaled(share)

    def _nearly_held_share(self, motion: FourierMotion) -> float:
        if self._are_kept(motion, fine=False):
            return 1.0
        low, high = 0.0, 1.0
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            kept = self._are_kept(motion.scaled(middle), fine=False)
            low, high = (middle, high) if kept else (low, middle)
        return low

    def _are_kept(self, motion: FourierMotion, fine: bool) -> bool:
        return all(one.is_kept(motion, fine) for one in self.each)


DEVIATIONS = 3.0
"""Standard deviations that are added to the torque that a model predicts."""

COARSE_HZ, FINE_HZ = 50.0, 1000.0


class TorqueLimits:
    """
    Limits of torques, and the model that predicts them.

    A torque counts with three standard deviations. Between two samples it is taken to be at most
    as far from either as they are from each other.
    """

    def __init__(self, model: InverseDynamicsModel, limits: JointLimits) -> None:
        assert limits.torque is not None, 'without limits of torques there is nothing to hold'
        assert model.arm is not None, 'only an arm is designed for'
        self._model, self._limit, self._names = model, limits.torque, limits.joint_names

    @property
    def settings(self) -> str:
        """What the limits are from."""
        return 'motion.torque_limits'

    def use(self, motion: FourierMotion, rate: float) -> Array:
        """Return the largest share of each limit that a motion uses, shape (n,)."""
        t = motion.times(rate)
        states = motion.sample(t)
        tau = self._model.predict(*states, t).tau
        size = np.abs(tau) + DEVIATIONS * self._model.torque_std(*states, t)
        steps = np.abs(np.diff(tau, axis=0))
        size[:-1] += steps
        return np.asarray((size / self._limit).max(axis=0))

    def require_posture(self, posture: Array) -> None:
        """Refuse a posture that cannot be held, by a ConfigError that names the joint."""
        still = np.zeros((1, len(posture)))
        state = posture[None], still, still
        tau = self._model.predict(*state).tau[0]
        std = self._model.torque_std(*state)[0]
        used = (np.abs(tau) + DEVIATIONS * std) / self._limit
        worst = int(np.argmax(used))
        if used[worst] >= 1.0:
            raise ConfigError(
                f'joint {self._names[worst]!r} needs {tau[worst]:.3g} ± '
                f'{DEVIATIONS * std[worst]:.2g} at the posture by the model, more than its limit '
                f'{self._limit[worst]:.3g}; choose another posture, or raise motion.torque_limits.'
            )

    def is_kept(self, motion: FourierMotion, fine: bool) -> bool:
        """Whether a motion keeps the limits: at 1 kHz if `fine`, else at some times."""
        return bool(self.use(motion, FINE_HZ if fine else COARSE_HZ).max() <= 1.0)


LEAST_SIZE = 1e-3

LARGEST_GROWTH = 2.0
"""A motion is at most so many times as large as the last one."""

TRIALS, SIZE_HALVINGS = 12, 6


def shrunk(limits: JointLimits, posture: Array, size: float) -> JointLimits:
    """
    Return limits for motion of a size: 0 to 1 of the way to each limit, of velocity and so on.

    Limits of torque stay.
    """
    return replace(
        limits,
        lower=posture + size * (limits.lower - posture),
        upper=posture + size * (limits.upper - posture),
        velocity=size * limits.velocity,
        acceleration=size * limits.acceleration,
        jerk=size * limits.jerk,
    )


def next_size(
    model: InverseDynamicsModel,
    limits: JointLimits,
    posture: Array,
    last: float,
    most: float = 1.0,
    seed: int = 0,
    duration: float = 20.0,
    harmonics: int = 5,
) -> float:
    """
    Return the size of the next motion, `most` at most, which may be smaller than the last one.

    It is the largest at which the torques of random motions, as the model predicts them with three
    deviations, are within the limits. ConfigError if the model vouches for no motion at all.
    """
    largest = min(most, LARGEST_GROWTH * last)
    if limits.torque is None:
        return largest
    torques = TorqueLimits(model, limits)
    torques.require_posture(posture)

    def vouched(size: float) -> bool:
        motions = LimitedMotions(shrunk(limits, posture, size), posture, duration, harmonics)
        rng = np.random.default_rng(seed)
        trials = (motions.random(rng) for _ in range(TRIALS))
        return all(torques.is_kept(motion, fine=False) for motion in trials)

    if vouched(largest):
        return largest
    last = min(last, largest)
    low, high = (last, largest) if vouched(last) else (0.0, last)
    for _ in range(SIZE_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if vouched(middle) else (low, middle)
    if low < LEAST_SIZE:
        raise ConfigError(
            'motion.torque_limits leave no motion at this posture, for which the model needs '
            'nearly all of them with three deviations; choose another posture, raise them, or '
            'record more motion.'
        )
    return low

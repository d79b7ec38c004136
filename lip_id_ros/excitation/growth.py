"""
Motions that grow: from a small and slow one to what the limits allow.

Nothing is known before the first motion, not even the torques that it needs. Each next one is as
large as the model that was learned from the last ones can vouch for.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.excitation.constraints import TorqueLimits
from lip_id_ros.excitation.joint_limits import JointLimits
from lip_id_ros.excitation.scaling import LimitedMotions
from lip_id_ros.model import InverseDynamicsModel

FIRST_SIZE = 0.15
"""Of the first motion, in the limits."""

LARGEST_GROWTH = 2.0
"""A motion is at most so many times as large as the last one."""

TRIALS, HALVINGS = 12, 6


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
    seed: int = 0,
    duration: float = 20.0,
    harmonics: int = 5,
) -> float:
    """
    Return the size of the next motion, which may be smaller than the last one.

    It is the largest at which the torques of random motions, as the model predicts them with three
    deviations, are within the limits. ConfigError if the model cannot hold the posture itself.
    """
    largest = min(1.0, LARGEST_GROWTH * last)
    if limits.torque is None:
        return largest
    torques = TorqueLimits(model, limits)
    torques.require_posture(posture)

    def vouched(size: float) -> bool:
        motions = LimitedMotions(shrunk(limits, posture, size), posture, duration, harmonics)
        rng = np.random.default_rng(seed)
        trials = (motions.motion(motions.random(rng)) for _ in range(TRIALS))
        return all(torques.is_kept(motion, fine=False) for motion in trials)

    if vouched(largest):
        return largest
    low, high = (last, largest) if vouched(last) else (0.0, last)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if vouched(middle) else (low, middle)
    return low

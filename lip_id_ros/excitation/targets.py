"""States at which torques will be wanted: what a motion is designed for."""

from __future__ import annotations

import numpy as np

from lip_id_ros.excitation.expected_error import States
from lip_id_ros.excitation.scaling import LimitedMotions

MOTIONS, STATES_EACH = 12, 50


def random_targets(motions: LimitedMotions, rng: np.random.Generator) -> States:
    """Return states of random motions within the limits."""
    found = []
    for _ in range(MOTIONS):
        motion = motions.motion(motions.random(rng))
        found.append(motion.sample(rng.uniform(0.0, motion.duration, STATES_EACH)))
    q, dq, ddq = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return q, dq, ddq

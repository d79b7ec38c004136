"""Small runs of the simulated Panda, without noise unless asked for."""

from __future__ import annotations

import numpy as np

from benchmarks._arms import FrictionalArm, JointFriction
from lip_id_ros.dataset import Dataset
from lip_id_ros.simulation import make_dataset, panda, SinusoidTrajectory
from lip_id_ros.simulation.arm import MOTION


def runs(
    n_joints: int, n_samples: int, friction: JointFriction | None = None, noise: float = 0.0
) -> tuple[Dataset, Dataset]:
    arm = panda(n_joints)
    rubbing = arm if friction is None else FrictionalArm(arm, friction)
    rng = np.random.default_rng(7)
    t = 0.25 * np.arange(n_samples, dtype=np.float64)
    limits = MOTION.first(n_joints)
    first, second = (
        make_dataset(rubbing, SinusoidTrajectory.random(limits, rng, 20), t, noise, rng)
        for _ in range(2)
    )
    return first, second

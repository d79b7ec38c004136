"""The paper's simulation (section `sec:gen`): a Panda on sums of 50 sinusoids, 500 samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lip_id_ros.dataset import Dataset
from lip_id_ros.simulation import make_dataset, panda, SinusoidTrajectory
from lip_id_ros.simulation.arm import MOTION
from lip_id_ros.simulation.trajectories import MotionLimits

N_SAMPLES = 500
STEP_S = 0.1
NOISE_STD = 0.01

# Mechanical range of the joints [rad], from the URDF and the maker's data sheet.
LOWEST = (-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973)
HIGHEST = (2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973)


def run_pair(n_joints: int, seed: int) -> tuple[Dataset, Dataset]:
    """Return a training run and an unseen test run, with noise of 0.01 N m on the torques."""
    arm, rng = panda(n_joints), np.random.default_rng(seed)
    t = np.arange(N_SAMPLES, dtype=np.float64) * STEP_S
    limits = half_ranges(n_joints)
    first, second = (
        make_dataset(arm, SinusoidTrajectory.random(limits, rng), t, NOISE_STD, rng)
        for _ in range(2)
    )
    return first, second


def half_ranges(n_joints: int) -> MotionLimits:
    """Take the middle half of each joint's range, and the velocities of the paper's table."""
    low, high = (np.array(x[:n_joints]) for x in (LOWEST, HIGHEST))
    centre, reach = (low + high) / 2, (high - low) / 4
    return replace(MOTION.first(n_joints), q_min=centre - reach, q_max=centre + reach)

"""Small data sets."""

from __future__ import annotations

from typing import Any

import numpy as np

from lip_id_ros.dataset import Dataset

N_SAMPLES, N_JOINTS = 6, 2


def fields(**changes: Any) -> dict[str, Any]:
    rng = np.random.default_rng(0)
    shape = (N_SAMPLES, N_JOINTS)
    values: dict[str, Any] = {name: rng.normal(size=shape) for name in ('q', 'dq', 'ddq', 'tau')}
    values |= {
        't': 0.1 * np.arange(N_SAMPLES),
        'joint_names': ('shoulder', 'elbow'),
        'joint_types': ('revolute', 'prismatic'),
        'segment': np.array([0, 0, 0, 4, 4, 4]),
    }
    return values | changes


def dataset(**changes: Any) -> Dataset:
    return Dataset(**fields(**changes))


def of_recordings() -> Dataset:
    return dataset(segment=[0, 0, 1, 1, 2, 2], recording=[3, 3, 3, 3, 7, 7])

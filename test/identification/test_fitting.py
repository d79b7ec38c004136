"""Data sets that a fit refuses, with what to do about it."""

from __future__ import annotations

import numpy as np
import pytest

from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import DataError
from lip_id_ros.identification.fitting import fit


def recorded(still: list[int], n_joints: int = 3) -> Dataset:
    """Return random samples in which some efforts never change."""
    q, dq, ddq, tau = np.random.default_rng(0).standard_normal((4, 20, n_joints))
    tau[:, still] = 0.0
    return Dataset.from_arrays(q, dq, ddq, tau, joint_names=('lift', 'elbow', 'finger')[:n_joints])


def test_every_joint_whose_effort_never_changes_is_named_with_the_option() -> None:
    with pytest.raises(DataError, match=r"those of 'lift', 'finger' are .*: --joints elbow, or"):
        fit(recorded([0, 2]))


def test_where_no_effort_changes_there_is_nothing_to_choose() -> None:
    with pytest.raises(DataError, match=r'or did not move[.]'):
        fit(recorded([0, 1, 2]))

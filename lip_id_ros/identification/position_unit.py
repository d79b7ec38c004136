"""
Positions in revolutions, told by how much better links explain the torques once they are in rad.

It takes half a usual motion: over small angles gravity is nearly a polynomial.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.identification.arm_search import ArmSearch
from lip_id_ros.identification.placement_search import Calibration
from lip_id_ros.joint_types import is_prismatic
from lip_id_ros.progress import Progress

TURN = 2.0 * np.pi

MOST_REACH = 2.0
"""Range of every revolute joint that may be in revolutions."""

BADLY, HALF = 0.05, 0.5
"""
Residuals as shares of the torques, beyond which links explain them badly, and what may be left of
them where positions are taken for revolutions (geometric means over joints).
"""


def may_be_revolutions(dataset: Dataset) -> bool:
    """Return whether no revolute joint turns by more than two revolutions, if they are such."""
    revolute = ~is_prismatic(dataset.joint_types)
    return bool(revolute.any() and np.ptp(dataset.q[:, revolute], axis=0).max() <= MOST_REACH)


def from_revolutions(dataset: Dataset) -> Dataset:
    """Return a data set whose revolute joints were in revolutions, in rad."""
    factor = np.where(is_prismatic(dataset.joint_types), 1.0, TURN)
    q, dq, ddq = (factor * each for each in (dataset.q, dataset.dq, dataset.ddq))
    return replace(dataset, q=q, dq=dq, ddq=ddq)


def left_by_revolutions(
    search: ArmSearch, calibration: Calibration, seed: int, progress: Progress
) -> float | None:
    """Return the share of residuals that is left by revolutions; None where rad will do."""
    fitter = search.fitter
    as_rad = _mean(calibration.noise_std / fitter.torque_std)
    if as_rad < BADLY or not may_be_revolutions(fitter.dataset):
        return None
    other = search.of(fitter.of(from_revolutions(fitter.dataset)))
    left = _mean(other.calibrated(seed, progress).noise_std / fitter.torque_std) / as_rad
    return left if left < HALF else None


def _mean(values: Array) -> float:
    return float(np.exp(np.mean(np.log(values))))

"""From the effort that a driver measures to torque, as the model's own fit had it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array


@dataclass(frozen=True, eq=False)
class Calibration:
    """
    Torque = scale * effort + offset, per joint of the model.

    Attributes
    ----------
    scale : ndarray, shape (n,)
        [N m or N per unit of effort].
    offset : ndarray, shape (n,)
        [N m or N].

    """

    scale: Array
    offset: Array

    def torque(self, effort: Array) -> Array:
        """Return torques [N m or N] of efforts, shape (n,)."""
        return self.scale * effort + self.offset


def calibration(provenance: Mapping[str, Any], joint_names: Sequence[str]) -> Calibration:
    """
    Read the calibration of the first recording that a model was fitted to.

    Parameters
    ----------
    provenance : mapping
        Of the model; a data set that was made elsewhere names no calibration: effort is torque.
    joint_names : sequence of str
        The model's joints.

    """
    sources = provenance.get('sources', [])
    recording: Mapping[str, Any] = next(
        (each['recording'] for each in sources if 'recording' in each), {}
    )
    joints = recording.get('joints') or joint_names
    return Calibration(
        _by_joint(recording.get('effort_scale'), joints, joint_names, 1.0),
        _by_joint(recording.get('effort_offset'), joints, joint_names, 0.0),
    )


def _by_joint(
    values: Sequence[float] | None,
    named: Sequence[str],
    joint_names: Sequence[str],
    default: float,
) -> Array:
    value_of = dict(zip(named, values or (), strict=False))
    return np.array([value_of.get(name, default) for name in joint_names])

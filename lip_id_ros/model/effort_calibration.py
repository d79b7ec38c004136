"""How the effort of a recording was turned into torques."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array


@dataclass(frozen=True, eq=False)
class EffortCalibration:
    """Torque = scale * effort + offset, per joint of the model, shapes (n,) [N m or N]."""

    scale: Array
    offset: Array

    @classmethod
    def identity(cls, n_joints: int) -> EffortCalibration:
        """Return the calibration of efforts that are torques."""
        return cls(np.ones(n_joints), np.zeros(n_joints))

    def torque(self, effort: Array) -> Array:
        """Return torques [N m or N] of efforts, shape (n,)."""
        return self.scale * effort + self.offset


def effort_calibrations(
    provenance: Mapping[str, Any], joint_names: Sequence[str]
) -> tuple[EffortCalibration, ...]:
    """
    Read the calibration of each recording that a data set comes from.

    One that changes nothing where no recording is named: its effort is torque.
    """
    sources = provenance.get('sources', [])
    recordings = [each['recording'] for each in sources if 'recording' in each]
    return tuple(_of_recording(each, joint_names) for each in recordings or [{}])


def _of_recording(recording: Mapping[str, Any], joint_names: Sequence[str]) -> EffortCalibration:
    joints = recording.get('joints') or joint_names
    return EffortCalibration(
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

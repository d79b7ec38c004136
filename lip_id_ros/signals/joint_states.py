"""One measured joint state in the order of a model, whatever the order of its message."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.signals.joints import JointOrder, Refusal, RefusedError


@dataclass(frozen=True, eq=False)
class EffortCalibration:
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


def effort_calibration(
    provenance: Mapping[str, Any], joint_names: Sequence[str]
) -> EffortCalibration:
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


@dataclass(frozen=True, eq=False)
class MeasuredState:
    """
    One measured joint state in the order of the model.

    Attributes
    ----------
    t : float
        Its stamp [s].
    q, dq : ndarray, shape (n,)
        Positions [rad or m], velocities.
    tau : ndarray, shape (n,), or None
        Measured torques [N m or N]; None where none are measured.

    """

    t: float
    q: Array
    dq: Array
    tau: Array | None


class JointStateReader:
    """
    Read joint states.

    Parameters
    ----------
    joint_names : sequence of str
        The model's joints.
    calibration : EffortCalibration
        Of the effort.

    """

    def __init__(self, joint_names: Sequence[str], calibration: EffortCalibration) -> None:
        self._order = JointOrder(joint_names)
        self._calibration = calibration

    def read(self, message: JointMessage) -> MeasuredState:
        """
        Read a message.

        Raises
        ------
        RefusedError
            If a joint of the model is missing or named twice, or a value missing or not finite.

        """
        columns = self._order.columns(message.names)
        q = _vector(message.position, message, columns, Refusal.NO_POSITION)
        dq = _vector(message.velocity, message, columns, Refusal.NO_VELOCITY)
        tau = None
        if len(message.effort):
            effort = _vector(message.effort, message, columns, Refusal.NO_EFFORT)
            tau = self._calibration.torque(effort)
        return MeasuredState(1e-9 * message.stamp_ns, q, dq, tau)


def _vector(row: object, message: JointMessage, columns: IndexArray, absent: Refusal) -> Array:
    values = np.asarray(row, dtype=np.float64)
    if len(values) != len(message.names):
        raise RefusedError(Refusal.WRONG_LENGTH if len(values) else absent)
    chosen = values[columns]
    if not np.isfinite(chosen).all():
        raise RefusedError(Refusal.NOT_FINITE)
    return chosen

"""One measured joint state in the order of a model, whatever the order of its message."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.model import EffortCalibration
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.signals.joints import JointOrder, Refusal, RefusedError


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

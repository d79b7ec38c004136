"""One measured joint state in the order of a model, whatever the order of its message."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.runtime.references import JointOrder, Reason, RefusedError
from lip_id_ros.runtime.serve.calibration import Calibration


@dataclass(frozen=True, eq=False)
class Motion:
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


class MotionReader:
    """
    Read joint states.

    Parameters
    ----------
    joint_names : sequence of str
        The model's joints.
    calibration : Calibration
        Of the effort.

    """

    def __init__(self, joint_names: Sequence[str], calibration: Calibration) -> None:
        self._order = JointOrder(joint_names)
        self._calibration = calibration

    def motion(self, message: JointMessage) -> Motion:
        """
        Read a message.

        Raises
        ------
        RefusedError
            If a joint of the model is missing or named twice, or a value missing or not finite.

        """
        columns = self._order.columns(message.names)
        q, dq = (_vector(row, message, columns) for row in (message.position, message.velocity))
        tau = None
        if len(message.effort):
            tau = self._calibration.torque(_vector(message.effort, message, columns))
        return Motion(1e-9 * message.stamp_ns, q, dq, tau)


def _vector(row: object, message: JointMessage, columns: IndexArray) -> Array:
    values = np.asarray(row, dtype=np.float64)
    if len(values) != len(message.names):
        raise RefusedError(Reason.WRONG_LENGTH)
    chosen = values[columns]
    if not np.isfinite(chosen).all():
        raise RefusedError(Reason.NOT_FINITE)
    return chosen

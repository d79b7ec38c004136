"""Measured joint states by the model's joints; stamps and ages of messages that are trusted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.signals.joints import JointOrder, Refusal, RefusedError

if TYPE_CHECKING:  # numba, which `train` starts without
    from lip_id_ros.model import EffortCalibration

JUMP_CONFIRMED_BY = 3
"""So many messages in a row that follow a doubted stamp show that the clock did jump."""

LONGEST_STAMP_STEP_S = 10.0
"""A stamp further ahead of the last one may be wrong."""

NANOSECONDS = 1_000_000_000

TURN = 2.0 * np.pi


def in_nearest_turn(q: Array, before: Array | None, is_revolute: BoolArray) -> Array:
    """
    Return positions (n,) in the turn that is nearest to positions before, if there are any.

    Joints without stops may be reported within one turn: their positions jump by a whole one.
    """
    if before is None:
        return q
    return q - TURN * np.where(is_revolute, np.round((q - before) / TURN), 0.0)


@dataclass(frozen=True, eq=False)
class MeasuredState:
    """One measured joint state in the order of the model, shapes (n,)."""

    t: float  # stamp [s]
    q: Array  # [rad or m]
    dq: Array
    tau: Array | None  # [N m or N]; None where none are measured


class JointStateReader:
    """
    Read joint states.

    `joint_names`: the model's joints. `calibration`: of the effort; without it efforts are not
    read.
    """

    def __init__(
        self, joint_names: Sequence[str], calibration: EffortCalibration | None = None
    ) -> None:
        self._order = JointOrder(joint_names)
        self._calibration = calibration

    def columns(self, message: JointMessage) -> IndexArray:
        """
        Find the model's joints in a message.

        RefusedError if one is missing or named twice. To be called before the stamp is judged:
        that of another robot is of another clock.
        """
        try:
            return self._order.columns(message.names)
        except RefusedError:
            if not len(message.names) or {*message.names} & {*self._order.joint_names}:
                raise
            raise RefusedError(Refusal.FOREIGN_JOINTS) from None

    def read(self, message: JointMessage) -> MeasuredState:
        """Read a message; RefusedError if a joint or a value is missing, or not as it must be."""
        columns = self.columns(message)
        q = _vector(message.position, message, columns, Refusal.NO_POSITION)
        dq = _vector(message.velocity, message, columns, Refusal.NO_VELOCITY)
        tau = None
        if self._calibration is not None and len(message.effort):
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


class StampWatch:
    """
    Judge stamps one after the other.

    A stamp that goes back or far ahead is doubted, so that neither a wrong one nor a second
    publisher with another clock is followed. When `JUMP_CONFIRMED_BY` messages in a row follow a
    doubted one, the clock has jumped: a restarted driver or simulation, or a pause.

    `longest_step_s`: a stamp further ahead is doubted [s]; of messages that come with the time of
    their receipt, one further ahead than it was long in coming. `jumps`: how often the clock
    jumped.
    """

    def __init__(self, longest_step_s: float = LONGEST_STAMP_STEP_S) -> None:
        self._longest_ns = round(NANOSECONDS * longest_step_s)
        self._last = self._doubted = (0, 0)
        self._n_doubted = 0
        self.jumps = 0

    def doubt(self, stamp_ns: int, received_ns: int = 0) -> Refusal | None:
        """
        Return why a stamp [ns] is not that of the next message, None where it is.

        `received_ns`: when the message came, on any steady clock [ns]; 0 where that says nothing.
        """
        message = stamp_ns, received_ns
        if stamp_ns <= 0:
            return Refusal.NO_STAMP
        if stamp_ns == self._last[0]:
            return Refusal.REPEATED_STAMP
        if self._last[0] == 0 or self._follows(self._last, message):
            self._accept(message)
            return None
        follows = self._n_doubted > 0 and self._follows(self._doubted, message)
        self._n_doubted = self._n_doubted + 1 if follows else 1
        self._doubted = message
        if self._n_doubted == JUMP_CONFIRMED_BY:
            self.jumps += 1
            self._accept(message)
            return None
        return Refusal.BACKWARD_STAMP if stamp_ns < self._last[0] else Refusal.FAR_STAMP

    def _follows(self, before: tuple[int, int], message: tuple[int, int]) -> bool:
        waited_ns = message[1] - before[1]
        return 0 < message[0] - before[0] <= self._longest_ns + waited_ns

    def _accept(self, message: tuple[int, int]) -> None:
        self._last, self._n_doubted = message, 0

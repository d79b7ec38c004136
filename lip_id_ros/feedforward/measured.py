"""Measured joint states beside a model: energies, and the torque that it does not explain."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.feedforward.loading import LoadedModel
from lip_id_ros.joint_types import is_prismatic
from lip_id_ros.model import DynamicsModel, InverseDynamicsModel, Query
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.signals.filters import LowPass
from lip_id_ros.signals.joint_states import (
    in_nearest_turn,
    JointStateReader,
    MeasuredState,
    NANOSECONDS,
    StampWatch,
)
from lip_id_ros.signals.joints import RefusedError

LONGEST_MEASURED_STEP_S = 0.5
"""A stamp that is further ahead, beyond the time its message was in coming, is doubted."""


class MeasuredArm:
    """Read joint states, and compare them with a model after a low-pass."""

    def __init__(self, loaded: LoadedModel, cutoff_hz: float) -> None:
        self._loaded = loaded
        self._reader = JointStateReader(loaded.joint_names, loaded.calibration)
        self._stamps = StampWatch(LONGEST_MEASURED_STEP_S)
        self._cutoff_hz, self._low_pass = cutoff_hz, LowPass(cutoff_hz)
        self._is_revolute = np.asarray(~is_prismatic(loaded.model.joint_types))
        self._q: Array | None = None
        self._newest: DynamicsModel | None = None
        self._filtered = loaded.newest

    def adjust(self, cutoff_hz: float) -> None:
        """Use another cut-off [Hz]; the low-pass begins anew then."""
        if cutoff_hz != self._cutoff_hz:
            self._cutoff_hz, self._low_pass = cutoff_hz, LowPass(cutoff_hz)

    def read(self, message: JointMessage, now: float) -> MeasuredState:
        """Read a joint state that came at `now` [s]; RefusedError if it lacks a part or is old."""
        measured = self._reader.read(message)
        doubt = self._stamps.doubt(message.stamp_ns, round(NANOSECONDS * now))
        if doubt is not None:
            raise RefusedError(doubt)
        return measured

    def energies(self, measured: MeasuredState) -> Query:
        """Return the energies at a measured state; the torques are those without acceleration."""
        return self._loaded.newest.query(measured.q, measured.dq, np.zeros_like(measured.q))

    def residual(self, measured: MeasuredState) -> Array | None:
        """
        Return measured torque minus the model's, both filtered alike, shape (n,) [N m or N].

        Positions, velocities and torques go through one low-pass; the acceleration is the
        derivative of the filtered velocity. So all have the same delay. None without measured
        torques, and until the filter has settled after a gap or a stamp that does not rise.
        """
        if measured.tau is None:
            return None
        self._q = in_nearest_turn(measured.q, self._q, self._is_revolute)
        signals = np.stack([self._q, measured.dq, measured.tau])
        filtered = self._low_pass.add(measured.t, signals)
        if filtered is None:
            return None
        (q, dq, tau), (_, ddq, _) = filtered
        q = in_nearest_turn(q, measured.q, self._is_revolute)
        with np.errstate(all='ignore'):
            residual = tau - self.model_of_filtered_torques().query(q, dq, ddq).tau
        return residual if np.isfinite(residual).all() else None

    def model_of_filtered_torques(self) -> DynamicsModel:
        """Return the model as it is now, with friction that is low-passed as in its fit."""
        newest = self._loaded.newest
        if newest is not self._newest:
            self._newest = self._filtered = newest
            if isinstance(newest, InverseDynamicsModel):
                self._filtered = newest.with_rise_time(self._loaded.rise_time)
        return self._filtered

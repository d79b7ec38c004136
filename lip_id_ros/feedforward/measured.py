"""What measured joint states say with a model: energies, and the torque it does not explain."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.feedforward.feedforward import Answer, Feedforward
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.signals.filters import LowPass
from lip_id_ros.signals.joint_states import EffortCalibration, JointStateReader, MeasuredState


class Measured:
    """
    Follow the arm's joint states with a model.

    Parameters
    ----------
    feedforward : Feedforward
    calibration : EffortCalibration
        Of the effort.
    cutoff_hz : float
        Of the low-pass before the torque residual [Hz].

    """

    def __init__(
        self, feedforward: Feedforward, calibration: EffortCalibration, cutoff_hz: float
    ) -> None:
        self._feedforward = feedforward
        self._reader = JointStateReader(feedforward.joint_names, calibration)
        self._low_pass = LowPass(cutoff_hz)

    def motion(self, message: JointMessage) -> MeasuredState:
        """
        Read a message.

        Raises
        ------
        RefusedError
            If a joint of the model is missing or named twice, or a value missing or not finite.

        """
        return self._reader.motion(message)

    def energies(self, motion: MeasuredState) -> Answer:
        """Return the energies at a measured state; the torques are those without acceleration."""
        return self._feedforward.at(np.stack([motion.q, motion.dq, np.zeros_like(motion.q)]))

    def residual(self, motion: MeasuredState) -> Array | None:
        """
        Return measured torque minus the model's, both filtered alike.

        Positions, velocities and torques go through one low-pass; the acceleration is the
        derivative of the filtered velocity. So all have the same delay.

        Parameters
        ----------
        motion : MeasuredState
            The next one; stamps must rise.

        Returns
        -------
        ndarray, shape (n,), or None
            [N m or N]; None without measured torques, and until the filter has settled after a
            gap or a stamp that does not rise.

        """
        if motion.tau is None:
            return None
        filtered = self._low_pass.add(motion.t, np.stack([motion.q, motion.dq, motion.tau]))
        if filtered is None:
            return None
        (q, dq, tau), (_, ddq, _) = filtered
        residual = tau - self._feedforward.at(np.stack([q, dq, ddq])).tau
        return residual if np.isfinite(residual).all() else None

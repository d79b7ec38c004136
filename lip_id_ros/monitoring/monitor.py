"""What the node `monitor` does with a joint state: watch energy and contacts, or refuse it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import DataError
from lip_id_ros.model import TrainedModel
from lip_id_ros.monitoring import (
    ContactMonitor,
    EnergyBalance,
    EnergyMonitor,
    Thresholds,
    Touch,
)
from lip_id_ros.monitoring.settings import MonitorSettings
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.serving import Predictor
from lip_id_ros.signals.joint_states import effort_calibration, JointStateReader, MeasuredState
from lip_id_ros.signals.joints import by_joint, Refusal, RefusedError, require_joints

LONGEST_GAP_S = 0.2
NEARLY = 0.95
"""A sample this share of a period after the one before is taken: stamps jitter."""


@dataclass(frozen=True)
class Watched:
    """
    What one joint state says.

    Attributes
    ----------
    touch : Touch
        External torques, and their sudden part.
    energy : EnergyBalance
    contact : bool, or None
        Whether anything touches the arm, or did in the last `hold_s`; None without thresholds.

    """

    touch: Touch
    energy: EnergyBalance
    contact: bool | None


class Monitor:
    """
    Watch an arm with a model.

    Parameters
    ----------
    settings : MonitorSettings

    Raises
    ------
    OSError
        If the model cannot be opened.
    ModelError
        If it is not a model, or its joints are not those expected.
    ConfigError
        If a list has not one value per joint.

    """

    def __init__(self, settings: MonitorSettings) -> None:
        model = TrainedModel.load(settings.model_path)
        require_joints(model.joint_names, settings.joints, settings.model_path)
        self.joint_names = model.joint_names
        self._settings = settings
        self._predictor = Predictor(model)
        self._predictor.predict(*np.zeros((3, 1, model.n_joints)))  # compiled now
        self._reader = JointStateReader(
            model.joint_names, effort_calibration(model.provenance, model.joint_names)
        )
        self._smallest = self._per_joint('smallest_contact')
        self._thresholds = (
            Thresholds(self._per_joint('thresholds')) if settings.thresholds else None
        )
        self._free: FreeMotion | None = None
        self._failure = ''
        self._told_until = -np.inf
        self._counts = Counter(watched=0, contacts=0)
        self._refused: Counter[str] = Counter()
        self._t = -np.inf
        self._contact = ContactMonitor(self._predictor)
        self._energy = EnergyMonitor(self._predictor)

    def calibrate(self) -> str:
        """Watch free motion from now on; return what was begun."""
        self._free = FreeMotion(self._settings.calibration_s, len(self.joint_names))
        return f'watching {self._settings.calibration_s:g} s of motion; let nothing touch the arm'

    def take(self, message: JointMessage) -> Watched | None:
        """
        Watch a joint state.

        Parameters
        ----------
        message : JointMessage
            With positions, velocities and efforts of all joints.

        Returns
        -------
        Watched, or None
            None where it comes too soon after the one before, and after a gap.

        Raises
        ------
        RefusedError
            If it cannot be used; it is counted.

        """
        step = 1e-9 * message.stamp_ns - self._t
        if 0.0 <= step < NEARLY / self._settings.rate_hz:
            return None
        try:
            return self._watch(step, self._reader.read(message))
        except RefusedError as refused:
            self._refused[refused.reason.value] += 1
            raise

    def status(self) -> dict[str, Any]:
        """Return what is told about the node; JSON-able."""
        thresholds = self._thresholds
        return {
            'state': self._state,
            'thresholds': None if thresholds is None else np.round(thresholds.torque, 3).tolist(),
            **self._counts,
            'refused': dict(self._refused),
            'failure': self._failure,
        }

    @property
    def _state(self) -> str:
        if self._free is not None:
            return 'calibrating'
        return 'watching' if self._thresholds is not None else 'without thresholds'

    def _watch(self, step: float, motion: MeasuredState) -> Watched | None:
        if motion.tau is None:
            raise RefusedError(Refusal.NO_EFFORT)
        self._t = motion.t
        follows = 0.0 < step <= max(LONGEST_GAP_S, 2.0 / self._settings.rate_hz)
        if not follows:
            self._begin_anew()
        state = (motion.t, motion.q, motion.dq, motion.tau)
        touch, energy = self._contact.update(*state), self._energy.update(*state)
        if not (np.isfinite(touch.torque).all() and np.isfinite(energy.unexplained)):
            self._begin_anew()
            raise RefusedError(Refusal.NOT_FINITE_TORQUE)
        if not follows:
            return None
        self._counts['watched'] += 1
        self._learn(step, touch.sudden)
        return Watched(touch, energy, self._told(motion.t, touch))

    def _begin_anew(self) -> None:
        self._contact = ContactMonitor(self._predictor)
        self._energy = EnergyMonitor(self._predictor)

    def _told(self, t: float, touch: Touch) -> bool | None:
        if self._thresholds is None:
            return None
        if self._thresholds.exceeded(touch.sudden).any():
            self._counts['contacts'] += t > self._told_until
            self._told_until = t + self._settings.hold_s
        # a clock that was set back must not tell a contact for ever
        return bool(0.0 <= self._told_until - t <= self._settings.hold_s)

    def _learn(self, step: float, sudden: Array) -> None:
        if self._free is None or not self._free.add(step, sudden):
            return
        found, self._free = self._free, None
        try:
            self._thresholds = Thresholds.between(found.largest[np.newaxis], self._smallest)
            self._failure = ''
        except DataError as error:
            self._failure = f'not calibrated: {error}'

    def _per_joint(self, name: str) -> Array:
        return by_joint(
            name, getattr(self._settings, name), self._settings.joints, self.joint_names, 0.0
        )


class FreeMotion:
    """
    What a motion without contact shows.

    Parameters
    ----------
    seconds : float
        How much is watched [s].
    n_joints : int

    Attributes
    ----------
    largest : ndarray, shape (n,)
        The largest sudden torques so far [N m or N].

    """

    def __init__(self, seconds: float, n_joints: int) -> None:
        self._left = seconds
        self.largest = np.zeros(n_joints)

    def add(self, step: float, sudden: Array) -> bool:
        """Take a sample, `step` [s] after the one before; tell whether it is enough."""
        self.largest = np.maximum(self.largest, np.abs(sudden))
        self._left -= step
        return self._left <= 0.0

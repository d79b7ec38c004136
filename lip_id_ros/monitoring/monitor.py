"""What the node `monitor` does with a joint state: watch energy and contacts, or refuse it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import DataError
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.monitoring.detection import ContactEstimate, ContactMonitor, Thresholds
from lip_id_ros.monitoring.observers import EnergyBalance, EnergyMonitor
from lip_id_ros.monitoring.settings import MonitorSettings
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.signals.health import Health, Level
from lip_id_ros.signals.joint_states import JointStateReader, MeasuredState
from lip_id_ros.signals.joints import by_joint, Refusal, RefusedError, require_joints
from lip_id_ros.signals.stamps import CONFIRMED_BY, StampWatch

LONGEST_GAP_S = 0.2
NEARLY = 0.95
"""A sample this share of a period after the one before is taken: stamps jitter."""

SILENCE_S = 2.0
"""After so long without a joint state the monitor is blind."""

LEAST_MOTION = 0.2
"""Share of the training data's range of velocities that calibration must see of every joint."""


@dataclass(frozen=True)
class Watched:
    """
    The estimates of one joint state.

    Attributes
    ----------
    external : ContactEstimate
    energy : EnergyBalance
    contact : bool, or None
        Whether there is a contact, or was in the last `hold_s`; None without thresholds.

    """

    external: ContactEstimate
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
        If a joint is named twice, or a list has not one value per joint.

    """

    def __init__(self, settings: MonitorSettings) -> None:
        model = InverseDynamicsModel.load(settings.model_path)
        require_joints(model.joint_names, settings.joints, settings.model_path)
        self.joint_names = model.joint_names
        self._settings = settings
        self._predictor = model
        self._predictor.predict(*np.zeros((3, 1, model.n_joints)))  # compiled now
        self._reader = JointStateReader(model.joint_names, model.effort_calibration)
        self._smallest = self._per_joint('smallest_contact')
        self._thresholds = (
            Thresholds(self._per_joint('thresholds')) if settings.thresholds else None
        )
        self._free: FreeMotion | None = None
        self._failure = ''
        self._contact_until = -np.inf
        self._counts = Counter(received=0, watched=0, contacts=0, too_soon=0, after_a_gap=0)
        self._refused: Counter[str] = Counter()
        self._stamps = StampWatch()
        self._t = -np.inf
        self._begin_anew()

    def calibrate(self) -> str:
        """Watch free motion from now on; return what was begun."""
        self._free = FreeMotion(self._settings.calibration_s, len(self.joint_names))
        return (
            f'watching {self._settings.calibration_s:g} s of motion; move all joints as in use, '
            'without any contact'
        )

    def take(self, message: JointMessage) -> Watched | None:
        """
        Watch a joint state; it is counted, whatever becomes of it.

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
            If it cannot be used.

        """
        self._counts['received'] += 1
        try:
            doubt = self._stamps.doubt(message.stamp_ns)
            if doubt is not None:
                raise RefusedError(doubt)
            step = 1e-9 * message.stamp_ns - self._t
            if 0.0 <= step < NEARLY / self._settings.rate_hz:
                self._counts['too_soon'] += 1
                return None
            return self._watch(step, self._reader.read(message))
        except RefusedError as refused:
            self._refused[refused.reason.value] += 1
            raise

    def status(self) -> dict[str, Any]:
        """Return what was done so far, JSON-able; received is the sum of the other counts."""
        thresholds = self._thresholds
        return {
            'state': self._state,
            'thresholds': None if thresholds is None else np.round(thresholds.torque, 3).tolist(),
            **self._counts,
            'refused': dict(self._refused),
            'failure': self._failure,
        }

    @property
    def counts(self) -> Counter[str]:
        """What became of joint states: a count for each outcome, and for each reason."""
        return self._counts + self._refused

    @property
    def _state(self) -> str:
        if self._free is not None:
            return 'calibrating'
        return 'watching' if self._thresholds is not None else 'without thresholds'

    def _watch(self, step: float, measured: MeasuredState) -> Watched | None:
        if measured.tau is None:
            raise RefusedError(Refusal.NO_EFFORT)
        self._t = measured.t
        follows = 0.0 < step <= self.longest_gap_s
        if not follows:
            self._begin_anew()
        state = (measured.t, measured.q, measured.dq, measured.tau)
        external, energy = self._contact.update(*state), self._energy.update(*state)
        if not (np.isfinite(external.torque).all() and np.isfinite(energy.unexplained)):
            self._begin_anew()
            raise RefusedError(Refusal.NOT_FINITE_TORQUE)
        if not follows:
            self._counts['after_a_gap'] += 1
            return None
        self._counts['watched'] += 1
        self._learn(step, measured.dq, external.high_pass)
        return Watched(external, energy, self._in_contact(measured.t, external))

    @property
    def longest_gap_s(self) -> float:
        """Joint states further apart are not watched [s]."""
        return max(LONGEST_GAP_S, 2.0 / self._settings.rate_hz)

    def _begin_anew(self) -> None:
        self._contact = ContactMonitor(self._predictor)
        self._energy = EnergyMonitor(self._predictor)

    def _in_contact(self, t: float, external: ContactEstimate) -> bool | None:
        if self._thresholds is None:
            return None
        if self._thresholds.exceeded(external.high_pass).any():
            self._counts['contacts'] += t > self._contact_until
            self._contact_until = t + self._settings.hold_s
        # a clock that was set back must not hold a contact for ever
        return bool(0.0 <= self._contact_until - t <= self._settings.hold_s)

    def _learn(self, step: float, dq: Array, high_pass: Array) -> None:
        if self._free is None or not self._free.add(step, dq, high_pass):
            return
        found, self._free = self._free, None
        try:
            low, high = self._predictor.training_range
            found.require_motion(self.joint_names, high[1] - low[1])
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
    The largest external torques of a motion without contact.

    Parameters
    ----------
    seconds : float
        How much is watched [s].
    n_joints : int

    Attributes
    ----------
    largest : ndarray, shape (n,)
        Largest high-pass of the external torques so far [N m or N].

    """

    def __init__(self, seconds: float, n_joints: int) -> None:
        self._remaining = seconds
        self._low, self._high = np.full((2, n_joints), [[np.inf], [-np.inf]])
        self.largest = np.zeros(n_joints)

    def add(self, step: float, dq: Array, high_pass: Array) -> bool:
        """Take a sample, `step` [s] after the one before; return whether it is enough."""
        self.largest = np.maximum(self.largest, np.abs(high_pass))
        self._low, self._high = np.minimum(self._low, dq), np.maximum(self._high, dq)
        self._remaining -= step
        return self._remaining <= 0.0

    def require_motion(self, joint_names: tuple[str, ...], trained: Array) -> None:
        """
        Refuse a motion that does not show the errors of the model.

        Parameters
        ----------
        joint_names : tuple of str
        trained : ndarray, shape (n,)
            Range of the velocities of the training data [rad/s or m/s].

        Raises
        ------
        DataError
            If a joint moved by less than `LEAST_MOTION` of that.

        """
        spanned, needed = self._high - self._low, LEAST_MOTION * trained
        for name, span, least in zip(joint_names, spanned, needed, strict=True):
            if span < least:
                raise DataError(
                    f'the velocity of {name} must span {least:.2g} rad/s or m/s, a fifth of the '
                    f'training data, but spanned {span:.2g}; call calibrate and move all joints.'
                )


class MonitorDiagnostics:
    """
    Judge a monitor again and again, by what was counted since the last time.

    Parameters
    ----------
    monitor : Monitor

    """

    def __init__(self, monitor: Monitor) -> None:
        self._monitor = monitor
        self._before = monitor.counts
        self._received_at: float | None = None
        self._n_unusable = 0

    def health(self, now: float) -> Health:
        """Judge at this time [s], on any steady clock."""
        counts = self._monitor.counts
        new, self._before = counts - self._before, counts
        if self._received_at is None or new['received']:
            self._received_at = now
        self._n_unusable += new['received'] - new['watched'] - new['too_soon']
        if new['watched']:
            self._n_unusable = 0
        return self._judge(new, now - self._received_at)

    def _judge(self, new: Counter[str], silence: float) -> Health:
        status = self._monitor.status()
        refused = ', '.join(f'{key} {new[key]}' for key in sorted(status['refused']) if new[key])
        if silence > SILENCE_S:
            return Health(Level.ERROR, f'blind: no joint states for {silence:.0f} s')
        if self._n_unusable >= CONFIRMED_BY:
            gap = f'more than {self._monitor.longest_gap_s:g} s apart'
            trouble = f'refused: {refused}' if refused else gap
            return Health(Level.ERROR, f'blind: joint states {trouble}')
        if status['failure']:
            return Health(Level.ERROR, status['failure'])
        if refused:
            return Health(Level.WARN, f'joint states refused: {refused}')
        return Health(Level.OK, status['state'])

"""Contacts of the monitor: of which size, by which deviations, and how long one is held."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.errors import DataError
from lip_id_ros.monitoring.detection import Calibration, ContactDetector, Deviation, FreeMotion
from lip_id_ros.monitoring.external_torque import ExternalTorque
from lip_id_ros.monitoring.settings import DEVIATIONS_OF, MonitorSettings
from lip_id_ros.signals.joints import by_joint

NO_SHARES = dict.fromkeys(DEVIATIONS_OF)


class Contacts:
    """
    Contacts at the joints of an arm; ConfigError if the settings do not fit them.

    `trained`, shape (n,): ranges of velocities of the training data. `failure`: why the last
    calibration failed; empty where it did not.
    """

    def __init__(
        self, settings: MonitorSettings, joint_names: Sequence[str], trained: Array
    ) -> None:
        self._settings, self._joint_names, self._trained = settings, joint_names, trained
        self._free: FreeMotion | None = None
        self._until = np.full(len(joint_names), -np.inf)
        self.failure, self._n_contacts, self._n_blind = '', 0, 0
        shares = np.stack([self._by_joint(name) for name in DEVIATIONS_OF])
        given = Calibration(Deviation(shares), np.zeros(len(joint_names)))
        self._calibration = given if settings.deviation_constant else None
        self._detector: ContactDetector | None = None
        self.find(settings.smallest_contact)

    @property
    def state(self) -> str:
        """What is done, in words."""
        if self._free is not None:
            return 'calibrating'
        return 'not calibrated' if self._detector is None else 'watching'

    def calibrate(self) -> str:
        """Watch free motion from now on; return what was begun."""
        seconds = self._settings.calibration_s
        self._free = FreeMotion(seconds, len(self._joint_names))
        return f'watching {seconds:g} s of motion; move all joints as in use, without any contact'

    def require_shown(self, smallest: Sequence[float]) -> None:
        """Refuse smallest contacts that do not fit: DataError where they would not show."""
        self._detector_of(self._by_joint('smallest_contact', smallest))

    def find(self, smallest: Sequence[float]) -> None:
        """Detect contacts of another size from now on; DataError as `require_shown`."""
        self._smallest = self._by_joint('smallest_contact', smallest)
        self._detector, self.failure = self._detector_of(self._smallest), ''

    def judge(
        self, t: float, step: float, dq: Array, external: ExternalTorque
    ) -> dict[str, Array | BoolArray] | None:
        """
        Return values of the joints by name, (n,), at t [s], a `step` [s] after the last.

        None before a calibration.
        """
        if self._free is not None and self._free.add(step, dq, external):
            self._learn(self._free)
        if self._detector is None:
            return None
        judged, until, hold_s = self._detector.judge(external), self._until, self._settings.hold_s
        self._n_blind += int(judged.blind.any())
        self._n_contacts += int(judged.touched.any() and (t > until).all())
        until[judged.touched] = t + hold_s
        return {
            'torque': external.torque,
            'deviation': judged.std,
            'threshold': judged.threshold,
            # a clock that was set back must not hold a contact for ever
            'contact': judged.touched | ((until >= t) & (until <= t + hold_s)),
            'blind': judged.blind,
        }

    def outcome(self) -> tuple[str, Mapping[str, Any]]:
        """Return how the last calibration has ended, and parameters that detect what it shows."""
        found = self._found
        if found is None:
            return self.failure, {}
        sentence = f'calibrated: {found.in_words(self._joint_names)} would show'
        return self.failure or sentence, {
            'joints': list(self._joint_names),
            'smallest_contact': np.maximum(self._smallest, found.least).tolist(),
            **_shares(found.deviation),
        }

    def values(self) -> dict[str, Any]:
        """Return the deviations under the names of their parameters, and the counts."""
        return {
            **(_shares(self._detector.deviation) if self._detector else NO_SHARES),
            'least_contact': self._found.least.tolist() if self._found else None,
            'contacts': self._n_contacts,
            'blind': self._n_blind,
            'failure': self.failure,
        }

    @property
    def _found(self) -> Calibration | None:
        """The last calibration, unless deviations were given."""
        given = self._calibration is None or not self._calibration.least.any()
        return None if given else self._calibration

    def _learn(self, free: FreeMotion) -> None:
        self._free = None
        try:
            self._calibration = free.calibration(
                self._joint_names, self._trained, self._by_joint('deviation_torque')
            )
            self._detector, self.failure = self._detector_of(self._smallest), ''
        except DataError as error:
            self.failure = f'not calibrated: {error}'

    def _detector_of(self, smallest: Array) -> ContactDetector | None:
        if self._calibration is None:
            return None
        return self._calibration.detector(self._joint_names, smallest)

    def _by_joint(self, name: str, values: Sequence[float] | None = None) -> Array:
        given = getattr(self._settings, name) if values is None else values
        return by_joint(name, given, self._settings.joints, self._joint_names, 0.0)


def _shares(deviation: Deviation) -> dict[str, list[float]]:
    """Return shares under the names of their parameters."""
    return dict(zip(DEVIATIONS_OF, deviation.shares.round(4).tolist(), strict=True))

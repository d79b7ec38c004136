"""The monitor: estimates contacts and energies from each joint state, or refuses and counts it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lip_id_ros.adaptation.adapted_model import AdaptedModel
from lip_id_ros.adaptation.follow_settings import (
    blend_setting,
    follow_rules,
    follow_setting,
    limit_setting,
    timeout_setting,
)
from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.errors import DataError
from lip_id_ros.joint_types import is_prismatic
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.monitoring.detection import (
    Calibration,
    Contact,
    ContactDetector,
    Deviation,
    FreeMotion,
    LEAST_AT_REST,
    TORQUE_ERROR,
)
from lip_id_ros.monitoring.external_torque import (
    BANDWIDTH,
    ExternalTorque,
    ExternalTorqueObserver,
)
from lip_id_ros.monitoring.observers import EnergyBalance, EnergyMonitor, Predictor
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.settings import executor_setting, setting, Settings
from lip_id_ros.settings.settings import AT_ONCE, AT_START, PER_JOINT
from lip_id_ros.signals.joint_states import (
    CONFIRMED_BY,
    continued,
    JointStateReader,
    MeasuredState,
    NANOSECONDS,
    StampWatch,
)
from lip_id_ros.signals.joints import (
    by_joint,
    Refusal,
    RefusedError,
    require_joints,
    require_unique,
)
from lip_id_ros.signals.status import in_words, Level, Tally

LONGEST_GAP_S = 0.2
NEARLY = 0.95
"""A sample this share of a period after the one before is taken: stamps jitter."""

DEVIATIONS_OF = ('deviation_constant', 'deviation_torque', 'deviation_inertial', 'deviation_rest')
"""Parameters that hold the rows of `Deviation.shares`."""

SILENCE_S = 2.0
"""After so long without a joint state the monitor is blind."""


@dataclass(frozen=True)
class MonitorSettings(Settings):
    """The node `monitor`."""

    model_path: str = setting('model.npz', 'Model of the arm.', applies=AT_START)
    joints: tuple[str, ...] = setting(
        (),
        'Joints that the model must have, in any order, and that every list here is given for; '
        'empty to take any model and its order.',
        applies=AT_START,
    )
    rate_hz: float = setting(
        100.0,
        'How often joint states are taken, at most; each costs about ten queries of the model.',
        unit='Hz',
        minimum=1.0,
        maximum=1000.0,
        applies=AT_START,
    )
    smallest_contact: tuple[float, ...] = setting(
        (5.0,),
        'Smallest contact that is to be detected; refused where the last calibration says that it '
        f'would not show. {PER_JOINT}',
        unit='N m or N',
        minimum=0.0,
        applies=AT_ONCE,
    )
    deviation_constant: tuple[float, ...] = setting(
        (),
        'Deviation of the external torque in free motion, as the status has it after calibrate; '
        f'empty: no contact is detected before calibrate. {PER_JOINT}',
        unit='N m or N',
        minimum=0.0,
        applies=AT_START,
    )
    deviation_torque: tuple[float, ...] = setting(
        (TORQUE_ERROR,),
        'Its share of the measured torque, or the least that calibrate takes: 0.1 for torques '
        f'from motor currents, 0.02 for torque sensors. {PER_JOINT}',
        minimum=0.0,
        applies=AT_START,
    )
    deviation_inertial: tuple[float, ...] = setting(
        (0.0,), f'Its share of the inertial torque. {PER_JOINT}', minimum=0.0, applies=AT_START
    )
    deviation_rest: tuple[float, ...] = setting(
        (LEAST_AT_REST,),
        f'Its share of the friction that changes sign near rest. {PER_JOINT}',
        minimum=0.0,
        applies=AT_START,
    )
    bandwidth: float = setting(
        BANDWIDTH,
        'Of the observer: a larger one detects contacts sooner, and shows more noise; calibrate '
        'anew after a change.',
        unit='1/s',
        minimum=1.0,
        maximum=1000.0,
        applies=AT_START,
    )
    calibration_s: float = setting(
        60.0,
        'How much motion without contact calibrate watches.',
        unit='s',
        minimum=1.0,
        applies=AT_START,
    )
    hold_s: float = setting(
        0.5, 'How long a contact is published at least.', unit='s', minimum=0.0, applies=AT_START
    )
    follow_adaptation: bool = follow_setting(AT_START)
    blend_s: float = blend_setting(AT_START)
    adaptation_timeout_s: float = timeout_setting(AT_START)
    adaptation_limit: tuple[float, ...] = limit_setting(AT_START)
    executor: str = executor_setting()


@dataclass(frozen=True)
class Watched:
    """
    The estimates of one joint state.

    `judged`, `contact`, shape (n,): deviations, and where there is a contact, or was in the last
    `hold_s`; None before a calibration.
    """

    external: ExternalTorque
    energy: EnergyBalance
    judged: Contact | None
    contact: BoolArray | None


class Monitor:
    """Watch an arm with a model; LipIdError if the settings do not fit it."""

    def __init__(self, settings: MonitorSettings) -> None:
        require_unique('joints', settings.joints)
        fitted = InverseDynamicsModel.load(settings.model_path)
        require_joints(fitted.joint_names, settings.joints, settings.model_path)
        model = fitted.with_rise_time(0.0)  # torques come as drives have them
        self.joint_names = model.joint_names
        self._settings = settings
        self._trained = model.training_range
        self._adapted: AdaptedModel | None = None
        if settings.follow_adaptation:
            self._adapted = AdaptedModel(fitted, follow_rules(settings, model.joint_names))
        self._predictor: Predictor = self._adapted or model
        self._predictor.predict(*np.zeros((3, 1, model.n_joints)))  # compiled now
        self._reader = JointStateReader(model.joint_names, model.effort_calibration)
        self._smallest = self._per_joint('smallest_contact')
        self._detector = self._configured() if settings.deviation_constant else None
        self.calibration: Calibration | None = None
        self._free: FreeMotion | None = None
        self.failure = ''
        self._contact_until = np.full(model.n_joints, -np.inf)
        self._tally = Tally('watched', 'too_soon', 'after_a_gap')
        self._n_contacts = self._n_blind = 0
        self._before = self._counts()
        self._received_at: float | None = None
        self._n_unusable = 0
        self._refused: Counter[str] = Counter()
        self._stamps = StampWatch()
        self._stamp_ns = -NANOSECONDS
        self._is_revolute = ~is_prismatic(model.joint_types)
        self._q: Array | None = None
        self._begin_anew()

    def calibrate(self) -> str:
        """Watch free motion from now on; return what was begun."""
        self._free = FreeMotion(self._settings.calibration_s, len(self.joint_names))
        return (
            f'watching {self._settings.calibration_s:g} s of motion; move all joints as in use, '
            'without any contact'
        )

    @property
    def is_calibrating(self) -> bool:
        """Whether free motion is watched."""
        return self._free is not None

    def require_shown(self, smallest: Sequence[float]) -> None:
        """Refuse smallest contacts that do not fit: DataError where they would not show."""
        wanted = self._by_joint('smallest_contact', smallest)
        if self.calibration is not None:
            self.calibration.detector(self.joint_names, wanted)

    def find(self, smallest: Sequence[float]) -> None:
        """Detect contacts of another size from now on, with the deviations that are known."""
        self._smallest = self._by_joint('smallest_contact', smallest)
        if self.calibration is not None:
            self._detector = self.calibration.detector(self.joint_names, self._smallest)
            self.failure = ''
        elif self._detector is not None:
            self._detector = replace(self._detector, smallest=self._smallest)

    def parameters(self) -> dict[str, Array]:
        """Return the parameters of a monitor that detects what the last calibration shows."""
        if self.calibration is None:
            return {}
        smallest = np.maximum(self._smallest, self.calibration.least)
        shares = zip(DEVIATIONS_OF, self.calibration.deviation.shares, strict=True)
        return {'smallest_contact': smallest, **dict(shares)}

    def take(self, message: JointMessage) -> Watched | None:
        """
        Watch a joint state, or refuse it by RefusedError; it is counted in any case.

        Returns None where it comes too soon after the one before, and after a gap.
        """
        with self._tally.receiving():
            self._reader.columns(message)
            doubt = self._stamps.doubt(message.stamp_ns)
            if doubt is not None:
                raise RefusedError(doubt)
            step = (message.stamp_ns - self._stamp_ns) / NANOSECONDS
            if 0.0 <= step < NEARLY / self._settings.rate_hz:
                self._tally.used['too_soon'] += 1
                return None
            return self._watch(step, message.stamp_ns, self._reader.read(message))

    def take_update(self, message: Any, now: float, clock_ns: int) -> None:
        """Follow an update of the model; RefusedError, counted, where it is not to be followed."""
        if self._adapted is not None:
            self._adapted.take(message, now, clock_ns)

    def judge(self, now: float) -> tuple[Level, str]:
        """Judge what came since the last call, in one sentence; `now` [s] is of any clock."""
        if self._adapted is not None:
            self._adapted.watch(now)
        counts = self._counts()
        new, self._before = counts - self._before, counts
        if self._received_at is None or new['received']:
            self._received_at = now
        refused = self._tally.new_refusals()
        self._n_unusable += new['received'] - new['watched'] - new['too_soon']
        self._refused.update(refused)
        if new['watched']:
            self._n_unusable, self._refused = 0, Counter()
        return self._judgement(new, refused, now - self._received_at)

    def values(self) -> dict[str, Any]:
        """Return the state and the counts, JSON-able."""
        return {
            'state': self._state,
            **self._deviations(),
            'least_contact': self.calibration.least.tolist() if self.calibration else None,
            'received': self._tally.received,
            **self._tally.used,
            'refused': dict(self._tally.refused),
            'contacts': self._n_contacts,
            'blind': self._n_blind,
            'failure': self.failure,
            'adaptation': self._adapted.values() if self._adapted else {},
        }

    def _counts(self) -> Counter[str]:
        tally = self._tally
        return Counter({'received': tally.received, **tally.used})

    def _judgement(
        self, new: Counter[str], refused: Counter[str], silence: float
    ) -> tuple[Level, str]:
        apart = f'more than {self._longest_gap_s:g} s apart'
        if silence > SILENCE_S:
            return Level.ERROR, f'blind: no joint states for {silence:.0f} s'
        if self._n_unusable >= CONFIRMED_BY:
            trouble = f'refused: {in_words(self._refused)}' if self._refused else apart
            return Level.ERROR, f'blind: joint states {trouble}'
        if self.failure:
            return Level.ERROR, self.failure
        if refused:
            return Level.WARN, f'joint states refused: {in_words(refused)}'
        if new['after_a_gap'] > 1:
            return Level.WARN, f'{new["after_a_gap"]} joint states not watched: they came {apart}'
        if self._adapted is not None and (trouble := self._adapted.new_trouble()):
            return Level.WARN, trouble
        return Level.OK, self._state

    @property
    def _state(self) -> str:
        if self._free is not None:
            return 'calibrating'
        return 'watching' if self._detector is not None else 'not calibrated'

    def _watch(self, step: float, stamp_ns: int, measured: MeasuredState) -> Watched | None:
        if measured.tau is None:
            raise RefusedError(Refusal.NO_EFFORT)
        self._stamp_ns = stamp_ns
        follows = 0.0 < step <= self._longest_gap_s / NEARLY
        if not follows:
            self._begin_anew()
        if self._adapted is not None:
            self._adapted.advance(measured.t)
        self._q = continued(measured.q, self._q, self._is_revolute)
        state = (measured.t, self._q, measured.dq, measured.tau)
        external, energy = self._external.update(*state), self._energy.update(*state)
        estimates = (external.torque, external.terms, energy.unexplained)
        if not all(np.isfinite(each).all() for each in estimates):
            self._begin_anew()
            raise RefusedError(Refusal.NOT_FINITE_TORQUE)
        if not follows:
            self._tally.used['after_a_gap'] += 1
            return None
        self._tally.used['watched'] += 1
        self._learn(step, measured.dq, external)
        judged = None if self._detector is None else self._detector.judge(external)
        return Watched(external, energy, judged, self._in_contact(measured.t, judged))

    @property
    def _longest_gap_s(self) -> float:
        """Joint states further apart are not watched [s]."""
        return max(LONGEST_GAP_S, 2.0 / self._settings.rate_hz)

    def _begin_anew(self) -> None:
        self._q = None
        self._external = ExternalTorqueObserver(self._predictor, self._settings.bandwidth)
        self._energy = EnergyMonitor(self._predictor)

    def _in_contact(self, t: float, judged: Contact | None) -> BoolArray | None:
        if judged is None:
            return None
        until, hold_s = self._contact_until, self._settings.hold_s
        self._n_blind += int(judged.blind.any())
        self._n_contacts += int(judged.touched.any() and (t > until).all())
        until[judged.touched] = t + hold_s
        # a clock that was set back must not hold a contact for ever
        return np.asarray(judged.touched | ((until >= t) & (until <= t + hold_s)))

    def _learn(self, step: float, dq: Array, external: ExternalTorque) -> None:
        if self._free is None or not self._free.add(step, dq, external):
            return
        found, self._free = self._free, None
        (low, high), least_error = self._trained, self._per_joint('deviation_torque')
        try:
            self.calibration = found.calibration(self.joint_names, high[1] - low[1], least_error)
            self._detector = self.calibration.detector(self.joint_names, self._smallest)
            self.failure = ''
        except DataError as error:
            self.failure = f'not calibrated: {error}'

    def _configured(self) -> ContactDetector:
        shares = np.stack([self._per_joint(name) for name in DEVIATIONS_OF])
        return ContactDetector(Deviation(shares), self._smallest)

    def _deviations(self) -> dict[str, list[float] | None]:
        """Return the deviations under the names of their parameters, None before a calibration."""
        if self._detector is None:
            return dict.fromkeys(DEVIATIONS_OF)
        shares = self._detector.deviation.shares
        return {
            name: [float(f'{value:.4g}') for value in row]
            for name, row in zip(DEVIATIONS_OF, shares, strict=True)
        }

    def _per_joint(self, name: str) -> Array:
        return self._by_joint(name, getattr(self._settings, name))

    def _by_joint(self, name: str, values: Sequence[float]) -> Array:
        return by_joint(name, values, self._settings.joints, self.joint_names, 0.0)

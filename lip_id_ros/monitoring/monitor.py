"""The monitor: estimates contacts and energies from each joint state, or refuses and counts it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lip_id_ros.adaptation.adapted_model import AdaptedModel
from lip_id_ros.adaptation.follow_settings import follow_rules
from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.joint_types import is_prismatic
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.monitoring.contacts import Contacts
from lip_id_ros.monitoring.external_torque import ExternalTorque, ExternalTorqueObserver
from lip_id_ros.monitoring.observers import EnergyBalance, EnergyMonitor, Predictor
from lip_id_ros.monitoring.settings import MonitorSettings
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.signals.joint_states import (
    in_nearest_turn,
    JointStateReader,
    JUMP_CONFIRMED_BY,
    MeasuredState,
    NANOSECONDS,
    StampWatch,
)
from lip_id_ros.signals.joints import Refusal, RefusedError, require_joints, require_unique
from lip_id_ros.signals.status import in_words, Level, Tally

LONGEST_GAP_S = 0.2
NEARLY = 0.95
"""A sample this share of a period after the one before is taken: stamps jitter."""

SILENCE_S = 2.0
"""After so long without a joint state the monitor is blind."""


@dataclass(frozen=True)
class Watched:
    """The estimates of one joint state; `contacts` as `Contacts.judge`."""

    external: ExternalTorque
    energy: EnergyBalance
    contacts: Mapping[str, Array | BoolArray] | None


class Monitor:
    """Watch an arm with a model; LipIdError if the settings do not fit it."""

    def __init__(self, settings: MonitorSettings) -> None:
        require_unique('joints', settings.joints)
        fitted = InverseDynamicsModel.load(settings.model_path)
        require_joints(fitted.joint_names, settings.joints, settings.model_path)
        model = fitted.with_rise_time(0.0)  # torques come as drives have them
        self.joint_names = model.joint_names
        self._settings = settings
        self._longest_gap_s = max(LONGEST_GAP_S, 2.0 / settings.rate_hz)
        low, high = model.training_range
        self.contacts = Contacts(settings, model.joint_names, high[1] - low[1])
        self._adapted: AdaptedModel | None = None
        if settings.follow_adaptation:
            self._adapted = AdaptedModel(fitted, follow_rules(settings, model.joint_names))
        self._predictor: Predictor = self._adapted or model
        self._predictor.predict(*np.zeros((3, 1, model.n_joints)))  # compiled now
        self._reader = JointStateReader(model.joint_names, model.effort_calibration)
        self._tally = Tally('watched', 'too_soon', 'after_a_gap')
        self._before = self._counts()
        self._received_at: float | None = None
        self._n_unusable = 0
        self._refused: Counter[str] = Counter()
        self._stamps = StampWatch()
        self._stamp_ns = -NANOSECONDS
        self._is_revolute = ~is_prismatic(model.joint_types)
        self._q: Array | None = None
        self._begin_anew()

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
        refused = self._tally.take_new_refusals()
        self._n_unusable += new['received'] - new['watched'] - new['too_soon']
        self._refused.update(refused)
        if new['watched']:
            self._n_unusable, self._refused = 0, Counter()
        return self._judgement(new, refused, now - self._received_at)

    def values(self) -> dict[str, Any]:
        """Return the state and the counts, JSON-able."""
        return {
            'state': self.contacts.state,
            **self.contacts.values(),
            'received': self._tally.received,
            **self._tally.used,
            'refused': dict(self._tally.refused),
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
        if self._n_unusable >= JUMP_CONFIRMED_BY:
            trouble = f'refused: {in_words(self._refused)}' if self._refused else apart
            return Level.ERROR, f'blind: joint states {trouble}'
        if self.contacts.failure:
            return Level.ERROR, self.contacts.failure
        if refused:
            return Level.WARN, f'joint states refused: {in_words(refused)}'
        if new['after_a_gap'] > 1:
            return Level.WARN, f'{new["after_a_gap"]} joint states not watched: they came {apart}'
        if self._adapted is not None and (trouble := self._adapted.take_new_trouble()):
            return Level.WARN, trouble
        return Level.OK, self.contacts.state

    def _watch(self, step: float, stamp_ns: int, measured: MeasuredState) -> Watched | None:
        if measured.tau is None:
            raise RefusedError(Refusal.NO_EFFORT)
        self._stamp_ns = stamp_ns
        follows = 0.0 < step <= self._longest_gap_s / NEARLY
        if not follows:
            self._begin_anew()
        if self._adapted is not None:
            self._adapted.advance(measured.t)
        self._q = in_nearest_turn(measured.q, self._q, self._is_revolute)
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
        contacts = self.contacts.judge(measured.t, step, measured.dq, external)
        return Watched(external, energy, contacts)

    def _begin_anew(self) -> None:
        self._q = None
        self._external = ExternalTorqueObserver(self._predictor, self._settings.bandwidth)
        self._energy = EnergyMonitor(self._predictor)

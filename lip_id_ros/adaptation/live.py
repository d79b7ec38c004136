"""The node `adapt` without ROS: joint states are filtered, gated, learned from, and counted."""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass
from typing import Any

import numpy as np

from lip_id_ros.adaptation.adaptation import Adaptation
from lip_id_ros.adaptation.changes import Change, changes
from lip_id_ros.adaptation.payloads import announced_payload, parts_of, PayloadEvent
from lip_id_ros.adaptation.saved_state import NOT_KEPT, path_of, resume, save
from lip_id_ros.adaptation.updates import Update
from lip_id_ros.arrays import Array
from lip_id_ros.errors import ConfigError, DataError, one_line, SourceError
from lip_id_ros.export.urdf import link_name
from lip_id_ros.joint_types import is_prismatic
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.settings import executor_setting, setting, Settings
from lip_id_ros.settings.settings import AT_START
from lip_id_ros.signals.filters import LONGEST_GAP_S, LowPass
from lip_id_ros.signals.joint_states import (
    in_nearest_turn,
    JointStateReader,
    MeasuredState,
    StampWatch,
)
from lip_id_ros.signals.joints import Refusal, RefusedError, require_joints, require_unique
from lip_id_ros.signals.status import in_words, Level, Status, Tally

SILENCE_S = 2.0
"""After so long without a usable joint state nobody knows whether an update still holds."""

OUTCOMES = ('learned', 'held', 'disturbed', 'resting', 'settling', 'stuck')
"""Keys of the status, in the order of the outcomes of the filter."""

SAVE_PERIOD_S = 60.0

MOST = 1e6
"""No position, velocity or torque of an arm is larger."""

ONE_WAY = 0.98
"""
Low-passed sign of the velocity below which a joint has turned just now: its torque is a mixture of
friction before and after, of which nothing is learned.
"""

TOO_FAR = 'friction has changed by more than is followed; look at the arm.'

SPARSE = f'nothing is learned: joint states are over {LONGEST_GAP_S:g} s apart, or have just begun'

RATE_HZ = 20.0
"""So many joint states are learned from a second, at most; what is between them is filtered."""

RANGE_MARGIN = 0.2
"""Of half its training range, by which a joint may go beyond it to be learned from."""

NEARLY = 0.95
"""A sample this share of a period after the one before is taken: stamps jitter."""


@dataclass(frozen=True)
class AdaptSettings(Settings):
    """The node `adapt`."""

    model_path: str = setting('model.npz', 'Model of the arm as commissioned.', applies=AT_START)
    joints: tuple[str, ...] = setting(
        (), 'Joints that the model must have, in any order; empty for any.', applies=AT_START
    )
    cutoff_hz: float = setting(
        10.0,
        'Cut-off of the low-pass on positions, velocities and torques.',
        unit='Hz',
        minimum=0.1,
        maximum=1000.0,
        applies=AT_START,
    )
    publish_rate_hz: float = setting(
        1.0,
        'How often updates are published.',
        unit='Hz',
        minimum=0.1,
        maximum=10.0,
        applies=AT_START,
    )
    state_path: str = setting(
        '',
        'File in which what was learned is kept; empty for adaptation.npz in the state folder of '
        f'the node, the word {NOT_KEPT} for none.',
        applies=AT_START,
    )
    alarm_change: float = setting(
        0.5,
        'Change of friction that the status warns of, as a share of the friction of the joint.',
        minimum=0.0,
    )
    executor: str = executor_setting()


@dataclass(frozen=True, eq=False)
class Step:
    """What came of the last joint states; `carried`: all of it, as it is announced."""

    update: Update | None
    payloads: tuple[PayloadEvent, ...]
    carried: tuple[float, Array, Array]
    alarms: tuple[str, ...]


class LiveAdaptation:
    """
    Follow an arm in joint states, from where the file of the last time ends.

    `take` and `announce` are for one thread; all others that are not properties are for one other.
    `node`: its full name. `now`, `clock`: as for `step`. LipIdError if the settings do not fit the
    model.

    """

    def __init__(self, settings: AdaptSettings, node: str, now: float, clock: float) -> None:
        require_unique('joints', settings.joints)
        model = InverseDynamicsModel.load(settings.model_path)
        require_joints(model.joint_names, settings.joints, settings.model_path)
        self.settings, self.joint_names = settings, model.joint_names
        self.payload_frame = link_name(model.joint_names[-1])
        self._adaptation = Adaptation(model)
        self._low, self._high = model.training_range
        self._is_revolute = np.asarray(~is_prismatic(model.joint_types))
        self._q: Array | None = None
        self._reader = JointStateReader(model.joint_names, model.effort_calibration)
        self._stamps, self._low_pass = StampWatch(), LowPass(settings.cutoff_hz)
        self._tally = Tally('too_soon', 'after_a_gap', 'out_of_range', 'learnable')
        self._judged = self._tally.used.copy()
        self._outcomes = Counter(dict.fromkeys(OUTCOMES, 0))
        self._waiting: deque[tuple[bool, float, Array]] = deque()
        self._last_t, self._jumps = -np.inf, 0
        self._used_at: float | None = None
        self._learned_at = now
        self._n_used = self._n_updates = 0
        self._announced: deque[Array] = deque()
        # what was asked for, even if the arm is silent
        self._is_to_be_told, self._wrong_payload = False, ''
        self._node, self._path = node, path_of(settings.state_path, node)
        self._saved_at, self._failure, self.note = now, '', ''
        self._found: list[Change] = []
        self._is_beyond = False
        self._alarms: dict[str, str] = {}
        still = np.zeros((1, model.n_joints))
        Adaptation(model).update(np.zeros(1), still, still, still, still)  # compiled now
        if self._path is None:
            return
        try:
            resume(self._path, node, self._adaptation, clock)
        except (SourceError, OSError) as error:
            self.note = one_line(error)
        except ConfigError as error:
            self.note, self._path = str(error), None

    # joint states

    def take(self, message: JointMessage) -> None:
        """Filter a joint state, and keep it for `step`; RefusedError if it cannot be used."""
        with self._tally.receiving():
            self._reader.columns(message)
            doubt = self._stamps.doubt(message.stamp_ns)
            if doubt is not None:
                raise RefusedError(doubt)
            measured = self._reader.read(message)
            if measured.tau is None:
                raise RefusedError(Refusal.NO_EFFORT)
            sign = np.sign(measured.dq)
            signals = np.stack([measured.q, measured.dq, measured.tau, sign])
            if not (np.abs(signals) <= MOST).all():
                raise RefusedError(Refusal.TOO_LARGE)
            signals[0] = self._q = in_nearest_turn(measured.q, self._q, self._is_revolute)
            self._tally.used[self._use(measured, signals)] += 1

    def _use(self, measured: MeasuredState, signals: Array) -> str:
        """Keep a state; return what became of it."""
        filtered = self._low_pass.add(measured.t, signals)
        if filtered is None:
            return 'after_a_gap'
        if 0.0 <= measured.t - self._last_t < NEARLY / RATE_HZ:
            return 'too_soon'
        (q, dq, torque, sign), (_, ddq, _, _) = filtered
        # in the turn that is reported, as in the data of the fit
        state = np.stack([in_nearest_turn(q, measured.q, self._is_revolute), dq, ddq])
        margin = 0.5 * RANGE_MARGIN * (self._high - self._low)
        self._last_t = measured.t
        if (state < self._low - margin).any() or (state > self._high + margin).any():
            return 'out_of_range'
        jumped, self._jumps = self._stamps.jumps != self._jumps, self._stamps.jumps
        self._waiting.append((jumped, measured.t, np.array([*state, torque, np.abs(sign)])))
        return 'learnable'

    # what is done beside the joint states

    def step(self, now: float, clock: float) -> Step:
        """
        Learn from what waits; return an update, where there were joint states, and events.

        `now`: on any steady clock [s]. `clock`: that of the computer [s].

        """
        while self._announced:
            self._adaptation.announce(self._announced.popleft())
            self._is_to_be_told = True
        used = self._tally.used.total()
        if used > self._n_used or self._used_at is None:
            self._n_used, self._used_at = used, now
        self._learn(now)
        if self._is_to_be_told or now - self._saved_at > SAVE_PERIOD_S:
            self._saved_at = now
            self.save(clock)
        payloads = tuple(self._adaptation.payload_events)
        self._adaptation.payload_events.clear()
        carried = parts_of(self._adaptation.carried_body)
        return Step(self._update(now), payloads, carried, self._new_alarms())

    def save(self, clock: float) -> None:
        """Write what was learned; a failure is in the status."""
        if self._path is None:
            return
        try:
            save(self._path, self._node, self._adaptation, clock)
            self._failure = ''
        except OSError as error:
            self._failure = f'{self._path} cannot be written: {error.strerror}'

    def reset(self) -> None:
        """Forget what was learned, with the next step also in the file."""
        self._adaptation.reset()
        self._is_to_be_told = True

    def announce(self, mass: float, centre: Array, inertia: Array, frame: str) -> None:
        """
        Carry a payload from the next step on, or none without mass; DataError if it is none.

        As `announced_payload`, in the frame `payload_frame`, which may be left empty.
        """
        try:
            if frame not in ('', self.payload_frame):
                raise DataError(
                    f'payloads must be given in {self.payload_frame}, the frame of the last link '
                    f'that lip_id export writes, but came in {frame}; transform them.'
                )
            self._announced.append(announced_payload(mass, centre, inertia))
        except DataError as error:
            self._wrong_payload = str(error)
            raise
        self._wrong_payload = ''

    def _learn(self, now: float) -> None:
        """
        Learn from the samples that wait, which begin anew where the clock jumped.

        A jump may be a pause: it took as long as nothing came to be learned from.
        """
        batch: list[tuple[float, Array]] = []
        while self._waiting:
            jumped, t, sample = self._waiting.popleft()
            if jumped:
                self._follow(batch)
                self._adaptation.pause(now - self._learned_at)
                batch = []
            batch.append((t, sample))
            self._learned_at = now
        self._follow(batch)

    def _follow(self, batch: list[tuple[float, Array]]) -> None:
        if not batch:
            return
        t = np.array([t for t, _ in batch])
        samples = np.array([sample for _, sample in batch])
        q, dq, ddq, tau, one_way = samples.transpose(1, 0, 2)
        followed = self._adaptation.update(t, q, dq, ddq, tau, one_way < ONE_WAY)
        self._outcomes.update(OUTCOMES[k] for k in followed.outcome.tolist())

    def _update(self, now: float) -> Update | None:
        is_silent = self._used_at is None or not self._n_used or now - self._used_at > SILENCE_S
        if is_silent and not self._is_to_be_told:
            return None
        self._is_to_be_told = False
        self._n_updates += 1
        own, numbers = self._adaptation, self._adaptation.trusted_numbers.copy()
        return Update(own.commissioned.fingerprint, numbers, own.is_trusted)

    def _new_alarms(self) -> tuple[str, ...]:
        """Return sentences that were not said before, of joints that are not back meanwhile."""
        own, before = self._adaptation, self._alarms
        self._found = changes(own)
        large = [each for each in self._found if each.share >= self.settings.alarm_change]
        beyond = [self.joint_names[k] for k in np.flatnonzero(own.arm.beyond(own.numbers))]
        self._is_beyond = bool(beyond)
        self._alarms = {each.joint: each.sentence() for each in large}
        self._alarms |= {name: f'{name}: {TOO_FAR}' for name in beyond}
        return tuple(text for name, text in self._alarms.items() if name not in before)

    # the status

    def status(self, now: float) -> Status:
        """Return the state and all counts; `now` as for `step`."""
        silence = 0.0 if self._used_at is None else now - self._used_at
        is_silent = silence > SILENCE_S or not self._n_used
        refused, are_sparse = self._tally.take_new_refusals(), self._are_sparse()
        trouble = f'joint states refused: {in_words(refused)}' if refused else 'no joint states'
        doubts = [
            *self._alarms.values(),
            f'{trouble}: no updates' if is_silent else trouble if refused else '',
            *(self._wrong_payload, self._failure, self.note),
            SPARSE if are_sparse else '',
        ]
        level = Level.ERROR if self._is_beyond else Level.WARN if any(doubts) else Level.OK
        usual = 'following' if self._adaptation.is_trusted else 'as commissioned'
        return Status(level, '; '.join(filter(None, doubts)) or usual, self.values())

    def _are_sparse(self) -> bool:
        """Whether all joint states since the last call came after a gap."""
        used, before = self._tally.used.copy(), self._judged
        self._judged = used
        new = used - before
        return new.total() > 1 and new.total() == new['after_a_gap']

    def values(self) -> dict[str, Any]:
        """Return the state and the counts, JSON-able."""
        learned, fitted = self._adaptation.errors
        carried = self._adaptation.carried
        used = {key: n for key, n in self._tally.used.items() if key != 'learnable'}
        return {
            'trusted': self._adaptation.is_trusted,
            'updates': self._n_updates,
            'error_adapted': round(learned, 3),
            'error_commissioned': round(fitted, 3),
            'changes': [each.sentence() for each in self._found],
            'payload': carried.in_words if carried else 'none',
            'announced_kg': self._adaptation.announced_mass,
            'forgotten': self._adaptation.n_forgotten,
            'received': self._tally.received,
            'waiting': len(self._waiting),
            **used,
            **self._outcomes,
            'refused': dict(self._tally.refused),
            'note': self.note,
        }

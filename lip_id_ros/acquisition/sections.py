"""Joint states in sections, which one wrong stamp cannot spoil."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from lip_id_ros.recording import JointSamples, Reason, SampleBuffer
from lip_id_ros.recording.bag_writer import JointStateTrack
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.signals.joint_states import JUMP_CONFIRMED_BY, LONGEST_STAMP_STEP_S, NANOSECONDS

LONGEST_STAMP_STEP_NS = round(LONGEST_STAMP_STEP_S * NANOSECONDS)

MOST_NAMES = 20
"""So many foreign joints are named, where messages have an endless variety."""

MOST_SECTIONS = 100
"""When the clock went back more often, it is not followed any more."""


class Sections:
    """
    Samples of one topic, of which one wrong stamp can spoil nothing; at most `max_rows` in all.

    A message whose stamp went back or lies far ahead is held and counted as rejected. If the next
    ones follow it, the clock has jumped: a restarted driver or simulation, a pause. The held
    messages are then taken, into a new section if the clock went back, and no longer counted as
    rejected. If the next one follows the stamps from before, the held stamp was wrong. So the
    messages kept and those rejected make all that came, at any time.
    """

    def __init__(self, joint_names: Sequence[str], max_rows: int) -> None:
        self._wanted = tuple(joint_names)
        self._max_rows = max_rows
        self.clear()

    def clear(self) -> None:
        """Forget all messages, counts and, unless they were given, the joints."""
        self._closed: list[SampleBuffer] = []
        self._current = SampleBuffer(self._wanted, self._max_rows)
        self._drop_held()

    def __len__(self) -> int:
        return sum(len(section) for section in (*self._closed, self._current))

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joints that are kept, empty while they are not known."""
        return self._current.joint_names

    @property
    def other_joints(self) -> list[str]:
        """Joints that messages have and that are not kept, at most `MOST_NAMES`."""
        sections = (*self._closed, self._current)
        names = dict.fromkeys(name for section in sections for name in section.seen_joints)
        return [name for name in names if name not in self.joint_names][:MOST_NAMES]

    @property
    def counts(self) -> Counter[str]:
        """Messages rejected, by reason."""
        total: Counter[str] = Counter()
        for section in (*self._closed, self._current):
            total.update(section.counts)
        return total

    @property
    def is_full(self) -> bool:
        """Whether no further message is kept."""
        return len(self) >= self._max_rows

    def add(self, message: JointMessage) -> Reason | None:
        """Take one message, or return why it is rejected, for now where its stamp jumped."""
        stamp = message.stamp_ns
        # the stamps of another robot are of another clock
        foreign = self.joint_names and not {*self.joint_names} & {*message.names}
        doubt = None if foreign else self._doubt(stamp)
        if doubt is not None:
            return self._hold(stamp, message, doubt)
        reason = self._current.add(*message)
        if reason is None and self._held:
            self._drop_held()
        return reason

    def samples(self, topic: str) -> list[JointSamples]:
        """Return copies of the samples of every section."""
        return [
            section.samples('recording', topic)
            for section in (*self._closed, self._current)
            if len(section)
        ]

    def tracks(self, topic: str) -> list[JointStateTrack]:
        """Return every message that was taken, by sections."""
        found = []
        for section in filter(len, (*self._closed, self._current)):
            each = section.all_samples('recording', topic)
            signals = each.position, each.velocity, each.effort
            found.append(JointStateTrack(topic, each.joint_names, each.t, *signals, each.start_ns))
        return found

    def _doubt(self, stamp: int) -> Reason | None:
        last = self._current.last_stamp_ns
        if not len(self._current) or stamp <= 0:
            return None  # there is nothing to compare, or the buffer knows what is wrong
        if stamp < last and len(self._closed) + 1 < MOST_SECTIONS:
            return Reason.BACKWARD_STAMP
        return Reason.FAR_STAMP if stamp > last + LONGEST_STAMP_STEP_NS else None

    def _hold(self, stamp: int, message: JointMessage, doubt: Reason) -> Reason:
        reason = self._trial(stamp).add(*message) or doubt
        if self._max_rows - len(self) < JUMP_CONFIRMED_BY:
            reason = Reason.BUFFER_FULL
        self._current.reject(reason)
        if reason is doubt:
            self._held.append((stamp, message, doubt))
        if len(self._held) == JUMP_CONFIRMED_BY:
            self._follow()
        return reason

    def _trial(self, stamp: int) -> SampleBuffer:
        """Return where doubted messages are checked, empty unless this stamp follows the last."""
        if not 0 <= stamp - self._held_in.last_stamp_ns <= LONGEST_STAMP_STEP_NS:
            self._drop_held()
        return self._held_in

    def _follow(self) -> None:
        """Take what is held, in a new section if the clock went back."""
        self._current.counts -= Counter(doubt for _, _, doubt in self._held)
        if self._held[0][0] < self._current.last_stamp_ns:
            room = self._max_rows - len(self)
            self._closed.append(self._current)
            self._current = SampleBuffer(self.joint_names, room)
        for _, message, _ in self._held:
            self._current.add(*message)
        self._drop_held()

    def _drop_held(self) -> None:
        self._held: list[tuple[int, JointMessage, Reason]] = []
        self._held_in = SampleBuffer(self.joint_names, expected_rows=JUMP_CONFIRMED_BY)

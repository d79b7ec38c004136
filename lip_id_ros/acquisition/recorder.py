"""The recorder of the node `train`: keeps joint states in sections, saved ones and others."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from lip_id_ros.acquisition import recording_file
from lip_id_ros.acquisition.gaps import Gaps
from lip_id_ros.errors import LipIdError
from lip_id_ros.recording import JointSamples, Reason, SampleBuffer
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.signals.joint_states import CONFIRMED_BY, LONGEST_STEP_S, NANOSECONDS

LONGEST_STEP_NS = round(LONGEST_STEP_S * NANOSECONDS)

MOST_SECTIONS = 100
"""When the clock went back more often, it is not followed any more."""

MESSAGE_BYTES, JOINT_BYTES = 128, 32
"""A bound on the size of a message in a bag; the names of its joints come on top."""

MOST_NAMES = 20
"""So many foreign joints are named, where messages have an endless variety."""


class Sections:
    """
    Samples of one topic, of which one wrong stamp can spoil nothing.

    A message whose stamp went back or lies far ahead is held and counted as rejected. If the next
    ones follow it, the clock has jumped: a restarted driver or simulation, a pause. The held
    messages are then taken, into a new section if the clock went back, and no longer counted as
    rejected. If the next one follows the stamps from before, the held stamp was wrong.

    So the messages kept and those rejected make all that came, at any time.

    Parameters
    ----------
    joint_names : sequence of str
        Joints to keep; empty for those of the first message that can be taken.
    max_rows : int
        Most messages kept in all sections together.

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
        """Return the number of messages kept."""
        return sum(len(section) for section in (*self._closed, self._current))

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joints that are kept, empty while they are not known."""
        return self._current.joint_names

    @property
    def other_joints(self) -> tuple[str, ...]:
        """Joints that messages have and that are not kept."""
        sections = (*self._closed, self._current)
        names = dict.fromkeys(name for section in sections for name in section.seen_joints)
        return tuple(name for name in names if name not in self.joint_names)

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
        """
        Take one message, or reject and count it.

        Returns
        -------
        Reason or None
            Why the message is rejected, for now where its stamp jumped; None where it was taken.

        """
        stamp = message.stamp_ns
        # the stamps of another robot are of another clock
        foreign = self.joint_names and not {*self.joint_names} & {*message.names}
        doubt = None if foreign else self._doubt(stamp)
        if doubt is not None:
            return self._hold(stamp, message, doubt)
        reason = self._current.add(stamp, *message[1:])
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

    def all_samples(self, topic: str) -> list[JointSamples]:
        """Return copies of every message that was taken, NaN where it lacks a value."""
        return [
            section.all_samples('recording', topic)
            for section in (*self._closed, self._current)
            if len(section)
        ]

    def _doubt(self, stamp: int) -> Reason | None:
        last = self._current.last_stamp_ns
        if not len(self._current) or stamp <= 0:
            return None  # there is nothing to compare, or the buffer knows what is wrong
        if stamp < last and len(self._closed) + 1 < MOST_SECTIONS:
            return Reason.BACKWARD_STAMP
        return Reason.FAR_STAMP if stamp > last + LONGEST_STEP_NS else None

    def _hold(self, stamp: int, message: JointMessage, doubt: Reason) -> Reason:
        reason = self._trial(stamp).add(stamp, *message[1:]) or doubt
        if self._max_rows - len(self) < CONFIRMED_BY:
            reason = Reason.BUFFER_FULL
        self._current.reject(reason)
        if reason is doubt:
            self._held.append((stamp, message, doubt))
        if len(self._held) == CONFIRMED_BY:
            self._follow()
        return reason

    def _trial(self, stamp: int) -> SampleBuffer:
        """Return where doubted messages are checked, empty unless this stamp follows the last."""
        if not 0 <= stamp - self._held_in.last_stamp_ns <= LONGEST_STEP_NS:
            self._drop_held()
        return self._held_in

    def _follow(self) -> None:
        """Take what is held, in a new section if the clock went back."""
        self._current.counts -= Counter(doubt for _, _, doubt in self._held)
        if self._held[0][0] < self._current.last_stamp_ns:
            room = self._max_rows - len(self)
            self._closed.append(self._current)
            self._current = SampleBuffer(self.joint_names, room)
        for stamp, message, _ in self._held:
            self._current.add(stamp, *message[1:])
        self._drop_held()

    def _drop_held(self) -> None:
        self._held: list[tuple[int, JointMessage, Reason]] = []
        self._held_in = SampleBuffer(self.joint_names, expected_rows=CONFIRMED_BY)


class Recorder(Sections):
    """
    A bounded recording that can be switched on and off.

    Parameters
    ----------
    joint_names : sequence of str
        Joints to keep; empty for those of the first message that can be taken.
    max_rows : int
        Most messages kept.

    Attributes
    ----------
    recording : bool
        Whether messages are taken.
    gaps : Gaps
        In the stamps kept; where recording was switched off there is none.

    """

    _times_cleared = 0

    def __init__(self, joint_names: Sequence[str], max_rows: int) -> None:
        super().__init__(joint_names, max_rows)
        self.recording = False

    def add(self, message: JointMessage) -> Reason | None:
        """Take one message while recording, or reject and count it."""
        if not self.recording:
            self._resumes = True
            return None
        self._n_received += 1
        last = self._current.last_stamp_ns
        reason = super().add(message)
        step = self._current.last_stamp_ns - last
        if step and last > 0 and not self._resumes:
            self.gaps.add(step)
        self._resumes &= not step
        return reason

    def clear(self) -> None:
        """Forget all messages, counts and, unless they were given, the joints."""
        super().clear()
        self._saved_rows = self._n_received = 0
        self._times_cleared += 1
        self.gaps, self._resumes = Gaps(), False

    def saving(self, sections: Sequence[JointSamples]) -> Callable[[], None]:
        """
        Return what to call once these samples have been saved, all of them.

        Messages that came meanwhile stay unsaved, and so does everything where the samples lack
        some message, since saved and unsaved messages could not be distinguished.

        """
        rows, cleared = len(self), self._times_cleared
        complete = sum(samples.n_samples for samples in sections) == rows

        def saved() -> None:
            if complete and cleared == self._times_cleared:
                self._saved_rows = max(self._saved_rows, rows)

        return saved

    def keep_unsaved(self, path: str, topic: str) -> list[Path]:
        """
        Write every message to bags, one for each section, unless all are saved already.

        Returns
        -------
        list of Path
            The bags, none where there was nothing to keep.

        Raises
        ------
        LipIdError
            If a bag can be written nowhere; the others are kept all the same.

        """
        if len(self) <= self._saved_rows:
            return []
        kept: list[Path] = []
        n_lost, reason = 0, ''
        for samples in self.all_samples(topic):
            try:
                kept.append(recording_file.keep(path, samples, topic))
            except OSError as error:
                n_lost, reason = n_lost + samples.n_samples, error.strerror or str(error)
        if n_lost:
            others = f' The others are in {", ".join(map(str, kept))}.' if kept else ''
            raise LipIdError(
                f'{n_lost} unsaved samples are lost: they can be written neither to {path} nor to '
                f'the home folder nor to those for temporary files ({reason}).{others}'
            )
        return kept

    def endangered(self, path: str) -> str:
        """Return why unsaved samples would be lost if the node ended now, empty if safe."""
        names = sum(JOINT_BYTES + len(name.encode()) for name in self.joint_names)
        needed = len(self) * (MESSAGE_BYTES + names)
        if len(self) <= self._saved_rows or recording_file.has_room(path, needed):
            return ''
        return (
            f'{len(self)} unsaved samples would be lost, no folder has {needed / 1e6:.0f} MB for '
            'them: free the disk or change unsaved_path'
        )

    @property
    def n_rejected(self) -> int:
        """How many messages were dropped."""
        return self.counts.total()

    @property
    def n_alarming(self) -> int:
        """How many were dropped, without those of other robots where this one has its own."""
        foreign = self.counts[Reason.FOREIGN_JOINTS] if len(self) else 0
        return self.n_rejected - foreign

    def status(self) -> dict[str, Any]:
        """Return what was done so far, JSON-able."""
        return {
            'recording': self.recording,
            'received': self._n_received,
            'rows': len(self),
            'rows_saved': self._saved_rows,
            'full': self.is_full,
            'joint_names': list(self.joint_names),
            'other_joints': self._other_joints,
            'gaps': self.gaps.count,
            'longest_gap_s': round(self.gaps.longest_s, 3),
            'rejected': {str(reason): count for reason, count in self.counts.most_common()},
        }

    @property
    def summary(self) -> str:
        """What was done so far, in words."""
        parts = ['recording' if self.recording else 'not recording', f'{len(self)} samples kept']
        if self.is_full:
            parts.append('no more fit under max_rows: call save_dataset, then clear')
        if self.gaps.count:
            parts.append(f'gaps in stamps: {self.gaps.count} up to {self.gaps.longest_s:.3g} s')
        return ', '.join([*parts, *self._complaints()])

    def why_empty(self, topic: str) -> str:
        """Return why there is nothing to fit, in a sentence."""
        found = ', '.join([f'no samples of {topic} are kept', *self._complaints()])
        remedy = 'call record and move the arm, or name recordings with bags'
        if self._other_joints:
            remedy = f'choose recording.joints among {", ".join(self._other_joints)}'
        return f'{found}; {remedy}.'

    @property
    def _other_joints(self) -> list[str]:
        return list(self.other_joints[:MOST_NAMES])

    def _complaints(self) -> list[str]:
        most = self.counts.most_common(1)
        return [f'{self.n_rejected} messages rejected, mostly for: {most[0][0]}'] if most else []

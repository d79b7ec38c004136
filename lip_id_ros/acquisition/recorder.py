"""The recorder of the node `train`: keeps joint states in sections, saved ones and others."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import count
import os
from pathlib import Path
import shutil
from typing import Any

import numpy as np

from lip_id_ros.acquisition.sections import Sections
from lip_id_ros.errors import LipIdError
from lip_id_ros.recording import JointSamples, Reason
from lip_id_ros.recording.bag_writer import JointStateTrack, write_mcap
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.recording.timing import GAP_STEPS
from lip_id_ros.signals.joint_states import NANOSECONDS

MESSAGE_BYTES, JOINT_BYTES = 128, 32
"""A bound on the size of a message in a bag; the names of its joints come on top."""

LEAST_GAP_S = 0.0625
"""A shorter step is no gap at any rate: preprocessing bridges it, at its default cut-off."""

DISTURBED_S = 1.0
"""A contact or a blocked joint is noticed within this time."""

LONGEST_WAIT_S = 0.4
"""Without a sample, a status every half second warns within a second."""

REMEDIES = {
    Reason.NO_NAMES: 'have the driver name its joints',
    Reason.MISSING_JOINT: 'have one publisher send all joints, as joint_state_publisher can',
    Reason.ZERO_STAMP: 'have the driver stamp its joint states',
}

FORGETTING = 0.05
"""The usual step is the mean of about twenty."""


class Gaps:
    """Count steps between stamps that are many times as long as the usual ones before."""

    def __init__(self) -> None:
        self.count, self.longest_s, self._usual_s = 0, 0.0, 0.0

    def add(self, step_ns: int) -> None:
        """Judge the step between two stamps [ns]; one that goes back begins anew."""
        step = step_ns / NANOSECONDS
        if step <= 0.0:
            return
        most = GAP_STEPS * (self._usual_s or step)
        if step > max(most, LEAST_GAP_S):
            self.count, self.longest_s = self.count + 1, max(step, self.longest_s)
        usual = self._usual_s or step
        self._usual_s = usual + FORGETTING * (min(step, most) - usual)


class Recorder(Sections):
    """
    A bounded recording of at most `max_rows` messages that can be switched on and off.

    `joint_names`: joints to keep; empty for those of the first message that can be taken. `gaps`:
    in the stamps kept; where recording was switched off there is none.
    """

    _times_cleared = 0

    def __init__(self, joint_names: Sequence[str], max_rows: int) -> None:
        super().__init__(joint_names, max_rows)
        self.recording = self._was_recording = False
        self._waits_since, self._before = 0.0, (0, Counter[str]())

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
        self._disturbed: list[tuple[int, int]] = []  # stamps between which it was
        self.gaps, self._resumes = Gaps(), False

    def end_disturbed(self) -> None:
        """End recording; leave its last second, in which a motion was disturbed, out of fits."""
        self.recording = False
        last = self._current.last_stamp_ns
        self._disturbed.append((last - round(DISTURBED_S * NANOSECONDS), last))

    def samples(self, topic: str) -> list[JointSamples]:
        """Return copies of the samples of every section, without those that were disturbed."""
        found = [self._undisturbed(each) for each in super().samples(topic)]
        return [each for each in found if each.n_samples]

    def _undisturbed(self, samples: JointSamples) -> JointSamples:
        if not self._disturbed:
            return samples
        stamps = samples.start_ns + np.round(samples.t * NANOSECONDS).astype(np.int64)
        keep = np.ones(samples.n_samples, dtype=np.bool_)
        for first, last in self._disturbed:
            keep &= (stamps < first) | (stamps > last)
        kept = samples.select(keep)
        if not kept.n_samples:
            return kept
        start = round(float(kept.t[0]) * NANOSECONDS)
        return replace(kept, t=kept.t - kept.t[0], start_ns=samples.start_ns + start)

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
        Write every message to bags, one for each section, unless all are saved; return the bags.

        LipIdError if a bag cannot be written; the others are kept all the same.
        """
        if len(self) <= self._saved_rows:
            return []
        kept: list[Path] = []
        n_lost, reason = 0, ''
        for track in self.tracks(topic):
            try:
                kept.append(keep(path, track))
            except OSError as error:
                n_lost, reason = n_lost + len(track.t), error.strerror or str(error)
        if n_lost:
            others = f' The others are in {", ".join(map(str, kept))}.' if kept else ''
            raise LipIdError(
                f'{n_lost} unsaved samples are lost: {path} cannot be written ({reason}); free '
                f'that disk, or change unsaved_path, before the next recording.{others}'
            )
        return kept

    def endangered(self, path: str) -> str:
        """Return why unsaved samples would be lost if the node ended now, empty if safe."""
        names = sum(JOINT_BYTES + len(name.encode()) for name in self.joint_names)
        needed = len(self) * (MESSAGE_BYTES + names)
        if len(self) <= self._saved_rows or has_room(path, needed):
            return ''
        return (
            f'{len(self)} unsaved samples would be lost, the folder of {path} has no '
            f'{needed / 1e6:.0f} MB for them: free the disk or change unsaved_path'
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
            'disturbed': len(self._disturbed),
            'joint_names': list(self.joint_names),
            'other_joints': self.other_joints,
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
        return f'{found}; {self._remedy(self.counts)}.'

    def trouble(self, topic: str, now: float) -> str:
        """Return why no sample has come for a while, with a remedy; empty where some do."""
        waits = self.recording and self._was_recording and not self.is_full
        self._was_recording = self.recording
        if not waits or len(self) != self._before[0]:
            self._waits_since, self._before = now, (len(self), self.counts)
        if now - self._waits_since < LONGEST_WAIT_S:
            return ''
        new = self.counts - self._before[1]
        if not new:
            return f'nothing is recorded: {topic} is silent; start the driver, or remap the topic'
        reason, remedy = new.most_common(1)[0][0], self._remedy(new)
        return f'nothing is recorded: {topic} is rejected, mostly for: {reason}; {remedy}'

    def _remedy(self, counts: Counter[str]) -> str:
        match counts.most_common(1):
            case [(Reason.FOREIGN_JOINTS, _)]:
                return f'choose recording.joints among {", ".join(self.other_joints)}'
            case [(reason, _)]:
                return REMEDIES.get(Reason(reason), 'correct the driver')
        return 'call record and move the arm, or name recordings with bags'

    def _complaints(self) -> list[str]:
        most = self.counts.most_common(1)
        return [f'{self.n_rejected} messages rejected, mostly for: {most[0][0]}'] if most else []


def keep(path: str | os.PathLike[str], track: JointStateTrack) -> Path:
    """
    Write messages as an MCAP bag, beside those that were kept before; return the file.

    A number is added to its name if there is one already. OSError if it cannot be written.
    """
    target = _claimed(Path(path))
    try:
        write_mcap(target, [track])
    except BaseException:
        target.unlink(missing_ok=True)
        raise
    return target


def has_room(path: str | os.PathLike[str], size: int) -> bool:
    """Return whether the folder of a path can take so many bytes."""
    folder = Path(path).parent
    return os.access(folder, os.W_OK) and shutil.disk_usage(folder).free > size


def _claimed(path: Path) -> Path:
    """Make an empty file under the first name that is free: nobody else gets that name."""
    for number in count():
        candidate = path.with_stem(f'{path.stem}_{number}') if number else path
        with suppress(FileExistsError):
            candidate.touch(exist_ok=False)
            return candidate
    raise AssertionError  # names are never used up

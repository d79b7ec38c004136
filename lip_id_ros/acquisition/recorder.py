"""What the node `train` keeps of joint_states, and whether it has been saved."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from lip_id_ros.acquisition import recording_file
from lip_id_ros.acquisition.sections import Sections
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.joint_messages import JointMessage

MESSAGE_BYTES, JOINT_BYTES = 100, 48
"""A bound on the size of a message in a bag."""

MOST_NAMES = 20
"""So many foreign joints are named, where messages have an endless variety."""


class Recorder:
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

    """

    def __init__(self, joint_names: Sequence[str], max_rows: int) -> None:
        self.recording = False
        self._sections = Sections(joint_names, max_rows)
        self._saved_rows = 0
        self._times_cleared = 0

    def __len__(self) -> int:
        """Return the number of messages kept."""
        return len(self._sections)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joints that are kept, empty while they are not known."""
        return self._sections.joint_names

    def add(self, message: JointMessage) -> None:
        """Take one message while recording; what cannot be used is counted."""
        if self.recording:
            self._sections.add(message)

    def clear(self) -> None:
        """Forget all messages and counts."""
        self._sections.clear()
        self._saved_rows = 0
        self._times_cleared += 1

    def samples(self, topic: str) -> list[JointSamples]:
        """Return a copy of what was taken so far, by section."""
        return self._sections.samples(topic)

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
        OSError
            If a bag can be written nowhere.

        """
        if len(self) <= self._saved_rows:
            return []
        sections = self._sections.all_samples(topic)
        return [recording_file.keep(path, samples, topic) for samples in sections]

    def endangered(self, path: str) -> str:
        """Return why unsaved samples would be lost if the node ended now, empty if safe."""
        needed = len(self) * (MESSAGE_BYTES + JOINT_BYTES * len(self.joint_names))
        if len(self) <= self._saved_rows or recording_file.has_room(path, needed):
            return ''
        return (
            f'{len(self)} unsaved samples would be lost, no folder has {needed / 1e6:.0f} MB for '
            'them: free the disk or change unsaved_path'
        )

    @property
    def n_rejected(self) -> int:
        """How many messages were dropped."""
        return self._sections.counts.total()

    @property
    def is_full(self) -> bool:
        """Whether no further message is kept."""
        return self._sections.is_full

    def status(self) -> dict[str, Any]:
        """Return what was done so far, JSON-able."""
        return {
            'recording': self.recording,
            'rows': len(self),
            'rows_saved': self._saved_rows,
            'full': self.is_full,
            'joint_names': list(self.joint_names),
            'other_joints': self._other_joints,
            'rejected': {
                str(reason): count for reason, count in self._sections.counts.most_common()
            },
        }

    @property
    def summary(self) -> str:
        """What was done so far, in words."""
        parts = ['recording' if self.recording else 'not recording', f'{len(self)} samples kept']
        if self.is_full:
            parts.append('no more fit under max_rows: call save_dataset, then clear')
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
        return list(self._sections.other_joints[:MOST_NAMES])

    def _complaints(self) -> list[str]:
        most = self._sections.counts.most_common(1)
        return [f'{self.n_rejected} messages rejected, mostly for: {most[0][0]}'] if most else []

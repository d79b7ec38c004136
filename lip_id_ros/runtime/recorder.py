"""What the node `train` keeps of joint_states, and whether it has been saved."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lip_id_ros.recording import JointSamples, SampleBuffer
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.runtime import recording_file


class Recorder:
    """
    A buffer that can be switched on and off.

    Parameters
    ----------
    joint_names : sequence of str
        Joints to keep; empty for those of the first message.
    max_rows : int
        Most messages kept.

    Attributes
    ----------
    recording : bool
        Whether messages are taken.

    """

    def __init__(self, joint_names: Sequence[str], max_rows: int) -> None:
        self.recording = False
        self._buffer = SampleBuffer(joint_names, max_rows)
        self._saved_rows = 0

    def __len__(self) -> int:
        """Return the number of messages kept."""
        return len(self._buffer)

    def add(self, message: JointMessage) -> None:
        """Take one message while recording; what cannot be used is counted."""
        if self.recording:
            self._buffer.add(1e-9 * message.stamp_ns, *message[1:])

    def clear(self) -> None:
        """Forget all messages and counts."""
        self._buffer.clear()
        self._saved_rows = 0

    def samples(self, topic: str) -> JointSamples:
        """Return a copy of what was taken so far."""
        return self._buffer.samples('recording', topic)

    def mark_saved(self, n_rows: int) -> None:
        """Note that the first rows are in a file now."""
        self._saved_rows = max(self._saved_rows, n_rows)

    def keep_unsaved(self, path: str, topic: str) -> Path | None:
        """
        Write everything to a bag, unless it is saved already.

        Returns
        -------
        Path or None
            The bag, None where there was nothing to keep.

        """
        samples = self.samples(topic)
        if len(self) <= self._saved_rows or samples.n_samples == 0:
            return None
        return recording_file.keep(path, samples, topic)

    @property
    def n_rejected(self) -> int:
        """How many messages were dropped."""
        return self._buffer.counts.total()

    def status(self) -> dict[str, Any]:
        """Return what was done so far, JSON-able."""
        return {
            'recording': self.recording,
            'rows': len(self),
            'rows_saved': self._saved_rows,
            'joint_names': list(self._buffer.joint_names),
            'rejected': {str(reason): count for reason, count in self._buffer.counts.items()},
        }

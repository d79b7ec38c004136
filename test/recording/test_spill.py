"""Large arrays lie in temporary files and are the same as small ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import errno
import os
from pathlib import Path
import tempfile

import numpy as np
import pytest
from recording.bag_files import moving, of_effort_alone, of_one_joint, State, write_folder

from lip_id_ros.recording import read_bag, spill
from lip_id_ros.recording.joint_samples import SIGNALS
from lip_id_ros.settings import RecordingSettings

BOTH = RecordingSettings(joints=('shoulder', 'elbow'))


def late() -> list[State]:
    states = moving(400)
    return [states[k ^ 1] for k in range(400)]


def of_two_publishers() -> list[State]:
    states = moving(400)
    return [
        of_one_joint(state, joint, stamp_ns=state.stamp_ns + 3_000_000 * joint)
        for state in states
        for joint in (0, 1)
    ]


def incomplete() -> list[State]:
    states = moving(400)
    return [replace(each, effort=()) if k % 9 == 0 else each for k, each in enumerate(states)]


def of_efforts_alone() -> list[State]:
    states = moving(400)
    return [*map(of_effort_alone, states), *(replace(each, effort=()) for each in states)]


@pytest.mark.parametrize('messages', [late, of_two_publishers, incomplete, of_efforts_alone])
def test_samples_in_files_are_those_in_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, messages: Callable[[], list[State]]
) -> None:
    path = write_folder(tmp_path / 'bag', messages())
    small = read_bag(path, BOTH)
    monkeypatch.setattr(spill, 'LARGE_BYTES', 500)
    monkeypatch.setattr(spill, 'BLOCK_ROWS', 70)
    large = read_bag(path, BOTH)
    np.testing.assert_array_equal(large.t, small.t)
    assert (large.counts, large.notes) == (small.counts, small.notes)
    assert large.n_samples > 300
    for name in SIGNALS:
        np.testing.assert_array_equal(getattr(large, name), getattr(small, name))
        assert isinstance(getattr(large, name), np.memmap)


def test_temporary_files_leave_no_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path))
    monkeypatch.setattr(spill, 'LARGE_BYTES', 0)
    array = spill.large_array(100, 3)
    array[:] = 1.0
    spill.release(array[:, 1])
    assert array.sum() == 300.0
    assert list(tmp_path.iterdir()) == []


def test_full_disk_is_an_error_before_anything_is_written(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Writing to a mapped file on a full disk would end the process."""

    def full(descriptor: int, start: int, size: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(spill, 'LARGE_BYTES', 0)
    monkeypatch.setattr(os, 'posix_fallocate', full)
    with pytest.raises(OSError, match='No space left'):
        spill.large_array(100, 3)

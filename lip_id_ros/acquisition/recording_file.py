"""Files of recorded samples: for the process of a job, or kept when the node ends."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from itertools import count
import json
import os
from pathlib import Path
import shutil
from typing import Any

import numpy as np

from lip_id_ros.files import HEADER, read_npz
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.bag_writer import JointStateTrack, write_mcap

_ARRAYS = ('t', 'position', 'velocity', 'effort')


def pass_on(folder: str | os.PathLike[str], sections: Sequence[JointSamples]) -> None:
    """Write samples for `receive` into an empty folder, with the interpreter free."""
    for number, samples in enumerate(sections):
        _write(Path(folder) / f'{number}.npz', samples)


def _write(path: Path, samples: JointSamples) -> None:
    header: dict[str, Any] = {
        'joint_names': samples.joint_names,
        'start_ns': samples.start_ns,
        'counts': dict(samples.counts),
        'source': samples.source,
        'topic': samples.topic,
    }
    arrays: dict[str, Any] = {name: getattr(samples, name) for name in _ARRAYS}
    with open(path, 'wb') as file:
        np.savez(file, **{HEADER: np.array(json.dumps(header)), **arrays})


def receive(folder: str | os.PathLike[str]) -> list[JointSamples]:
    """Read what `pass_on` wrote."""
    files = sorted(Path(folder).iterdir(), key=lambda path: int(path.stem))
    return [_read(path) for path in files]


def _read(path: Path) -> JointSamples:
    arrays, header = read_npz(path)
    fields: dict[str, Any] = {**arrays, **header, 'joint_names': tuple(header['joint_names'])}
    return JointSamples(**fields)


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

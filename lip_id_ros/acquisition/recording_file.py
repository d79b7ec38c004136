"""Samples in memory, handed to another process or kept for later."""

from __future__ import annotations

from collections.abc import Sequence
import json
import os
from pathlib import Path
import tempfile
from typing import Any

import numpy as np

from lip_id_ros.files import HEADER, read_npz
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.bag_writer import JointStateTrack, write_mcap

_ARRAYS = ('t', 'position', 'velocity', 'effort')


def hand_over(folder: str | os.PathLike[str], sections: Sequence[JointSamples]) -> None:
    """
    Write samples for `take_over`, as fast as the disk allows and with the interpreter free.

    Parameters
    ----------
    folder : path
        An empty one.
    sections : sequence of JointSamples

    """
    for number, samples in enumerate(sections):
        _write(Path(folder) / f'{number}.npz', samples)


def _write(path: Path, samples: JointSamples) -> None:
    header: dict[str, Any] = {
        'joint_names': samples.joint_names,
        'start_s': samples.start_s,
        'counts': dict(samples.counts),
        'source': samples.source,
        'topic': samples.topic,
    }
    arrays: dict[str, Any] = {name: getattr(samples, name) for name in _ARRAYS}
    with open(path, 'wb') as file:
        np.savez(file, **{HEADER: np.array(json.dumps(header)), **arrays})


def take_over(folder: str | os.PathLike[str]) -> list[JointSamples]:
    """Read what `hand_over` wrote."""
    files = sorted(Path(folder).iterdir(), key=lambda path: int(path.stem))
    return [_read(path) for path in files]


def _read(path: Path) -> JointSamples:
    arrays, header = read_npz(path)
    fields: dict[str, Any] = {**arrays, **header, 'joint_names': tuple(header['joint_names'])}
    return JointSamples(**fields)


def keep(path: str | os.PathLike[str], samples: JointSamples, topic: str) -> Path:
    """
    Write samples as an MCAP bag, beside those that were kept before.

    Parameters
    ----------
    path : path
        Where the file goes; a number is added to its name if there is one already. Where nothing
        can be written, it goes to the system's temporary folder instead.
    samples : JointSamples
        At least one.
    topic : str
        Topic they are written under.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    OSError
        If it cannot be written there either.

    """
    track = JointStateTrack(
        topic,
        samples.joint_names,
        samples.start_s + samples.t,
        samples.position,
        samples.velocity if samples.has_velocity else None,
        samples.effort if samples.has_effort else None,
    )
    try:
        return _write_beside(Path(path), track)
    except OSError:
        return _write_beside(Path(tempfile.gettempdir()) / Path(path).name, track)


def _write_beside(path: Path, track: JointStateTrack) -> Path:
    target = _free(path)
    write_mcap(target, [track])
    return target


def _free(path: Path) -> Path:
    candidate, number = path, 0
    while candidate.exists():
        number += 1
        candidate = path.with_stem(f'{path.stem}_{number}')
    return candidate

"""Recordings of joint states in the MCAP format, for PlotJuggler, Foxglove and rosbag2."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import os
from pathlib import Path
import shutil
import tempfile
from typing import Literal, TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

MESSAGE_TYPE = 'sensor_msgs/msg/JointState'
BAG_VERSION: Literal[8] = 8  # the newest that Humble reads too


@dataclass(frozen=True)
class JointStateTrack:
    """
    The messages of one JointState topic.

    Attributes
    ----------
    topic : str
    joint_names : sequence of str, n of them
    t : ndarray, shape (N,)
        Stamps [s], not negative; the receive time is the same.
    position, velocity, effort : ndarray, shape (N, n), or None
        [rad or m, rad/s or m/s, N m or N]; None leaves the array of the message empty.

    """

    topic: str
    joint_names: Sequence[str]
    t: NDArray[np.float64]
    position: NDArray[np.float64] | None = None
    velocity: NDArray[np.float64] | None = None
    effort: NDArray[np.float64] | None = None


def write_bag_folder(path: str | os.PathLike[str], tracks: Sequence[JointStateTrack]) -> None:
    """
    Write a rosbag2 folder: metadata.yaml and one MCAP file.

    Parameters
    ----------
    path : path
        The folder to be made; nothing of it is left after a failure.
    tracks : sequence of JointStateTrack

    Raises
    ------
    OSError
        If the folder exists or cannot be made.

    """
    target = Path(path)
    if target.exists():
        raise FileExistsError(f'{target} exists; choose another name for the bag.')
    _in_scratch(target, tracks, lambda bag: bag.rename(target))


def write_mcap(path: str | os.PathLike[str], tracks: Sequence[JointStateTrack]) -> None:
    """
    Write one MCAP file, in place of any that was there.

    Parameters
    ----------
    path : path
    tracks : sequence of JointStateTrack

    Raises
    ------
    OSError
        If the file cannot be written.

    """
    target = Path(path)

    def keep(bag: Path) -> None:
        (storage,) = bag.glob('*.mcap')
        storage.replace(target)

    _in_scratch(target, tracks, keep)


def _in_scratch(
    target: Path, tracks: Sequence[JointStateTrack], keep: Callable[[Path], object]
) -> None:
    scratch = Path(tempfile.mkdtemp(prefix=f'.{target.name}.', dir=target.parent))
    try:
        bag = scratch / target.stem
        _write(bag, tracks)
        keep(bag)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def _write(bag: Path, tracks: Sequence[JointStateTrack]) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    with Writer(bag, version=BAG_VERSION, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = [
            writer.add_connection(track.topic, MESSAGE_TYPE, typestore=store) for track in tracks
        ]
        for stamp, number, row in _in_order(tracks):
            message = _serialized(store, tracks[number], stamp, row)
            writer.write(connections[number], stamp, message)


def _in_order(tracks: Sequence[JointStateTrack]) -> list[tuple[int, int, int]]:
    return sorted(
        (round(seconds * 1e9), number, row)
        for number, track in enumerate(tracks)
        for row, seconds in enumerate(track.t.tolist())
    )


def _serialized(store: Typestore, track: JointStateTrack, stamp: int, row: int) -> memoryview:
    types = store.types
    seconds, nanoseconds = divmod(stamp, 10**9)
    time = types['builtin_interfaces/msg/Time'](sec=seconds, nanosec=nanoseconds)
    message = types[MESSAGE_TYPE](
        header=types['std_msgs/msg/Header'](stamp=time, frame_id=''),
        name=list(track.joint_names),
        position=_row(track.position, row),
        velocity=_row(track.velocity, row),
        effort=_row(track.effort, row),
    )
    return store.serialize_cdr(message, MESSAGE_TYPE)


def _row(values: NDArray[np.float64] | None, row: int) -> NDArray[np.float64]:
    return np.empty(0) if values is None else np.ascontiguousarray(values[row], dtype=np.float64)

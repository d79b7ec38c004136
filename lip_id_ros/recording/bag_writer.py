"""Write bags in the MCAP format, of arrays or of serialised messages."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
import os
from pathlib import Path
from typing import Any, ClassVar, Literal, Self

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores

from lip_id_ros.arrays import Array
from lip_id_ros.files import move_into_place, scratch_folder, sync, sync_folder

JOINT_STATE = 'sensor_msgs/msg/JointState'
BAG_VERSION: Literal[8] = 8  # the newest that Humble reads too

_SCRATCH = '.lip_id_ros.'


@dataclass(frozen=True)
class JointStateTrack:
    """
    The messages of one JointState topic, stamped and received at times (N,) [s] after `start_ns`.

    Of `position`, `velocity`, `effort`, shape (N, n), None, or NaN throughout a row, leaves the
    array of the message empty.
    """

    topic: str
    joint_names: Sequence[str]
    t: Array
    position: Array | None = None
    velocity: Array | None = None
    effort: Array | None = None
    start_ns: int = 0
    message_type: ClassVar[str] = JOINT_STATE

    def message(self, types: Mapping[str, Any], stamp_ns: int, row: int) -> Any:
        """Return one message."""
        seconds, nanoseconds = divmod(stamp_ns, 10**9)
        time = types['builtin_interfaces/msg/Time'](sec=seconds, nanosec=nanoseconds)
        return types[JOINT_STATE](
            types['std_msgs/msg/Header'](stamp=time, frame_id=''),
            list(self.joint_names),
            *(_row(values, row) for values in (self.position, self.velocity, self.effort)),
        )


@dataclass(frozen=True)
class JointTrajectoryTrack:
    """One JointTrajectory, received at time zero: states (N, n) at times (N,) [s]."""

    topic: str
    joint_names: Sequence[str]
    times_from_start: Array
    positions: Array
    velocities: Array
    accelerations: Array
    start_ns: ClassVar[int] = 0
    message_type: ClassVar[str] = 'trajectory_msgs/msg/JointTrajectory'

    @property
    def t(self) -> Array:
        """Times [s] at which messages are received."""
        return np.zeros(1)

    def message(self, types: Mapping[str, Any], stamp_ns: int, row: int) -> Any:
        """Return the message; its stamp is zero: the motion may start at once."""
        time = types['builtin_interfaces/msg/Time'](sec=0, nanosec=0)
        points = [
            types['trajectory_msgs/msg/JointTrajectoryPoint'](
                *(_row(values, at) for values in self._states),
                effort=np.empty(0),
                time_from_start=types['builtin_interfaces/msg/Duration'](
                    *divmod(round(1e9 * seconds), 10**9)
                ),
            )
            for at, seconds in enumerate(self.times_from_start.tolist())
        ]
        header = types['std_msgs/msg/Header'](stamp=time, frame_id='')
        return types[self.message_type](header, list(self.joint_names), points)

    @property
    def _states(self) -> tuple[Array, Array, Array]:
        return self.positions, self.velocities, self.accelerations


Track = JointStateTrack | JointTrajectoryTrack


def write_bag_folder(path: str | os.PathLike[str], tracks: Sequence[Track]) -> None:
    """
    Write a rosbag2 folder: metadata.yaml and one MCAP file; nothing is left after a failure.

    OSError if the folder exists or cannot be made.
    """
    target = Path(path)
    if target.exists():
        raise FileExistsError(f'{target} exists; choose another name for the bag.')
    with _written_beside(target, tracks) as bag:
        for file in bag.iterdir():
            sync(file)
        sync_folder(bag)
        bag.rename(target)
        sync_folder(target.parent)


def write_mcap(path: str | os.PathLike[str], tracks: Sequence[Track]) -> None:
    """
    Write one MCAP file, in place of any that was there; OSError if that fails.

    A link is followed, the mode of an existing file is kept.
    """
    with _written_beside(Path(os.path.realpath(path)), tracks) as bag:
        (storage,) = bag.glob('*.mcap')
        move_into_place(storage, path)


@contextmanager
def _written_beside(target: Path, tracks: Sequence[Track]) -> Iterator[Path]:
    """Give a bag in a scratch folder beside its place while the context lasts."""
    with scratch_folder(f'.{target.name}{_SCRATCH}', target.parent) as scratch:
        bag = Path(scratch, target.stem)
        _write(bag, tracks)
        yield bag


def _write(bag: Path, tracks: Sequence[Track]) -> None:
    types = get_typestore(Stores.ROS2_JAZZY).types
    in_order = sorted(
        (track.start_ns + round(seconds * 1e9), number, row)
        for number, track in enumerate(tracks)
        for row, seconds in enumerate(track.t.tolist())
    )
    with RawBag(bag, {track.topic: track.message_type for track in tracks}) as raw:
        for stamp, number, row in in_order:
            track = tracks[number]
            raw.write_message(track.topic, stamp, track.message(types, stamp, row))


def _row(values: Array | None, row: int) -> Array:
    if values is None or np.isnan(values[row]).all():
        return np.empty(0)
    return np.ascontiguousarray(values[row], dtype=np.float64)


class RawBag:
    """
    A rosbag2 folder (MCAP) being written, without rosbag2; to be used in a `with` statement.

    `topics` gives message types (as package/msg/Name). OSError if the folder exists or cannot be
    made.
    """

    def __init__(self, path: str | os.PathLike[str], topics: Mapping[str, str]) -> None:
        self._writer = Writer(Path(path), version=BAG_VERSION, storage_plugin=StoragePlugin.MCAP)
        self._topics = topics
        self._store = get_typestore(Stores.ROS2_JAZZY)

    def __enter__(self) -> Self:
        self._writer.open()
        self._connections = {
            topic: self._writer.add_connection(topic, kind, typestore=self._store)
            for topic, kind in self._topics.items()
        }
        return self

    def __exit__(self, *error: object) -> None:
        self._writer.close()

    def write(self, topic: str, receive_ns: int, data: bytes | memoryview) -> None:
        """Append a serialized message (CDR) that came at a time [ns]."""
        self._writer.write(self._connections[topic], receive_ns, data)

    def write_message(self, topic: str, receive_ns: int, message: Any) -> None:
        """Append a message of the library's type that came at a time [ns]."""
        self.write(topic, receive_ns, self._store.serialize_cdr(message, self._topics[topic]))

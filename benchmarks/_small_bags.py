"""Small bags of every kind, for the fuzzers to break."""

from __future__ import annotations

from pathlib import Path
import tempfile
from typing import Any

import lz4.frame
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import get_typestore, Stores

from lip_id_ros.dataset import Dataset

JOINT_STATE = 'sensor_msgs/msg/JointState'
MESSAGES = 12
ROS2: Any = get_typestore(Stores.ROS2_JAZZY)
ROS1: Any = get_typestore(Stores.ROS1_NOETIC)


def seeds() -> list[tuple[str, bytes]]:
    """Return suffix and content of a small file of every kind."""
    files = [('.mcap', _mcap(kind, chunking)) for kind in CompressionType for chunking in (0, 1)]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        files.append(('.db3', _sqlite(folder / 'sqlite')))
        for compression in (None, *rosbag1.Writer.CompressionFormat):
            files.append(('.bag', _ros1(folder / f'{compression}.bag', compression)))
    files.append(('.mcap.lz4', lz4.frame.compress(files[0][1])))
    return [*files, ('.csv', _log()), ('.csv', _data('.csv')), ('.npz', _data('.npz'))]


def _log() -> bytes:
    lines = [f'{k / 10},{np.sin(k / 9)},{np.cos(k / 9)}' for k in range(60)]
    return '\n'.join(['t,q_a,tau_a', *lines, '']).encode()


def _data(suffix: str) -> bytes:
    values = np.sin(np.arange(40.0)).reshape(20, 2)
    with tempfile.NamedTemporaryFile(suffix=suffix) as file:
        Dataset.from_arrays(values, values, values, values).save(file.name)
        return Path(file.name).read_bytes()


def _mcap(compression: CompressionType, chunking: int) -> bytes:
    with tempfile.NamedTemporaryFile() as file:
        # without checksums, so that a changed byte gets further
        writer = McapWriter(
            file.name,
            chunk_size=600,
            compression=compression,
            use_chunking=bool(chunking),
            enable_crcs=False,
        )
        writer.start('ros2', 'seed')
        definition, _ = ROS2.generate_msgdef(JOINT_STATE, ros_version=2)
        schema = writer.register_schema(JOINT_STATE, 'ros2msg', definition.encode()[:200])
        for topic in ('/joint_states', '/other'):
            channel = writer.register_channel(topic, 'cdr', schema)
            for number in range(MESSAGES):
                data = bytes(ROS2.serialize_cdr(_message(ROS2, number), JOINT_STATE))
                writer.add_message(channel, number * 10**7, data, number * 10**7)
        writer.finish()  # type: ignore[no-untyped-call]
        return Path(file.name).read_bytes()


def _sqlite(folder: Path) -> bytes:
    with rosbag2.Writer(folder, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connection = writer.add_connection('/joint_states', JOINT_STATE, typestore=ROS2)
        for number in range(3 * MESSAGES):
            data = ROS2.serialize_cdr(_message(ROS2, number), JOINT_STATE)
            writer.write(connection, number * 10**7, data)
    return next(folder.glob('*.db3')).read_bytes()


def _ros1(path: Path, compression: Any) -> bytes:
    writer = rosbag1.Writer(path)
    if compression is not None:
        writer.set_compression(compression)
    with writer:
        connection = writer.add_connection('/joint_states', JOINT_STATE, typestore=ROS1)
        for number in range(MESSAGES):
            data = ROS1.serialize_ros1(_message(ROS1, number), JOINT_STATE)
            writer.write(connection, number * 10**7, data)
    return path.read_bytes()


def _message(store: Any, number: int) -> Any:
    types = store.types
    time_ns = number * 10**7
    stamp = types['builtin_interfaces/msg/Time'](sec=0, nanosec=time_ns)
    extra = {'seq': number} if store is ROS1 else {}
    return types[JOINT_STATE](
        header=types['std_msgs/msg/Header'](stamp=stamp, frame_id='', **extra),
        name=['a', 'b'],
        position=np.array([0.1 * number, 1.0]),
        velocity=np.array([1.0, 0.5 * number]),
        effort=np.array([2.0, 3.0]),
    )

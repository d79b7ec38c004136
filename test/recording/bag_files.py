"""Small bags for tests, written with the library that also reads them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import get_typestore, Stores

ROS2: Any = get_typestore(Stores.ROS2_JAZZY)
ROS1: Any = get_typestore(Stores.ROS1_NOETIC)
JOINT_STATE = 'sensor_msgs/msg/JointState'
TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'
TEXT = 'std_msgs/msg/String'
STEP_NS = 10_000_000
PLUGINS = {'.db3': StoragePlugin.SQLITE3, '.mcap': StoragePlugin.MCAP}


@dataclass(frozen=True)
class State:
    """A JointState; received when it says it was sent, unless told otherwise."""

    stamp_ns: int
    position: Sequence[float] = (0.5, -0.5)
    velocity: Sequence[float] = (0.1, 0.2)
    effort: Sequence[float] = (1.0, 2.0)
    names: Sequence[str] = ('shoulder', 'elbow')
    receive_ns: int | None = None
    topic: str = '/joint_states'


def moving(count: int, **fields: Any) -> list[State]:
    """Return states at 100 Hz, each different from the one before."""
    return [
        replace(
            State(
                stamp_ns=k * STEP_NS,
                position=(0.01 * k, -0.02 * k),
                velocity=(1.0, -2.0 + 0.001 * k),
                effort=(3.0 + k, 4.0 - k),
            ),
            **fields,
        )
        for k in range(count)
    ]


def write_folder(
    folder: Path, states: Iterable[State], suffix: str = '.db3', empty_topics: Sequence[str] = ()
) -> Path:
    """Write a rosbag2 folder with metadata.yaml; return it."""
    with rosbag2.Writer(folder, version=9, storage_plugin=PLUGINS[suffix]) as writer:
        connections: dict[str, Any] = {
            topic: writer.add_connection(topic, JOINT_STATE, typestore=ROS2)
            for topic in empty_topics
        }
        for state in states:
            if state.topic not in connections:
                connections[state.topic] = writer.add_connection(
                    state.topic, JOINT_STATE, typestore=ROS2
                )
            data = ROS2.serialize_cdr(_message(ROS2, state), JOINT_STATE)
            writer.write(connections[state.topic], _received(state), data)
    return folder


def write_file(folder: Path, states: Iterable[State], suffix: str) -> Path:
    """Write a bare storage file without metadata.yaml; return it."""
    write_folder(folder, states, suffix)
    (folder / 'metadata.yaml').unlink()
    return next(folder.iterdir())


def write_ros1(path: Path, states: Iterable[State]) -> Path:
    """Write a ROS 1 bag; return it."""
    with rosbag1.Writer(path) as writer:
        connections: dict[str, Any] = {}
        for state in states:
            if state.topic not in connections:
                connections[state.topic] = writer.add_connection(
                    state.topic, JOINT_STATE, typestore=ROS1
                )
            data = ROS1.serialize_ros1(_message(ROS1, state), JOINT_STATE)
            writer.write(connections[state.topic], _received(state), data)
    return path


def write_raw(folder: Path, topic: str, kind: str, data: Sequence[bytes], suffix: str) -> Path:
    """Write ready-made message bytes into a rosbag2 folder; return it."""
    with rosbag2.Writer(folder, version=9, storage_plugin=PLUGINS[suffix]) as writer:
        connection = writer.add_connection(topic, kind, typestore=ROS2)
        for number, item in enumerate(data):
            writer.write(connection, number * STEP_NS, item)
    return folder


def state_bytes(state: State) -> bytes:
    """Return a JointState as it lies in a ROS 2 bag."""
    return bytes(ROS2.serialize_cdr(_message(ROS2, state), JOINT_STATE))


def trajectory_bytes(names: Sequence[str], points: Sequence[dict[str, Any]]) -> bytes:
    """Return a JointTrajectory as it lies in a ROS 2 bag; points name their fields."""
    types = ROS2.types
    empty = np.zeros(0)
    fields = ('positions', 'velocities', 'accelerations', 'effort')
    message = types[TRAJECTORY](
        header=_header(ROS2, 0),
        joint_names=list(names),
        points=[
            types['trajectory_msgs/msg/JointTrajectoryPoint'](
                **{field: np.array(point.get(field, empty), float) for field in fields},
                time_from_start=types['builtin_interfaces/msg/Duration'](
                    sec=number, nanosec=500_000_000
                ),
            )
            for number, point in enumerate(points)
        ],
    )
    return bytes(ROS2.serialize_cdr(message, TRAJECTORY))


def _received(state: State) -> int:
    return state.stamp_ns if state.receive_ns is None else state.receive_ns


def _message(store: Any, state: State) -> Any:
    return store.types[JOINT_STATE](
        header=_header(store, state.stamp_ns),
        name=list(state.names),
        position=np.array(state.position, float),
        velocity=np.array(state.velocity, float),
        effort=np.array(state.effort, float),
    )


def _header(store: Any, stamp_ns: int) -> Any:
    stamp = store.types['builtin_interfaces/msg/Time'](
        sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9
    )
    extra = {'seq': 0} if store is ROS1 else {}
    return store.types['std_msgs/msg/Header'](stamp=stamp, frame_id='', **extra)

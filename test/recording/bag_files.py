"""Small bags for tests, written with the library that also reads them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import get_types_from_msg, get_typestore, Stores

from lip_id_ros.recording.joint_messages import KNOWN_DEFINITIONS

ROS2: Any = get_typestore(Stores.ROS2_JAZZY)
ROS1: Any = get_typestore(Stores.ROS1_NOETIC)
JOINT_STATE = 'sensor_msgs/msg/JointState'
TEXT = 'std_msgs/msg/String'
STEP_NS = 10_000_000
PLUGINS = {'.db3': StoragePlugin.SQLITE3, '.mcap': StoragePlugin.MCAP}


@dataclass(frozen=True)
class State:
    """A JointState; received at its stamp unless a time is given."""

    stamp_ns: int
    position: Sequence[float] = (0.5, -0.5)
    velocity: Sequence[float] = (0.1, 0.2)
    effort: Sequence[float] = (1.0, 2.0)
    names: Sequence[str] = ('shoulder', 'elbow')
    receive_ns: int | None = None
    topic: str = '/joint_states'
    frame_id: str = ''


def moving(count: int, **fields: Any) -> list[State]:
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


def of_one_joint(state: State, joint: int, **changes: Any) -> State:
    """Return the state that a publisher of one joint sends."""
    parts = ('names', 'position', 'velocity', 'effort')
    values: dict[str, Any] = {name: [getattr(state, name)[joint]] for name in parts}
    return replace(state, **values, **changes)


def of_effort_alone(state: State, **changes: Any) -> State:
    """Return what drives send that publish their efforts beside the joint states."""
    return replace(state, position=(), velocity=(), **changes)


def damage(path: Path, place: int, data: bytes) -> Path:
    """Write other bytes at a place of a file; return it."""
    with open(path, 'r+b') as file:
        file.seek(place)
        file.write(data)
    return path


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


def write_ros1(
    path: Path,
    states: Iterable[State],
    compression: Any = None,
    publishers: int = 1,
    chunk_bytes: int = 2**20,
) -> Path:
    """Write a ROS 1 bag; return it. Publishers of a topic take turns."""
    writer = rosbag1.Writer(path)
    writer.chunk_threshold = chunk_bytes
    if compression is not None:
        writer.set_compression(compression)
    with writer:
        connections: dict[tuple[str, int], Any] = {}
        for number, state in enumerate(states):
            key = (state.topic, number % publishers)
            if key not in connections:
                connections[key] = writer.add_connection(
                    state.topic, JOINT_STATE, typestore=ROS1, callerid=f'/node{key[1]}'
                )
            data = ROS1.serialize_ros1(_message(ROS1, state), JOINT_STATE)
            writer.write(connections[key], _received(state), data)
    return path


def write_mcap(
    path: Path,
    states: Iterable[State],
    compression: CompressionType = CompressionType.NONE,
    index: IndexType = IndexType.ALL,
    profile: str = 'ros2',
    **options: Any,
) -> Path:
    """Write an MCAP file with another library, with all its options; return it."""
    definition, _ = ROS2.generate_msgdef(JOINT_STATE, ros_version=2)
    writer = McapWriter(str(path), compression=compression, index_types=index, **options)
    writer.start(profile, 'test')
    schema = writer.register_schema(JOINT_STATE, 'ros2msg', definition.encode())
    channels: dict[str, int] = {}
    for state in states:
        if state.topic not in channels:
            channels[state.topic] = writer.register_channel(state.topic, 'cdr', schema)
        writer.add_message(
            channels[state.topic], _received(state), state_bytes(state), _received(state)
        )
    writer.finish()  # type: ignore[no-untyped-call]
    return path


def write_raw(folder: Path, topic: str, kind: str, data: Sequence[bytes], suffix: str) -> Path:
    with rosbag2.Writer(folder, version=9, storage_plugin=PLUGINS[suffix]) as writer:
        connection = writer.add_connection(topic, kind, typestore=ROS2)
        for number, item in enumerate(data):
            writer.write(connection, number * STEP_NS, item)
    return folder


def write_defined(folder: Path, kind: str, definition: str, **fields: Any) -> Path:
    """Write three equal messages of a type that the bag defines in its own way; return it."""
    store: Any = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(definition, kind))
    message = store.types[kind](header=_header(store, 0), **fields)
    data = store.serialize_cdr(message, kind)
    with rosbag2.Writer(folder, version=9, storage_plugin=PLUGINS['.mcap']) as writer:
        connection = writer.add_connection('/odd', kind, typestore=store)
        for number in range(3):
            writer.write(connection, number * STEP_NS, data)
    return folder


def state_bytes(state: State) -> bytes:
    """Return a JointState as it lies in a ROS 2 bag."""
    return bytes(ROS2.serialize_cdr(_message(ROS2, state), JOINT_STATE))


CONTROLLER = 'control_msgs/msg/JointTrajectoryControllerState'
CONTROLLER_FORMS = dict(zip(('newest', 'new', 'old'), KNOWN_DEFINITIONS[CONTROLLER], strict=True))
POINT, MULTI_DOF = 'trajectory_msgs/JointTrajectoryPoint ', 'multi_dof_'


def write_controller_states(
    folder: Path,
    form: str,
    points: Sequence[dict[str, dict[str, Sequence[float]]]],
    suffix: str = '.mcap',
) -> Path:
    """Write controller states of joints a and b at 100 Hz, in the old or new form; return it."""
    store: Any = get_typestore(Stores.ROS2_JAZZY)
    definition = CONTROLLER_FORMS[form]
    store.register(get_types_from_msg(definition, CONTROLLER))
    names = [line.removeprefix(POINT) for line in definition.split('\n') if POINT in line]
    multi = [line.split()[1] for line in definition.split('\n') if f'Point {MULTI_DOF}' in line]
    nothing = store.types['trajectory_msgs/msg/MultiDOFJointTrajectoryPoint'](
        [], [], [], _duration(store, 0)
    )
    rest: dict[str, Any] = dict.fromkeys(multi, nothing)
    if multi:
        rest['multi_dof_joint_names'] = []
    if form == 'newest':
        rest['speed_scaling_factor'] = 1.0
    with rosbag2.Writer(folder, version=9, storage_plugin=PLUGINS[suffix]) as writer:
        connection = writer.add_connection('/controller/state', CONTROLLER, typestore=store)
        for number, given in enumerate(points):
            message = store.types[CONTROLLER](
                header=_header(store, number * STEP_NS),
                joint_names=['a', 'b'],
                **{name: _point(store, given.get(name, {}), 0) for name in names},
                **rest,
            )
            data = store.serialize_cdr(message, CONTROLLER)
            writer.write(connection, number * STEP_NS, data)
    return folder


def _point(store: Any, given: dict[str, Any], number: int) -> Any:
    fields = ('positions', 'velocities', 'accelerations', 'effort')
    return store.types['trajectory_msgs/msg/JointTrajectoryPoint'](
        **{field: np.array(given.get(field, ()), float) for field in fields},
        time_from_start=_duration(store, number),
    )


def _duration(store: Any, seconds: int) -> Any:
    return store.types['builtin_interfaces/msg/Duration'](sec=seconds, nanosec=500_000_000)


def _received(state: State) -> int:
    return state.stamp_ns if state.receive_ns is None else state.receive_ns


def _message(store: Any, state: State) -> Any:
    return store.types[JOINT_STATE](
        header=_header(store, state.stamp_ns, state.frame_id),
        name=list(state.names),
        position=np.array(state.position, float),
        velocity=np.array(state.velocity, float),
        effort=np.array(state.effort, float),
    )


def _header(store: Any, stamp_ns: int, frame_id: str = '') -> Any:
    stamp = store.types['builtin_interfaces/msg/Time'](
        sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9
    )
    extra = {'seq': 0} if store is ROS1 else {}
    return store.types['std_msgs/msg/Header'](stamp=stamp, frame_id=frame_id, **extra)

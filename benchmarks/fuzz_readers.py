"""
Broken recordings without end: reading them never crashes, hangs or takes unbounded memory.

Every message of a bag that is read must be used, or counted once with a reason.

Mutations are changed bytes and numbers, cuts, copies of parts to elsewhere, parts of other files.

"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable
from pathlib import Path
import resource
import signal
import tempfile
import time
import traceback
from typing import Any

import lz4.frame
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import get_typestore, Stores

from lip_id_ros.csv_table import CSV_SUFFIX
from lip_id_ros.dataset import Dataset, DATASET_SUFFIX
from lip_id_ros.errors import LipIdError
from lip_id_ros.loading import load_dataset
from lip_id_ros.preprocessing import describe
from lip_id_ros.recording import Bag, read_bag
from lip_id_ros.recording.reading import choose_topics

MEMORY_BYTES = 2 * 2**30
CASE_S, WAITING = 10, 12
NUMBERS = (0, 1, 0x7F, 0xFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 2**40, 2**63 - 1, 2**64 - 1)

JOINT_STATE, MESSAGES = 'sensor_msgs/msg/JointState', 12
ROS2: Any = get_typestore(Stores.ROS2_JAZZY)
ROS1: Any = get_typestore(Stores.ROS1_NOETIC)

Case = tuple[str, bytes]


def main(arguments: list[str]) -> int:
    """Read broken bags until the time is up; write down what breaks the reader."""
    parser = argparse.ArgumentParser(prog='benchmarks fuzz_readers', description=__doc__)
    parser.add_argument('--minutes', type=float, default=1.0)
    parser.add_argument('--cases', type=int, default=0, help='stop after so many')
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--findings', type=Path, default=Path('fuzz_findings'))
    options = parser.parse_args(arguments)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    for each in (signal.SIGALRM, signal.SIGPROF):
        signal.signal(each, _too_long)
    rng, files = np.random.default_rng(options.seed), seeds()
    outcomes: Counter[str] = Counter()
    ends = time.monotonic() + 60 * options.minutes
    while time.monotonic() < ends and (not options.cases or outcomes.total() < options.cases):
        outcomes[outcome(broken(rng, files), options.findings)] += 1
    print(f'{outcomes.total()} cases:', dict(outcomes.most_common()))
    return int(any(name.startswith('!') for name in outcomes))


def broken(rng: np.random.Generator, files: list[Case]) -> Case:
    """Return a file with a few things wrong."""
    suffix, content = files[rng.integers(len(files))]
    data = bytearray(content)
    for _ in range(rng.integers(1, 6)):
        if data:
            mutation = MUTATIONS[rng.integers(len(MUTATIONS))]
            mutation(rng, data, files[rng.integers(len(files))][1])
    return suffix, bytes(data)


def outcome(case: Case, findings: Path) -> str:
    """Read a file; return the outcome, which begins with ! where it is a fault."""
    suffix, data = case
    with tempfile.TemporaryDirectory(dir='/dev/shm') as folder:
        path = Path(folder) / f'bag{suffix}'
        path.write_bytes(data)
        _allow(CASE_S)
        try:
            read(path)
        except LipIdError as error:
            return type(error).__name__
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt):
                raise
            findings.mkdir(exist_ok=True)
            name = f'{type(error).__name__}_{abs(hash(data)):x}'
            (findings / f'{name}{suffix}').write_bytes(data)
            (findings / f'{name}.txt').write_text(traceback.format_exc())
            return f'!{type(error).__name__}'
        finally:
            _allow(0)
    return 'read'


def _allow(cpu_s: float) -> None:
    """Allow so much time to compute, and more to wait, since the machine may be loaded; 0: any."""
    signal.setitimer(signal.ITIMER_PROF, cpu_s)
    signal.setitimer(signal.ITIMER_REAL, WAITING * cpu_s)


def read(path: Path) -> None:
    """Read all that can be read, and check that every message is used or counted once."""
    describe(path)
    if path.suffix in (CSV_SUFFIX, DATASET_SUFFIX):
        load_dataset(path)
        return
    samples = read_bag(path)
    with Bag(path) as bag:
        (topic,) = choose_topics(bag, '')
        stored = sum(1 for _ in bag.stored(topic.name, topic.type)) + bag.lost(topic.name)
    accounted = samples.n_samples + sum(samples.counts.values())
    if accounted != stored:
        raise AssertionError(f'{stored} messages, but {accounted} used or counted')
    arrays = (samples.t, samples.position)
    if not all(np.isfinite(array).all() for array in arrays) or (np.diff(samples.t) <= 0).any():
        raise AssertionError('samples out of order or not finite')


def _change(rng: np.random.Generator, data: bytearray, other: bytes) -> None:
    for _ in range(rng.integers(1, 4)):
        data[rng.integers(len(data))] = rng.integers(256)


def _number(rng: np.random.Generator, data: bytearray, other: bytes) -> None:
    size, place = 2 ** int(rng.integers(4)), int(rng.integers(len(data)))
    value = NUMBERS[rng.integers(len(NUMBERS))] % 256**size
    data[place : place + size] = value.to_bytes(size, 'little')


def _cut(rng: np.random.Generator, data: bytearray, other: bytes) -> None:
    del data[rng.integers(len(data)) :]


def _remove(rng: np.random.Generator, data: bytearray, other: bytes) -> None:
    start = rng.integers(len(data))
    del data[start : start + rng.integers(200)]


def _splice(rng: np.random.Generator, data: bytearray, other: bytes) -> None:
    start, place = rng.integers(len(other)), rng.integers(len(data))
    data[place:place] = other[start : start + rng.integers(2000)]


def _zeros(rng: np.random.Generator, data: bytearray, other: bytes) -> None:
    start = int(rng.integers(len(data)))
    count = min(len(data) - start, int(rng.integers(1, 600)))
    data[start : start + count] = bytes(count)


MUTATIONS: tuple[Callable[[np.random.Generator, bytearray, bytes], None], ...] = (
    _change,
    _change,
    _number,
    _number,
    _cut,
    _remove,
    _splice,
    _zeros,
)


def _too_long(signal_number: int, frame: object) -> None:
    raise TimeoutError(f'not read within {CASE_S} s')


def seeds() -> list[Case]:
    """Return suffix and content of a small file of every kind."""
    files = [('.mcap', _mcap(kind, chunking)) for kind in CompressionType for chunking in (0, 1)]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        files.append(('.db3', _sqlite(folder / 'sqlite')))
        for compression in (None, *rosbag1.Writer.CompressionFormat):
            files.append(('.bag', _ros1(folder / f'{compression}.bag', compression)))
    files.append(('.mcap.lz4', lz4.frame.compress(files[0][1])))
    return [*files, ('.csv', _log()), ('.npz', _data())]


def _log() -> bytes:
    lines = [f'{k / 10},{np.sin(k / 9)},{np.cos(k / 9)}' for k in range(60)]
    return '\n'.join(['t,q_a,tau_a', *lines, '']).encode()


def _data() -> bytes:
    values = np.sin(np.arange(40.0)).reshape(20, 2)
    with tempfile.NamedTemporaryFile(suffix='.npz') as file:
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

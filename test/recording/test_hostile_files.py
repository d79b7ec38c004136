"""Files of any making: bounded memory and time, right notes, sentences instead of tracebacks."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
import sqlite3
import struct

from backports import zstd
import lz4.frame
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
import numpy as np
import pytest
from recording.bag_files import (
    damage,
    JOINT_STATE,
    moving,
    State,
    STEP_NS,
    write_file,
    write_folder,
    write_mcap,
    write_ros1,
)
from recording.test_damage import chunk_places
from work import counted_work

from lip_id_ros.errors import LipIdError, SourceError
from lip_id_ros.loading import load_dataset
from lip_id_ros.preprocessing import describe
from lip_id_ros.recording import Bag, read_bag, Reason

METADATA_CALLS = 200_000
TOPIC_CALLS = 5_000

COUNT = 2000


def framed(compress: Callable[[bytes], bytes], content: bytes, size: int) -> bytes:
    return b''.join(compress(content[k : k + size]) for k in range(0, len(content), size))


@pytest.mark.parametrize(
    ('ending', 'compress'), [('.zstd', zstd.compress), ('.lz4', lz4.frame.compress)]
)
def test_all_frames_of_a_compressed_file_are_read(
    tmp_path: Path, ending: str, compress: Callable[[bytes], bytes]
) -> None:
    path = write_mcap(tmp_path / 'a.mcap', moving(COUNT), chunk_size=10_000)
    packed = tmp_path / f'b.mcap{ending}'
    packed.write_bytes(framed(compress, path.read_bytes(), 30_000))
    samples = read_bag(packed)
    assert (samples.n_samples, samples.counts, samples.notes) == (COUNT, {}, ())


@pytest.mark.parametrize('method', ['zstd', 'lz4'])
def test_frames_of_a_chunk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, method: str) -> None:
    from mcap import writer

    compress = {'zstd': zstd.compress, 'lz4': lz4.frame.compress}[method]
    kind = {'zstd': CompressionType.ZSTD, 'lz4': CompressionType.LZ4}[method]
    module = {'zstd': 'zstandard', 'lz4': 'lz4'}[method]
    if method == 'zstd':
        monkeypatch.setattr(
            getattr(writer, module), 'compress', lambda d: framed(compress, d, 999)
        )
    else:
        monkeypatch.setattr(lz4.frame, 'compress', lambda d: framed_lz4(d, 999))
    path = write_mcap(tmp_path / 'a.mcap', moving(COUNT), kind, chunk_size=10_000)
    samples = read_bag(path)
    assert (samples.n_samples, samples.counts, samples.notes) == (COUNT, {}, ())


def framed_lz4(data: bytes, size: int) -> bytes:
    frames = []
    for k in range(0, len(data), size):
        compressor = lz4.frame.LZ4FrameCompressor()
        frames.append(compressor.begin() + compressor.compress(data[k : k + size]))
        frames[-1] += compressor.flush()
    return b''.join(frames)


def test_chunk_that_declares_one_byte_less_is_noted(tmp_path: Path) -> None:
    """Without a checksum nothing else shows that its last message is not whole."""
    path = write_mcap(
        tmp_path / 'a.mcap',
        moving(COUNT),
        CompressionType.ZSTD,
        chunk_size=10_000,
        enable_crcs=False,
    )
    content = path.read_bytes()
    places = chunk_places(content, 'mcap')
    place = places[len(places) // 2] + 9 + 16
    (size,) = struct.unpack_from('<Q', content, place)
    samples = read_bag(damage(path, place, struct.pack('<Q', size - 1)))
    assert samples.n_samples + samples.counts[Reason.LOST] == COUNT
    assert samples.counts[Reason.LOST] > 0
    assert any(f'bytes or more instead of {size - 1}' in note for note in samples.notes)


def test_gap_before_the_index_of_a_ros1_bag_is_no_cut(tmp_path: Path) -> None:
    path = write_ros1(tmp_path / 'a.bag', moving(200))
    content = path.read_bytes()
    start = content.index(b'index_pos=') + len(b'index_pos=')
    (index,) = struct.unpack_from('<Q', content, start)
    moved = content[:start] + struct.pack('<Q', index + 49) + content[start + 8 :]
    path.write_bytes(moved[:index] + b'\xa5' * 49 + moved[index:])
    samples = read_bag(path)
    assert samples.n_samples == 200
    assert samples.notes == (f'a.bag: bytes {index} to {index + 49} hold no record',)


def test_claimed_counts_reserve_no_memory(tmp_path: Path) -> None:
    """An index that claims a million messages of a thousand joints in a small file."""
    names = [f'joint{k}' for k in range(900)]
    values = tuple(np.zeros(900))
    state = State(STEP_NS, names=names, position=values, velocity=values, effort=values)
    path = write_ros1(tmp_path / 'a.bag', [state, State(2 * STEP_NS)])
    content = path.read_bytes()
    place = content.index(b'count=', content.index(b'op=\x04') - 60) + len(b'count=')
    damage(path, place, struct.pack('<I', 1_000_000))
    with Bag(path) as bag:
        assert sum(topic.count for topic in bag.topics) >= 1_000_000
    assert peak_growth(lambda: read_bag(path)) < 200 * 2**20


def peak_growth(run: Callable[[], object]) -> int:
    """Return how much virtual memory an action may take more, found by a limit."""
    import resource

    used = int(Path('/proc/self/statm').read_text().split()[0]) * resource.getpagesize()
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (used + 200 * 2**20 - 1, before[1]))
    try:
        run()
    except MemoryError:
        return 200 * 2**20
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)
    return 0


@pytest.mark.parametrize('name', ['a.mcap', 'a.db3', 'a.bag', 'a.csv', 'a.npz', 'a.mcap.zstd'])
def test_sources_are_regular_files(tmp_path: Path, name: str) -> None:
    pipe = tmp_path / name
    os.mkfifo(pipe)
    device = tmp_path / f'device_{name}'
    device.symlink_to('/dev/zero')
    for path in (pipe, device):
        for read in (describe, load_dataset):
            with pytest.raises(SourceError, match=r'must be a regular file, but is a'):
                read(path)


@pytest.mark.parametrize('suffix', ['.mcap', '.db3', '.bag', '.csv', '.npz', ''])
def test_path_with_nul_is_refused(suffix: str) -> None:
    for read in (describe, load_dataset):
        with pytest.raises(LipIdError, match='a path must not contain NUL'):
            read(f'a\0b{suffix}')


def test_empty_path_is_not_the_current_folder() -> None:
    for read in (describe, load_dataset):
        with pytest.raises(SourceError, match=r'^the path of a recording is empty; name'):
            read('')


def test_pipe_within_a_folder_is_no_storage_file(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / 'bag', moving(5), '.mcap')
    os.mkfifo(folder / 'bag_1.mcap')
    (folder / 'metadata.yaml').unlink()
    os.mkfifo(folder / 'metadata.yaml')
    samples = read_bag(folder)
    assert samples.n_samples == 5
    assert samples.notes == ('metadata.yaml is not a file',)


LAUGHS = '\n'.join(
    ['a0: &a0 [ha, ha, ha, ha, ha, ha, ha, ha, ha]']
    + [f'a{k}: &a{k} [{", ".join([f"*a{k - 1}"] * 9)}]' for k in range(1, 30)]
)


@pytest.mark.slow
@pytest.mark.parametrize(
    'text',
    [
        f'{LAUGHS}\nrosbag2_bagfile_information: {{relative_file_paths: [*a29, *a29]}}',
        f'rosbag2_bagfile_information: {"[" * 20_000}',
        f'rosbag2_bagfile_information: {{relative_file_paths: [{"9" * 5000}]}}',
        'rosbag2_bagfile_information: {relative_file_paths: [2001-99-99]}',
        f'# {"x" * 2**21}',
    ],
    ids=['laughs', 'deep', 'digits', 'date', 'long'],
)
def test_hostile_metadata_is_noted(tmp_path: Path, text: str) -> None:
    folder = write_folder(tmp_path / 'bag', moving(5), '.mcap')
    (folder / 'metadata.yaml').write_text(text, encoding='utf-8')
    with counted_work() as work:
        samples = read_bag(folder)
    assert work.calls < METADATA_CALLS
    assert samples.n_samples == 5
    assert samples.notes[0].startswith('metadata.yaml ')


@pytest.mark.parametrize('table', ['messages', 'topics', 'message_definitions'])
def test_view_in_place_of_a_table_is_refused(tmp_path: Path, table: str) -> None:
    path = write_file(tmp_path / 'a', moving(5), '.db3')
    with sqlite3.connect(path) as database:
        columns = [row[1] for row in database.execute(f'PRAGMA table_info({table})')]
        database.execute(f'DROP TABLE {table}')
        database.execute(
            f'CREATE VIEW {table} AS WITH RECURSIVE n(x) AS '
            '(SELECT 1 UNION ALL SELECT x + 1 FROM n) '
            f'SELECT {", ".join(f"x AS {name}" for name in columns)} FROM n'
        )
    with pytest.raises(SourceError, match=f"its '{table}' is no table"):
        read_bag(path)


def test_column_with_the_name_of_the_row_number(tmp_path: Path) -> None:
    path = write_file(tmp_path / 'a', moving(20), '.db3')
    with sqlite3.connect(path) as database:
        database.execute("ALTER TABLE messages ADD COLUMN rowid TEXT DEFAULT 'x'")
    assert read_bag(path).n_samples == 20
    with sqlite3.connect(path) as database:
        for name in ('oid', '_rowid_'):
            database.execute(f'ALTER TABLE messages ADD COLUMN {name}')
    with pytest.raises(SourceError, match='its columns have the names of the row number'):
        read_bag(path)


def test_journal_of_an_unfinished_write_is_noted(tmp_path: Path) -> None:
    path = write_file(tmp_path / 'a', moving(20), '.db3')
    (path.parent / f'{path.name}-journal').write_bytes(b'\xd9\xd5\x05\xf9\x20\xa1\x63\xd7' * 100)
    samples = read_bag(path)
    assert samples.n_samples == 20
    assert samples.notes == ('a.db3: a.db3-journal is left of a write that was never finished',)


@pytest.mark.slow
def test_only_some_of_very_many_topics_are_described(tmp_path: Path) -> None:
    states = [*moving(3)] + [State(STEP_NS, topic=f'/t{k}') for k in range(3000)]
    path = write_mcap(tmp_path / 'a.mcap', states)
    with counted_work() as work:
        description = describe(path)
    assert work.calls < TOPIC_CALLS * 3001
    assert len(description['topics']) == 3001
    assert len(description['recordings']) == 32
    assert '/joint_states' in {each['topic'] for each in description['recordings']}
    assert description['notes'] == [
        'of 3001 topics with joint samples the 32 with most messages were read.'
    ]
    with pytest.raises(SourceError, match=r'/t1 \(.*, \d+ more; choose one') as caught:
        read_bag(write_mcap(tmp_path / 'b.mcap', states[3:]))
    assert len(str(caught.value)) < 3000


def test_message_of_very_many_joints_is_dropped(tmp_path: Path) -> None:
    names = [f'j{k}' for k in range(100_000)]
    values = tuple(np.zeros(len(names)))
    states = [State(STEP_NS, names=names, position=values, velocity=(), effort=()), *moving(5)]
    samples = read_bag(write_mcap(tmp_path / 'a.mcap', states))
    assert samples.joint_names == ('shoulder', 'elbow')
    assert samples.counts[Reason.TOO_MANY_NAMES] == 1
    assert len(samples.seen_joints) == 2


def test_chunks_that_unpack_to_far_more_than_the_file_are_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from lip_id_ros.recording.storage import chunked

    monkeypatch.setattr(chunked, '_MOST_UNPACKED', 10 * 2**20)
    path = tmp_path / 'a.mcap'
    writer = McapWriter(str(path), compression=CompressionType.ZSTD, chunk_size=2**20)
    writer.start('ros2', 'test')
    schema = writer.register_schema(JOINT_STATE, 'ros2msg', b'')
    channel = writer.register_channel('/joint_states', 'cdr', schema)
    for k in range(40):
        writer.add_message(channel, k, bytes(2**20), k)
    writer.finish()  # type: ignore[no-untyped-call]
    with pytest.raises(SourceError, match='10 message unreadable, 30 in a damaged part'):
        read_bag(path)

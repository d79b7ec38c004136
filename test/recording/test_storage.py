"""Storage files: the same messages as the libraries find, whatever is indexed or compressed."""

from __future__ import annotations

import bz2
from collections.abc import Callable
from pathlib import Path
import sqlite3
from typing import Any

from backports import zstd
import lz4.frame
from mcap.writer import CompressionType, IndexType
import pytest
from recording.bag_files import moving, write_file, write_mcap, write_ros1
from rosbags import rosbag1, rosbag2

from lip_id_ros.recording import Bag, read_bag
from lip_id_ros.recording.storage.contents import DamageError, plain_message, unpacked_chunk

STATES = [*moving(40), *moving(30, topic='/others')]


def stored(path: Path, topic: str = '/joint_states') -> list[tuple[int, bytes]]:
    with Bag(path) as bag:
        assert bag.notes == ()
        return [(time, data or b'') for _, time, data in bag.stored(topic)]


def of_library(reader: Any) -> list[tuple[int, bytes]]:
    with reader:
        wanted = [each for each in reader.connections if each.topic == '/joint_states']
        return [(time, bytes(data)) for _, time, data in reader.messages(wanted)]


@pytest.mark.parametrize('compression', list(CompressionType))
@pytest.mark.parametrize('index', [IndexType.ALL, IndexType.CHUNK, IndexType.NONE])
def test_mcap_gives_what_the_library_finds(
    tmp_path: Path, compression: CompressionType, index: IndexType
) -> None:
    path = write_mcap(tmp_path / 'a.mcap', STATES, compression, index, chunk_size=2000)
    assert stored(path) == of_library(rosbag2.Reader(write_mcap(tmp_path / 'all.mcap', STATES)))
    with Bag(path) as bag:
        assert [(topic.name, topic.count) for topic in bag.topics] == [
            ('/joint_states', 40),
            ('/others', 30),
        ]


def test_mcap_without_chunks(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / 'a.mcap', STATES, use_chunking=False)
    assert len(stored(path)) == 40
    assert len(stored(path, '/others')) == 30


def test_mcap_of_another_profile(tmp_path: Path) -> None:
    assert read_bag(write_mcap(tmp_path / 'a.mcap', moving(9), profile='')).n_samples == 9


def test_mcap_without_summary(tmp_path: Path) -> None:
    path = write_mcap(
        tmp_path / 'a.mcap',
        STATES,
        index=IndexType.NONE,
        repeat_channels=False,
        repeat_schemas=False,
        use_statistics=False,
        use_summary_offsets=False,
    )
    assert len(stored(path)) == 40


@pytest.mark.parametrize('compression', [None, *rosbag1.Writer.CompressionFormat])
def test_ros1_bag_gives_what_the_library_finds(tmp_path: Path, compression: object) -> None:
    path = write_ros1(tmp_path / 'a.bag', STATES, compression)
    assert stored(path) == of_library(rosbag1.Reader(path))


def test_sqlite_gives_what_the_library_finds(tmp_path: Path) -> None:
    path = write_file(tmp_path / 'a', STATES, '.db3')
    assert stored(path) == of_library(rosbag2.Reader(path))


@pytest.mark.parametrize('suffix', ['.mcap', '.db3'])
@pytest.mark.parametrize(
    ('ending', 'compress'), [('.zstd', zstd.compress), ('.lz4', lz4.frame.compress)]
)
def test_compressed_files(
    tmp_path: Path, suffix: str, ending: str, compress: Callable[[bytes], bytes]
) -> None:
    path = write_file(tmp_path / 'a', moving(20), suffix)
    packed = path.with_name(path.name + ending)
    packed.write_bytes(compress(path.read_bytes()))
    path.unlink()
    assert read_bag(packed).n_samples == 20
    assert read_bag(packed.parent).n_samples == 20


def test_compressed_file_cut_short_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / 'a.mcap', moving(2000), chunk_size=10_000)
    packed = tmp_path / 'cut.mcap.lz4'
    content = lz4.frame.compress(path.read_bytes(), block_linked=True)
    packed.write_bytes(content[: len(content) // 2])
    samples = read_bag(packed)
    assert 500 < samples.n_samples < 2000
    assert 'cut.mcap.lz4: it was cut short' in samples.notes


@pytest.mark.parametrize('compress', [zstd.compress, lz4.frame.compress])
def test_compressed_messages(tmp_path: Path, compress: Callable[[bytes], bytes]) -> None:
    path = write_file(tmp_path / 'a', moving(20), '.db3')
    with sqlite3.connect(path) as database:
        for row, data in database.execute('SELECT id, data FROM messages').fetchall():
            packed = compress(data) if row != 7 else compress(data)[:20]
            database.execute('UPDATE messages SET data=? WHERE id=?', (packed, row))
    samples = read_bag(path)
    assert (samples.n_samples, samples.counts) == (19, {'message unreadable': 1})


def test_decompression_makes_no_more_than_it_may() -> None:
    bomb = zstd.compress(bytes(2**28))
    assert len(bomb) < 2**16
    assert len(plain_message(bomb)) == 2**26
    assert len(unpacked_chunk(bomb, 'zstd', 1000, is_cut=True)) == 1000
    with pytest.raises(DamageError, match='a chunk has 1001 bytes or more instead of 1000'):
        unpacked_chunk(bomb, 'zstd', 1000, is_cut=False)
    with pytest.raises(DamageError, match='a chunk claims 1099511627776 bytes'):
        unpacked_chunk(bomb, 'zstd', 2**40, is_cut=False)
    with pytest.raises(DamageError, match='a chunk has 5 bytes instead of 6'):
        unpacked_chunk(bz2.compress(b'hello'), 'bz2', 6, is_cut=False)
    with pytest.raises(DamageError, match="compression 'snappy' is unknown"):
        unpacked_chunk(b'', 'snappy', 6, is_cut=False)


def test_sqlite_log_that_was_never_merged_is_read(tmp_path: Path) -> None:
    path = write_file(tmp_path / 'a', moving(30), '.db3')
    database = sqlite3.connect(path)
    database.execute('PRAGMA journal_mode=WAL')
    database.execute('PRAGMA wal_autocheckpoint=0')
    database.execute('DELETE FROM messages WHERE id > 20')
    database.commit()
    kept = {file.name: file.read_bytes() for file in path.parent.iterdir()}
    database.close()
    for name in kept:  # as a killed recorder leaves it
        (path.parent / name).write_bytes(kept[name])
    (path.parent / 'a.db3-shm').unlink()
    log = (path.parent / 'a.db3-wal').read_bytes()
    assert log
    assert read_bag(path).n_samples == 20
    assert path.read_bytes() == kept['a.db3']
    assert (path.parent / 'a.db3-wal').read_bytes() == log

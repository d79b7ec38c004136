"""Files of any making: right notes, and sentences instead of tracebacks."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
import sqlite3

from backports import zstd
import lz4.frame
import pytest
from recording.bag_files import (
    moving,
    State,
    STEP_NS,
    write_file,
    write_mcap,
)

from lip_id_ros.errors import SourceError
from lip_id_ros.loading import load_dataset
from lip_id_ros.preprocessing import describe
from lip_id_ros.recording import read_bag

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


@pytest.mark.parametrize('name', ['a.mcap', 'a.db3', 'a.csv', 'a.npz'])
def test_sources_are_regular_files(tmp_path: Path, name: str) -> None:
    pipe = tmp_path / name
    os.mkfifo(pipe)
    device = tmp_path / f'device_{name}'
    device.symlink_to('/dev/zero')
    for path in (pipe, device):
        for read in (describe, load_dataset):
            with pytest.raises(SourceError, match=r'must be a regular file, but is a'):
                read(path)


def test_empty_path_is_not_the_current_folder() -> None:
    for read in (describe, load_dataset):
        with pytest.raises(SourceError, match=r'^the path of a recording is empty; name'):
            read('')


def test_view_in_place_of_a_table_is_refused(tmp_path: Path) -> None:
    path = write_file(tmp_path / 'a', moving(5), '.db3')
    with sqlite3.connect(path) as database:
        database.execute('ALTER TABLE messages RENAME TO others')
        database.execute('CREATE VIEW messages AS SELECT * FROM others')
    with pytest.raises(SourceError, match="its 'messages' is no table"):
        read_bag(path)


def test_journal_of_an_unfinished_write_is_noted(tmp_path: Path) -> None:
    path = write_file(tmp_path / 'a', moving(20), '.db3')
    (path.parent / f'{path.name}-journal').write_bytes(b'\xd9\xd5\x05\xf9\x20\xa1\x63\xd7' * 100)
    samples = read_bag(path)
    assert samples.n_samples == 20
    assert samples.notes == ('a.db3: a.db3-journal is left of a write that was never finished',)


def test_only_some_of_very_many_topics_are_described(tmp_path: Path) -> None:
    states = [*moving(3)] + [State(STEP_NS, topic=f'/t{k}') for k in range(100)]
    description = describe(write_mcap(tmp_path / 'a.mcap', states))
    assert len(description['topics']) == 101
    assert len(description['recordings']) == 32
    assert '/joint_states' in {each['topic'] for each in description['recordings']}
    assert description['notes'] == [
        'of 101 topics with joint samples the 32 with most messages were read.'
    ]
    with pytest.raises(SourceError, match=r'/t1 \(.*, \d+ more; choose one') as caught:
        read_bag(write_mcap(tmp_path / 'b.mcap', states[3:]))
    assert len(str(caught.value)) < 3000

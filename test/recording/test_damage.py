"""Files broken in the ways that files break: what is left is read, the rest is noted."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
import shutil
import struct
import subprocess
import sys

from backports import zstd
import lz4.frame
from mcap.writer import CompressionType, IndexType
import numpy as np
import pytest
from recording.bag_files import (
    damage,
    moving,
    write_file,
    write_folder,
    write_mcap,
    write_ros1,
)

from lip_id_ros.errors import SourceError
from lip_id_ros.loading import load_dataset
from lip_id_ros.preprocessing import describe
from lip_id_ros.recording import JointSamples, read_bag, Reason

COUNT = 2000
CUT = 'the file was cut short'
Writer = Callable[[Path], Path]

WRITERS: dict[str, Writer] = {
    'mcap': lambda path: write_mcap(path / 'a.mcap', moving(COUNT), chunk_size=20_000),
    'mcap zstd': lambda path: write_mcap(
        path / 'a.mcap', moving(COUNT), CompressionType.ZSTD, chunk_size=20_000
    ),
    'mcap unindexed': lambda path: write_mcap(
        path / 'a.mcap', moving(COUNT), index=IndexType.NONE, chunk_size=20_000
    ),
    'mcap without chunks': lambda path: write_mcap(
        path / 'a.mcap', moving(COUNT), use_chunking=False
    ),
    'sqlite': lambda path: write_file(path / 'a', moving(COUNT), '.db3'),
    'ros1': lambda path: write_ros1(path / 'a.bag', moving(COUNT)),
}


def assert_part_of_clean(samples: JointSamples) -> None:
    k = np.rint(samples.position[:, 0] / 0.01)
    assert (np.diff(k) > 0).all()
    np.testing.assert_allclose(samples.position, np.column_stack([0.01 * k, -0.02 * k]))
    np.testing.assert_allclose(samples.velocity[:, 1], -2.0 + 0.001 * k)
    np.testing.assert_allclose(samples.effort, np.column_stack([3 + k, 4 - k]))
    np.testing.assert_allclose(samples.t, 0.01 * (k - k[0]))


@pytest.mark.parametrize('kind', WRITERS)
@pytest.mark.parametrize('share', [0.1, 0.5, 0.9])
def test_file_cut_short_is_read_as_far_as_it_goes(tmp_path: Path, kind: str, share: float) -> None:
    path = WRITERS[kind](tmp_path)
    os.truncate(path, int(share * path.stat().st_size))
    samples = read_bag(path)
    assert_part_of_clean(samples)
    # the tail of a chunk that is cut, or rows whose page is gone, cannot be had
    assert samples.n_samples > 0.7 * share * COUNT - 100
    assert any(CUT in note for note in samples.notes)


@pytest.mark.parametrize('kind', WRITERS)
@pytest.mark.parametrize('size', [1, 20, 60])
def test_file_cut_to_almost_nothing_is_reported(tmp_path: Path, kind: str, size: int) -> None:
    path = WRITERS[kind](tmp_path)
    os.truncate(path, size)
    with pytest.raises(SourceError, match=rf'^{path} (cannot be read as|must have a topic of) '):
        read_bag(path)


def test_damaged_page_costs_its_rows(tmp_path: Path) -> None:
    path = write_file(tmp_path / 'a', moving(COUNT), '.db3')
    samples = read_bag(damage(path, 4096 * 60, b'\xff' * 4096))
    assert_part_of_clean(samples)
    assert COUNT - 100 < samples.n_samples < COUNT
    assert 'a.db3: rows cannot be read (database disk image is malformed)' in samples.notes


@pytest.mark.parametrize('compression', list(CompressionType))
def test_damaged_chunk_costs_its_messages(tmp_path: Path, compression: CompressionType) -> None:
    path = write_mcap(tmp_path / 'a.mcap', moving(COUNT), compression, chunk_size=20_000)
    places = chunk_places(path.read_bytes(), 'mcap')
    samples = read_bag(damage(path, places[len(places) // 2] + 200, b'\xa5' * 8))
    assert_part_of_clean(samples)
    lost = samples.counts[Reason.LOST]
    assert samples.n_samples + lost == COUNT
    assert lost < 400
    assert any('are damaged' in note for note in samples.notes)


@pytest.mark.parametrize('kind', ['mcap', 'ros1'])
def test_reading_goes_on_after_bytes_that_are_no_record(tmp_path: Path, kind: str) -> None:
    """The head of a record is overwritten: the index gives the next chunk."""
    if kind == 'mcap':
        path = write_mcap(tmp_path / 'a.mcap', moving(COUNT), chunk_size=20_000)
    else:
        path = write_ros1(tmp_path / 'a.bag', moving(COUNT), chunk_bytes=20_000)
    places = chunk_places(path.read_bytes(), kind)
    samples = read_bag(damage(path, places[len(places) // 2], b'\0' * 16))
    assert_part_of_clean(samples)
    assert COUNT - 300 < samples.n_samples < COUNT
    assert any('are damaged' in note for note in samples.notes)


def chunk_places(content: bytes | bytearray, kind: str) -> list[int]:
    places = []
    position = 8 if kind == 'mcap' else 13
    while position < len(content) - 8:
        if kind == 'mcap':
            code, length = struct.unpack_from('<BQ', content, position)
            end = position + 9 + length
            is_chunk = code == 6
        else:
            (length,) = struct.unpack_from('<I', content, position)
            is_chunk = b'op=\x05' in content[position + 4 : position + 4 + length]
            end = position + 4 + length
            end += 4 + struct.unpack_from('<I', content, end)[0]
        if is_chunk:
            places.append(position)
        position = end
    return places


@pytest.mark.parametrize('tail', [bytes(100_000), b'\xff' * 100_000], ids=['zeros', 'ones'])
@pytest.mark.parametrize('kind', ['mcap unindexed', 'ros1'])
def test_tail_that_the_disk_never_wrote(tmp_path: Path, kind: str, tail: bytes) -> None:
    path = WRITERS[kind](tmp_path)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2] + tail)
    samples = read_bag(path)
    assert_part_of_clean(samples)
    assert samples.n_samples > 0.4 * COUNT


def test_one_damaged_file_of_several(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / 'bag', moving(10), '.mcap')
    (folder / 'bag_1.mcap').write_bytes(b'not an mcap file')
    (folder / 'bag_2.mcap').touch()
    samples = read_bag(folder)
    assert samples.n_samples == 10
    assert samples.notes == (
        'metadata.yaml does not name bag_1.mcap',
        'metadata.yaml does not name bag_2.mcap',
        'bag_1.mcap: nothing can be read (it does not begin as an MCAP file does)',
        'bag_2.mcap: nothing can be read (it is empty)',
    )


def test_file_that_metadata_does_not_name_is_read(tmp_path: Path) -> None:
    """A killed recorder had begun another file."""
    states = moving(40)
    folder = write_folder(tmp_path / 'bag', states[:20], '.mcap')
    later = write_file(tmp_path / 'later', states[20:], '.mcap')
    shutil.move(later, folder / 'bag_1.mcap')
    samples = read_bag(folder)
    assert samples.n_samples == 40
    assert samples.notes == ('metadata.yaml does not name bag_1.mcap',)


def test_file_that_is_missing_is_reported(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / 'bag', moving(20), '.mcap')
    metadata = folder / 'metadata.yaml'
    text = metadata.read_text(encoding='utf-8')
    metadata.write_text(text.replace('- bag.mcap', '- bag.mcap\n  - bag_1.mcap', 1))
    samples = read_bag(folder)
    assert samples.n_samples == 20
    assert samples.notes == ('metadata.yaml names bag_1.mcap, which is not there',)


def test_other_format_beside_the_bag_is_left_aside(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / 'bag', moving(20), '.mcap')
    shutil.copy(write_file(tmp_path / 'copy', moving(20), '.db3'), folder / 'converted.db3')
    samples = read_bag(folder)
    assert (samples.n_samples, samples.counts) == (20, {})
    assert samples.notes == ('converted.db3 was left aside',)


@pytest.mark.parametrize(
    'text', ['', '{nonsense', 'rosbag2_bagfile_information: 7', '\udcff'], ids=range(4)
)
def test_metadata_of_any_nonsense(tmp_path: Path, text: str) -> None:
    folder = write_folder(tmp_path / 'bag', moving(5), '.mcap')
    (folder / 'metadata.yaml').write_bytes(text.encode(errors='surrogateescape'))
    samples = read_bag(folder)
    assert samples.n_samples == 5
    assert samples.notes[0].startswith('metadata.yaml cannot be read (')


def test_ros1_bag_that_is_still_active(tmp_path: Path) -> None:
    path = write_ros1(tmp_path / 'a.bag', moving(COUNT), chunk_bytes=20_000)
    os.truncate(path, path.stat().st_size // 2)
    samples = read_bag(path.rename(tmp_path / 'a.bag.active'))
    assert_part_of_clean(samples)
    assert samples.n_samples > 0.4 * COUNT


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


def test_journal_of_an_unfinished_write_is_noted(tmp_path: Path) -> None:
    path = write_file(tmp_path / 'a', moving(20), '.db3')
    (path.parent / f'{path.name}-journal').write_bytes(b'\xd9\xd5\x05\xf9\x20\xa1\x63\xd7' * 100)
    samples = read_bag(path)
    assert samples.n_samples == 20
    assert samples.notes == ('a.db3: a.db3-journal is left of a write that was never finished',)


ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith('linux'), reason='limits memory as Linux does')
def test_broken_bags_never_crash_hang_or_take_memory(tmp_path: Path) -> None:
    ran = subprocess.run(
        [
            *(sys.executable, '-m', 'benchmarks', 'fuzz_readers'),
            *('--cases', '800', '--minutes', '0.5', '--findings', str(tmp_path / 'findings')),
        ],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "'read': " in ran.stdout
    assert "'SourceError': " in ran.stdout

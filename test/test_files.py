"""Files are whole or absent, and damaged npz files are refused."""

from __future__ import annotations

import errno
import fcntl
import io
import json
import os
from pathlib import Path
import stat
from typing import BinaryIO
import zipfile

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from lip_id_ros import files
from lip_id_ros.errors import ConfigError
from lip_id_ros.files import (
    HEADER,
    read_header,
    read_npz,
    require_suffix,
    require_writable,
    scratch_folder,
    write_atomically,
    write_npz,
)

ARRAYS = {'q': np.arange(6.0).reshape(3, 2), 'names': np.array(['a', 'bc'])}


def archive(**arrays: object) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
    return file.getvalue()


GOOD = archive(header_json=np.array('{"version": 1}'), **ARRAYS)


def write_new(file: BinaryIO) -> None:
    file.write(b'new')


def test_write_atomically_writes_the_file(tmp_path: Path) -> None:
    path = tmp_path / 'file'
    write_atomically(path, write_new)
    assert path.read_bytes() == b'new'
    assert os.listdir(tmp_path) == ['file']


def test_a_failing_writer_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / 'file'
    path.write_bytes(b'old')

    def fail(file: BinaryIO) -> None:
        file.write(b'half')
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_atomically(path, fail)
    assert path.read_bytes() == b'old'
    assert os.listdir(tmp_path) == ['file']


def test_a_missing_folder_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"none/file'$"):
        write_atomically(tmp_path / 'none' / 'file', write_new)
    assert os.listdir(tmp_path) == []


def test_permissions_follow_the_mask(tmp_path: Path) -> None:
    mask = os.umask(0o027)
    try:
        write_atomically(tmp_path / 'file', write_new)
    finally:
        os.umask(mask)
    assert stat.S_IMODE((tmp_path / 'file').stat().st_mode) == 0o640


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=10,
)


@pytest.mark.slow
@given(header=st.dictionaries(st.text(), JSON))
def test_round_trip(header: dict[str, object], tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.mktemp('npz') / 'without_suffix'
    write_npz(path, ARRAYS, header)
    arrays, read = read_npz(path)
    assert read == header
    assert arrays.keys() == ARRAYS.keys()
    for name, values in ARRAYS.items():
        np.testing.assert_array_equal(arrays[name], values)


def test_foreign_npz_has_an_empty_header(tmp_path: Path) -> None:
    path = tmp_path / 'file.npz'
    path.write_bytes(archive(q=np.ones(3)))
    arrays, header = read_npz(path)
    assert header == {}
    np.testing.assert_array_equal(arrays['q'], np.ones(3))


def check_refused(path: Path, content: bytes, sentence: str) -> None:
    path.write_bytes(content)
    with pytest.raises(ValueError, match=sentence):
        read_npz(path)


def test_bad_headers_are_refused(tmp_path: Path) -> None:
    path = tmp_path / 'file.npz'
    not_json, not_object = np.array('{'), np.array(json.dumps([1]))
    check_refused(path, archive(**{HEADER: not_json}), 'Expecting property name')
    check_refused(path, archive(**{HEADER: not_object}), 'the header is not a JSON object')


def test_pickled_objects_are_refused(tmp_path: Path) -> None:
    content = archive(q=np.array([object], dtype=object))
    check_refused(tmp_path / 'file.npz', content, 'Object arrays cannot be loaded')


def test_an_archive_with_a_missing_end_is_refused(tmp_path: Path) -> None:
    for length in range(0, len(GOOD), 7):
        check_refused(tmp_path / 'file.npz', GOOD[:length], 'npz archive, or only a part of one')


@given(place=st.integers(0, len(GOOD) - 1), bit=st.integers(0, 7))
def test_a_flipped_bit_is_seen_or_harmless(
    place: int, bit: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    damaged = bytearray(GOOD)
    damaged[place] ^= 1 << bit
    path = tmp_path_factory.mktemp('npz') / 'file.npz'
    path.write_bytes(damaged)
    try:
        arrays, _ = read_npz(path)
    except ValueError:
        return
    for name in arrays.keys() & ARRAYS.keys():
        np.testing.assert_array_equal(arrays[name], ARRAYS[name])


def test_a_link_is_followed_and_the_mode_is_kept(tmp_path: Path) -> None:
    target, link = tmp_path / 'target', tmp_path / 'link'
    target.write_bytes(b'old')
    target.chmod(0o600)
    link.symlink_to('target')
    write_atomically(link, write_new)
    assert link.is_symlink()
    assert target.read_bytes() == b'new'
    assert stat.S_IMODE(target.stat().st_mode) == 0o600


def test_temporary_files_of_killed_writes_are_swept(tmp_path: Path) -> None:
    name = f'.file.{"0123456789abcdef" * 2}'
    left, in_use, young, foreign, other = (
        tmp_path / each
        for each in (name, f'{name[:-1]}e', f'{name[:-1]}d', '.file.notes', f'.other{name[5:]}')
    )
    for path in (left, in_use, young, foreign, other):
        path.write_bytes(b'half')
        if path != young:
            os.utime(path, (0, 0))
    with open(in_use, 'rb') as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        write_atomically(tmp_path / 'file', write_new)
    assert {path.name for path in tmp_path.iterdir()} == {
        'file', in_use.name, young.name, foreign.name, other.name
    }  # fmt: skip


def test_a_place_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    require_writable(tmp_path / 'file')
    assert list(tmp_path.iterdir()) == []
    for path, reason in ((tmp_path, 'Is a directory'), (tmp_path / 'no' / 'file', 'No such file')):
        with pytest.raises(
            ConfigError, match=rf'^{path} cannot be written \({reason}.*; name ano'
        ):
            require_writable(path)


def test_a_failed_write_names_its_file(tmp_path: Path) -> None:
    def fail(file: BinaryIO) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.raises(OSError, match='No space') as failed:
        write_atomically(tmp_path / 'file', fail)
    assert failed.value.filename == str(tmp_path / 'file')


def test_a_suffix_is_that_of_the_format() -> None:
    require_suffix('b/a.npz', '.npz', 'the data set')
    for path in ('a', 'a.csv', 'npz'):
        sentence = rf'^{path} must end in .npz, the format of the data set; rename it\.$'
        with pytest.raises(ConfigError, match=sentence):
            require_suffix(path, '.npz', 'the data set')


def test_what_an_archive_claims_is_not_believed(tmp_path: Path) -> None:
    member, packed = io.BytesIO(), io.BytesIO()
    claim = {'descr': '<f8', 'fortran_order': False, 'shape': (10**12,)}
    np.lib.format.write_array_header_1_0(member, claim)
    with zipfile.ZipFile(packed, 'w') as file:
        file.writestr('q.npy', member.getvalue())
    check_refused(tmp_path / 'a', packed.getvalue(), r'an array of shape .1000000000000,. in only')
    deep = archive(header_json=np.array('[' * 100_000))
    check_refused(tmp_path / 'b', deep, 'nested too deeply|not a JSON')


def test_an_archive_that_expands_beyond_measure_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / 'file.npz').write_bytes(archive(q=np.zeros(1_000_000)))
    assert len(read_npz(tmp_path / 'file.npz')[0]['q']) == 1_000_000
    monkeypatch.setattr(files, 'LARGE_BYTES', 1_000_000)
    with pytest.raises(ValueError, match='that expand to 8000'):
        read_npz(tmp_path / 'file.npz')


def test_the_header_alone_is_read(tmp_path: Path) -> None:
    (tmp_path / 'file.npz').write_bytes(GOOD)
    assert read_header(tmp_path / 'file.npz') == {'version': 1}


@pytest.mark.parametrize(
    ('cause', 'number'),
    [
        (OSError(errno.ESTALE, 'Stale file handle'), errno.ESTALE),
        (OSError(errno.EIO, 'Input/output error'), errno.EIO),
        (MemoryError(), errno.ENOMEM),
    ],
)
def test_a_disk_that_fails_is_not_a_damaged_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cause: Exception, number: int
) -> None:
    path = tmp_path / 'file.npz'
    path.write_bytes(GOOD)

    def fail(*values: object) -> None:
        raise cause

    monkeypatch.setattr('zipfile.ZipFile.open', fail)
    with pytest.raises(OSError, match=r'\[Errno') as failed:
        read_npz(path)
    assert failed.value.errno == number


def test_a_disk_without_locks_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def unsupported(*values: object) -> None:
        raise OSError(errno.ENOLCK, 'No locks available')

    monkeypatch.setattr(fcntl, 'flock', unsupported)
    write_atomically(tmp_path / 'file', write_new)
    assert (tmp_path / 'file').read_bytes() == b'new'
    with scratch_folder() as folder:
        assert Path(folder).is_dir()
    assert not Path(folder).exists()


def test_a_folder_in_use_is_not_swept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('tempfile.tempdir', str(tmp_path))
    with scratch_folder() as first:
        os.utime(first, (0, 0))
        with scratch_folder():
            assert Path(first).is_dir()
    (tmp_path / f'{files.SCRATCH}link').symlink_to(tmp_path / 'elsewhere')
    (tmp_path / 'elsewhere').mkdir()
    os.utime(tmp_path / f'{files.SCRATCH}link', (0, 0), follow_symlinks=False)
    with scratch_folder():
        assert (tmp_path / 'elsewhere').is_dir()


@pytest.mark.parametrize('path', ['/', '', '/tmp/'])
def test_a_folder_is_no_place_for_a_file(path: str) -> None:
    with pytest.raises(IsADirectoryError, match=rf"Is a directory: '{path}'$"):
        write_atomically(path, write_new)

"""Files are whole or absent, and what is no good npz is told from what is."""

from __future__ import annotations

import io
import json
import os
from pathlib import Path
import stat
from typing import BinaryIO

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from lip_id_ros.files import HEADER, read_npz, write_atomically, write_npz

ARRAYS = {'q': np.arange(6.0).reshape(3, 2), 'names': np.array(['a', 'bc'])}


def archive(**arrays: object) -> bytes:
    """Return the bytes of an npz file."""
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


def test_a_file_for_a_folder_is_an_os_error(tmp_path: Path) -> None:
    (tmp_path / 'file').touch()
    with pytest.raises(NotADirectoryError, match=r"file/inner'$"):
        write_atomically(tmp_path / 'file' / 'inner', write_new)


def test_a_folder_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / 'folder').mkdir()
    with pytest.raises(IsADirectoryError, match='folder'):
        write_atomically(tmp_path / 'folder', write_new)
    assert os.listdir(tmp_path) == ['folder']


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


@given(header=st.dictionaries(st.text(), JSON))
def test_npz_round_trip(
    header: dict[str, object], tmp_path_factory: pytest.TempPathFactory
) -> None:
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


def test_an_npy_file_is_refused(tmp_path: Path) -> None:
    file = io.BytesIO()
    np.save(file, np.ones(3))
    check_refused(tmp_path / 'file.npz', file.getvalue(), 'not an npz archive')


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


@given(content=st.binary(max_size=200))
def test_random_bytes_are_refused(
    content: bytes, tmp_path_factory: pytest.TempPathFactory
) -> None:
    check_refused(tmp_path_factory.mktemp('npz') / 'file', content, 'not an npz archive')


def test_a_missing_file_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r'nothing\.npz'):
        read_npz(tmp_path / 'nothing.npz')

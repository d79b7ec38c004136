from __future__ import annotations

import os
from pathlib import Path
from typing import Any
from unittest.mock import patch

from fleet.logs import logged
from fleet.stores import upload
import fsspec
import pytest
from simulation.pendulums import swing

from lip_id_ros.errors import ConfigError, SourceError
from lip_id_ros.fleet import sources, stored_files
from lip_id_ros.fleet.sources import find, StoredRecording
from lip_id_ros.fleet.stored_files import ATTEMPTS, fetch, StoredFile
from lip_id_ros.recording import read_bag
from lip_id_ros.simulation import write_bag

CUSTOM = """
rosbag2_bagfile_information:
  relative_file_paths: [run.mcap]
  custom_data: {robot: r2}
"""


@pytest.fixture
def bags(tmp_path: Path) -> Path:
    for name in ('arm1/run', 'arm2/run'):
        (tmp_path / name).parent.mkdir()
        write_bag(tmp_path / name, swing(0, rate=20.0), start=1.7e9)
    (tmp_path / 'alone.mcap').write_bytes(
        next((tmp_path / 'arm1/run').glob('*.mcap')).read_bytes()
    )
    (tmp_path / 'notes.txt').write_text('nothing')
    return tmp_path


def names(found: list[StoredRecording], folder: Path) -> list[str]:
    return [os.path.relpath(each.name, folder) for each in found]


def test_a_folder_of_recordings_is_searched(bags: Path) -> None:
    found = find([str(bags)])
    assert names(found, bags) == ['alone.mcap', 'arm1/run', 'arm2/run']
    assert [each.is_folder for each in found] == [False, True, True]
    assert all(each.size > 1000 for each in found)


def test_patterns_name_files_or_bags(bags: Path) -> None:
    assert names(find([f'{bags}/**/*.mcap']), bags) == [
        'alone.mcap',
        'arm1/run/run.mcap',
        'arm2/run/run.mcap',
    ]
    assert names(find([f'{bags}/arm*/run', f'{bags}/arm1']), bags) == ['arm1/run', 'arm2/run']


def test_a_name_with_the_letters_of_patterns_is_a_name_where_it_exists(tmp_path: Path) -> None:
    write_bag(tmp_path / 'run[1]', swing(0, rate=20.0))
    assert names(find([str(tmp_path / 'run[1]')]), tmp_path) == ['run[1]']


@pytest.mark.parametrize('pattern', ['none', '**/*.bag', 'notes.txt'])
def test_a_pattern_that_names_nothing_is_refused(bags: Path, pattern: str) -> None:
    with pytest.raises(SourceError, match=r'must name recordings, but there is none; correct it'):
        find([str(bags / pattern)])


def test_an_unknown_kind_of_store_is_refused() -> None:
    with pytest.raises(ConfigError, match=r'nonsense://a must be a path or a URL that fsspec'):
        find(['nonsense://a'])


def test_groups_are_searched_for_in_the_address(bags: Path) -> None:
    assert [each.group for each in find([str(bags / 'arm*')], r'(arm\d)')] == ['arm1', 'arm2']
    assert [each.group for each in find([str(bags)])] == ['', '', '']


@pytest.mark.parametrize(
    ('group_by', 'message'),
    [
        (r'(arm\d', r'must be a regular expression, but .* is none'),
        (r'arm\d', r'must have one group in parentheses, but .* has 0'),
        (r'(arm\d)', r'must match every recording, but .* does not match .*alone\.mcap'),
        ('metadata:robot', r'needs robot in custom_data of the metadata\.yaml of .*alone'),
    ],
)
def test_groups_that_cannot_be_found_are_named(bags: Path, group_by: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        find([str(bags)], group_by)


def test_groups_of_metadata(bags: Path) -> None:
    (bags / 'arm2/run/metadata.yaml').write_text(CUSTOM)
    assert [each.group for each in find([str(bags / 'arm2')], 'metadata:robot')] == ['r2']


def test_fingerprints_follow_the_content(bags: Path) -> None:
    first = {each.name: each.fingerprint for each in find([str(bags)])}
    assert len(set(first.values())) == 3
    assert {each.name: each.fingerprint for each in find([str(bags)])} == first
    path = bags / 'alone.mcap'
    status = path.stat()
    path.write_bytes(path.read_bytes()[:-1] + b'?')
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    changed = {each.name: each.fingerprint for each in find([str(bags)])}
    assert {name for name in first if first[name] != changed[name]} == {str(path)}
    os.renames(path, bags / 'renamed.mcap')
    (renamed,) = find([str(bags / 'renamed.mcap')])
    assert renamed.fingerprint == changed[str(path)]


def test_recordings_of_a_store_are_those_of_the_disk(bags: Path) -> None:
    store = 'memory:///bags'
    upload(bags, store)
    found = find([f'{store}/'], r'(arm\d|alone)')
    assert [each.name.removeprefix(store) for each in found] == [
        '/alone.mcap',
        '/arm1/run',
        '/arm2/run',
    ]
    assert [each.group for each in found] == ['alone', 'arm1', 'arm2']
    assert find([f'{store}/'], r'(arm\d|alone)') == found
    assert [each.name for each in find([f'{store}/**/*.mcap'])] == [
        f'{store}/alone.mcap',
        f'{store}/arm1/run/run.mcap',
        f'{store}/arm2/run/run.mcap',
    ]
    for there, here in zip(found, find([str(bags)]), strict=True):
        assert there.size == here.size
        with there.local() as path:
            assert (read_bag(path).position == read_bag(here.name).position).all()
            copied = Path(path)
        assert not copied.exists()


class Broken:
    """A remote file whose connection breaks after some bytes, a number of times."""

    breaks = 0

    def __init__(self, file: Any) -> None:
        self._file = file

    def __enter__(self) -> Broken:
        return self

    def __exit__(self, *error: object) -> None:
        self._file.close()

    def seek(self, place: int) -> None:
        self._file.seek(place)

    def read(self, size: int) -> bytes:
        if Broken.breaks and self._file.tell():
            Broken.breaks -= 1
            raise ConnectionResetError('reset by peer')
        block: bytes = self._file.read(10)
        return block


@pytest.mark.parametrize('breaks', [0, 2, ATTEMPTS - 1, ATTEMPTS])
def test_a_connection_that_breaks_is_continued_and_logged(tmp_path: Path, breaks: int) -> None:
    content = bytes(range(100))
    system = fsspec.filesystem('memory')
    system.pipe_file('/broken/run.mcap', content)
    ((file,),) = (each.files for each in find(['memory://broken/run.mcap']))
    Broken.breaks = breaks
    waits: list[float] = []
    plain = type(system)._open

    def open_broken(self: Any, path: str, *rest: Any, **options: Any) -> Broken:
        return Broken(plain(self, path, *rest, **options))

    def copy() -> None:
        fetch(file, tmp_path / 'copy', waits.append)

    with logged(stored_files.__name__) as lines, patch.object(type(system), '_open', open_broken):
        if breaks == ATTEMPTS:
            with pytest.raises(SourceError, match=rf'the connection broke {ATTEMPTS} times'):
                copy()
        else:
            copy()
            assert (tmp_path / 'copy').read_bytes() == content
    assert waits == list(stored_files.WAITS_S)[: len(waits)]
    assert len(waits) == min(breaks, ATTEMPTS - 1)
    assert len(lines) == len(waits)
    assert all('connection broke after 10 bytes' in line for line in lines)


def test_what_is_gone_is_not_waited_for(tmp_path: Path) -> None:
    waits: list[float] = []
    gone = StoredFile('memory://nowhere/run.mcap', 10, '')
    with pytest.raises(FileNotFoundError, match='memory://nowhere/run'):
        fetch(gone, tmp_path / 'copy', waits.append)
    assert waits == []


def test_a_copy_that_does_not_fit_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    fsspec.filesystem('memory').pipe_file('/large/run.mcap', b'bytes')
    (found,) = find(['memory://large'])
    monkeypatch.setattr(sources, 'SPARE_BYTES', 2**60)
    with (
        pytest.raises(SourceError, match=r'needs 5 bytes in .* are free; free some, or set'),
        found.local(),
    ):
        pass

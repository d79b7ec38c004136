from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
import os
from pathlib import Path
import shutil
import subprocess
import tempfile

from fleet.logs import logged
import pytest
from test_imports import BASE, PARTS

from lip_id_ros.fleet import cache
from lip_id_ros.fleet.cache import FolderCache

KEY, OTHER = 64 * 'a' + '.survey', 'ab' + 62 * '0' + '.refusal'
CONTENT = bytes(range(256)) * 40
NOBODY = 65534


def entries(folder: str | Path) -> list[Path]:
    return [path for path in Path(folder).rglob('*') if path.is_file()]


def test_what_was_put_comes_back(tmp_path: Path) -> None:
    kept = FolderCache(tmp_path / 'new' / 'folder')
    assert kept.get(KEY) is None
    kept[KEY] = CONTENT
    assert kept.get(KEY) == CONTENT
    assert kept.get(OTHER) is None
    kept[OTHER] = b''
    assert kept.get(OTHER) == b''


@pytest.mark.parametrize('share', [0.0, 0.3, 0.9])
def test_a_damaged_entry_is_removed_and_made_anew(tmp_path: Path, share: float) -> None:
    kept = FolderCache(tmp_path)
    kept[KEY] = CONTENT
    (entry,) = entries(tmp_path)
    content = entry.read_bytes()
    entry.write_bytes(content[: int(share * len(content))])
    assert kept.get(KEY) is None
    assert not entry.exists()
    kept[KEY] = CONTENT
    assert kept.get(KEY) == CONTENT


def test_a_flipped_bit_is_noticed(tmp_path: Path) -> None:
    kept = FolderCache(tmp_path)
    kept[KEY] = CONTENT
    (entry,) = entries(tmp_path)
    content = bytearray(entry.read_bytes())
    content[len(content) // 2] ^= 1
    entry.write_bytes(content)
    assert kept.get(KEY) is None


def test_fits_that_run_at_once_see_whole_entries(tmp_path: Path) -> None:
    def use(seed: int) -> bool:
        kept = FolderCache(tmp_path)
        for _ in range(30):
            kept[KEY] = CONTENT
            if kept.get(KEY) != CONTENT:
                return False
        return True

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(use, range(4)))
    assert [each.name for each in entries(tmp_path)] == [KEY]


def test_another_version_reads_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    FolderCache(tmp_path)[KEY] = CONTENT
    monkeypatch.setattr(cache, 'code_version', lambda: 'another')
    later = FolderCache(tmp_path)
    assert later.get(KEY) is None


def test_a_folder_that_cannot_be_written_costs_one_warning(tmp_path: Path) -> None:
    (tmp_path / 'file').touch()
    kept = FolderCache(tmp_path / 'file')
    with logged(cache.__name__) as lines:
        kept[KEY] = CONTENT
        kept[OTHER] = CONTENT
    assert kept.get(KEY) is None
    (line,) = lines
    assert line.startswith('results are not kept, since ')


def test_the_version_follows_all_sources_that_results_depend_on() -> None:
    root = Path(cache.__file__).parents[1]
    assert all((root / name).exists() for name in cache.MADE_BY)
    needed, waiting = set(BASE), ['fleet']
    while waiting:
        room = waiting.pop()
        waiting += PARTS[room] - needed
        needed |= {room, *PARTS[room]}
    messages = {'errors', 'progress'}
    assert needed - messages == {Path(name).stem for name in cache.MADE_BY}
    assert len(cache.code_version()) == 16


def test_another_version_of_a_package_is_another_version(monkeypatch: pytest.MonkeyPatch) -> None:
    here = cache.code_version()
    fresh = cache.code_version.__wrapped__
    assert fresh() == here
    monkeypatch.setattr(cache, 'version', lambda name: '9.9' if name == 'numba' else '1')
    assert fresh() != here


@contextmanager
def mounted(folder: Path, *options: str) -> Iterator[None]:
    mount, unmount = shutil.which('mount'), shutil.which('umount')
    if mount is None or unmount is None:
        pytest.skip('there is no mount')
    command = [mount, *options, str(folder)]
    if subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip('mounting needs rights that are missing here')
    try:
        yield
    finally:
        subprocess.run([unmount, str(folder)], check=True)


@pytest.fixture
def read_only(tmp_path: Path) -> Iterator[Path]:
    FolderCache(tmp_path)[KEY] = CONTENT
    with mounted(tmp_path, '--bind', str(tmp_path)):
        subprocess.run(['mount', '-o', 'remount,bind,ro', str(tmp_path)], check=True)
        yield tmp_path


def test_a_full_disk_costs_one_warning_and_leaves_no_halves(tmp_path: Path) -> None:
    with mounted(tmp_path, '-t', 'tmpfs', '-o', 'size=32k', 'tmpfs'):
        kept = FolderCache(tmp_path)
        kept[KEY] = CONTENT
        with logged(cache.__name__) as lines:
            kept[OTHER] = kept[64 * 'c' + '.survey'] = 20 * CONTENT
        assert kept.get(KEY) == CONTENT
        assert [path.name for path in entries(tmp_path)] == [KEY]
    (line,) = lines
    assert 'No space left on device' in line


def test_a_cache_that_cannot_be_written_is_read(read_only: Path) -> None:
    with pytest.raises(OSError, match='Read-only'):
        (read_only / 'more').touch()
    assert FolderCache(read_only).get(KEY) == CONTENT


@pytest.mark.skipif(os.geteuid() != 0, reason='only root can become another user')
def test_a_cache_of_another_user_is_read() -> None:
    with tempfile.TemporaryDirectory(dir='/tmp') as folder:
        os.chmod(folder, 0o755)
        kept = FolderCache(folder)
        kept[KEY] = CONTENT
        (entry,) = entries(folder)
        with as_user(NOBODY), logged(cache.__name__) as lines:
            readable = os.access(entry, os.R_OK, effective_ids=True)
            writable = os.access(entry, os.W_OK, effective_ids=True)
            assert (readable, writable) == (True, False)
            assert kept.get(KEY) == CONTENT
            kept[OTHER] = CONTENT
        assert kept.get(OTHER) is None
        (line,) = lines
        assert 'Permission denied' in line


@contextmanager
def as_user(number: int) -> Iterator[None]:
    os.setresuid(number, number, 0)
    try:
        yield
    finally:
        os.setresuid(0, 0, 0)


@pytest.mark.skipif(os.geteuid() != 0, reason='only root can become a user without an entry')
def test_a_user_without_a_home_has_a_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ('HOME', 'XDG_CACHE_HOME'):
        monkeypatch.delenv(name, raising=False)
    cache.code_version()  # the sources may be closed to others
    with tempfile.TemporaryDirectory(dir='/tmp') as folder:
        os.chmod(folder, 0o777)
        monkeypatch.setattr('tempfile.tempdir', folder)
        with as_user(12345):
            kept = FolderCache(cache.default_folder())
            kept[KEY] = CONTENT
            assert kept.get(KEY) == CONTENT
        (entry,) = entries(Path(folder) / 'cache_of_12345' / 'lip_id_ros' / 'fleet')
        assert entry.name == KEY

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from fleet.logs import logged
import pytest
from test_imports import BASE, PARTS

from lip_id_ros.fleet import cache
from lip_id_ros.fleet.cache import FolderCache

KEY, OTHER = 64 * 'a' + '.survey', 'ab' + 62 * '0' + '.refusal'
CONTENT = bytes(range(256)) * 40


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

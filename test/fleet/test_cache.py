from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
import os
from pathlib import Path
import time

from fleet.logs import logged
import numpy as np
import pytest

from lip_id_ros.fleet import cache
from lip_id_ros.fleet.cache import entries, FolderCache, prune, unused_for

KEY, OTHER = 64 * 'a', 'ab' + 62 * '0'
ARRAYS = {'R': np.triu(np.arange(9.0).reshape(3, 3)), 'text': np.array('{"key": 1}')}


def test_what_was_put_comes_back(tmp_path: Path) -> None:
    kept = FolderCache(tmp_path / 'new' / 'folder')
    assert kept.get(KEY) is None
    kept.put(KEY, ARRAYS)
    found = kept.get(KEY)
    assert found is not None
    assert found.keys() == ARRAYS.keys()
    np.testing.assert_array_equal(found['R'], ARRAYS['R'])
    assert str(found['text']) == str(ARRAYS['text'])
    assert kept.get(OTHER) is None


@pytest.mark.parametrize('share', [0.0, 0.3, 0.9])
def test_a_damaged_entry_is_removed_and_made_anew(tmp_path: Path, share: float) -> None:
    kept = FolderCache(tmp_path)
    kept.put(KEY, ARRAYS)
    (entry,) = entries(tmp_path)
    content = entry.path.read_bytes()
    entry.path.write_bytes(content[: int(share * len(content))])
    assert kept.get(KEY) is None
    assert not entry.path.exists()
    kept.put(KEY, ARRAYS)
    assert kept.get(KEY) is not None


def test_a_flipped_bit_is_noticed(tmp_path: Path) -> None:
    kept = FolderCache(tmp_path)
    kept.put(KEY, {'noise': np.random.default_rng(0).normal(size=1000)})
    (entry,) = entries(tmp_path)
    content = bytearray(entry.path.read_bytes())
    content[len(content) // 2] ^= 1
    entry.path.write_bytes(content)
    assert kept.get(KEY) is None


def test_fits_that_run_at_once_see_whole_entries(tmp_path: Path) -> None:
    def use(seed: int) -> bool:
        kept = FolderCache(tmp_path)
        for _ in range(30):
            kept.put(KEY, ARRAYS)
            found = kept.get(KEY)
            if found is None or found.keys() != ARRAYS.keys():
                return False
        return True

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(use, range(4)))
    assert [each.path.name for each in entries(tmp_path)] == [f'{KEY}.npz']


def test_another_version_of_the_code_reads_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    FolderCache(tmp_path).put(KEY, ARRAYS)
    monkeypatch.setattr(cache, 'code_version', lambda: 'another')
    later = FolderCache(tmp_path)
    assert later.get(KEY) is None
    later.put(OTHER, ARRAYS)
    old = [each for each in entries(tmp_path) if not each.is_current]
    assert [each.path.stem for each in old] == [KEY]
    assert prune(old) == old[0].size
    assert [each.path.stem for each in entries(tmp_path)] == [OTHER]
    assert [each.name for each in tmp_path.iterdir()] == ['another']


def test_entries_that_were_used_lately_are_kept(tmp_path: Path) -> None:
    kept = FolderCache(tmp_path)
    for key in (KEY, OTHER):
        kept.put(key, ARRAYS)
    long_ago = time.time() - 40 * 86400
    for each in entries(tmp_path):
        os.utime(each.path, (long_ago, long_ago))
    kept.get(OTHER)
    assert [each.path.stem for each in unused_for(list(entries(tmp_path)), 30)] == [KEY]


def test_a_folder_that_cannot_be_written_costs_one_warning(tmp_path: Path) -> None:
    (tmp_path / 'file').touch()
    kept = FolderCache(tmp_path / 'file')
    with logged(cache.__name__) as lines:
        kept.put(KEY, ARRAYS)
        kept.put(OTHER, ARRAYS)
    assert kept.get(KEY) is None
    (line,) = lines
    assert line.startswith('results are not kept, since ')


def test_the_version_follows_the_sources() -> None:
    root = Path(cache.__file__).parents[1]
    assert all((root / name).exists() for name in cache.MADE_BY)
    assert len(cache.code_version()) == 16

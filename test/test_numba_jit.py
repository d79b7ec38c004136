"""Compiled code is kept from run to run, and made anew when a formula changes in any module."""

from __future__ import annotations

from collections.abc import Mapping
import os
from pathlib import Path
import shutil
import subprocess
import sys
from types import MappingProxyType

import numpy as np
import pytest

from lip_id_ros.numba_jit import in_threads

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[1]

INNER = """
from lip_id_ros.numba_jit import jit

@jit
def inner(x: float) -> float:
    return {factor} * x
"""

OUTER = """
from inner import inner
from lip_id_ros.numba_jit import jit

@jit
def outer(x: float) -> float:
    return inner(x)

value = outer(1.0)
print(value, sum(outer.stats.cache_hits.values()))
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / 'inner.py').write_text(INNER.format(factor=2.0))
    (tmp_path / 'outer.py').write_text(OUTER)
    return tmp_path


def environment() -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if name != 'NUMBA_CACHE_DIR'}
    return kept | {'PYTHONPATH': str(ROOT), 'PYTHONDONTWRITEBYTECODE': '1'}


def run(folder: Path, more: Mapping[str, str] = MappingProxyType({})) -> tuple[float, int]:
    """Return what the outer function computes in a new process, and how often from disk."""
    ran = subprocess.run(
        [sys.executable, 'outer.py'],
        cwd=folder,
        env={**environment(), **more},
        capture_output=True,
        text=True,
        check=True,
    )
    value, hits = ran.stdout.split()
    return float(value), int(hits)


def test_code_for_types_that_are_gone_is_discarded(folder: Path) -> None:
    """A type of the package that moved to another module must not end the program."""
    typed = 'from typing import NamedTuple\n\nclass Pair(NamedTuple):\n    x: float\n'
    (folder / 'gone.py').write_text(typed)
    source = OUTER.replace('x: float', 'x').replace('inner(x)', 'inner(x.x)')
    source = source.replace('outer(1.0)', 'outer(Pair(1.0))')
    # the file of the function itself stays as it is
    outer = 'from pair import Pair\n' + source
    (folder / 'pair.py').write_text('from gone import Pair')
    (folder / 'outer.py').write_text(outer)
    assert run(folder) == (2.0, 0)
    (folder / 'inner.py').write_text(INNER.format(factor=3.0))
    (folder / 'gone.py').unlink()
    (folder / 'pair.py').write_text(typed)
    assert run(folder) == (3.0, 0)


def test_damaged_code_is_compiled_anew(folder: Path) -> None:
    """A robot is switched off while files are written."""
    run(folder)
    for kind, length in (('nbi', 20), ('nbc', 0)):
        for path in folder.glob(f'__pycache__/outer.outer*.{kind}'):
            os.truncate(path, length)
        assert run(folder) == (2.0, 0), (kind, length)
        assert run(folder) == (2.0, 1), (kind, length)


INSTEAD_OF_WRITING = """
from numba.core.caching import IndexDataCacheFile
import os
write = IndexDataCacheFile._save_data

def without_outer(self, name, data):
    if name.startswith('outer'):
        {instead}
    write(self, name, data)

IndexDataCacheFile._save_data = without_outer
import outer
"""


def ended(folder: Path, program: str = 'instead.py') -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, program],
        cwd=folder,
        env=environment(),
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_process_killed_between_index_and_code_leaves_no_code_of_another_source(
    folder: Path,
) -> None:
    (folder / 'instead.py').write_text(INSTEAD_OF_WRITING.format(instead='os._exit(9)'))
    run(folder)
    (folder / 'outer.py').write_text(OUTER.replace('inner(x)', '10.0 * inner(x)'))
    assert ended(folder).returncode == 9
    assert run(folder)[0] == 20.0


def test_a_full_disk_does_not_end_the_program(folder: Path) -> None:
    full = "raise OSError(28, 'No space left on device')"
    (folder / 'instead.py').write_text(INSTEAD_OF_WRITING.format(instead=full))
    assert ended(folder).stdout == '2.0 0\n'


COMPILED = """
from lip_id_ros.room import (
    constants,
)
from lip_id_ros.numba_jit import jit

FACTOR = constants.FACTOR

@jit
def outer(x: float) -> float:
    return FACTOR * x
"""

MAIN = """
from lip_id_ros.compiled import outer
print(outer(1.0), sum(outer.stats.cache_hits.values()))
"""


def test_only_a_change_in_what_a_module_imports_is_seen(tmp_path: Path) -> None:
    package = tmp_path / 'lip_id_ros'
    (package / 'room').mkdir(parents=True)
    shutil.copy(ROOT / 'lip_id_ros' / 'numba_jit.py', package)
    for name in ('__init__', 'room/__init__', 'other'):
        (package / f'{name}.py').touch()
    (package / 'room' / 'numbers.py').write_text('FACTOR = 2.0\n')
    (package / 'room' / 'constants.py').write_text(
        'def _late() -> None:\n    import lip_id_ros.other\n\n'
        'from lip_id_ros.room.numbers import FACTOR\n'
    )
    (package / 'compiled.py').write_text(COMPILED)
    (tmp_path / 'outer.py').write_text(MAIN)
    (package / 'stranger.py').write_text('FACTOR = 1.0\n')
    path = {'PYTHONPATH': str(tmp_path)}
    assert run(tmp_path, path) == (2.0, 0)
    (package / 'stranger.py').write_text('FACTOR = 5.0\n')
    assert run(tmp_path, path) == (2.0, 1)
    (package / 'room' / 'numbers.py').write_text('FACTOR = 3.0\n')
    assert run(tmp_path, path) == (3.0, 0)
    (package / 'other.py').write_text('FACTOR = 3.0\n')
    assert run(tmp_path, path) == (3.0, 0)


@pytest.mark.parametrize('cores', [1, 2, 7])
@pytest.mark.parametrize('count', [0, 1, 11, 100])
def test_all_threads_evaluate_each_state_once(
    monkeypatch: pytest.MonkeyPatch, cores: int, count: int
) -> None:
    monkeypatch.setattr(os, 'cpu_count', lambda: cores)
    times = np.zeros(count, dtype=int)

    def work(rows: slice) -> None:
        times[rows] += 1

    in_threads(work, count, few=10)
    assert (times == 1).all()


def test_an_error_in_any_thread_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, 'cpu_count', lambda: 3)

    def work(rows: slice) -> None:
        if rows.stop == 100:
            raise ArithmeticError

    with pytest.raises(ArithmeticError):
        in_threads(work, 100, few=10)

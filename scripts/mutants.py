"""
Try deliberate bugs: each must fail a test.

scripts/mutants.toml has the table. Each mutant replaces one text in a copy of the sources and runs
the tests that should catch it. A mutant survives if they pass.

"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
TABLE = Path(__file__).with_suffix('.toml')
COPIED = ('benchmarks', 'config', 'docs', 'examples', 'launch', 'lip_id_ros', 'scripts', 'test')
MOST_SURVIVORS = 0.05
PASSED, FAILED = 0, 1  # exit statuses of pytest


class Mutant(NamedTuple):
    """A replacement in a module of the package, and the tests that should catch it."""

    name: str
    file: str
    old: str
    new: str
    tests: list[str]


class MutantError(Exception):
    """A mutant that cannot be tried."""


def read_table(path: Path = TABLE) -> list[Mutant]:
    """Read the table."""
    return [Mutant(**entry) for entry in tomllib.loads(path.read_text('utf-8'))['mutant']]


def mutated(text: str, mutant: Mutant) -> str:
    """
    Return the source with the bug.

    Raises
    ------
    MutantError
        If the old text does not occur exactly once.

    """
    count = text.count(mutant.old)
    if count != 1:
        raise MutantError(f'{mutant.file} must have {mutant.old!r} once, not {count} times.')
    return text.replace(mutant.old, mutant.new)


def survives(mutant: Mutant, copy: Path) -> bool:
    """
    Run the tests of a mutant in a copy of the project.

    Raises
    ------
    MutantError
        If the tests cannot be run.

    """
    source = copy / mutant.file
    text = source.read_text('utf-8')
    source.write_text(mutated(text, mutant), 'utf-8')
    try:
        ran = run_tests(mutant.tests, copy)
    finally:
        source.write_text(text, 'utf-8')
    if ran.returncode not in (PASSED, FAILED):
        raise MutantError(f'pytest ended with status {ran.returncode}: {ran.stdout[-300:]}')
    return ran.returncode == PASSED


def run_tests(tests: list[str], copy: Path) -> subprocess.CompletedProcess[str]:
    """Run tests on the copy rather than on the built package."""
    path = os.pathsep.join([str(copy), os.environ.get('PYTHONPATH', '')])
    return subprocess.run(
        [sys.executable, '-m', 'pytest', '-q', '-x', '-p', 'no:cacheprovider', *tests],
        cwd=copy,
        env={**os.environ, 'PYTHONPATH': path},
        capture_output=True,
        text=True,
        check=False,
    )


def copy_project(folder: Path) -> Path:
    """Copy what the tests need, with the compiled code beside the sources."""
    copy = folder / ROOT.name
    copy.mkdir()
    for name in COPIED:
        shutil.copytree(ROOT / name, copy / name)
    for file in ROOT.iterdir():
        if file.is_file():
            shutil.copy2(file, copy)
    shared = ROOT.parent / 'shared'
    if shared.is_dir():
        (folder / 'shared').symlink_to(shared)
    return copy


def main() -> int:
    """Try the mutants that are asked for; exit status 1 where too many survive."""
    parser = argparse.ArgumentParser(prog='make mutants', description=__doc__)
    parser.add_argument('words', nargs='*', help='only mutants whose name contains one of them')
    words = parser.parse_args().words
    wanted = [
        mutant
        for mutant in read_table()
        if not words or any(word in mutant.name for word in words)
    ]
    survivors, untried = [], []
    with tempfile.TemporaryDirectory() as folder:
        copy = copy_project(Path(folder))
        for mutant in wanted:
            began = time.monotonic()
            try:
                verdict = 'SURVIVED' if survives(mutant, copy) else 'caught'
            except MutantError as error:
                verdict = f'NOT TRIED: {error}'
                untried.append(mutant.name)
            if verdict == 'SURVIVED':
                survivors.append(mutant.name)
            print(f'{time.monotonic() - began:6.1f} s  {mutant.name}: {verdict}', flush=True)
    print(f'{len(wanted)} mutants, {len(survivors)} survived, {len(untried)} were not tried')
    return int(bool(untried) or len(survivors) > MOST_SURVIVORS * len(wanted))


if __name__ == '__main__':
    sys.exit(main())

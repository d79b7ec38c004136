"""What package.xml, setup.py and the built package promise."""

from __future__ import annotations

import ast
from collections.abc import Iterator
import os
from pathlib import Path
import re
import sys
from xml.etree import ElementTree

from programs import run
import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = 'lip_id_ros'
# rosdep keys of what has one; the rest is in requirements.txt
ROSDEP = {
    'argcomplete': 'python3-argcomplete',
    'matplotlib': 'python3-matplotlib',
    'numba': 'python3-numba',
    'numpy': 'python3-numpy',
    'rich': 'python3-rich',
    'scipy': 'python3-scipy',
    'yaml': 'python3-yaml',
}
WITHOUT_KEY = {
    'backports': 'rosbags',  # which brings zstd
    'coal': 'pin',  # which brings it
    'compression': 'rosbags',  # the same, from Python 3.14
    'example_robot_data': 'example-robot-data',
    'fsspec': 'fsspec',
    'lz4': 'rosbags',  # which needs it too
    'mujoco': 'mujoco',
    'pinocchio': 'pin',
    'rosbags': 'rosbags',
    'threadpoolctl': 'threadpoolctl',
}


def foreign_imports(*folders: str) -> set[str]:
    return {
        name
        for folder in folders
        for path in (ROOT / folder).rglob('*.py')
        for name in top_level_imports(path)
        if name != PACKAGE and name not in sys.stdlib_module_names
    }


def top_level_imports(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.Import):
            yield from (alias.name.split('.')[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module.split('.')[0]


@pytest.fixture(scope='module')
def manifest() -> ElementTree.Element:
    return ElementTree.parse(ROOT / 'package.xml').getroot()


def test_manifest_and_setup_agree_on_the_version(manifest: ElementTree.Element) -> None:
    assert f"version='{manifest.findtext('version')}'" in (ROOT / 'setup.py').read_text()


def test_manifest_names_what_is_imported_and_no_more(manifest: ElementTree.Element) -> None:
    named = [element.text for element in manifest.iter('exec_depend')]
    imported = foreign_imports(PACKAGE, 'launch')
    needed = {ROSDEP.get(name, name) for name in imported - set(WITHOUT_KEY)}
    assert sorted(needed) == named


def test_requirements_name_what_has_no_rosdep_key() -> None:
    files = ('requirements.txt', 'requirements-extras.txt')
    lines = [line for name in files for line in (ROOT / name).read_text().splitlines()]
    for distribution in WITHOUT_KEY.values():
        assert any(line.startswith(distribution) for line in lines)


def test_requirements_of_the_package_are_what_only_pip_brings() -> None:
    """What the demo and the tests need beside would bring numpy 2 over the system's."""
    lines = (ROOT / 'requirements.txt').read_text().splitlines()
    names = {re.split('[<>=]', line)[0] for line in lines if line and not line.startswith('#')}
    assert names == {'rosbags', 'threadpoolctl', 'fsspec'}


@pytest.mark.parametrize(
    'files',
    [('requirements-lock.txt', 'requirements-test-lock.txt'), ('requirements-docs.txt',)],
)
def test_lock_files_pin_everything_exactly(files: tuple[str, ...]) -> None:
    lines = [line for name in files for line in (ROOT / name).read_text().splitlines()]
    pins = [line.split(';')[0].strip() for line in lines if line and not line.startswith('#')]
    assert all(pin.count('==') == 1 and '*' not in pin for pin in pins)
    assert len({pin.split('==')[0] for pin in pins}) == len(pins)


def test_no_test_holds_seconds() -> None:
    """Each test that names a clock of a processor puts a fake in its place."""
    clock = re.compile('|'.join(('perf' + '_counter', 'process' + '_time', 'time' + 'it')))
    holders = [
        f'{path.relative_to(ROOT)}: {line.strip()}'
        for path in ROOT.glob('test/**/*.py')
        for line in path.read_text(encoding='utf-8').splitlines()
        if clock.search(line) and 'monkeypatch' not in line
    ]
    assert holders == []


def test_the_version_is_told(manifest: ElementTree.Element) -> None:
    told = run(sys.executable, '-m', PACKAGE, '--version', PYTHONPATH=str(ROOT))
    assert told.stdout == f'lip_id {manifest.findtext("version")}\n'


@pytest.mark.ros
@pytest.mark.slow
def test_ros2_finds_the_built_programs() -> None:
    if not built():
        pytest.skip('the package is not built, or its environment is not sourced')
    listed = run('ros2', 'pkg', 'executables', PACKAGE).stdout
    assert {'lip_id', 'serve', 'train'} <= {line.split()[-1] for line in listed.splitlines()}
    helped = run('ros2', 'run', PACKAGE, 'lip_id', '--help')
    assert helped.returncode == 0, helped.stderr


def built() -> bool:
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    marker = Path('share/ament_index/resource_index/packages') / PACKAGE
    return any((Path(prefix) / marker).is_file() for prefix in prefixes if prefix)

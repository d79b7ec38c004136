"""What package.xml, setup.py and the built package promise."""

from __future__ import annotations

import ast
from collections.abc import Iterator
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
from xml.etree import ElementTree

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = 'lip_id_ros'
SHIPPED = (
    'setup.py',
    'setup.cfg',
    'pyproject.toml',
    'package.xml',
    'resource',
    'config',
    'launch',
)
# rosdep keys of what has one; the rest is in requirements.txt
ROSDEP = {
    'backports': 'python3-rosbags-pip',  # rosbags brings its zstd
    'compression': 'python3-rosbags-pip',  # the same, from Python 3.14
    'lz4': 'python3-rosbags-pip',  # rosbags needs it too
    'matplotlib': 'python3-matplotlib',
    'numba': 'python3-numba',
    'numpy': 'python3-numpy',
    'rich': 'python3-rich',
    'rosbags': 'python3-rosbags-pip',
    'scipy': 'python3-scipy',
    'yaml': 'python3-yaml',
}
WITHOUT_KEY = {
    'example_robot_data': 'example-robot-data',
    'fsspec': 'fsspec',
    'mujoco': 'mujoco',
    'pinocchio': 'pin',
    'threadpoolctl': 'threadpoolctl',
}
OPTIONAL = {'torch'}
LAUNCH_FILE = """
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, LogInfo
from launch.substitutions import LaunchConfiguration


def generate_launch_description():
    word = DeclareLaunchArgument('word', default_value='nothing', description='to say')
    say = LogInfo(msg=['says ', LaunchConfiguration('word')])
    return LaunchDescription([word, say])
"""


def run(*command: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(word) for word in command],
        capture_output=True,
        text=True,
        env=os.environ | environment,
        check=False,
    )


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


def test_manifest_is_an_ament_python_package(manifest: ElementTree.Element) -> None:
    assert manifest.get('format') == '3'
    assert manifest.findtext('name') == PACKAGE
    assert manifest.findtext('license') == 'Apache-2.0'
    assert manifest.findtext('export/build_type') == 'ament_python'
    assert (ROOT / 'resource' / PACKAGE).is_file()


def test_manifest_and_setup_agree_on_the_version(manifest: ElementTree.Element) -> None:
    assert f"version='{manifest.findtext('version')}'" in (ROOT / 'setup.py').read_text()


def test_manifest_names_what_is_imported_and_no_more(manifest: ElementTree.Element) -> None:
    named = [element.text for element in manifest.iter('exec_depend')]
    imported = foreign_imports(PACKAGE, 'launch') - OPTIONAL
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


def test_lock_files_pin_everything_exactly() -> None:
    files = ('requirements-lock.txt', 'requirements-test-lock.txt')
    lines = [line for name in files for line in (ROOT / name).read_text().splitlines()]
    pins = [line.split(';')[0].strip() for line in lines if line and not line.startswith('#')]
    assert all(pin.count('==') == 1 and '*' not in pin for pin in pins)
    assert len({pin.split('==')[0] for pin in pins}) == len(pins)


@pytest.fixture(scope='module')
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install the wheel that `pip install .` makes, built from a copy of the sources."""
    copy = tmp_path_factory.mktemp('sources')
    for name in (*SHIPPED, PACKAGE):
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, copy / name, ignore=shutil.ignore_patterns('__pycache__'))
        elif source.is_file():
            shutil.copy(source, copy)
    target = tmp_path_factory.mktemp('target')
    pip = (sys.executable, '-m', 'pip', '--disable-pip-version-check', 'install', '-q')
    done = run(*pip, '--no-deps', '--no-build-isolation', '--target', target, copy)
    assert done.returncode == 0, done.stderr
    return target


@pytest.mark.slow
def test_pip_install_ships_everything(wheel: Path) -> None:
    shipped = {path.relative_to(wheel).as_posix() for path in wheel.rglob('*')}
    modules = {
        path.relative_to(ROOT).as_posix()
        for ending in ('*.py', '*.in')
        for path in (ROOT / PACKAGE).rglob(ending)
    }
    assert modules <= shipped
    for folder in ('config', 'launch'):
        for path in (ROOT / folder).glob('*.*'):
            assert (wheel / 'share' / PACKAGE / folder / path.name).is_file()


@pytest.mark.slow
def test_pip_install_gives_a_lip_id_that_needs_no_ros(wheel: Path, tmp_path: Path) -> None:
    # a rclpy that fails on import stands for a machine without ROS
    (tmp_path / 'rclpy.py').write_text("raise ImportError('no ROS here')\n")
    path = os.pathsep.join((str(tmp_path), str(wheel)))
    helped = run(wheel / 'bin' / 'lip_id', '--help', PYTHONPATH=path, LD_LIBRARY_PATH='')
    assert helped.returncode == 0, helped.stderr
    assert 'fit' in helped.stdout


@pytest.mark.slow
def test_a_wheel_has_no_program_of_another_name(wheel: Path) -> None:
    """Ray has a program `serve` too."""
    assert [path.name for path in (wheel / 'bin').iterdir()] == ['lip_id']


def test_every_key_is_one_of_rosdep(manifest: ElementTree.Element) -> None:
    lists = ROOT.parent / 'shared/rosdep'
    if not lists.is_dir():
        pytest.skip(f'no rosdep lists in {lists}')
    known = [yaml.safe_load(path.read_text()) for path in lists.glob('*.yaml')]
    keys = {
        str(element.text)
        for tag in ('exec_depend', 'test_depend')
        for element in manifest.iter(tag)
        if str(element.text).startswith('python3-')
    }
    assert keys <= {key for each in known for key in each}


def test_no_test_holds_seconds() -> None:
    """Each test that names a clock of a processor puts a fake in its place."""
    clock = re.compile('|'.join(('perf' + '_counter', 'process' + '_time', 'time' + 'it')))
    holders = [
        f'{path.relative_to(ROOT)}: {line.strip()}'
        for path in (ROOT / 'test').rglob('*.py')
        for line in path.read_text(encoding='utf-8').splitlines()
        if clock.search(line) and 'monkeypatch' not in line
    ]
    assert holders == []


@pytest.mark.slow
def test_a_package_that_cannot_be_written_runs_without_a_cache(
    wheel: Path, tmp_path: Path
) -> None:
    """As in a container: no HOME, and a file where numba would put its folder."""
    copy = tmp_path / PACKAGE
    shutil.copytree(wheel / PACKAGE, copy, ignore=shutil.ignore_patterns('__pycache__'))
    for folder in (copy, *(path for path in copy.rglob('*') if path.is_dir())):
        (folder / '__pycache__').write_text('')
    code = (
        'import lip_id_ros\n'
        'from lip_id_ros.rigid_body import spatial\n'
        'print(lip_id_ros.__file__, spatial.dot((1.0, 2.0, 3.0), (4.0, 5.0, 6.0)))\n'
    )
    ran = run(
        sys.executable,
        '-P',
        '-c',
        code,
        PYTHONPATH=str(tmp_path),
        PYTHONDONTWRITEBYTECODE='1',
        HOME='/proc/none',
        XDG_CACHE_HOME='/proc/none',
        NUMBA_CACHE_DIR='',
    )
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.split() == [str(copy / '__init__.py'), '32.0']
    assert ran.stderr.count('set NUMBA_CACHE_DIR') == 1


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


@pytest.mark.ros
@pytest.mark.slow
def test_ros2_launch_passes_arguments(tmp_path: Path) -> None:
    if shutil.which('ros2') is None:
        pytest.skip('the program ros2 is not on the path')
    file = tmp_path / 'says.launch.py'
    file.write_text(LAUNCH_FILE)
    environment = {'ROS_LOG_DIR': str(tmp_path / 'log')}
    ran = run('ros2', 'launch', file, 'word:=a:=b', **environment)
    assert ran.returncode == 0, ran.stderr
    assert 'says a:=b' in ran.stdout + ran.stderr
    listed = run('ros2', 'launch', file, '--show-args', **environment)
    assert "'word'" in listed.stdout
    assert 'nothing' in listed.stdout
    missing = run('ros2', 'launch', tmp_path / 'none.launch.py', **environment)
    assert missing.returncode == 1
    assert 'none.launch.py' in missing.stderr


def built() -> bool:
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    marker = Path('share/ament_index/resource_index/packages') / PACKAGE
    return any((Path(prefix) / marker).is_file() for prefix in prefixes if prefix)

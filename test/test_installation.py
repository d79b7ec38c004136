"""What is installed: by rosdep, with pip, and where little may be written."""

from __future__ import annotations

import os
from pathlib import Path
import re
import shutil
import signal
import subprocess
import sys
import tarfile

import numpy as np
from programs import run
import pytest
from ros_domain import free_domain
from simulation.pendulums import swing
import yaml

from lip_id_ros.simulation import write_bag

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = 'lip_id_ros'
LOWEST = ROOT / '.deps/lowest'
SETUP = (ROOT / 'setup.py').read_text(encoding='utf-8')
RELEASE = {'tags': {'release': '{package}'}, 'url': 'file:///none.git', 'version': '1.0.0-1'}
JAZZY = {'distribution_status': 'active', 'distribution_type': 'ros2', 'python_version': 3}
SHIPPED = (
    'setup.py',
    'setup.cfg',
    'pyproject.toml',
    'package.xml',
    'README.md',
    'LICENSE',
    'resource',
    'config',
    'launch',
)


@pytest.fixture(scope='module')
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
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
    assert [path.name for path in (wheel / 'bin').iterdir()] == ['lip_id']
    for folder in ('config', 'launch'):
        for path in (ROOT / folder).glob('*.*'):
            assert (wheel / 'share' / PACKAGE / folder / path.name).is_file()


@pytest.fixture(scope='module')
def archives(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Build a source archive, and a wheel from what it holds."""
    for name in ('build', 'twine'):
        pytest.importorskip(name)
    if not (ROOT / '.git').exists():
        pytest.skip('needs the list of files of a git checkout')
    folder = tmp_path_factory.mktemp('archives')
    for path in tracked():
        (folder / 'sources' / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / path, folder / 'sources' / path)
    build = (sys.executable, '-m', 'build', '--no-isolation')
    done = run(*build, '--sdist', '--outdir', folder, folder / 'sources')
    assert done.returncode == 0, done.stderr
    (sdist,) = folder.glob('*.tar.gz')
    with tarfile.open(sdist) as archive:
        archive.extractall(folder / 'unpacked', filter='data')
    (unpacked,) = (folder / 'unpacked').iterdir()
    done = run(*build, '--wheel', '--outdir', folder, unpacked)
    assert done.returncode == 0, done.stderr
    (wheel,) = folder.glob('*.whl')
    return sdist, wheel


def tracked() -> list[str]:
    return run('git', '-C', ROOT, 'ls-files').stdout.split()


@pytest.mark.slow
def test_the_archives_are_complete_and_described(archives: tuple[Path, Path]) -> None:
    checked = run(sys.executable, '-m', 'twine', 'check', '--strict', *archives)
    assert checked.returncode == 0, checked.stdout
    with tarfile.open(archives[0]) as archive:
        held = {name.partition('/')[2] for name in archive.getnames()}
    left_out = {path for path in tracked() if path not in held}
    assert {path.split('/')[0] for path in left_out} <= {'.ci', '.gitignore', '.github'}


@pytest.mark.slow
def test_pip_install_gives_a_lip_id_that_needs_no_ros(wheel: Path, tmp_path: Path) -> None:
    # a rclpy that fails on import stands for a machine without ROS
    (tmp_path / 'rclpy.py').write_text("raise ImportError('no ROS here')\n")
    path = os.pathsep.join((str(tmp_path), str(wheel)))
    helped = run(wheel / 'bin' / 'lip_id', '--help', PYTHONPATH=path, LD_LIBRARY_PATH='')
    assert helped.returncode == 0, helped.stderr
    assert 'fit' in helped.stdout


@pytest.fixture(scope='module')
def rosdep(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Let rosdep know the keys of its lists and the packages of this ROS."""
    lists = ROOT.parent / 'shared/rosdep'
    if not lists.is_dir():
        pytest.skip(f'no rosdep lists in {lists}')
    pytest.importorskip('rosdep2')
    folder = tmp_path_factory.mktemp('rosdep')
    (folder / 'sources').mkdir()
    sources = [f'yaml {path.as_uri()}\n' for path in sorted(lists.glob('*.yaml'))]
    (folder / 'sources/20-default.list').write_text(''.join(sources))
    distribution = {
        'type': 'distribution',
        'version': 2,
        'release_platforms': {'ubuntu': ['noble']},
        'repositories': {'ros': {'release': {**RELEASE, 'packages': ros_packages()}}},
    }
    index = {
        'type': 'index',
        'version': 4,
        'distributions': {'jazzy': {**JAZZY, 'distribution': ['jazzy.yaml']}},
    }
    for name, content in (('jazzy', distribution), ('index', index)):
        (folder / f'{name}.yaml').write_text(yaml.safe_dump(content))
    environment = {
        'AMENT_PREFIX_PATH': str(folder),  # what is installed here would be left out
        'HOME': str(folder),
        'ROS_HOME': str(folder / 'home'),
        'ROSDEP_SOURCE_PATH': str(folder / 'sources'),
        'ROSDISTRO_INDEX_URL': (folder / 'index.yaml').as_uri(),
    }
    updated = run('rosdep', 'update', '--rosdistro', 'jazzy', **environment)
    assert updated.returncode == 0, updated.stderr
    return environment


def ros_packages() -> list[str]:
    prefixes = filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep))
    names = {
        path.name
        for prefix in prefixes
        for path in (Path(prefix) / 'share/ament_index/resource_index/packages').glob('*')
    }
    return sorted(names - {PACKAGE})


@pytest.mark.ros
def test_rosdep_installs_packages_of_the_system_alone(
    rosdep: dict[str, str], tmp_path: Path
) -> None:
    """Ubuntu's pip refuses to install outside an environment, so a key of pip would fail."""
    shutil.copy(ROOT / 'package.xml', tmp_path)
    system = ('--os', 'ubuntu:noble', '--rosdistro', 'jazzy')
    command = ('rosdep', 'install', '--from-paths', tmp_path, '--ignore-src')
    done = run(*command, '-y', '--simulate', '--reinstall', *system, **rosdep)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.split('\n')
    installed = {line.split()[-1] for line in lines if line.startswith('  apt-get install')}
    assert {'python3-numba', 'python3-scipy', 'ros-jazzy-rclpy'} <= installed
    assert 'pip' not in done.stdout


def test_the_lowest_versions_are_those_of_setup() -> None:
    (needed,) = re.findall(r'install_requires=\[(.*?)\]', SETUP, re.DOTALL)
    bounds = dict(re.findall("'([a-z0-9.]+)>=([0-9.]+)[;']", needed))
    lines = (ROOT / 'requirements-lowest.txt').read_text().splitlines()
    lowest = dict(line.split('==') for line in lines if line and not line.startswith('#'))
    assert len(bounds) > 10
    assert sorted(lowest) == sorted(bounds)
    assert all(f'{lowest[name]}.'.startswith(f'{bounds[name]}.') for name in bounds)


@pytest.fixture(scope='module')
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp('bag') / 'run'
    write_bag(path, swing(0, rate=50.0), start=1.7e9)
    return path


@pytest.fixture(scope='module')
def unwritable(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Give a package without cache, as in a container: no HOME, files in place of folders."""
    copy = tmp_path_factory.mktemp('unwritable') / PACKAGE
    shutil.copytree(wheel / PACKAGE, copy, ignore=shutil.ignore_patterns('__pycache__'))
    for folder in (copy, *(path for path in copy.rglob('*') if path.is_dir())):
        (folder / '__pycache__').write_text('')
    return {
        'PYTHONPATH': str(copy.parent),
        'PYTHONDONTWRITEBYTECODE': '1',
        'HOME': '/proc/none',
        'XDG_CACHE_HOME': '/proc/none',
        'NUMBA_CACHE_DIR': '',
    }


BOTH = """
import sys
from lip_id_ros.cli import main
model, bag, torques = sys.argv[1:]
for command in (['fit', bag, '-o', model], ['predict', model, bag, '-o', torques]):
    if status := main(command):
        sys.exit(status)
"""


@pytest.fixture(scope='module')
def fitted(
    unwritable: dict[str, str], bag: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, Path, str]:
    """
    Fit and predict with the lowest versions where nothing can be kept.

    Returns model, torques and warnings. One process compiles once for both.
    """
    model = tmp_path_factory.mktemp('fitted') / 'arm.npz'
    torques = model.with_name('torques.npz')
    # the lowest versions have an environment of their own; without Python 3.11 there is none
    lowest = LOWEST.is_dir()
    python = LOWEST / 'bin/python' if lowest else sys.executable
    given = unwritable | {'LD_LIBRARY_PATH': ''} if lowest else with_packages(unwritable)
    done = run(python, '-P', '-c', BOTH, model, bag, torques, **given)
    assert done.returncode == 0, done.stderr
    return model, torques, done.stderr


def with_packages(unwritable: dict[str, str]) -> dict[str, str]:
    path = os.pathsep.join([unwritable['PYTHONPATH'], os.environ.get('PYTHONPATH', '')])
    return unwritable | {'PYTHONPATH': path}


@pytest.mark.slow
def test_the_lowest_versions_fit_and_predict_where_nothing_can_be_written(
    fitted: tuple[Path, Path, str],
) -> None:
    _, torques, warned = fitted
    assert warned.count('set NUMBA_CACHE_DIR') == 1
    with np.load(torques) as content:
        assert np.isfinite(content['tau']).all()


@pytest.mark.slow
def test_a_package_that_cannot_be_written_serves(
    fitted: tuple[Path, Path, str], unwritable: dict[str, str], tmp_path: Path
) -> None:
    pytest.importorskip('rclpy', reason='needs ROS 2')
    given = (f'model_path:={fitted[0]}', 'autostart:=true', 'torque_limits_from:=none')
    node = (sys.executable, '-P', '-m', f'{PACKAGE}.nodes.serve', '--ros-args')
    with free_domain() as domain:
        process = subprocess.Popen(
            [*node, *(word for each in given for word in ('-p', each))],
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ
            | with_packages(unwritable)
            | {'ROS_LOG_DIR': str(tmp_path), 'ROS_DOMAIN_ID': str(domain)},
        )
        assert process.stderr
        served = next((line for line in process.stderr if ' serves ' in line), '')
        process.send_signal(signal.SIGINT)
        rest = process.stderr.read()
        assert process.wait() == 0, rest
    assert 'shoulder, elbow, wrist' in served

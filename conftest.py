"""What all tests share: the real recordings, the tests this machine can run, and their workers."""

from __future__ import annotations

from collections.abc import Iterator
import importlib
import os
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, settings
from programs import installed
import pytest

ROOT = Path(__file__).resolve().parent

os.environ.setdefault('MPLBACKEND', 'Agg')

# Beside other load, processes lost each other for good over shared memory, and not over UDP:
# https://github.com/eProsima/Fast-DDS/issues/5244
os.environ.setdefault('FASTDDS_BUILTIN_TRANSPORTS', 'UDPv4')

# Workers of pytest-xdist share the cores; their libraries read this when they are imported.
if 'PYTEST_XDIST_WORKER_COUNT' in os.environ:
    share = max(1, (os.cpu_count() or 1) // int(os.environ['PYTEST_XDIST_WORKER_COUNT']))
    for library in ('NUMBA', 'OMP', 'OPENBLAS', 'MKL'):
        os.environ.setdefault(f'{library}_NUM_THREADS', str(share))

# The same examples in every run: a red test stays red until it is mended. To look for new ones:
# pytest --hypothesis-profile=explore
settings.register_profile(
    'steady',
    derandomize=True,
    database=None,
    deadline=None,
    max_examples=50,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile('explore', deadline=None, max_examples=1000)
settings.load_profile('steady')


@pytest.fixture(scope='session')
def shared_data() -> Path:
    """Folder of the real recordings: $LIP_ID_ROS_SHARED_DATA, or ../shared/data."""
    named = os.environ.get('LIP_ID_ROS_SHARED_DATA')
    folder = Path(named) if named else ROOT.parent / 'shared' / 'data'
    if not folder.is_dir():
        pytest.skip(f'no folder of real recordings at {folder}; set LIP_ID_ROS_SHARED_DATA')
    return folder


@pytest.fixture
def strange_modules(
    tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> Iterator[None]:
    """Work in a folder with files named as modules, which no process may run."""
    folder = tmp_path_factory.mktemp('strange')
    trace = folder / 'trace'
    for name in ('json', 'numpy', 'pickle', 'struct', 'yaml'):
        (folder / f'{name}.py').write_text(f'open({str(trace)!r}, "a").write("{name} ")')
    monkeypatch.chdir(folder)
    yield
    assert not trace.exists(), trace.read_text()


@pytest.hookimpl(tryfirst=True)
def pytest_pycollect_makemodule(
    module_path: Path, parent: pytest.Collector
) -> pytest.Module | None:
    """
    Keep launch_testing's plugin away from all but launch tests.

    To find launch tests it imports every test module under its bare name, so that two files of
    one name clash and a module that skips itself ends the run.

    """
    if 'generate_test_description' in module_path.read_text(encoding='utf-8'):
        return None
    return pytest.Module.from_parent(parent, path=module_path)


@pytest.hookimpl(tryfirst=True)  # pytest-xdist reads the groups in this hook too
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip, with the reason, the tests that this machine cannot run; keep each file together."""
    for item in items:
        # a worker makes the fixtures of a module once
        if not item.get_closest_marker('xdist_group'):
            item.add_marker(pytest.mark.xdist_group(item.location[0]))
    # files that take long come first, so that no worker is alone with one at the end
    long = {_group(item) for item in items if _is_long(item)}
    items.sort(key=lambda item: _group(item) not in long)
    marked = [item for item in items if item.get_closest_marker('ros')]
    if marked and (reason := _no_ros()):
        for item in marked:
            item.add_marker(pytest.mark.skip(reason=reason))
    marked = [item for item in items if item.get_closest_marker('ros2_control')]
    if marked and not installed('controller_manager', 'ros2_control_node'):
        reason = 'needs ros2_control_node; where there is g++ make setup compiles it'
        for item in marked:
            item.add_marker(pytest.mark.skip(reason=reason))


def _group(item: pytest.Item) -> Any:
    marker = item.get_closest_marker('xdist_group')
    return marker and marker.args[0]


def _is_long(item: pytest.Item) -> bool:
    return any(item.get_closest_marker(name) for name in ('slow', 'ros'))


def _no_ros() -> str | None:
    try:
        importlib.import_module('rclpy')
    except ImportError as error:
        return f'needs ROS 2: {error}'
    return None

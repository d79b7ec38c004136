"""The scripts that set a machine up, on small machines made for the purpose."""

from __future__ import annotations

import os
from pathlib import Path
import shutil
import subprocess
import sys

import pytest

SCRIPTS = Path(__file__).resolve().parents[1] / 'scripts'
SHELLS = [
    pytest.param(shell, marks=pytest.mark.skipif(not shutil.which(shell), reason=f'no {shell}'))
    for shell in ('bash', 'zsh')
]

pytestmark = pytest.mark.skipif(sys.platform == 'win32', reason='shell scripts')


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """Copy the scripts into a checkout of their own, whose path has a space."""
    root = tmp_path / 'a checkout'
    shutil.copytree(SCRIPTS, root / 'scripts')
    return root


def run(command: list[str], **environment: str) -> subprocess.CompletedProcess[str]:
    clean = {'PATH': '/usr/bin:/bin', 'HOME': '/nonexistent', **environment}
    return subprocess.run(command, capture_output=True, text=True, env=clean, check=False)


def program(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f'#!/bin/sh\n{text}\n')
    path.chmod(0o755)
    return path


def find_python(checkout: Path, *conditions: str, **environment: str) -> str:
    found = run([str(checkout / 'scripts/find_python.sh'), *conditions], **environment)
    return found.stdout.strip() if found.returncode == 0 else ''


def test_a_python_that_does_not_run_is_passed_over(checkout: Path, tmp_path: Path) -> None:
    """A pyenv shim stands on the path, and fails when it is called."""
    program(tmp_path / 'shims/python3.12', 'echo "python3.12: command not found" >&2; exit 127')
    real = tmp_path / 'pyenv/versions/3.12.9/bin/python3.12'
    program(real, f'REACHED=yes exec {sys.executable} "$@"')
    found = find_python(
        checkout,
        'os.environ.get("REACHED") == "yes"',
        PATH=f'{tmp_path}/shims:/usr/bin:/bin',
        PYENV_ROOT=str(tmp_path / 'pyenv'),
    )
    assert found == os.path.realpath(sys.executable)


def test_the_named_python_goes_first(checkout: Path) -> None:
    found = find_python(checkout, 'v >= (3, 11)', PYTHON312=sys.executable)
    assert found == os.path.realpath(sys.executable)


def test_a_wrong_jazzy_folder_is_named(checkout: Path, tmp_path: Path) -> None:
    setup = run([str(checkout / 'scripts/setup.sh')], LIP_ID_ROS_JAZZY=str(tmp_path / 'nowhere'))
    assert setup.returncode == 1
    assert f'LIP_ID_ROS_JAZZY names {tmp_path}/nowhere, which has no setup.bash' in setup.stderr


def source(shell: str, checkout: Path, then: str, **environment: str) -> list[str]:
    line = f'set -u; . "{checkout}/scripts/env.sh" || exit 3; {then}'
    ran = run([shell, '-c', line], **environment)
    assert ran.returncode == 0, ran.stderr
    return ran.stdout.splitlines()


@pytest.mark.parametrize('shell', SHELLS)
def test_environment_before_set_up_says_so(shell: str, checkout: Path) -> None:
    ran = run([shell, '-c', f'. "{checkout}/scripts/env.sh" || exit 3'])
    assert ran.returncode == 3
    assert ran.stderr.strip() == 'env.sh: nothing is set up yet; run make setup first'


@pytest.mark.parametrize('shell', SHELLS)
def test_environment_of_the_wheel_can_be_sourced_twice(shell: str, checkout: Path) -> None:
    deps = checkout / '.deps'
    deps.mkdir()
    (deps / 'ros').write_text('wheel\n')
    then = (
        f'. "{checkout}/scripts/env.sh"; echo "$PATH"; echo "$LD_LIBRARY_PATH"; '
        'echo "$PYTHONPATH"; echo "$AMENT_PREFIX_PATH"; echo "$ROS_AUTOMATIC_DISCOVERY_RANGE"'
    )
    assert source(shell, checkout, then, PYTHONPATH='/mine') == [
        f'{deps}/venv/bin:/usr/bin:/bin',
        f'{deps}/jazzy/lib:{deps}/lib',
        f'{deps}/build/lip_id_ros:{deps}/jazzy/rclpy:/mine',
        f'{deps}/install/lip_id_ros:{deps}/jazzy',
        'LOCALHOST',
    ]


@pytest.mark.parametrize('shell', SHELLS)
def test_environment_of_an_installation(shell: str, checkout: Path, tmp_path: Path) -> None:
    """An installation's set-up script uses variables that may be unset; `set -u` comes back."""
    for suffix in ('bash', 'zsh'):
        text = 'if [ -n "$AMENT_TRACE_SETUP_FILES" ]; then :; fi; export ROS_DISTRO=jazzy\n'
        (tmp_path / f'setup.{suffix}').write_text(text)
    (checkout / '.deps').mkdir()
    (checkout / '.deps/ros').write_text(f'{tmp_path}\n')
    then = 'echo "$ROS_DISTRO"; echo "${ROS_AUTOMATIC_DISCOVERY_RANGE:-untouched}"; echo "$-"'
    distro, discovery, options = source(shell, checkout, then)
    assert (distro, discovery) == ('jazzy', 'untouched')
    assert 'u' in options


@pytest.mark.parametrize('shell', SHELLS)
def test_environment_without_ros_or_home(shell: str, checkout: Path) -> None:
    (checkout / '.deps').mkdir()
    (checkout / '.deps/ros').write_text('\n')
    then = 'echo "$PATH"; echo "${AMENT_PREFIX_PATH:-none}"; echo "$ROS_LOG_DIR"'
    assert source(shell, checkout, then, HOME='') == [
        f'{checkout}/.deps/venv/bin:/usr/bin:/bin',
        'none',
        f'{checkout}/.deps/log/ros',
    ]

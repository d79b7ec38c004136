"""The demo ends its nodes however it is ended."""

from __future__ import annotations

from pathlib import Path
import re
import subprocess
import sys
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')
pytest.importorskip('pinocchio', reason='the simulated Panda needs pinocchio')

import psutil
from waiting import wait_until

pytestmark = pytest.mark.ros

ROOT = Path(__file__).resolve().parents[2]


def test_a_demo_that_is_terminated_ends_its_nodes(tmp_path: Path) -> None:
    """As by `timeout` and CI; the nodes have a session of their own."""
    demo = [sys.executable, '-m', 'examples.demo.ros', '--output', str(tmp_path)]
    quiet: Any = {'stdout': subprocess.DEVNULL, 'stderr': subprocess.DEVNULL, 'cwd': ROOT}
    with subprocess.Popen(demo, **quiet) as process:
        wait_until(lambda: len(nodes_of(tmp_path)) == 3, 'the start of three nodes')
        nodes = nodes_of(tmp_path)
        process.terminate()
        assert process.wait() == 143
    assert not [pid for pid in nodes if is_running(pid)]


def nodes_of(folder: Path) -> list[int]:
    log = folder / 'nodes.log'
    text = log.read_text() if log.exists() else ''
    return [int(pid) for pid in re.findall(r'process started with pid \[(\d+)\]', text)]


def is_running(pid: int) -> bool:
    return psutil.pid_exists(pid) and bool(psutil.Process(pid).status() != psutil.STATUS_ZOMBIE)

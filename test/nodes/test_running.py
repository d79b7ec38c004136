"""A node is stopped in good order, whatever ends it."""

from __future__ import annotations

import os
from pathlib import Path
import sys

import pytest
from waiting import run_to_end

pytest.importorskip('rclpy', reason='needs ROS 2')

pytestmark = pytest.mark.ros

PROGRAM = """
import gc
from rclpy.node import Node
from lip_id_ros.nodes import running

class Faulty(Node):
    def __init__(self):
        super().__init__('faulty')
        self.declare_parameter('executor', '{executor}')
        self.create_timer(0.01, self.fail)

    def fail(self):
        print('frozen', gc.get_freeze_count())
        raise RuntimeError('a programming error')

    def stop(self):
        print('kept the data')

running.run(Faulty)
"""


@pytest.mark.parametrize('executor', ['events', 'single_threaded'])
def test_an_error_in_a_callback_ends_in_good_order_too(executor: str, tmp_path: Path) -> None:
    ended = run_to_end(
        [sys.executable, '-c', PROGRAM.format(executor=executor)],
        tmp_path,
        env={**os.environ, 'ROS_LOG_DIR': str(tmp_path)},
    )
    assert ended.returncode == 1
    assert 'kept the data' in ended.stdout
    frozen = int(ended.stdout.split()[1])
    assert frozen > 10_000  # what was imported costs no collection any more
    assert 'RuntimeError: a programming error' in ended.stderr

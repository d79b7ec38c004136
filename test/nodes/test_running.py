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
from lip_id_ros.feedforward.settings import ServeSettings
from lip_id_ros.nodes import running
from lip_id_ros.nodes.node import NodeBase
from lip_id_ros.settings import parameters_of

class Faulty(NodeBase):
    def __init__(self):
        super().__init__('faulty', parameters_of(ServeSettings))
        Node.create_timer(self, 0.001, self.fail)  # without the guard

    def fail(self):
        print('frozen', gc.get_freeze_count())
        raise RuntimeError('a programming error')

    def stop(self):
        print('kept the data')

running.run(Faulty)
"""


@pytest.mark.parametrize('executor', ['events', 'single_threaded'])
def test_errors_past_the_guard_end_in_good_order_when_there_are_too_many(
    executor: str, tmp_path: Path
) -> None:
    ended = run_to_end(
        [sys.executable, '-c', PROGRAM, '--ros-args', '-p', f'executor:={executor}'],
        tmp_path,
        env={**os.environ, 'ROS_LOG_DIR': str(tmp_path)},
    )
    assert ended.returncode == 1
    assert 'kept the data' in ended.stdout
    frozen = int(ended.stdout.split()[1])
    assert frozen > 10_000  # what was imported costs no collection any more
    assert 'RuntimeError: a programming error' in ended.stderr
    assert 'a callback failed, the node goes on' in ended.stderr

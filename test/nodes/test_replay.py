"""`replay` publishes what ROS 2 can name, and ends when it is asked to."""

from __future__ import annotations

from pathlib import Path
import re
import signal
from typing import TYPE_CHECKING

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from sensor_msgs.msg import JointState

from lip_id_ros.recording.bag_writer import JointStateTrack, write_mcap

if TYPE_CHECKING:
    from nodes.ros_graph import Graph, Process, Ros

pytestmark = pytest.mark.ros


def bag(folder: Path, *topics: str, gap_s: float = 0.1) -> str:
    t, values = 1e9 + gap_s * np.arange(2.0), np.ones((2, 1))
    tracks = [JointStateTrack(topic, ('a',), t, values, values, values) for topic in topics]
    write_mcap(folder / 'bag.mcap', tracks)
    return 'bag.mcap'


def replay(graph: Graph, *arguments: str) -> Process:
    return graph.start_program('replay', ['-m', 'lip_id_ros.nodes.replay', *arguments])


def test_a_topic_that_ros_cannot_name_is_left_out(ros: Ros, tmp_path: Path) -> None:
    graph, client = ros
    received = client.await_topic(JointState, '/left/joint_states')
    player = replay(graph, bag(tmp_path, '/right arm/joint_states', '/left/joint_states'))
    assert player.wait() == 0, player.log
    client.wait_until(lambda: len(received) == 2, 'the messages of the other topic')
    assert "'/right arm/joint_states' is left out: " in player.log


@pytest.mark.parametrize(
    ('options', 'sentence'),
    [
        ([], 'bag.mcap must have a topic that ROS 2 can name, but has none.'),
        (['--ros-args', '-r', 'nonsense'], "Couldn't parse"),
    ],
)
def test_what_cannot_be_published_gives_one_line(
    options: list[str], sentence: str, ros: Ros, tmp_path: Path
) -> None:
    player = replay(ros[0], bag(tmp_path, '/right arm/joint_states'), *options)
    assert player.wait() == 1
    assert sentence in player.log
    assert 'Traceback' not in player.log


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_pause_of_the_recording_can_be_ended(number: int, ros: Ros, tmp_path: Path) -> None:
    graph, client = ros
    client.await_topic(JointState, '/joint_states')
    player = replay(graph, bag(tmp_path, '/joint_states', gap_s=1e5), '--speed', '1e-9')
    # the seconds that have passed already, few or many, are taken off the pause
    note = re.compile(r'the recording pauses, the next message is due in (\d+) s')
    client.wait_until(lambda: note.search(player.log), 'note')
    assert 1e14 - 1e3 < int(note.findall(player.log)[0]) <= 1e14
    assert player.end(number) != 0
    assert 'Traceback' not in player.log

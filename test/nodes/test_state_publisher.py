"""The exported URDF in robot_state_publisher, which publishes the frames of its links."""

from __future__ import annotations

from functools import partial
import json
from pathlib import Path
from typing import Any, TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')
pytest.importorskip('pinocchio')

from builtin_interfaces.msg import Time
from export.arms import random_arm
import numpy as np
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from lip_id_ros.arrays import Array
from lip_id_ros.export.arm import ArmDescription
from lip_id_ros.export.urdf import to_urdf
from lip_id_ros.nodes import qos

if TYPE_CHECKING:
    from nodes.ros_graph import Ros

pytestmark = pytest.mark.ros
NAME = 'robot_state_publisher'


def pose(arm: ArmDescription, i: int, q: float) -> tuple[Array, Array]:
    """Return where a link is in the one before: rotation and translation."""
    rotation, origin = arm.chain.rotations[i], arm.chain.translations[i]
    if arm.chain.prismatic[i]:
        return rotation, origin + q * rotation[:, 2]
    return rotation @ Rotation.from_euler('z', q).as_matrix(), origin


def has(messages: list[Any], count: int) -> bool:
    return len(messages) == count


def published(transform: Any) -> tuple[Array, Array]:
    at, turn = transform.translation, transform.rotation
    rotation = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix()
    return rotation, np.array([at.x, at.y, at.z])


def test_it_publishes_the_frames_of_the_arm(ros: Ros, tmp_path: Path) -> None:
    graph, client = ros
    arm = random_arm('RPRRRR')
    text, parameters = to_urdf(arm), tmp_path / 'parameters.yaml'
    content = {'/**': {'ros__parameters': {'robot_description': text}}}
    parameters.write_text(json.dumps(content))
    arguments = ['--ros-args', '--params-file', str(parameters)]
    graph.start_installed(NAME, NAME, arguments)
    descriptions = client.await_topic(String, '/robot_description', qos.LATCHED)
    frames = client.await_topic(TFMessage, '/tf')
    states = client.speak(JointState, '/joint_states')
    client.wait_until(lambda: descriptions, 'the description')
    assert descriptions[0].data == text
    links = ['base_link', *(f'{name}_link' for name in arm.joint_names)]
    ends = arm.ranges.q_min, arm.ranges.q_max
    drawn = np.random.default_rng(0).uniform(*ends, (3, len(ends[0])))
    for count, q in enumerate(drawn, 1):
        state = JointState(name=arm.joint_names, position=q.tolist())
        state.header.stamp = Time(sec=count)
        states.publish(state)
        client.wait_until(partial(has, frames, count), 'the frames')
        found = {each.child_frame_id: each for each in frames[-1].transforms}
        assert list(found) == links[1:]
        for i, link in enumerate(links[1:]):
            assert found[link].header.frame_id == links[i]
            for value, expected in zip(
                published(found[link].transform), pose(arm, i, q[i]), strict=True
            ):
                np.testing.assert_allclose(value, expected, atol=1e-12)

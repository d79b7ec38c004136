"""Node `excite` in front of a real joint_trajectory_controller."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')
pytest.importorskip('controller_manager_msgs')

from nodes import toy
import numpy as np
from ros2_control.arm import BROADCASTER, Control, controlled, LIMIT_S
from sensor_msgs.msg import JointState

from lip_id_ros.nodes import qos

pytestmark = [pytest.mark.ros, pytest.mark.ros2_control]

SETTINGS = """
motion: {joints: [elbow, shoulder], duration_s: 10, lower: [-1.5], upper: [1.5], velocity: [2]}
search: {draws: 2}
"""


def test_a_stop_has_the_controller_hold_the_arm_where_it_was_measured(
    parameters: Path, tmp_path: Path
) -> None:
    with controlled(tmp_path, parameters, toy.JOINTS) as control:
        assert control.load(BROADCASTER)
        assert control.switch([BROADCASTER])
        control.use('arm_position')
        control.client.limit_s = LIMIT_S
        stop_in_mid_motion(control, tmp_path)


def stop_in_mid_motion(control: Control, tmp_path: Path) -> None:
    graph, client = control.graph, control.client
    (tmp_path / 'excite.yaml').write_text(SETTINGS)
    graph.start('train', recording__joints=list(toy.JOINTS), unsaved_path=str(tmp_path / 'kept'))
    excite = graph.start(
        'excite',
        controller_action='/arm_position/follow_joint_trajectory',
        config_path=str(tmp_path / 'excite.yaml'),
        motion_path=str(tmp_path / 'motion.yaml'),
        use_robot_description=False,
        effort_limits_from='none',
        tracking_tolerance=[10.0],
        stale_timeout_s=30.0,
        confirm=False,
        first_size=0.3,
    )
    states = client.listen(JointState, '/joint_states', qos.SENSOR_STREAM)
    client.status('train', lambda status: True)
    client.wait_until(lambda: client.trigger('/excite/start').success, 'the start')
    client.wait_until(lambda: len(states) > 1 and moved(states) > 0.02, 'a motion')
    assert client.trigger('/excite/stop').success
    ended = client.status('excite', lambda status: status['held'])
    assert 'Nobody knows' not in excite.log  # which joints the controller moves
    assert ended['stage'] == 'stopped'
    wanted = [ended['held'][name] for name in states[-1].name]
    client.wait_until(lambda: np.allclose(states[-1].position, wanted, atol=1e-6), 'the hold')
    heard = len(states)
    client.wait_until(lambda: len(states) > heard + 50, 'joint states')
    np.testing.assert_allclose(states[-1].position, wanted, atol=1e-6)
    assert 'by other means' not in client.status('excite', lambda status: True)['summary']


def moved(states: list[JointState]) -> float:
    return float(np.abs(np.subtract(states[-1].position, states[0].position)).max())

"""Diagnostics of the nodes, as tools of diagnostic_aggregator read them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from sensor_msgs.msg import JointState

from lip_id_ros.nodes import messages, qos

if TYPE_CHECKING:
    from nodes.ros_graph import Ros

pytestmark = pytest.mark.ros


def test_an_input_that_dies_is_stale(ros: Ros) -> None:
    graph, client = ros
    graph.start_with('train', ['-r', '__ns:=/left'])
    states = client.speak(JointState, '/left/joint_states', qos.OUTPUT)
    diagnostics = client.listen(DiagnosticArray, '/diagnostics', qos.DIAGNOSTICS)
    timer = client.node.create_timer(0.01, lambda: states.publish(JointState()))

    def inputs() -> DiagnosticStatus:
        client.wait_until(lambda: diagnostics, 'diagnostics')
        assert [each.name for each in diagnostics[-1].status] == [
            'left/train: status',
            'left/train: inputs',
        ]
        return diagnostics[-1].status[1]

    def rate() -> float:
        values = messages.status_values(inputs())['left/joint_states']
        return float(values['rate_hz'])

    client.wait_until(lambda: rate() > 5.0, 'the rate of the joint states')
    assert inputs().level == DiagnosticStatus.OK
    timer.cancel()
    client.wait_until(lambda: inputs().level == DiagnosticStatus.STALE, 'a dead input')
    assert inputs().message == 'came, and are silent: /left/joint_states'
    timer.reset()
    client.wait_until(lambda: inputs().level == DiagnosticStatus.OK, 'a living input')

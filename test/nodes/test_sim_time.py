"""Both nodes follow the /clock of a simulation, and a /clock that begins anew."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from diagnostic_msgs.msg import DiagnosticArray
from nodes.test_serve import GOOD
from nodes.test_train import joint_publisher, joint_state
from nodes.test_train_stream import counted
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.nodes import messages

if TYPE_CHECKING:
    from nodes.ros_graph import Graph, Ros

pytestmark = pytest.mark.ros


UNLIMITED = 'torques are not limited, and neither are their steps'


@contextmanager
def clock(graph: Graph, start_s: float) -> Iterator[None]:
    program = Path(__file__).with_name('clock.py')
    process = subprocess.Popen([sys.executable, program, str(start_s)], env=graph.environment)
    try:
        yield
    finally:
        process.terminate()
        process.wait()


def test_train_records_a_simulation_that_is_started_twice(ros: Ros) -> None:
    graph, client = ros
    graph.start('train', use_sim_time=True, record_on_start=True)
    publisher = joint_publisher(client)  # no clock yet: the status comes all the same
    diagnostics = client.listen(DiagnosticArray, '/diagnostics')

    def publish(first_s: float) -> None:
        for row in range(20):
            message = joint_state(row)
            message.header.stamp = messages.stamp_at(round((first_s + 0.01 * row) * 1e9))
            publisher.publish(message)

    def on_clock(first_s: float) -> bool:
        return bool(first_s <= diagnostics[-1].header.stamp.sec < first_s + 400)

    with clock(graph, 500.0):
        client.wait_until(lambda: diagnostics and on_clock(500.0), 'simulated time')
        publish(500.0)
        client.status('train', lambda status: status['rows'] == 20)
    with clock(graph, 5.0):
        client.wait_until(lambda: on_clock(5.0), 'simulated time that went back')
        publish(5.0)
        status = client.status('train', lambda status: counted(status) == 40)
    assert (status['rows'], status['rejected']) == (40, {})


def test_simulated_time_without_a_clock_is_told(ros: Ros, model_path: str) -> None:
    graph, client = ros
    graph.start('serve', model_path=model_path, use_sim_time=True, torque_limits=[1.0])
    client.status('serve', lambda status: 'but /clock has no time' in status['summary'])


def test_serve_stamps_by_the_clock_of_the_simulation(ros: Ros, model_path: str) -> None:
    graph, client = ros
    unstamped = JointTrajectory(joint_names=GOOD.joint_names, points=GOOD.points)
    with clock(graph, 500.0):
        graph.start('serve', model_path=model_path, use_sim_time=True, torque_limits_from='none')
        client.status('serve', lambda status: status['state'] == 'active')
        ticks = client.listen(Clock, '/clock')
        diagnostics = client.listen(DiagnosticArray, '/diagnostics')
        client.wait_until(
            lambda: diagnostics and diagnostics[-1].header.stamp.sec > 0, 'simulated time'
        )
        answers = client.listen(JointState, '/serve/feedforward_torque')
        publisher = client.speak(JointTrajectory, '/serve/desired_trajectory')
        publisher.publish(unstamped)
        client.wait_until(lambda: answers, 'answer')
        client.status('serve', lambda status: status['summary'] == 'answering; ' + UNLIMITED)
    stamp = answers[0].header.stamp
    assert ticks[0].clock.sec - 1 <= stamp.sec <= ticks[-1].clock.sec + 1

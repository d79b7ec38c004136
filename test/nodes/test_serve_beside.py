"""Node `serve` in a process of its own: the inputs and outputs beside references and torques."""

from __future__ import annotations

from copy import deepcopy
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from nodes import toy
from nodes.test_serve import EXPECTED, GOOD, REFERENCE, start_serve, TORQUE, trajectory
import numpy as np
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.nodes import messages

if TYPE_CHECKING:
    from nodes.ros_graph import Ros

pytestmark = pytest.mark.ros

PARTS = ('inertial', 'coriolis', 'gravity', 'friction')


def test_the_reference_of_a_running_controller_is_followed(ros: Ros, model_path: str) -> None:
    control_msgs = pytest.importorskip('control_msgs.msg')
    graph, client = ros
    start_serve(graph, model_path=model_path, follow_controller=True)
    torques = client.listen(JointState, TORQUE)
    State = control_msgs.JointTrajectoryControllerState
    publisher = client.speak(State, '/serve/controller_state')
    client.status('serve', lambda status: status['state'] == 'active')
    good = deepcopy(GOOD)
    state = State(header=good.header, joint_names=good.joint_names, reference=good.points[0])
    state.speed_scaling_factor = 1.0
    publisher.publish(state)
    client.wait_until(lambda: torques, 'answer')
    assert torques[0].header.stamp == GOOD.header.stamp
    np.testing.assert_allclose(torques[0].effort, EXPECTED, atol=0.1)
    state.reference.accelerations = []
    publisher.publish(state)
    client.status('serve', lambda status: status['refused'] == {'wrong length': 1})


def test_parts_and_deviations_are_published_if_asked_for(ros: Ros, model_path: str) -> None:
    graph, client = ros
    start_serve(
        graph,
        model_path=model_path,
        publish_parts=True,
        publish_std=True,
        std_rate_hz=100.0,
    )
    torques = client.listen(JointState, TORQUE)
    parts = [client.listen(JointState, f'/serve/torque/{part}') for part in PARTS]
    deviations = client.listen(JointState, '/serve/torque_std')
    publisher = client.speak(JointTrajectory, REFERENCE)
    client.status('serve', lambda status: status['state'] == 'active')

    def answered() -> bool:
        publisher.publish(GOOD)  # again: each topic finds its subscriber in its own time
        return bool(torques and all(parts) and deviations)

    client.wait_until(answered, 'answers')
    effort = {part: np.array(heard[0].effort) for part, heard in zip(PARTS, parts, strict=True)}
    total = np.sum(list(effort.values()), axis=0)
    np.testing.assert_allclose(total, torques[0].effort, atol=1e-9)
    np.testing.assert_allclose(
        effort['gravity'], toy.torque(np.array([0.3, -0.2]), np.zeros(2)), atol=0.1
    )
    assert deviations[0].header.stamp == GOOD.header.stamp
    assert all(0.0 < std < 1.0 for std in deviations[0].effort)


def test_measured_joint_states_give_energies_and_a_torque_residual(
    serving: Ros,
) -> None:
    _, client = serving
    client.set_parameter('serve', 'residual_cutoff_hz', 50.0)
    kinetic = client.listen(Float64, '/serve/measured/kinetic_energy')
    potential = client.listen(Float64, '/serve/measured/potential_energy')
    residuals = client.listen(JointState, '/serve/torque_residual')
    publisher = client.speak(JointState, '/joint_states')
    _, q, dq, ddq = toy.motion(60, seed=3)
    effort = toy.torque(q, ddq) + [0.0, 2.0]
    for row in range(len(q)):
        message = JointState(name=toy.JOINTS, position=q[row], velocity=dq[row])
        message.effort = effort[row].tolist()
        message.header.stamp = messages.stamp_at(10**18 + 10**7 * row)
        publisher.publish(message)
        client.wait_until(lambda: len(kinetic) > row, 'energy')  # noqa: B023
    client.wait_until(lambda: len(potential) == len(q), 'energies')
    energies = [each.data for each in kinetic]
    np.testing.assert_allclose(energies, toy.kinetic(dq), atol=0.05)
    client.wait_until(lambda: len(residuals) > 40, 'residuals')
    heard = [list(each.effort) for each in list(residuals)]
    assert residuals[0].header.stamp.nanosec > 0
    np.testing.assert_allclose(heard, np.tile([0.0, 2.0], (len(heard), 1)), atol=0.5)
    publisher.publish(JointState(name=['elbow'], position=[0.0]))
    client.status('serve', lambda status: status['unmeasured'] == {'joint missing': 1})


def test_a_plan_that_comes_out_after_its_begin_is_told(serving: Ros) -> None:
    _, client = serving
    plans = client.listen(JointTrajectory, '/serve/trajectory_with_effort')
    publisher = client.speak(JointTrajectory, REFERENCE)
    plan = trajectory(toy.JOINTS, deepcopy(GOOD.points[0]), deepcopy(GOOD.points[0]))
    now = client.node.get_clock().now().nanoseconds
    plan.points[1].time_from_start.sec = 600
    for begin in (now - 2 * 10**9, now + 600 * 10**9, 0):
        plan.header.stamp = messages.stamp_at(begin)
        publisher.publish(plan)
    client.wait_until(lambda: len(plans) == 3, 'plans')
    status = client.status('serve', lambda status: status['answered']['plans'] == 3)
    assert status['late_plans'] == 1

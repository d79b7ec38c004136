"""What the node `serve` does with messages: convert, ask, convert, publish."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import time
from typing import Any

from builtin_interfaces.msg import Time
import numpy as np
from rclpy.lifecycle import LifecycleNode
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.arrays import Array
from lip_id_ros.feedforward.server import Server
from lip_id_ros.nodes import messages
from lip_id_ros.nodes.serve_outputs import (
    ENERGY_TOPICS,
    Outputs,
    PART_TOPICS,
    RESIDUAL_TOPIC,
    STD_TOPIC,
)
from lip_id_ros.recording.joint_messages import from_joint_state
from lip_id_ros.signals.joints import ON_PURPOSE, RefusedError

WARNING_PERIOD_S = 5.0


class Answers:
    """
    Callbacks between a node's inputs, its server and its outputs.

    Parameters
    ----------
    node : LifecycleNode
        For its clock and log.
    server : Server
    outputs : Outputs

    """

    def __init__(self, node: LifecycleNode, server: Server, outputs: Outputs) -> None:
        self._node = node
        self._server = server
        self._outputs = outputs

    def on_trajectory(self, message: JointTrajectory) -> None:
        """Answer a plan, or a sample of a stream."""
        if len(message.points) > 1:
            self._unless_refused(lambda: self._answer_plan(message))
        else:
            self.on_sample(message.header.stamp, message.joint_names, message.points)

    def on_sample(self, stamp: Time, names: Sequence[str], points: Sequence[Any]) -> None:
        """Answer a sample of a stream: one point."""
        self._unless_refused(lambda: self._answer_sample(stamp, names, points))

    def _unless_refused(self, answer: Callable[[], None]) -> None:
        try:
            answer()
        except RefusedError as refused:
            if refused.reason not in ON_PURPOSE:
                self._node.get_logger().warning(
                    f'refused a reference ({refused.reason}): {refused}',
                    throttle_duration_sec=WARNING_PERIOD_S,
                )

    def _answer_sample(self, stamp: Time, names: Sequence[str], points: Sequence[Any]) -> None:
        if messages.is_zero(stamp):
            stamp = self._now()
        answer = self._server.sample(names, points, time.monotonic(), stamp)
        self._outputs.torque(stamp, self._server.joint_names, answer.tau)
        self._outputs.energies(answer)
        if self._outputs.wants(*PART_TOPICS):
            self._outputs.parts(stamp, self._server.joint_names, self._server.parts(answer))

    def _answer_plan(self, message: JointTrajectory) -> None:
        tau = self._server.plan(message.joint_names, message.points)
        self._outputs.plan(message, tau)

    def on_joint_state(self, message: JointState) -> None:
        """Tell energies and torque residual to those who listen."""
        motion = self._server.measure(from_joint_state(message), time.monotonic())
        if motion is None:
            return
        if self._outputs.wants(*ENERGY_TOPICS):
            self._outputs.measured_energies(self._server.measured_energies(motion))
        if self._outputs.wants(RESIDUAL_TOPIC):
            self._publish_vector(
                RESIDUAL_TOPIC, message.header.stamp, self._server.residual(motion)
            )

    def watch(self) -> None:
        """Say what a robot must hear that no reference reaches, and what was computed beside."""
        tau = self._server.safe_torque(time.monotonic())
        if tau is not None:
            self._outputs.torque(self._now(), self._server.joint_names, tau)
        deviated = self._server.take_deviation()
        if deviated is not None:
            self._publish_vector(STD_TOPIC, deviated.tag, deviated.std)

    def _publish_vector(self, topic: str, stamp: Time, tau: Array | None) -> None:
        if tau is not None:
            self._outputs.joints(topic, stamp, self._server.joint_names, tau)

    def publish_zero(self) -> None:
        """Publish zero torque: whoever holds the last command then holds none."""
        if self._server.active and self._server.enabled:
            names = self._server.joint_names
            self._outputs.torque(self._now(), names, np.zeros(len(names)))

    def _now(self) -> Time:
        return self._node.get_clock().now().to_msg()

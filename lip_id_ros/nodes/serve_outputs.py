"""What the node `serve` publishes."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any

from builtin_interfaces.msg import Time
import numpy as np
from rclpy.lifecycle import LifecycleNode
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.arrays import Array
from lip_id_ros.feedforward.feedforward import Answer, Parts
from lip_id_ros.feedforward.settings import ServeSettings
from lip_id_ros.nodes import messages, qos

PARTS = ('inertial', 'coriolis', 'gravity', 'friction')
PART_TOPICS = tuple(f'torque/{part}' for part in PARTS)
STD_TOPIC = 'torque_std'
ENERGY_TOPICS = ('measured/kinetic_energy', 'measured/potential_energy')
RESIDUAL_TOPIC = 'torque_residual'


class Outputs:
    """
    Publishers that speak while the node is active.

    Parameters
    ----------
    node : LifecycleNode

    """

    def __init__(self, node: LifecycleNode) -> None:
        self._node = node
        self._torque = self._publisher(JointState, '~/feedforward_torque')
        self._kinetic = self._publisher(Float64, '~/kinetic_energy')
        self._potential = self._publisher(Float64, '~/potential_energy')
        self._plan = self._publisher(JointTrajectory, '~/trajectory_with_effort')
        self._optional: dict[str, Any] = {}

    def configure(self, settings: ServeSettings) -> None:
        """Make the publishers that are asked for."""
        if settings.publish_commands:
            self._add(Float64MultiArray, 'commands')
        for topic in PART_TOPICS if settings.publish_parts else ():
            self._add(JointState, topic)
        if settings.publish_std:
            self._add(JointState, STD_TOPIC)
        if settings.follow_joint_states:
            for topic in ENERGY_TOPICS:
                self._add(Float64, topic)
            self._add(JointState, RESIDUAL_TOPIC)

    def clean_up(self) -> None:
        """Take back what `configure` made."""
        for publisher in self._optional.values():
            self._node.destroy_lifecycle_publisher(publisher)
        self._optional.clear()

    def wants(self, *names: str) -> bool:
        """Tell whether anybody listens to one of the optional topics."""
        publishers = [self._optional[name] for name in names if name in self._optional]
        return any(publisher.get_subscription_count() for publisher in publishers)

    def torque(self, stamp: Time, names: Sequence[str], tau: Array) -> None:
        """Publish what the robot shall do, shape (n,) [N m or N]."""
        self._torque.publish(messages.torque_message(stamp, names, tau))
        if 'commands' in self._optional:
            self._optional['commands'].publish(messages.command_message(tau))

    def energies(self, answer: Answer) -> None:
        """Publish the energies of a reference."""
        _publish_finite(self._kinetic, answer.kinetic)
        _publish_finite(self._potential, answer.potential)

    def measured_energies(self, answer: Answer) -> None:
        """Publish the energies of a measured state."""
        kinetic, potential = ENERGY_TOPICS
        _publish_finite(self._optional[kinetic], answer.kinetic)
        _publish_finite(self._optional[potential], answer.potential)

    def plan(self, plan: JointTrajectory, tau: Array) -> None:
        """Publish a plan with efforts, shape (number of points, n) [N m or N]."""
        self._plan.publish(messages.with_effort(plan, tau))

    def parts(self, stamp: Time, names: Sequence[str], parts: Parts) -> None:
        """Publish the parts of the model's torque at one sample, those that are finite."""
        for part, topic in zip(PARTS, PART_TOPICS, strict=True):
            self.joints(topic, stamp, names, getattr(parts, part)[0])

    def joints(self, topic: str, stamp: Time, names: Sequence[str], tau: Array) -> None:
        """Publish one optional vector, shape (n,) [N m or N], if it is finite."""
        if topic in self._optional and np.isfinite(tau).all():
            self._optional[topic].publish(messages.torque_message(stamp, names, tau))

    def _add(self, kind: Any, name: str) -> None:
        self._optional[name] = self._publisher(kind, f'~/{name}')

    def _publisher(self, kind: Any, topic: str) -> Any:
        return self._node.create_lifecycle_publisher(kind, topic, qos.OUTPUT)


def _publish_finite(publisher: Any, value: float) -> None:
    if math.isfinite(value):
        publisher.publish(Float64(data=value))

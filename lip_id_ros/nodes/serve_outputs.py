"""The publishers of the node `serve`."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
import math
import time
from typing import Any

from builtin_interfaces.msg import Time
import numpy as np
from pal_statistics_msgs.msg import Statistics
from rclpy.duration import Duration
from rclpy.lifecycle import LifecycleNode
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.arrays import Array
from lip_id_ros.feedforward.settings import ServeSettings
from lip_id_ros.model import Prediction, Query
from lip_id_ros.nodes import messages, qos

DELIVERY_S = 5.0
"""A subscriber that does not answer for so long holds up the node's end no more."""

COMPONENTS = ('inertial', 'coriolis', 'gravity', 'friction')
COMPONENT_TOPICS = tuple(f'torque/{part}' for part in COMPONENTS)
STD_TOPIC = 'torque_std'
MEASURED_TOPICS = ('measured/kinetic_energy', 'measured/potential_energy', 'measured/energies')
RESIDUAL_TOPIC = 'torque_residual'


class Outputs:
    """Publishers, which are active while the node is."""

    def __init__(self, node: LifecycleNode) -> None:
        self._node = node
        self._torque = self._publisher(JointState, '~/feedforward_torque', qos.COMMAND)
        self._kinetic = self._publisher(Float64, '~/kinetic_energy')
        self._potential = self._publisher(Float64, '~/potential_energy')
        self._energies = self._publisher(Statistics, '~/energies')
        self._plan = self._publisher(JointTrajectory, '~/trajectory_with_effort')
        self._optional: dict[str, Any] = {}
        self._message, self._command = JointState(), Float64MultiArray()
        self._of_commands: list[int] = []  # they have no names, but the order of `joints`

    def configure(self, settings: ServeSettings, joint_names: Sequence[str]) -> None:
        """Make the publishers that are asked for; torques are of these joints."""
        self._message.name = list(joint_names)
        order = settings.joints or joint_names
        self._of_commands = [joint_names.index(name) for name in order]
        if settings.publish_commands:
            self._add(Float64MultiArray, 'commands', qos.COMMAND)
        for topic in COMPONENT_TOPICS if settings.publish_parts else ():
            self._add(JointState, topic)
        if settings.publish_std:
            self._add(JointState, STD_TOPIC)
        if settings.follow_joint_states:
            for topic in MEASURED_TOPICS[:2]:
                self._add(Float64, topic)
            self._add(Statistics, MEASURED_TOPICS[2])
            self._add(JointState, RESIDUAL_TOPIC)

    def topics(self) -> set[str]:
        """Return the full names of topics of torques and plans."""
        return {self._plan.topic_name, *self.commands()}

    def commands(self) -> set[str]:
        """Return the full names of topics of torques."""
        publishers = [self._torque, *filter(None, [self._optional.get('commands')])]
        return {publisher.topic_name for publisher in publishers}

    def clean_up(self) -> None:
        """Destroy what `configure` made, after subscribers have its last messages."""
        self._await_delivery()
        for publisher in self._optional.values():
            self._node.destroy_lifecycle_publisher(publisher)
        self._optional.clear()

    def _await_delivery(self) -> None:
        """Wait for reliable subscribers of torques: with its publisher the last zero is lost."""
        publishers = [self._torque, *filter(None, [self._optional.get('commands')])]
        if all(publisher.wait_for_all_acked(Duration()) for publisher in publishers):
            return
        log = self._node.get_logger()
        log.info('waits until every subscriber has the last torque')
        end = time.monotonic() + DELIVERY_S
        for publisher in publishers:
            rest = Duration(seconds=max(0.0, end - time.monotonic()))
            if not publisher.wait_for_all_acked(rest):
                log.warning(
                    f'a subscriber of {publisher.topic_name} has not confirmed the last torque '
                    f'within {DELIVERY_S:g} s; it may still hold another one.'
                )

    def wants(self, *names: str) -> bool:
        """Return whether anybody subscribes to one of the optional topics."""
        publishers = [self._optional[name] for name in names if name in self._optional]
        return any(publisher.get_subscription_count() for publisher in publishers)

    def torque(self, stamp: Time, tau: Array) -> None:
        """Publish the robot's torque, shape (n,) [N m or N]; its message has the names already."""
        self._message.header.stamp = stamp
        self._message.effort = array('d', tau.tobytes())
        self._torque.publish(self._message)
        if 'commands' in self._optional:
            self._command.data = array('d', tau[self._of_commands].tobytes())
            self._optional['commands'].publish(self._command)

    def energies(self, stamp: Time, query: Query) -> None:
        """Publish the energies of a reference."""
        _publish_finite(self._kinetic, query.kinetic)
        _publish_finite(self._potential, query.potential)
        if self._energies.get_subscription_count():
            self._energies.publish(_energies(stamp, query))

    def measured_energies(self, stamp: Time, query: Query) -> None:
        """Publish the energies of a measured state."""
        kinetic, potential, both = MEASURED_TOPICS
        _publish_finite(self._optional[kinetic], query.kinetic)
        _publish_finite(self._optional[potential], query.potential)
        self._optional[both].publish(_energies(stamp, query))

    def plan(self, plan: JointTrajectory) -> None:
        """Publish a plan with efforts."""
        self._plan.publish(plan)

    def components(self, stamp: Time, predicted: Prediction) -> None:
        """Publish the parts of the model's torque at one sample, those that are finite."""
        for part, topic in zip(COMPONENTS, COMPONENT_TOPICS, strict=True):
            self.joints(topic, stamp, getattr(predicted, part)[0])

    def joints(self, topic: str, stamp: Time, tau: Array) -> None:
        """Publish one optional vector, shape (n,) [N m or N], if it is finite."""
        if topic in self._optional and np.isfinite(tau).all():
            message = messages.torque_message(stamp, self._message.name, tau)
            self._optional[topic].publish(message)

    def _add(self, kind: Any, name: str, profile: QoSProfile = qos.OUTPUT) -> None:
        self._optional[name] = self._publisher(kind, f'~/{name}', profile)

    def _publisher(self, kind: Any, topic: str, profile: QoSProfile = qos.OUTPUT) -> Any:
        with qos.overriding(self._node, 'publisher', topic, profile) as given:
            return self._node.create_lifecycle_publisher(kind, topic, **given)


def _publish_finite(publisher: Any, value: float) -> None:
    if math.isfinite(value):
        publisher.publish(Float64(data=value))


def _energies(stamp: Time, query: Query) -> Statistics:
    energies = {'kinetic_energy': query.kinetic, 'potential_energy': query.potential}
    return messages.statistics_message(stamp, energies)

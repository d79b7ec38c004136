"""What the node `serve` subscribes to."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.errors import ConfigError
from lip_id_ros.feedforward.settings import ServeSettings
from lip_id_ros.nodes import qos
from lip_id_ros.nodes.serve_answers import Answers


class Inputs:
    """
    Subscriptions, those that are asked for while the node is configured.

    Parameters
    ----------
    node : Node
    answers : Answers
        Gets the messages.

    """

    def __init__(self, node: Node, answers: Answers) -> None:
        self._node = node
        self._answers = answers
        self._optional: list[Any] = []
        node.create_subscription(
            JointTrajectory, '~/desired_trajectory', answers.on_trajectory, qos.REFERENCE
        )

    def configure(self, settings: ServeSettings) -> None:
        """
        Subscribe to what is asked for.

        Raises
        ------
        ConfigError
            If the type of a message is not installed.

        """
        if settings.follow_controller:
            kind = _controller_state()
            self._add(kind, '~/controller_state', self._on_controller_state)
        if settings.follow_joint_states:
            self._add(JointState, 'joint_states', self._answers.on_joint_state)

    def clean_up(self) -> None:
        """Unsubscribe from what `configure` subscribed to."""
        for subscription in self._optional:
            self._node.destroy_subscription(subscription)
        self._optional.clear()

    def _add(self, kind: Any, topic: str, callback: Callable[[Any], None]) -> None:
        subscription = self._node.create_subscription(kind, topic, callback, qos.NEWEST)
        self._optional.append(subscription)

    def _on_controller_state(self, message: Any) -> None:
        # before Jazzy the reference was called desired
        reference = message.reference if hasattr(message, 'reference') else message.desired
        self._answers.on_sample(message.header.stamp, message.joint_names, [reference])


def _controller_state() -> Any:
    try:
        from control_msgs.msg import JointTrajectoryControllerState
    except ImportError:
        raise ConfigError(
            'follow_controller needs the package control_msgs, which this ROS has not; install '
            'ros-jazzy-control-msgs or leave follow_controller false.'
        ) from None
    return JointTrajectoryControllerState

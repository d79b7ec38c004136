"""The URDF of a node's robot: from its parameter, or from the latched topic robot_description."""

from __future__ import annotations

from collections.abc import Sequence
import time

from std_msgs.msg import String

from lip_id_ros.description import is_text
from lip_id_ros.description.limits import effort_limits
from lip_id_ros.errors import DataError
from lip_id_ros.nodes import qos
from lip_id_ros.nodes.node import NodeBase

NAME = 'robot_description'

LONGEST_WAIT_S, POLL_S = 5.0, 0.02
"""A launch starts robot_state_publisher, which may read xacro, with the node that needs it."""


class Description:
    """
    The last URDF that came on robot_description, or the one that the node was given.

    `given`: text of a URDF; empty for that of the topic.
    """

    def __init__(self, node: NodeBase, given: str = '') -> None:
        self._text, self._place = given, f'the parameter {NAME}'
        self._node = node
        if not given:
            self._subscription = node.create_subscription(String, NAME, self._take, qos.LATCHED)
            self._place = self._subscription.topic_name

    def require(self, setting: str, remedy: str) -> str:
        """Return the URDF that a setting asks for; DataError if there is none."""
        if not self._text:
            raise DataError(
                f'a URDF was expected on {self._place} ({setting}), but none has come; start '
                f'robot_state_publisher, or {remedy}.'
            )
        if not is_text(self._text):  # else it would be taken for the name of a file
            raise DataError(
                f'a URDF was expected on {self._place} ({setting}), but {self._text[:40]!r} came; '
                'correct its publisher.'
            )
        return self._text

    def torque_limits(self, joints: Sequence[str]) -> tuple[float, ...]:
        """Return the limits of joints [N m or N], and log them; DataError if one lacks."""
        end = time.monotonic() + LONGEST_WAIT_S
        while not self._text and time.monotonic() < end:
            self._node.take_waiting(self._subscription)
            time.sleep(POLL_S)
        text = self.require('torque_limits_from', 'give torque_limits')
        limits = effort_limits(text, self._place, joints)
        found = ', '.join(
            f'{joint} {limit:g}' for joint, limit in zip(joints, limits, strict=True)
        )
        self._node.get_logger().info(f'torque_limits of {self._place}: {found}')
        return limits

    def _take(self, message: String) -> None:
        if self._text not in ('', message.data):
            self._node.warn(
                NAME,
                f'another URDF came on {self._place}: limits of torques stay until they are read '
                'again, a fit takes the newest; check for two publishers.',
            )
        self._text = message.data

"""What a node tells about itself: latched JSON on ~/status, and /diagnostics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
import json
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node
from std_msgs.msg import String

from lip_id_ros.nodes import messages, qos
from lip_id_ros.nodes.guard import GuardedNode

OK: bytes = DiagnosticStatus.OK
WARN: bytes = DiagnosticStatus.WARN
ERROR: bytes = DiagnosticStatus.ERROR


@dataclass(frozen=True)
class Status:
    """
    One state of a node.

    Attributes
    ----------
    level : bytes
        `OK`, `WARN` or `ERROR`.
    summary : str
        One sentence.
    values : mapping
        JSON-able.

    """

    level: bytes
    summary: str
    values: Mapping[str, Any] = field(default_factory=dict)


class StatusPublisher:
    """
    Publish states of a node.

    Parameters
    ----------
    node : Node
        Whose state it is.

    """

    def __init__(self, node: Node) -> None:
        self._node = node
        # A lifecycle node must tell about itself in every state: these are plain publishers.
        self._status = node.create_publisher(String, '~/status', qos.LATCHED)
        self._diagnostics = node.create_publisher(DiagnosticArray, '/diagnostics', qos.DIAGNOSTICS)
        self._last = ''
        self._faults = 0

    def publish(self, status: Status) -> None:
        """Publish to /diagnostics, and to ~/status if anything changed."""
        status = self._with_faults(status)
        text = json.dumps({'summary': status.summary, **status.values})
        if text != self._last:
            self._status.publish(String(data=text))
            self._last = text
        self._diagnostics.publish(
            messages.diagnostics_message(
                self._node.get_clock().now().to_msg(),
                self._node.get_fully_qualified_name().lstrip('/'),
                status.level,
                status.summary,
                status.values,
            )
        )

    def _with_faults(self, status: Status) -> Status:
        """Add what the node's guard caught."""
        node = self._node
        if not isinstance(node, GuardedNode):
            return status
        values = {**status.values, 'faults': node.faults}
        new, self._faults = node.faults - self._faults, node.faults
        if not new:
            return replace(status, values=values)
        return Status(ERROR, f'a callback failed: {node.last_fault}', values)

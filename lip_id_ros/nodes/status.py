"""The state of a node: latched on ~/status, and in /diagnostics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
import socket
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node

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
        # A lifecycle node has a status in every state: these are plain publishers.
        self._status = node.create_publisher(DiagnosticStatus, '~/status', qos.LATCHED)
        self._diagnostics = node.create_publisher(DiagnosticArray, '/diagnostics', qos.DIAGNOSTICS)
        self._name = node.get_fully_qualified_name().lstrip('/')
        # the robot's name where it has one: nodes of several arms may share a computer
        self._hardware = node.get_namespace().strip('/') or socket.gethostname()
        self._last: DiagnosticStatus | None = None
        self._faults = 0

    def publish(self, status: Status) -> None:
        """Publish to /diagnostics, and to ~/status if anything changed."""
        status = self._with_misfits(self._with_faults(status))
        message = messages.status_message(
            self._name, self._hardware, status.level, status.summary, status.values
        )
        if message != self._last:
            self._status.publish(message)
            self._last = message
        diagnostics = DiagnosticArray(status=[message])
        diagnostics.header.stamp = self._node.get_clock().now().to_msg()
        self._diagnostics.publish(diagnostics)

    def _with_faults(self, status: Status) -> Status:
        """Add what the node's guard caught."""
        node = self._node
        if not isinstance(node, GuardedNode):
            return status
        values = {**status.values, 'faults': node.faults, 'last_fault': node.last_fault}
        new, self._faults = node.faults - self._faults, node.faults
        if new:
            return Status(ERROR, f'a callback failed: {node.last_fault}', values)
        return Status(status.level, status.summary, values)

    def _with_misfits(self, status: Status) -> Status:
        """Warn of publishers whose quality of service is too low."""
        misfits = qos.misfits(self._node)
        if not misfits or status.level != OK:
            return status
        return Status(WARN, f'{status.summary}; {"; ".join(misfits)}', status.values)

"""Topics of the graph into a bag."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
import importlib
from typing import Any

from rclpy.node import Node

from lip_id_ros.demo.topics import TYPES
from lip_id_ros.nodes import qos
from lip_id_ros.recording.bag_writer import RawBag


class BagRecorder:
    """
    Write the demo's topics as they come.

    Parameters
    ----------
    node : Node
        Subscribes.
    bag : RawBag
        Open.

    Attributes
    ----------
    counts : Counter
        Messages by topic.

    """

    def __init__(self, node: Node, bag: RawBag) -> None:
        self.counts: Counter[str] = Counter()
        self._node = node
        self._bag = bag
        self._subscriptions = [
            node.create_subscription(
                message_class(kind), topic, self._writer(topic), qos.OUTPUT, raw=True
            )
            for topic, kind in TYPES.items()
        ]

    def stop(self) -> None:
        """Write nothing more."""
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)

    def _writer(self, topic: str) -> Callable[[bytes], None]:
        def write(data: bytes) -> None:
            self._bag.write(topic, self._node.get_clock().now().nanoseconds, data)
            self.counts[topic] += 1

        return write


def message_class(kind: str) -> Any:
    """Return the class of a message type such as std_msgs/msg/Float64."""
    package, _, name = kind.split('/')
    return getattr(importlib.import_module(f'{package}.msg'), name)

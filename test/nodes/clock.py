"""Program: publish /clock from a given second on, as a simulator does."""

from __future__ import annotations

from contextlib import suppress
import sys
import time

import rclpy
from rclpy.executors import ExternalShutdownException
from rosgraph_msgs.msg import Clock

from lip_id_ros.nodes import messages

STEP_S = 0.01


def main(start_s: float) -> None:
    rclpy.init()
    node = rclpy.create_node('clock')
    publisher = node.create_publisher(Clock, '/clock', 10)
    begun = time.monotonic()

    def tick() -> None:
        now_s = start_s + time.monotonic() - begun
        publisher.publish(Clock(clock=messages.stamp_at(round(now_s * 1e9))))

    node.create_timer(STEP_S, tick)
    with suppress(ExternalShutdownException):
        rclpy.spin(node)


if __name__ == '__main__':
    main(float(sys.argv[1]))

"""Program: publish /clock from a given second on, as a simulator does."""

from __future__ import annotations

import sys
import time

import rclpy
from rosgraph_msgs.msg import Clock

from lip_id_ros.nodes import messages

STEP_S = 0.01


def main(start_s: float) -> None:
    rclpy.init()
    publisher = rclpy.create_node('clock').create_publisher(Clock, '/clock', 10)
    begun = time.monotonic()
    while rclpy.ok():
        now_s = start_s + time.monotonic() - begun
        publisher.publish(Clock(clock=messages.stamp_at(round(now_s * 1e9))))
        time.sleep(STEP_S)


if __name__ == '__main__':
    main(float(sys.argv[1]))

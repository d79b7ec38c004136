"""A motion as a stream of states, for controllers that take positions or references."""

from __future__ import annotations

from collections.abc import Mapping
import time

import numpy as np
from rclpy.task import Future
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.excitation.streaming import StreamedMotion
from lip_id_ros.excitation.trajectory_file import Trajectory
from lip_id_ros.nodes import messages, qos
from lip_id_ros.nodes.motion_goal import LATE_S, Until
from lip_id_ros.nodes.node import NodeBase

LATEST = 2.0
"""Periods by which the motion goes on at most: a busy machine makes it slower, without a jump."""


class MotionStream:
    """
    Publishes motions, one at a time, at a rate [Hz].

    Positions go to ~/commands, for a forward_command_controller, and whole states to ~/reference,
    for `serve` or a controller of one's own. One that is halted slows down along its path, and
    rests after `ramp` seconds. `positions`: of the joints by name, as they are.
    """

    doubt = ''

    def __init__(
        self, node: NodeBase, rate: float, ramp: float, positions: Mapping[str, float]
    ) -> None:
        self._node, self._period, self._ramp, self._positions = node, 1.0 / rate, ramp, positions
        self._commands = node.create_publisher(Float64MultiArray, '~/commands', qos.OUTPUT)
        self._reference = node.create_publisher(JointTrajectory, '~/reference', qos.OUTPUT)
        self._motion: StreamedMotion | None = None
        self._names: tuple[str, ...] = ()
        # of the last state: by the time of the motion, and by the clock
        self._t, self._published_at = 0.0, 0.0
        self._over = Future(executor=node.executor)
        node.create_steady_timer(self._period, self._publish)

    def forget(self) -> None:
        """Forget what was in doubt: nothing is."""

    def missing(self) -> str | None:
        """Return why no motion can begin, or None."""
        publishers = self._commands, self._reference
        if not any(each.get_subscription_count() for each in publishers):
            return (
                f'nobody takes {publishers[0].topic_name} or {publishers[1].topic_name}; remap '
                'one of them to the topic of a controller, and activate that'
            )
        for each in publishers:
            if (count := self._node.count_publishers(each.topic_name)) > 1:
                return f'{each.topic_name} has {count} publishers; end all but one'
        return None

    def since_start(self) -> tuple[float, float]:
        """Return between which times after its start a joint state heard now is [s]."""
        return max(0.0, self._t - LATE_S - self._period), self._t

    async def execute(self, planned: Trajectory, until: Until) -> None:
        """Publish a motion to its end."""
        position = np.array([self._positions[name] for name in planned.joint_names])
        self._names = planned.joint_names
        self._over = Future(executor=self._node.executor)
        self._t, self._published_at = 0.0, time.monotonic()
        self._motion = StreamedMotion(planned, position, self._ramp)
        await until(self._over)

    def halt(self) -> None:
        """Slow down the motion that runs, if one does."""
        if self._motion is not None:
            self._motion.halt(self._t)

    def stop(self) -> None:
        """Publish until the motion rests."""
        while self._motion is not None:
            self._publish()
            time.sleep(self._period)

    def watch(self, moving: bool) -> str | None:
        """Return why a motion must be halted, or None."""
        return self.missing() if moving else None

    def _publish(self) -> None:
        if self._motion is None:
            return
        now = time.monotonic()
        self._t += min(now - self._published_at, LATEST * self._period)
        self._published_at = now
        q, dq, ddq = self._motion.state(self._t)
        self._commands.publish(Float64MultiArray(data=messages.doubles(q)))
        sample = messages.plan_message(
            self._names, np.zeros(1), *(each[None] for each in (q, dq, ddq))
        )
        sample.header.stamp = self._node.get_clock().now().to_msg()
        self._reference.publish(sample)
        if self._motion.is_over(self._t):
            self._motion = None
            if not self._over.done():
                self._over.set_result(None)

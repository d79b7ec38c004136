"""An arm of two joints that a controller moves: its action, and its joint states with efforts."""

from __future__ import annotations

from contextlib import suppress
import threading
import time
from typing import Any

from control_msgs.action import FollowJointTrajectory
from gp.chains import R, random_arm
import numpy as np
import rclpy
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.arrays import Array
from lip_id_ros.nodes import messages, qos

JOINTS = ('shoulder', 'elbow')
RATE_HZ = 100.0
VISCOUS, COULOMB, WIDTH, NOISE = 0.5, 0.8, 0.02, 0.02
ACTION = '/arm/follow_joint_trajectory'
REST = np.zeros((3, len(JOINTS)))


class MovedArm(Node):
    """
    It follows plans exactly; beyond `blocked_at` [rad] its first joint does not move.

    Where it `ignores_cancels` it goes on all the same. It `answers_after` a while [s], and says
    that a motion `ends_after` another, whenever that ends. With a topic `reference` it follows
    that.
    """

    def __init__(self) -> None:
        super().__init__('moved_arm')
        self._blocked_at = self.declare_parameter('blocked_at', np.inf).value
        self._ignores_cancels = self.declare_parameter('ignores_cancels', False).value
        if topic := self.declare_parameter('reference', '').value:
            self.create_subscription(JointTrajectory, topic, self._follow, qos.REFERENCE)
        self._answers_after = self.declare_parameter('answers_after', 0.0).value
        self._ends_after = self.declare_parameter('ends_after', 0.0).value
        self._arm, self._rng = random_arm((R, R), seed=3), np.random.default_rng(0)
        self._lock = threading.Lock()
        self._plan: tuple[Array, Array] | None = None  # times, states
        self._begun, self._q = 0.0, REST[0].copy()
        self._states = self.create_publisher(JointState, '/joint_states', qos.OUTPUT)
        own = ReentrantCallbackGroup()
        self._server = ActionServer(
            self,
            FollowJointTrajectory,
            ACTION,
            execute_callback=self._execute,
            goal_callback=self._accept,
            cancel_callback=self._cancel,
            callback_group=own,
        )
        self.create_timer(1.0 / RATE_HZ, self._tick, callback_group=own)

    def _accept(self, goal: Any) -> GoalResponse:
        time.sleep(self._answers_after)
        return GoalResponse.ACCEPT

    def _execute(self, handle: Any) -> Any:
        points = handle.request.trajectory.points
        names = handle.request.trajectory.joint_names
        order = [names.index(joint) for joint in JOINTS]
        t = np.array([p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in points])
        rows = np.array([[p.positions, p.velocities, p.accelerations] for p in points])
        with self._lock:
            self._plan, self._begun = (t, rows[:, :, order]), time.monotonic()
        end = self._ends_after or t[-1]
        while time.monotonic() - self._begun < end:
            if handle.is_cancel_requested:
                self._end()  # it may have been cancelled before it began
                handle.canceled()
                return FollowJointTrajectory.Result()
            time.sleep(0.02)
        if not self._ends_after:
            self._end()
        handle.succeed()
        return FollowJointTrajectory.Result()

    def _follow(self, message: JointTrajectory) -> None:
        (point,), names = message.points, list(message.joint_names)
        order = [names.index(joint) for joint in JOINTS]
        row = np.array([[point.positions, point.velocities, point.accelerations]])[:, :, order]
        with self._lock:
            self._plan, self._begun = (np.zeros(1), row), 0.0

    def _cancel(self, handle: Any) -> CancelResponse:
        if self._ignores_cancels:
            return CancelResponse.REJECT
        self._end()
        return CancelResponse.ACCEPT

    def _end(self) -> None:
        with self._lock:
            self._plan = None

    def _tick(self) -> None:
        with self._lock:
            q, dq, ddq = self._state()
            self._q = q
        load = self._arm.torque(q[None], dq[None], ddq[None])[0]
        friction = VISCOUS * dq + COULOMB * np.tanh(dq / WIDTH)
        tau = load + friction + NOISE * self._rng.standard_normal(len(q))
        now = self.get_clock().now().to_msg()
        # as drivers do, in an order that is not that of the motion
        values = (each[::-1] for each in (q, dq, tau))
        self._states.publish(messages.joint_state_message(now, JOINTS[::-1], *values))

    def _state(self) -> Array:
        if self._plan is None:
            return np.stack([self._q, *REST[1:]])
        t, rows = self._plan
        since = time.monotonic() - self._begun
        flat = rows.reshape(len(t), -1).T
        state = np.array([np.interp(since, t, column) for column in flat]).reshape(3, -1)
        if abs(state[0, 0]) > self._blocked_at:
            state[:, 0] = np.sign(state[0, 0]) * self._blocked_at, 0.0, 0.0
        return state


def main() -> None:
    rclpy.init()
    executor = MultiThreadedExecutor(num_threads=3)
    executor.add_node(MovedArm())
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        executor.spin()


if __name__ == '__main__':
    main()

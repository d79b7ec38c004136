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

from lip_id_ros.arrays import Array
from lip_id_ros.nodes import messages, qos

JOINTS = ('shoulder', 'elbow')
RATE_HZ = 100.0
VISCOUS, COULOMB, WIDTH, NOISE = 0.5, 0.8, 0.02, 0.02
ACTION = '/arm/follow_joint_trajectory'
REFERENCE = '/arm/reference'
REST = np.zeros((3, len(JOINTS)))


class MovedArm(Node):
    """
    It follows plans exactly; beyond `blocked_at` [rad] its first joint does not move.

    Its controller is of the `joints` of its parameter, takes no notice of names, and holds the
    last reference of a motion that is cancelled, which it publishes as well. Where it
    `ignores_cancels` it goes on all the same. It `answers_after` a while [s], and says that a
    motion `ends_after` another, whenever that ends. Where it `splits`, each joint has joint states
    of its own.
    """

    def __init__(self) -> None:
        super().__init__('arm')
        self._joints = self.declare_parameter('joints', list(JOINTS)).value
        self._splits = self.declare_parameter('splits', False).value
        self._blocked_at = self.declare_parameter('blocked_at', np.inf).value
        self._ignores_cancels = self.declare_parameter('ignores_cancels', False).value
        self._answers_after = self.declare_parameter('answers_after', 0.0).value
        self._ends_after = self.declare_parameter('ends_after', 0.0).value
        self._arm, self._rng = random_arm((R, R), seed=3), np.random.default_rng(0)
        self._lock = threading.Lock()
        self._plan: tuple[Array, Array] | None = None  # times, states
        self._begun, self._q = 0.0, REST[0].copy()
        self._reference = self.create_publisher(JointState, REFERENCE, qos.OUTPUT)
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
        busy = self._ignores_cancels and self._plan is not None
        return GoalResponse.REJECT if busy else GoalResponse.ACCEPT

    def _execute(self, handle: Any) -> Any:
        points = handle.request.trajectory.points
        order = [self._joints.index(joint) for joint in JOINTS]
        t = np.array([p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in points])
        rows = np.array([[p.positions, p.velocities, p.accelerations] for p in points])
        rows = rows[:, :, order]
        with self._lock:
            if t[0] > 0.0:  # it goes there from where it is told to be
                here = np.stack([self._q, *REST[1:]])[None]
                t, rows = np.append(0.0, t), np.concatenate([here, rows])
            self._plan, self._begun = (t, rows), time.monotonic()
        end = self._ends_after or t[-1]
        while rclpy.ok() and time.monotonic() - self._begun < end:
            if handle.is_cancel_requested:
                self._end()  # it may have been cancelled before it began
                handle.canceled()
                return FollowJointTrajectory.Result()
            time.sleep(0.02)
        if not rclpy.ok():
            return FollowJointTrajectory.Result()
        if not self._ends_after:
            with self._lock:
                self._plan, self._q = None, rows[-1, 0]
        handle.succeed()
        return FollowJointTrajectory.Result()

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
            state = self._state()
            self._q = state[0]
        now = self.get_clock().now().to_msg()
        self._reference.publish(messages.joint_state_message(now, JOINTS, *state))
        q, dq, ddq = self._blocked(state)
        load = self._arm.torque(q[None], dq[None], ddq[None])[0]
        friction = VISCOUS * dq + COULOMB * np.tanh(dq / WIDTH)
        tau = load + friction + NOISE * self._rng.standard_normal(len(q))
        # as drivers do, in an order that is not that of the motion
        names, values = JOINTS[::-1], [each[::-1] for each in (q, dq, tau)]
        parts = [slice(0, 1), slice(1, 2)] if self._splits else [slice(0, 2)]
        for part in parts:
            own = (each[part] for each in values)
            self._states.publish(messages.joint_state_message(now, names[part], *own))

    def _state(self) -> Array:
        if self._plan is None:
            return np.stack([self._q, *REST[1:]])
        t, rows = self._plan
        since = time.monotonic() - self._begun
        flat = rows.reshape(len(t), -1).T
        return np.array([np.interp(since, t, column) for column in flat]).reshape(3, -1)

    def _blocked(self, state: Array) -> Array:
        if abs(state[0, 0]) > self._blocked_at:
            state = state.copy()
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

"""Plans of messages, with the points, times and efforts that `serve` gives them."""

from __future__ import annotations

import time

from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.feedforward.served_arm import LATE_S
from lip_id_ros.feedforward.server import Server
from lip_id_ros.nodes.messages import nanoseconds, plan_message
from lip_id_ros.nodes.node import NodeBase
from lip_id_ros.signals.joints import Refusal, RefusedError

MOST_SECONDS = 2.0**31
"""Beyond those of a Duration."""


def answered(
    node: NodeBase,
    server: Server,
    asked: JointTrajectory,
    *,
    age: float = 0.0,
    speed: float = 1.0,
) -> JointTrajectory:
    """
    Return a plan with efforts; RefusedError if it cannot be answered.

    `age`, `speed`: as in `Server.plan`. A plan that begins late is logged.
    """
    late, now = _lateness(node, asked), time.monotonic()
    found = server.plan(asked.joint_names, asked.points, now, age, speed, late)
    plan, (q, dq, ddq) = found.plan, found.plan.states
    if plan.t[-1] >= MOST_SECONDS:
        raise RefusedError(Refusal.BEYOND_LIMITS)
    if late > LATE_S:
        node.warn(
            'late_plans',
            f'a plan came out {late:.1f} s after the stamp at which it begins; send plans '
            'earlier, or leave their stamps zero',
        )
    message = plan_message(plan.joint_names, plan.t, q, dq, ddq, found.tau)
    message.header = asked.header
    return message


def _lateness(node: NodeBase, plan: JointTrajectory) -> float:
    """Return the time since the stamp at which a plan begins [s]; 0 where it has none."""
    stamp_ns = nanoseconds(plan.header.stamp)
    return 1e-9 * (node.get_clock().now().nanoseconds - stamp_ns) if stamp_ns else 0.0

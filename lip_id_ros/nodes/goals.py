"""The action FollowJointTrajectory of `serve`, in front of that of the controller."""

from __future__ import annotations

import time
from typing import Any

from control_msgs.action import FollowJointTrajectory
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import GoalEvent
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory

from lip_id_ros.feedforward.goals import Ending, GoalCounts, Outcome
from lip_id_ros.feedforward.server import Server
from lip_id_ros.nodes import plans, qos
from lip_id_ros.nodes.controller import Controller, SpeedScaling
from lip_id_ros.nodes.node import NodeBase
from lip_id_ros.nodes.relay import Relay, WatchedTime
from lip_id_ros.signals.joints import Refusal, RefusedError

NAME = '~/follow_joint_trajectory'

LOOK_S = 0.1
"""A controller is looked for so often while it has goals: each look takes half a millisecond."""

KEPT_S = 60
"""Results are kept for so long: every client asks for them when its goal is accepted."""

NEARLY = 0.05
"""Speed scalings that differ by less are alike."""


class Goals:
    """
    Fill the efforts of goals, hand them to the controller, and hand back all that it answers.

    A goal keeps its identity, its tolerances and whatever else it has. One that cannot be filled,
    or that no controller would take, is refused. `action` is that of the controller, and
    `state_topic` has its states, which are to be heard.
    """

    def __init__(self, node: NodeBase, server: Server, counts: GoalCounts, action: str) -> None:
        self._node, self._server, self._counts = node, server, counts
        self.controller = Controller(node, action)
        self._relays: dict[bytes, Relay] = {}  # by the identity of the goal
        self._time, self._look_at = WatchedTime(), 0.0
        self._scaling, self._speed = SpeedScaling(), 1.0
        self._is_closed = False
        self.state_topic = f'{self.controller.action.rpartition("/")[0]}/controller_state'
        calls = dict.fromkeys(
            [f'{each}_service_qos_profile' for each in ('goal', 'result', 'cancel')], qos.CALLS
        )
        self._offered = ActionServer(
            node,
            FollowJointTrajectory,
            NAME,
            goal_callback=self._on_goal,
            handle_accepted_callback=self._hand_on,
            cancel_callback=self._on_cancel,
            result_timeout=KEPT_S,
            **calls,
        )

    def warnings(self) -> list[str]:
        """Describe what is missing or wrong for goals."""
        found = []
        if not self.controller.is_offered:
            found.append(f'no controller offers the action {self.controller.action}')
        for relay in self._relays.values():
            if abs(self._speed - relay.speed) > NEARLY:
                found.append(
                    f'a goal with efforts for {100 * relay.speed:.0f} % of its speed is executed '
                    f'at {100 * self._speed:.0f} %: its efforts of inertia and friction are '
                    'wrong; send it again at this speed'
                )
        return found

    def watch(self) -> None:
        """Go on with goals whose controller is missing."""
        self.controller.watch()
        self._time.advance(time.monotonic())
        if not self._relays or self._time.now < self._look_at:
            return
        self._look_at = self._time.now + LOOK_S
        for relay in list(self._relays.values()):
            relay.watch()

    def close(self) -> None:
        """Take no more goals, and have the controller cancel all."""
        self._is_closed = True
        self.release()

    def release(self) -> None:
        """Have the controller cancel all goals: nobody wants their efforts, or can cancel them."""
        for relay in list(self._relays.values()):
            relay.release()

    def destroy(self) -> None:
        """Offer the action no more; the controller is left to be asked on."""
        self.release()
        self._offered.destroy()

    def hear(self, message: Any) -> None:
        """Take a state of the controller: efforts of the next goal are for its speed."""
        speed = self._scaling.read(message)
        self._speed = speed if self._scaling.is_known else 1.0  # an old controller at rest has 0

    def _on_goal(self, goal: Any) -> GoalResponse:
        """Fill a goal; refuse it where that is not possible, with a reason in log and status."""
        self._counts.received += 1
        references = self._server.counts.references
        try:
            with references.receiving():
                if self._is_closed:
                    raise RefusedError(Refusal.ENDING)
                if not self.controller.is_offered:
                    raise RefusedError(Refusal.NO_CONTROLLER)
            goal.trajectory = plans.answered(
                self._node, self._server, goal.trajectory, speed=self._speed
            )
        except RefusedError as refused:
            # the action has no place for a reason
            reason = refused.reason
            self._node.warn(f'goal: {reason}', f'refused a goal ({reason}): {refused}')
        except Exception as error:
            reason = Refusal.FAILED
            self._node.caught(error)
        else:
            return GoalResponse.ACCEPT
        self._counts.refused[reason.value] += 1
        return GoalResponse.REJECT

    def _hand_on(self, handle: Any) -> None:
        handle.executing()
        relay = Relay(self.controller, self._time, handle, self._speed, self._finish)
        self._relays[_identity(handle)] = relay
        relay.send()
        _forget_plan(handle)

    def _on_cancel(self, handle: Any) -> CancelResponse:
        relay = self._relays.get(_identity(handle))
        if relay is not None:
            relay.cancel()
        return CancelResponse.ACCEPT

    def _finish(self, relay: Relay, outcome: Outcome, result: Any) -> None:
        handle = relay.handle
        del self._relays[_identity(handle)]
        self._counts.end(outcome)
        if result is None:
            result = FollowJointTrajectory.Result(
                error_code=outcome.code, error_string=outcome.sentence
            )
        if outcome.ending is Ending.SUCCEEDED:
            handle.succeed(result)
        elif outcome.ending is Ending.CANCELED:
            if not handle.is_cancel_requested:  # the controller did it by itself
                handle._update_state(GoalEvent.CANCEL_GOAL)
            handle.canceled(result)
        else:
            handle.abort(result)


def _identity(handle: Any) -> bytes:
    return bytes(handle.goal_id.uuid)


def _forget_plan(handle: Any) -> None:
    """Let go of what is large in a goal: rclpy keeps it for `KEPT_S` after its end."""
    handle.request.trajectory = JointTrajectory()
    handle.request.multi_dof_trajectory = MultiDOFJointTrajectory()

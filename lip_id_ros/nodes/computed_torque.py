"""Node `computed_torque`: plans with efforts and joint states in, torques out."""

from __future__ import annotations

from dataclasses import replace
import sys
import time

from builtin_interfaces.msg import Time
from rclpy.duration import Duration
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.arrays import Array
from lip_id_ros.control.plan_controller import LetGo, PlanController
from lip_id_ros.control.settings import ControlSettings
from lip_id_ros.nodes import messages, qos, running
from lip_id_ros.nodes.description import Description
from lip_id_ros.nodes.node import NodeBase
from lip_id_ros.recording.joint_messages import from_joint_state
from lip_id_ros.settings import parameters_of
from lip_id_ros.signals.joints import RefusedError
from lip_id_ros.signals.status import Status
from lip_id_ros.signals.torque_steps import DESCRIBED

WATCH_PERIOD_S = 0.005

DELIVERY_S = 1.0
"""A subscriber that does not confirm the last torque holds up the node's end no longer."""


class ComputedTorqueNode(NodeBase):
    """
    Answer each joint state with a torque, while there is a plan.

    The plan's clock is the stamp of the joint states: it begins with the first after the plan.
    Where a plan is let go, a callback fails or the node ends, torques go to zero, and then there
    are none: to hold the arm is the business of its brakes or its driver.
    """

    def __init__(self) -> None:
        super().__init__('computed_torque', parameters_of(ControlSettings))
        settings = self._settings()
        self._controller = PlanController(settings)
        self._several = settings.several_publishers
        self._told = ''
        self._command = self.create_publisher(JointState, '~/command', qos.OUTPUT)
        self.create_subscription(
            JointTrajectory, '~/joint_trajectory', self._on_plan, qos.REFERENCE, raw=True
        )
        states = self.create_subscription(
            JointState, 'joint_states', self._on_joint_state, qos.NEWEST
        )
        self._states_topic = states.topic_name
        self.create_steady_timer(WATCH_PERIOD_S, self._watch)
        # the first line of a log takes up to 100 ms: not while a torque has to go to zero
        self.get_logger().info(f'controls {", ".join(self._controller.joint_names)}')

    def status(self) -> Status:
        """Return the controller's status."""
        return self._controller.status()

    def warnings(self) -> list[str]:
        """Describe what is wrong around the node, several publishers of joint states too."""
        if self._several == 'allow':
            return super().warnings()
        return [*super().warnings(), *qos.several_publishers(self, self._states_topic)]

    def output_safe_torque(self) -> None:
        """Let the plan go: torques go to zero from now on."""
        self._controller.let_go(LetGo.FAULT, f'a callback failed: {self.last_fault}')
        self._watch()

    def stop(self) -> None:
        """Bring the torques to zero, and wait until subscribers have the last one."""
        self._controller.let_go(LetGo.END, 'the node ends')
        while self._controller.releasing:
            self._watch()
            time.sleep(WATCH_PERIOD_S)
        self._command.wait_for_all_acked(Duration(seconds=DELIVERY_S))

    def _settings(self) -> ControlSettings:
        settings = ControlSettings(**self.values())
        if settings.torque_limits != DESCRIBED:
            return settings
        description = Description(self, settings.robot_description)
        description.wait()
        return replace(settings, torque_limits=description.torque_limits(settings.joints))

    def _on_plan(self, raw: bytes) -> None:
        try:
            self._controller.take_serialised(raw, time.monotonic())
        except RefusedError as refused:
            self.warn_of_refusal(refused)

    def _on_joint_state(self, message: JointState) -> None:
        try:
            tau = self._controller.torques(from_joint_state(message), time.monotonic())
        except RefusedError as refused:
            self.warn_of_refusal(refused)
            return
        if tau is not None:
            self._publish(message.header.stamp, tau)
        self._tell()

    def _watch(self) -> None:
        """Publish the next torque on the way to zero, if a plan was let go."""
        if self._several == 'refuse' and self.count_publishers(self._states_topic) > 1:
            self._controller.let_go(LetGo.PUBLISHERS, 'joint states have several publishers')
        tau = self._controller.watch(time.monotonic())
        if tau is not None:
            self._publish(self.get_clock().now().to_msg(), tau)
        self._tell()

    def _publish(self, stamp: Time, tau: Array) -> None:
        self._command.publish(messages.torque_message(stamp, self._controller.joint_names, tau))

    def _tell(self) -> None:
        failure = self._controller.failure
        if failure != self._told:
            self._told = failure
            if failure:
                self.get_logger().error(failure)
            self.publish_status()


def main() -> int:
    """Run the node `computed_torque`."""
    return running.run(ComputedTorqueNode)


if __name__ == '__main__':
    sys.exit(main())

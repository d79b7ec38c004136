"""Node `computed_torque`: plans with efforts and joint states in, torques out."""

from __future__ import annotations

import sys

from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.control.computed_torque import ControlSettings, PlanController
from lip_id_ros.nodes import messages, qos, running
from lip_id_ros.nodes.node import NodeBase
from lip_id_ros.recording.joint_messages import from_joint_state
from lip_id_ros.settings import parameters_of
from lip_id_ros.signals.joints import RefusedError
from lip_id_ros.signals.status import Status


class ComputedTorqueNode(NodeBase):
    """
    Answer each joint state with a torque, while there is a plan.

    The plan's clock is the stamp of the joint states: it begins with the first after the plan.
    Without torques an arm engages its brakes, so nothing is done when the node ends.

    """

    def __init__(self) -> None:
        super().__init__('computed_torque', parameters_of(ControlSettings))
        self._controller = PlanController(ControlSettings(**self.values()))
        self._command = self.create_publisher(JointState, '~/command', qos.OUTPUT)
        self.create_subscription(
            JointTrajectory, '~/joint_trajectory', self._on_plan, qos.REFERENCE
        )
        self.create_subscription(JointState, 'joint_states', self._on_joint_state, qos.NEWEST)

    def status(self) -> Status:
        """Return the controller's status."""
        return self._controller.status()

    def _on_plan(self, plan: JointTrajectory) -> None:
        try:
            self._controller.take(plan.joint_names, plan.points)
        except RefusedError as refused:
            self.warn_of_refusal(refused)

    def _on_joint_state(self, message: JointState) -> None:
        try:
            tau = self._controller.torques(from_joint_state(message))
        except RefusedError as refused:
            self.warn_of_refusal(refused)
            return
        if tau is not None:
            names = self._controller.joint_names
            self._command.publish(messages.torque_message(message.header.stamp, names, tau))


def main() -> int:
    """Run the node `computed_torque`."""
    return running.run(ComputedTorqueNode)


if __name__ == '__main__':
    sys.exit(main())

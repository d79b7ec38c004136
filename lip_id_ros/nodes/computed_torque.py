"""Node `computed_torque`: plans with efforts and joint states in, torques out."""

from __future__ import annotations

from collections import Counter
import sys

from rclpy.clock import Clock, ClockType
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.control.plan_controller import PlanController
from lip_id_ros.control.settings import ControlSettings
from lip_id_ros.nodes import messages, parameters, qos, running
from lip_id_ros.nodes.guard import GuardedNode
from lip_id_ros.nodes.status import OK, Status, StatusPublisher, WARN
from lip_id_ros.recording.joint_messages import from_joint_state
from lip_id_ros.settings.nodes import parameters_of
from lip_id_ros.signals.joints import RefusedError

STATUS_PERIOD_S = 0.5


class ComputedTorqueNode(GuardedNode):
    """
    Answer each joint state with a torque, while there is a plan.

    The plan's clock is the stamp of the joint states: it begins with the first after the plan.

    """

    def __init__(self) -> None:
        super().__init__('computed_torque')
        table = parameters_of(ControlSettings)
        parameters.declare(self, table)
        self._controller = PlanController(ControlSettings(**parameters.values(self, table)))
        self._counts = Counter(plans=0, torques=0, idle=0)
        self._refused: Counter[str] = Counter()
        self._status = StatusPublisher(self)
        self._command = self.create_publisher(JointState, '~/command', qos.OUTPUT)
        self.create_subscription(
            JointTrajectory, '~/joint_trajectory', self._on_plan, qos.REFERENCE
        )
        self.create_subscription(JointState, 'joint_states', self._on_joint_state, qos.NEWEST)
        # steady: a paused simulation must not silence the diagnostics
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(STATUS_PERIOD_S, self._publish_status, clock=steady)

    def stop(self) -> None:
        """Do nothing: an arm without torques takes its brakes."""

    def _on_plan(self, plan: JointTrajectory) -> None:
        try:
            self._controller.take(plan.joint_names, plan.points)
        except RefusedError as refused:
            self._refuse(refused)
        else:
            self._counts['plans'] += 1

    def _on_joint_state(self, message: JointState) -> None:
        try:
            torques = self._controller.torques(from_joint_state(message))
        except RefusedError as refused:
            self._refuse(refused)
            return
        if torques is None:
            self._counts['idle'] += 1
            return
        self._counts['torques'] += 1
        names = self._controller.joint_names
        self._command.publish(messages.torque_message(message.header.stamp, names, torques))

    def _refuse(self, refused: RefusedError) -> None:
        self._refused[refused.reason.value] += 1
        self.get_logger().warning(f'refused: {refused}', throttle_duration_sec=1.0)

    def _publish_status(self) -> None:
        level = WARN if self._refused else OK
        summary = 'something was refused' if self._refused else 'all is answered'
        self._status.publish(
            Status(level, summary, {**self._counts, 'refused': dict(self._refused)})
        )


def main() -> int:
    """Run the node `computed_torque`."""
    return running.run(ComputedTorqueNode)


if __name__ == '__main__':
    sys.exit(main())

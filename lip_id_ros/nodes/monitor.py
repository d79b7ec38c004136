"""Node `monitor`: joint states in; external torques, contacts and the balance of energy out."""

from __future__ import annotations

import math
import sys
import time

from pal_statistics_msgs.msg import Statistics
from rclpy.clock import Clock, ClockType
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64
from std_srvs.srv import Trigger

from lip_id_ros.monitoring.monitor import Monitor, MonitorDiagnostics
from lip_id_ros.monitoring.settings import MonitorSettings
from lip_id_ros.nodes import messages, parameters, qos, running
from lip_id_ros.nodes.guard import GuardedNode
from lip_id_ros.nodes.status import Status, StatusPublisher
from lip_id_ros.recording.joint_messages import from_joint_state
from lip_id_ros.settings.nodes import parameters_of
from lip_id_ros.signals.joints import RefusedError

STATUS_PERIOD_S = 0.5


class MonitorNode(GuardedNode):
    """
    Publish what the model estimates of each joint state.

    Raises
    ------
    InvalidParameterValueException
        If a parameter is given a value that is not allowed.
    LipIdError
        If the model does not fit.
    OSError
        If it cannot be opened.

    """

    def __init__(self) -> None:
        super().__init__('monitor')
        table = parameters_of(MonitorSettings)
        parameters.declare(self, table)
        self._monitor = Monitor(MonitorSettings(**parameters.values(self, table)))
        self._diagnostics = MonitorDiagnostics(self._monitor)
        self._status = StatusPublisher(self)
        self._torque = self.create_publisher(JointState, '~/external_torque', qos.OUTPUT)
        self._contact = self.create_publisher(Bool, '~/contact', qos.OUTPUT)
        self._total = self.create_publisher(Float64, '~/total_energy', qos.OUTPUT)
        self._unexplained = self.create_publisher(Float64, '~/power_unexplained', qos.OUTPUT)
        self._energy = self.create_publisher(Statistics, '~/energy', qos.OUTPUT)
        self.create_service(Trigger, '~/calibrate', self._on_calibrate)
        self.create_subscription(JointState, 'joint_states', self._on_joint_state, qos.NEWEST)
        # steady: a paused simulation must not silence the diagnostics
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(STATUS_PERIOD_S, self._publish_status, clock=steady)

    def stop(self) -> None:
        """Nothing to let go of."""

    def _on_joint_state(self, message: JointState) -> None:
        try:
            watched = self._monitor.take(from_joint_state(message))
        except RefusedError as refused:
            self.get_logger().warning(f'refused: {refused}', throttle_duration_sec=5.0)
            return
        if watched is None:
            return
        self._torque.publish(
            messages.torque_message(
                message.header.stamp, self._monitor.joint_names, watched.external.torque
            )
        )
        self._unexplained.publish(Float64(data=watched.energy.unexplained))
        if math.isfinite(watched.energy.total):
            self._total.publish(Float64(data=watched.energy.total))
        if self._energy.get_subscription_count():
            energies = {
                'total_energy': watched.energy.total,
                'power_supplied': watched.energy.supplied,
                'power_unexplained': watched.energy.unexplained,
            }
            self._energy.publish(messages.energies_message(message.header.stamp, energies))
        if watched.contact is not None:
            self._contact.publish(Bool(data=watched.contact))

    def _on_calibrate(
        self, request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        response.success, response.message = True, self._monitor.calibrate()
        return response

    def _publish_status(self) -> None:
        level, summary = self._diagnostics.health(time.monotonic())
        self._status.publish(Status(bytes([level]), summary, self._monitor.status()))


def main() -> int:
    """Run the node `monitor`."""
    return running.run(MonitorNode)


if __name__ == '__main__':
    sys.exit(main())

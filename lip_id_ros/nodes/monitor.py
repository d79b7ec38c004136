"""Node `monitor`: joint states in; external torques, contacts and the balance of energy out."""

from __future__ import annotations

import math
import sys
import time

from control_msgs.msg import DynamicInterfaceGroupValues
from pal_statistics_msgs.msg import Statistics
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64
from std_srvs.srv import Trigger

from lip_id_ros.monitoring.monitor import Monitor, MonitorSettings, Watched
from lip_id_ros.nodes import messages, qos, running
from lip_id_ros.nodes.node import NodeBase
from lip_id_ros.recording.joint_messages import from_joint_state
from lip_id_ros.settings import parameters_of
from lip_id_ros.signals.joints import RefusedError
from lip_id_ros.signals.status import Status


class MonitorNode(NodeBase):
    """Publish what the model estimates of each joint state; LipIdError if it does not fit."""

    def __init__(self) -> None:
        super().__init__('monitor', parameters_of(MonitorSettings))
        settings = MonitorSettings(**self.values())
        self._monitor = Monitor(settings)
        self._torque = self.create_publisher(JointState, '~/external_torque', qos.OUTPUT)
        self._std = self.create_publisher(JointState, '~/external_torque_std', qos.OUTPUT)
        self._contact = self.create_publisher(Bool, '~/contact', qos.OUTPUT)
        self._blind = self.create_publisher(Bool, '~/blind', qos.OUTPUT)
        self._total = self.create_publisher(Float64, '~/total_energy', qos.OUTPUT)
        self._unexplained = self.create_publisher(Float64, '~/power_unexplained', qos.OUTPUT)
        self._energy = self.create_publisher(Statistics, '~/energy', qos.OUTPUT)
        self.create_service(Trigger, '~/calibrate', self._on_calibrate)
        self.create_subscription(JointState, 'joint_states', self._on_joint_state, qos.WATCHED)
        if settings.follow_adaptation:
            self.create_subscription(
                DynamicInterfaceGroupValues, 'adapt/update', self._on_update, qos.LATCHED
            )

    def status(self) -> Status:
        """Return the state of the monitor and its counts."""
        return Status(*self._monitor.judge(time.monotonic()), self._monitor.values())

    def _on_joint_state(self, message: JointState) -> None:
        try:
            watched = self._monitor.take(from_joint_state(message))
        except RefusedError as refused:
            self.warn_of_refusal(refused)
            return
        if watched is not None:
            self._publish(message, watched)

    def _on_update(self, message: DynamicInterfaceGroupValues) -> None:
        try:
            clock_ns = self.get_clock().now().nanoseconds
            self._monitor.take_update(message, time.monotonic(), clock_ns)
        except RefusedError as refused:
            self.warn_of_refusal(refused)

    def _publish(self, message: JointState, watched: Watched) -> None:
        stamp, energy = message.header.stamp, watched.energy
        names = self._monitor.joint_names
        self._torque.publish(messages.torque_message(stamp, names, watched.external.torque))
        self._unexplained.publish(Float64(data=energy.unexplained))
        if math.isfinite(energy.total):
            self._total.publish(Float64(data=energy.total))
        if self._energy.get_subscription_count():
            energies = {
                'total_energy': energy.total,
                'power_supplied': energy.supplied,
                'power_unexplained': energy.unexplained,
            }
            self._energy.publish(messages.statistics_message(stamp, energies))
        if watched.judged is not None:
            self._std.publish(messages.torque_message(stamp, names, watched.judged.std))
            self._blind.publish(Bool(data=bool(watched.judged.blind.any())))
            self._contact.publish(Bool(data=watched.contact))

    def _on_calibrate(
        self, request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        response.success, response.message = True, self._monitor.calibrate()
        return response


def main() -> int:
    """Run the node `monitor`."""
    return running.run(MonitorNode)


if __name__ == '__main__':
    sys.exit(main())

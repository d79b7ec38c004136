"""Node `monitor`: joint states in; external torques, contacts and the balance of energy out."""

from __future__ import annotations

from collections.abc import Mapping
import json
import math
import sys
import time
from typing import Any

from control_msgs.msg import DynamicInterfaceGroupValues, DynamicJointState
from pal_statistics_msgs.msg import Statistics
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from lip_id_ros.errors import one_line
from lip_id_ros.files import state_folder, write_whole
from lip_id_ros.monitoring.monitor import Monitor, Watched
from lip_id_ros.monitoring.settings import MonitorSettings
from lip_id_ros.nodes import messages, qos, running
from lip_id_ros.nodes.node import NodeBase
from lip_id_ros.recording.joint_messages import from_joint_state
from lip_id_ros.settings import parameters_of
from lip_id_ros.signals.status import Status


class MonitorNode(NodeBase):
    """Publish what the model estimates of each joint state; LipIdError if it does not fit."""

    def __init__(self, **options: Any) -> None:
        super().__init__('monitor', parameters_of(MonitorSettings), **options)
        settings = MonitorSettings(**self.values())
        self._monitor = Monitor(settings)
        self._torque = self.create_publisher(JointState, '~/external_torque', qos.OUTPUT)
        self._contact = self.create_publisher(DynamicJointState, '~/contact', qos.OUTPUT)
        self._total = self.create_publisher(Float64, '~/total_energy', qos.OUTPUT)
        self._unexplained = self.create_publisher(Float64, '~/power_unexplained', qos.OUTPUT)
        self._energy = self.create_publisher(Statistics, '~/energy', qos.OUTPUT)
        self._calibrated: Future | None = None
        self.create_service(
            Trigger,
            '~/calibrate',
            self._on_calibrate,
            callback_group=ReentrantCallbackGroup(),  # a call begins anew while another waits
        )
        self.create_subscription(JointState, 'joint_states', self._on_joint_state, qos.WATCHED)
        if settings.follow_adaptation:
            self.create_subscription(
                DynamicInterfaceGroupValues, 'adapt/update', self._on_update, qos.LATCHED
            )

    def status(self) -> Status:
        """Return the state of the monitor and its counts."""
        return Status(*self._monitor.judge(time.monotonic()), self._monitor.values())

    def check_change(self, values: Mapping[str, Any]) -> None:
        """Refuse contacts that the last calibration does not show."""
        if 'smallest_contact' in values:
            self._monitor.contacts.require_shown(values['smallest_contact'])

    def apply_change(self, values: Mapping[str, Any]) -> None:
        """Detect contacts of another size from the next joint state on."""
        if 'smallest_contact' in values:
            self._monitor.contacts.find(values['smallest_contact'])

    def _on_joint_state(self, message: JointState) -> None:
        watched = self.unless_refused(self._monitor.take, from_joint_state(message))
        if watched is not None:
            self._publish(message, watched)
        if self._calibrated is not None and self._monitor.contacts.state != 'calibrating':
            self._calibrated.set_result('')
            self._calibrated = None

    def _on_update(self, message: DynamicInterfaceGroupValues) -> None:
        clock_ns = self.get_clock().now().nanoseconds
        self.unless_refused(self._monitor.take_update, message, time.monotonic(), clock_ns)

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
        if watched.contacts is not None:
            self._contact.publish(messages.joint_values_message(stamp, names, watched.contacts))

    async def _on_calibrate(
        self, request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        """Answer once the motion has been watched."""
        if self._calibrated is not None:
            self._calibrated.set_result('begun anew by another call')
        self.get_logger().info(self._monitor.contacts.calibrate())
        self._calibrated = calibrated = Future(executor=self.executor)
        response.message = await calibrated
        if not response.message:
            response.message = self._ended()
            response.success = not self._monitor.contacts.failure
        return response

    def _ended(self) -> str:
        """Log how a calibration has ended; keep parameters that do."""
        sentence, parameters = self._monitor.contacts.outcome()
        name = self.get_fully_qualified_name()
        path = state_folder(name) / 'monitor.yaml'
        if parameters:
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                lines = [f'    {key}: {json.dumps(row)}' for key, row in parameters.items()]
                text = '\n'.join([f'{name}:', '  ros__parameters:', *lines, ''])
                write_whole(path, text.encode())
                sentence += f'; parameters that do are in {path}'
            except OSError as error:
                sentence += f'; {one_line(error)}'
        logger = self.get_logger()
        (logger.error if self._monitor.contacts.failure else logger.info)(sentence)
        return sentence


def main() -> int:
    """Run the node `monitor`."""
    return running.run(MonitorNode)


if __name__ == '__main__':
    sys.exit(main())

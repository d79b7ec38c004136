"""Node `simulated_arm`: torques in, joint states out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
import sys
import time

import numpy as np
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

from lip_id_ros.arrays import Array
from lip_id_ros.demo.settings import ArmSettings
from lip_id_ros.errors import ConfigError
from lip_id_ros.nodes import messages, parameters, qos, running
from lip_id_ros.recording.joint_messages import from_joint_state
from lip_id_ros.settings.nodes import parameters_of
from lip_id_ros.signals.joints import JointOrder, Refusal, RefusedError
from lip_id_ros.simulation import TorqueControlledArm
from lip_id_ros.tracking.experiment import panda_setup

RETRY_S = 0.2


class ArmNode(Node):
    """
    A Panda that moves by a millisecond for each torque that it hears.

    Its clock is in the stamps, and advances with the torques: a slow computer makes the motion
    slow, not unstable; and without torques the arm stands, as if it had taken its brakes. A
    torque answers the joint state whose stamp it bears; any other is left aside. What is not
    answered is published again, since messages may be lost.

    Raises
    ------
    ConfigError
        If `contact` has another length than there are joints.

    """

    def __init__(self) -> None:
        super().__init__('simulated_arm')
        self._table = parameters_of(ArmSettings)
        parameters.declare(self, self._table)
        settings = self._settings()
        setup, n = panda_setup(settings.n_joints), settings.n_joints
        still = np.zeros((1, n))
        self._arm = TorqueControlledArm(
            setup.arm, setup.drives, setup.posture, still[0], np.random.default_rng(settings.seed)
        )
        self._arm.hold(self._arm.bodies.inverse_dynamics(setup.posture[None], still, still)[0])
        self._order = JointOrder(setup.arm.joint_names)
        self._contact = external(settings)
        self._start_ns = self.get_clock().now().nanoseconds
        self._publisher = self.create_publisher(JointState, 'joint_states', qos.OUTPUT)
        self.create_subscription(JointState, 'command', self._on_command, qos.OUTPUT)
        self.add_on_set_parameters_callback(self._check_change)
        self.add_post_set_parameters_callback(self._on_change)
        self._measure()
        # steady: the arm is its own clock
        self.create_timer(RETRY_S / 2, self._retry, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def stop(self) -> None:
        """Nothing to let go of."""

    def _settings(self) -> ArmSettings:
        return ArmSettings(**parameters.values(self, self._table))

    def _check_change(self, changed: Sequence[Parameter]) -> SetParametersResult:
        try:
            values = parameters.changed_values(self._table, changed)
            external(replace(self._settings(), **values))
        except ConfigError as error:
            return parameters.refused(error)
        return SetParametersResult(successful=True)

    def _on_change(self, changed: Sequence[Parameter]) -> None:
        self._contact = external(self._settings())

    def _measure(self) -> None:
        measured = self._arm.measure()
        stamp = messages.stamp_at(self._start_ns + round(1e9 * measured.t))
        message = messages.torque_message(stamp, self._order.joint_names, measured.tau)
        message.position = messages.doubles(measured.q)
        message.velocity = messages.doubles(measured.dq)
        self._state = message
        self._publish()

    def _publish(self) -> None:
        self._published = time.monotonic()
        self._publisher.publish(self._state)

    def _retry(self) -> None:
        if time.monotonic() - self._published > RETRY_S:
            self._publish()

    def _on_command(self, message: JointState) -> None:
        if message.header.stamp != self._state.header.stamp:
            return
        try:
            command = self._torque(message)
        except RefusedError as refused:
            self.get_logger().warning(f'refused: {refused}', throttle_duration_sec=1.0)
            return
        self._arm.step(command, self._contact)
        self._measure()

    def _torque(self, message: JointState) -> Array:
        command = from_joint_state(message)
        columns = self._order.columns(command.names)
        if len(command.effort) != len(command.names):
            raise RefusedError(Refusal.WRONG_LENGTH)
        effort = np.asarray(command.effort, dtype=np.float64)[columns]
        if not np.isfinite(effort).all():
            raise RefusedError(Refusal.NOT_FINITE)
        return effort


def external(settings: ArmSettings) -> Array:
    """
    Return the torques of the contact, shape (n,) [N m].

    Raises
    ------
    ConfigError
        If their number is not that of the joints.

    """
    contact = settings.contact or (0.0,) * settings.n_joints
    if len(contact) != settings.n_joints:
        raise ConfigError(
            f'contact must have one number for each of {settings.n_joints} joints, but has '
            f'{len(contact)}.'
        )
    return np.array(contact)


def main() -> int:
    """Run the node `simulated_arm`."""
    return running.run(ArmNode)


if __name__ == '__main__':
    sys.exit(main())

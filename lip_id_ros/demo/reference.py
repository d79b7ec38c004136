"""Node `reference`: the paper's tracking reference as one plan."""

from __future__ import annotations

import math
import sys
import time

from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from lip_id_ros.control import GrowingCosine
from lip_id_ros.demo.settings import ReferenceSettings
from lip_id_ros.nodes import messages, parameters, qos, running
from lip_id_ros.settings.nodes import parameters_of
from lip_id_ros.tracking.experiment import panda_setup

POINTS_HZ = 100.0
RETRY_S = 5.0


class ReferenceNode(Node):
    """
    Publish the plan as soon as `serve` is active and hears it.

    Publish it again where `computed_torque` has not taken it: as long as nodes find each other,
    messages between them may be lost.

    """

    def __init__(self) -> None:
        super().__init__('reference')
        table = parameters_of(ReferenceSettings)
        parameters.declare(self, table)
        self._plan = plan(ReferenceSettings(**parameters.values(self, table)))
        self._active = self._taken = False
        self._published = -math.inf
        self._publisher = self.create_publisher(
            JointTrajectory, 'desired_trajectory', qos.REFERENCE
        )
        self.create_subscription(DiagnosticStatus, 'serve/status', self._on_serve, qos.LATCHED)
        self.create_subscription(
            DiagnosticStatus, 'computed_torque/status', self._on_controller, qos.LATCHED
        )
        self.create_timer(0.1, self._publish)

    def stop(self) -> None:
        """Nothing to let go of."""

    def _on_serve(self, message: DiagnosticStatus) -> None:
        self._active = messages.status_values(message).get('state') == 'active'

    def _on_controller(self, message: DiagnosticStatus) -> None:
        self._taken = messages.status_values(message).get('plans', 0) > 0

    def _publish(self) -> None:
        due = time.monotonic() - self._published > RETRY_S
        if due and self._active and not self._taken and self._publisher.get_subscription_count():
            self._publisher.publish(self._plan)
            self._published = time.monotonic()


def plan(settings: ReferenceSettings) -> JointTrajectory:
    """Return the reference at a hundred points per second."""
    setup = panda_setup(settings.n_joints)
    reference = GrowingCosine(setup.posture, settings.amplitude, settings.horizon)
    t = np.linspace(0.0, settings.horizon, round(POINTS_HZ * settings.horizon) + 1)
    message = JointTrajectory(joint_names=list(setup.arm.joint_names))
    for at, q, dq, ddq in zip(t, *reference.sample(t), strict=True):
        sec, nanosec = divmod(round(1e9 * at), 1_000_000_000)
        message.points.append(
            JointTrajectoryPoint(
                positions=messages.doubles(q),
                velocities=messages.doubles(dq),
                accelerations=messages.doubles(ddq),
                time_from_start=Duration(sec=sec, nanosec=nanosec),
            )
        )
    return message


def main() -> int:
    """Run the node `reference`."""
    return running.run(ReferenceNode)


if __name__ == '__main__':
    sys.exit(main())

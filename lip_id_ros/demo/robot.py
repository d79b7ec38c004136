"""Node `simulated_panda`: a simulated Panda that moves on exciting sums of sinusoids."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import sys

from builtin_interfaces.msg import Time
import numpy as np
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from lip_id_ros.dataset import Dataset
from lip_id_ros.nodes import messages, parameters, qos, running
from lip_id_ros.settings import setting, Settings
from lip_id_ros.settings.nodes import EXECUTORS, parameters_of
from lip_id_ros.simulation import make_dataset, panda, SinusoidTrajectory, with_encoder_noise
from lip_id_ros.simulation.panda import MOTION


@dataclass(frozen=True)
class RobotSettings(Settings):
    """The node `simulated_panda`."""

    seed: int = setting(1, 'Seed of the motion; change it for another motion.', minimum=0)
    paused: bool = setting(False, 'Stand still and publish nothing.')
    rate_hz: float = setting(100.0, 'Samples per simulated second.', unit='Hz', minimum=1.0)
    speed: float = setting(2.0, 'Simulated seconds per second.', minimum=0.01)
    torque_noise: float = setting(0.05, 'Noise on efforts.', unit='N m', minimum=0.0)
    position_noise: float = setting(2e-5, 'Noise on positions.', unit='rad', minimum=0.0)
    velocity_noise: float = setting(1e-3, 'Noise on velocities.', unit='rad/s', minimum=0.0)
    executor: str = setting('events', 'How callbacks are run.', choices=EXECUTORS)


def motion(settings: RobotSettings) -> tuple[Dataset, Dataset]:
    """
    One period of a motion.

    Parameters
    ----------
    settings : RobotSettings

    Returns
    -------
    exact, measured : Dataset
        The motion with its true torques and energies, and as encoders and torque sensors see it.

    """
    rng = np.random.default_rng(settings.seed)
    trajectory = SinusoidTrajectory.random(MOTION, rng)
    t = np.arange(0.0, trajectory.period, 1.0 / settings.rate_hz)
    exact = make_dataset(panda(), trajectory, t, settings.torque_noise, rng)
    return exact, with_encoder_noise(exact, settings.position_noise, settings.velocity_noise, rng)


class RobotNode(Node):
    """
    Publish what the robot's encoders and torque sensors measure, and the reference it follows.

    Stamps advance by one sample per message, so that the motion is the same at any speed.

    """

    def __init__(self) -> None:
        super().__init__('simulated_panda')
        self._table = parameters_of(RobotSettings)
        parameters.declare(self, self._table)
        self._start_ns = self.get_clock().now().nanoseconds
        self._n_published = 0
        self._begin()
        self._paused = self._settings().paused
        self._joint_states = self.create_publisher(JointState, 'joint_states', qos.OUTPUT)
        self._reference = self.create_publisher(
            JointTrajectory, 'desired_trajectory', qos.REFERENCE
        )
        self.add_post_set_parameters_callback(self._on_change)
        settings = self._settings()
        self._step_ns = round(1e9 / settings.rate_hz)
        self.create_timer(1.0 / (settings.rate_hz * settings.speed), self._step)

    def stop(self) -> None:
        """Nothing to let go of."""

    def _settings(self) -> RobotSettings:
        return RobotSettings(**parameters.values(self, self._table))

    def _on_change(self, changed: Sequence[Parameter]) -> None:
        if any(parameter.name == 'seed' for parameter in changed):
            self._begin()
        self._paused = self._settings().paused

    def _begin(self) -> None:
        self._exact, self._measured = motion(self._settings())
        self._row = 0

    def _step(self) -> None:
        if not self._paused:
            self._publish()

    def _publish(self) -> None:
        stamp = messages.stamp_at(self._start_ns + self._n_published * self._step_ns)
        self._joint_states.publish(joint_state(stamp, self._measured, self._row))
        self._reference.publish(reference(stamp, self._exact, self._row))
        self._n_published += 1
        self._row = (self._row + 1) % self._exact.n_samples


def joint_state(stamp: Time, measured: Dataset, row: int) -> JointState:
    """Return one sample as a driver publishes it."""
    message = messages.torque_message(stamp, measured.joint_names, measured.tau[row])
    message.position = messages.doubles(measured.q[row])
    message.velocity = messages.doubles(measured.dq[row])
    return message


def reference(stamp: Time, exact: Dataset, row: int) -> JointTrajectory:
    """Return one sample of the motion as a trajectory of one point."""
    point = JointTrajectoryPoint(
        positions=messages.doubles(exact.q[row]),
        velocities=messages.doubles(exact.dq[row]),
        accelerations=messages.doubles(exact.ddq[row]),
    )
    message = JointTrajectory(joint_names=list(exact.joint_names), points=[point])
    message.header.stamp = stamp
    return message


def main() -> int:
    """Run the node `simulated_panda`."""
    return running.run(RobotNode)


if __name__ == '__main__':
    sys.exit(main())

"""The simulated node `simulated_panda`, on an exciting motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from builtin_interfaces.msg import Time
import numpy as np
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.dataset import Dataset
from lip_id_ros.nodes import messages, qos, running
from lip_id_ros.nodes.node import NodeBase
from lip_id_ros.settings import executor_setting, parameters_of, setting, Settings
from lip_id_ros.signals.status import Level, Status
from lip_id_ros.simulation import (
    make_dataset,
    panda,
    SinusoidTrajectory,
    with_encoder_noise,
)
from lip_id_ros.simulation.arm import MOTION


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
    executor: str = executor_setting()


def motion(settings: RobotSettings) -> tuple[Dataset, Dataset]:
    """One period of a motion: exact with the truth, and as encoders and torque sensors see it."""
    rng = np.random.default_rng(settings.seed)
    trajectory = SinusoidTrajectory.random(MOTION, rng)
    t = np.arange(0.0, trajectory.period, 1.0 / settings.rate_hz)
    exact = make_dataset(panda(), trajectory, t, settings.torque_noise, rng)
    return exact, with_encoder_noise(exact, settings.position_noise, settings.velocity_noise, rng)


class RobotNode(NodeBase):
    """
    Publish what the robot's encoders and torque sensors measure, and the reference it follows.

    Stamps advance by one sample per message, so that the motion is the same at any speed.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__('simulated_panda', parameters_of(RobotSettings), **options)
        self._start_ns = self.get_clock().now().nanoseconds
        self._n_published = 0
        self._begin()
        settings = self._settings()
        self._paused = settings.paused
        self._joint_states = self.create_publisher(JointState, 'joint_states', qos.OUTPUT)
        self._reference = self.create_publisher(
            JointTrajectory, 'desired_trajectory', qos.REFERENCE
        )
        self._step_ns = round(1e9 / settings.rate_hz)
        self.create_timer(1.0 / (settings.rate_hz * settings.speed), self._step)

    def status(self) -> Status:
        """Return whether the arm moves."""
        summary = 'paused' if self._paused else 'moving'
        return Status(Level.OK, summary, {'published': self._n_published})

    def apply_change(self, values: Mapping[str, Any]) -> None:
        """Begin another motion where the seed changed."""
        if 'seed' in values:
            self._begin()
        self._paused = self._settings().paused

    def _settings(self) -> RobotSettings:
        return RobotSettings(**self.values())

    def _begin(self) -> None:
        self._exact, self._measured = motion(self._settings())
        self._row = 0

    def _step(self) -> None:
        if not self._paused:
            self._publish()

    def _publish(self) -> None:
        stamp = messages.stamp_at(self._start_ns + self._n_published * self._step_ns)
        self._joint_states.publish(measured_message(stamp, self._measured, self._row))
        self._reference.publish(reference_message(stamp, self._exact, self._row))
        self._n_published += 1
        self._row = (self._row + 1) % self._exact.n_samples


def measured_message(stamp: Time, measured: Dataset, row: int) -> JointState:
    """Return one sample as a driver publishes it."""
    return messages.joint_state_message(
        stamp, measured.joint_names, measured.q[row], measured.dq[row], measured.tau[row]
    )


def reference_message(stamp: Time, exact: Dataset, row: int) -> JointTrajectory:
    """Return one sample of the motion as a trajectory of one point."""
    only = slice(row, row + 1)
    message = messages.plan_message(
        exact.joint_names, np.zeros(1), exact.q[only], exact.dq[only], exact.ddq[only]
    )
    message.header.stamp = stamp
    return message


def simulated_panda() -> int:
    """Run the node `simulated_panda`."""
    return running.run(RobotNode)

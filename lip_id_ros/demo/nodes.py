"""Simulated nodes: `simulated_panda` on an exciting motion, `simulated_arm`, `reference`."""

from __future__ import annotations

from collections.abc import Mapping
import math
import time
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.demo.settings import ArmSettings, ReferenceSettings, RobotSettings
from lip_id_ros.errors import ConfigError
from lip_id_ros.nodes import messages, qos, running
from lip_id_ros.nodes.node import NodeBase
from lip_id_ros.recording.joint_messages import from_joint_state
from lip_id_ros.settings import parameters_of
from lip_id_ros.signals.joints import JointOrder, Refusal, RefusedError
from lip_id_ros.signals.status import Level, Status, Tally
from lip_id_ros.simulation import (
    GrowingCosine,
    make_dataset,
    panda,
    SinusoidTrajectory,
    StoppedTrajectory,
    TorqueControlledArm,
    with_encoder_noise,
)
from lip_id_ros.simulation.arm import MOTION
from lip_id_ros.simulation.torque_controlled import panda_setup

RETRY_S, REPEAT_S = 0.2, 5.0
FASTEST = 100.0  # no joint of an arm gets there [rad/s]
POINTS_HZ = 100.0


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

    def __init__(self) -> None:
        super().__init__('simulated_panda', parameters_of(RobotSettings))
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


class ArmNode(NodeBase):
    """
    A Panda that moves by a millisecond for each torque that it receives.

    Its clock is in the stamps, and advances with the torques: a slow computer makes the motion
    slow, not unstable; and without torques the arm stands, as if it had engaged its brakes. A
    torque answers the joint state that has its stamp; any other is ignored. What is not answered
    is published again, since messages may be lost. Where a joint would move faster than `FASTEST`,
    the arm stops where it is, as by its brakes.

    ConfigError if `contact` has another length than there are joints.
    """

    def __init__(self) -> None:
        super().__init__('simulated_arm', parameters_of(ArmSettings))
        settings = ArmSettings(**self.values())
        setup, n = panda_setup(settings.n_joints), settings.n_joints
        still = np.zeros((1, n))
        self._arm = TorqueControlledArm(
            setup.arm, setup.drives, setup.posture, still[0], np.random.default_rng(settings.seed)
        )
        self._arm.hold(self._arm.bodies.inverse_dynamics(setup.posture[None], still, still)[0])
        self._order = JointOrder(setup.arm.joint_names)
        self._contact = external(settings)
        self._start_ns = self.get_clock().now().nanoseconds
        self._tally = Tally('steps', 'others')
        self._stops = self._told_stops = 0
        self._publisher = self.create_publisher(JointState, 'joint_states', qos.OUTPUT)
        self.create_subscription(JointState, 'command', self._on_command, qos.OUTPUT)
        self._measure()
        self.create_steady_timer(RETRY_S / 2, self._retry)

    def status(self) -> Status:
        """Return the counts of torques."""
        tally = self._tally
        counts = {'received': tally.received, **tally.used, 'refused': dict(tally.refused)}
        values, new = {**counts, 'stops': self._stops}, self._stops - self._told_stops
        self._told_stops = self._stops
        if new:
            return Status(
                Level.ERROR, f'stopped: a joint would move faster than {FASTEST:g} rad/s', values
            )
        return Status(Level.OK, f'{tally.used["steps"]} steps', values)

    def check_change(self, values: Mapping[str, Any]) -> None:
        """Refuse a contact of another length than there are joints."""
        external(ArmSettings(**{**self.values(), **values}))

    def apply_change(self, values: Mapping[str, Any]) -> None:
        """Apply another contact at once."""
        self._contact = external(ArmSettings(**self.values()))

    def _measure(self) -> None:
        measured = self._arm.measure()
        stamp = messages.stamp_at(self._start_ns + round(1e9 * measured.t))
        self._state = messages.joint_state_message(
            stamp, self._order.joint_names, measured.q, measured.dq, measured.tau
        )
        self._publish()

    def _publish(self) -> None:
        self._published = time.monotonic()
        self._publisher.publish(self._state)

    def _retry(self) -> None:
        if time.monotonic() - self._published > RETRY_S:
            self._publish()

    def _on_command(self, message: JointState) -> None:
        try:
            with self._tally.receiving():
                self._obey(message)
        except RefusedError as refused:
            self.warn_of_refusal(refused)

    def _obey(self, message: JointState) -> None:
        if message.header.stamp != self._state.header.stamp:
            self._tally.used['others'] += 1
            return
        before, torque = self._arm.q, self._torque(message)
        with np.errstate(all='ignore'):
            self._arm.step(torque, self._contact)
        self._tally.used['steps'] += 1
        if not (np.abs(self._arm.dq) < FASTEST).all():  # what is not a number is too fast as well
            self._stops += 1
            self._arm.stop(before)
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
    """Return the torques of the contact, shape (n,) [N m]; ConfigError if there are not n."""
    contact = settings.contact or (0.0,) * settings.n_joints
    if len(contact) != settings.n_joints:
        raise ConfigError(
            f'contact must have one number for each of {settings.n_joints} joints, but has '
            f'{len(contact)}.'
        )
    return np.array(contact)


class ReferenceNode(NodeBase):
    """
    Publish the paper's tracking reference as one plan once `serve` is active and subscribes.

    Publish it again until `computed_torque` has it: while nodes discover each other, messages
    between them may be lost.
    """

    def __init__(self) -> None:
        super().__init__('reference', parameters_of(ReferenceSettings))
        self._plan = plan(ReferenceSettings(**self.values()))
        self._active = self._taken = False
        self._published_at = -math.inf
        self._publisher = self.create_publisher(
            JointTrajectory, 'desired_trajectory', qos.REFERENCE
        )
        self.create_subscription(DiagnosticStatus, 'serve/status', self._on_serve, qos.LATCHED)
        self.create_subscription(
            DiagnosticStatus, 'computed_torque/status', self._on_controller, qos.LATCHED
        )
        self.create_timer(0.1, self._publish)

    def status(self) -> Status:
        """Return whether the controller has the plan."""
        summary = 'the controller has the plan' if self._taken else 'waiting for the controller'
        return Status(Level.OK, summary, {'taken': self._taken})

    def _on_serve(self, message: DiagnosticStatus) -> None:
        self._active = messages.status_values(message).get('state') == 'active'

    def _on_controller(self, message: DiagnosticStatus) -> None:
        self._taken = messages.status_values(message).get('plans', 0) > 0

    def _publish(self) -> None:
        due = time.monotonic() - self._published_at > REPEAT_S
        if due and self._active and not self._taken and self._publisher.get_subscription_count():
            self._publisher.publish(self._plan)
            self._published_at = time.monotonic()


def plan(settings: ReferenceSettings) -> JointTrajectory:
    """Return the reference at a hundred points per second, brought to rest after the horizon."""
    setup = panda_setup(settings.n_joints)
    reference = GrowingCosine(setup.posture, settings.amplitude, settings.horizon)
    stopped = StoppedTrajectory(reference, settings.horizon)
    end = stopped.until + stopped.within
    t = np.linspace(0.0, end, round(POINTS_HZ * end) + 1)
    return messages.plan_message(setup.arm.joint_names, t, *stopped.sample(t))


def simulated_panda() -> int:
    """Run the node `simulated_panda`."""
    return running.run(RobotNode)


def simulated_arm() -> int:
    """Run the node `simulated_arm`."""
    return running.run(ArmNode)


def reference() -> int:
    """Run the node `reference`."""
    return running.run(ReferenceNode)

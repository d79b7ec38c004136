"""The topics of the node `serve`: its publishers, and its subscriptions with their callbacks."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Mapping, Sequence
import math
import time
from typing import Any

from builtin_interfaces.msg import Time
import numpy as np
from pal_statistics_msgs.msg import Statistics
from rclpy.duration import Duration
from rclpy.lifecycle import LifecycleNode
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ConfigError
from lip_id_ros.feedforward.loading import LoadedModel
from lip_id_ros.feedforward.server import Server
from lip_id_ros.feedforward.settings import ServeSettings
from lip_id_ros.model import Prediction, Query
from lip_id_ros.nodes import messages, qos
from lip_id_ros.nodes.node import NodeBase
from lip_id_ros.nodes.plans import Planned, PlanWorker
from lip_id_ros.recording.joint_messages import from_joint_state
from lip_id_ros.signals.ages import AgeWatch, stamp_age
from lip_id_ros.signals.joints import Refusal, RefusedError

DELIVERY_S = 5.0
"""A subscriber that does not answer for so long holds up the node's end no more."""

INLINE_BYTES = 24 * 1024
"""A longer plan, of about a hundred points of seven joints, is answered beside the stream."""

Info = Mapping[str, Any]
"""What the middleware says of a message."""

LATE_S = 0.1
"""Where a reference waits for longer, the newest that has arrived is answered in its place."""

COMPONENTS = ('inertial', 'coriolis', 'gravity', 'friction')
COMPONENT_TOPICS = tuple(f'torque/{part}' for part in COMPONENTS)
STD_TOPIC = 'torque_std'
MEASURED_TOPICS = ('measured/kinetic_energy', 'measured/potential_energy', 'measured/energies')
RESIDUAL_TOPIC = 'torque_residual'


class Outputs:
    """Publishers, which are active while the node is."""

    def __init__(self, node: LifecycleNode) -> None:
        self._node = node
        self._torque = self._publisher(JointState, '~/feedforward_torque')
        self._kinetic = self._publisher(Float64, '~/kinetic_energy')
        self._potential = self._publisher(Float64, '~/potential_energy')
        self._energies = self._publisher(Statistics, '~/energies')
        self._plan = self._publisher(JointTrajectory, '~/trajectory_with_effort')
        self._optional: dict[str, Any] = {}
        self._message, self._command = JointState(), Float64MultiArray()

    def configure(self, settings: ServeSettings, joint_names: Sequence[str]) -> None:
        """Make the publishers that are asked for; torques are of these joints."""
        self._message.name = list(joint_names)
        if settings.publish_commands:
            self._add(Float64MultiArray, 'commands')
        for topic in COMPONENT_TOPICS if settings.publish_parts else ():
            self._add(JointState, topic)
        if settings.publish_std:
            self._add(JointState, STD_TOPIC)
        if settings.follow_joint_states:
            for topic in MEASURED_TOPICS[:2]:
                self._add(Float64, topic)
            self._add(Statistics, MEASURED_TOPICS[2])
            self._add(JointState, RESIDUAL_TOPIC)

    def clean_up(self) -> None:
        """Destroy what `configure` made, after subscribers have its last messages."""
        self._await_delivery()
        for publisher in self._optional.values():
            self._node.destroy_lifecycle_publisher(publisher)
        self._optional.clear()

    def _await_delivery(self) -> None:
        """Wait for reliable subscribers of torques: with its publisher the last zero is lost."""
        publishers = [self._torque, *filter(None, [self._optional.get('commands')])]
        if all(publisher.wait_for_all_acked(Duration()) for publisher in publishers):
            return
        log = self._node.get_logger()
        log.info('waits until every subscriber has the last torque')
        end = time.monotonic() + DELIVERY_S
        for publisher in publishers:
            rest = Duration(seconds=max(0.0, end - time.monotonic()))
            if not publisher.wait_for_all_acked(rest):
                log.warning(
                    f'a subscriber of {publisher.topic_name} has not confirmed the last torque '
                    f'within {DELIVERY_S:g} s; it may still hold another one.'
                )

    def wants(self, *names: str) -> bool:
        """Return whether anybody subscribes to one of the optional topics."""
        publishers = [self._optional[name] for name in names if name in self._optional]
        return any(publisher.get_subscription_count() for publisher in publishers)

    def torque(self, stamp: Time, tau: Array) -> None:
        """Publish the robot's torque, shape (n,) [N m or N]; its message has the names already."""
        self._message.header.stamp = stamp
        self._message.effort = self._command.data = array('d', tau.tobytes())
        self._torque.publish(self._message)
        if 'commands' in self._optional:
            self._optional['commands'].publish(self._command)

    def energies(self, stamp: Time, query: Query) -> None:
        """Publish the energies of a reference."""
        _publish_finite(self._kinetic, query.kinetic)
        _publish_finite(self._potential, query.potential)
        if self._energies.get_subscription_count():
            self._energies.publish(_energies(stamp, query))

    def measured_energies(self, stamp: Time, query: Query) -> None:
        """Publish the energies of a measured state."""
        kinetic, potential, both = MEASURED_TOPICS
        _publish_finite(self._optional[kinetic], query.kinetic)
        _publish_finite(self._optional[potential], query.potential)
        self._optional[both].publish(_energies(stamp, query))

    def plan(self, plan: JointTrajectory, tau: Array) -> None:
        """Publish a plan with efforts, shape (number of points, n) [N m or N]."""
        self._plan.publish(messages.with_effort(plan, tau))

    def raw_plan(self, plan: bytes) -> None:
        """Publish a plan with efforts that is serialised already."""
        self._plan.publish(plan)

    def components(self, stamp: Time, predicted: Prediction) -> None:
        """Publish the parts of the model's torque at one sample, those that are finite."""
        for part, topic in zip(COMPONENTS, COMPONENT_TOPICS, strict=True):
            self.joints(topic, stamp, getattr(predicted, part)[0])

    def joints(self, topic: str, stamp: Time, tau: Array) -> None:
        """Publish one optional vector, shape (n,) [N m or N], if it is finite."""
        if topic in self._optional and np.isfinite(tau).all():
            message = messages.torque_message(stamp, self._message.name, tau)
            self._optional[topic].publish(message)

    def _add(self, kind: Any, name: str) -> None:
        self._optional[name] = self._publisher(kind, f'~/{name}')

    def _publisher(self, kind: Any, topic: str) -> Any:
        return self._node.create_lifecycle_publisher(kind, topic, qos.OUTPUT)


class Inputs:
    """Subscriptions with their callbacks: convert, ask the server, convert, publish."""

    def __init__(self, node: NodeBase, server: Server, outputs: Outputs) -> None:
        self._node = node
        self._server = server
        self._references = server.counts.references
        self._outputs = outputs
        self._optional: list[Any] = []
        self._worker: PlanWorker | None = None
        self._settings = ServeSettings()
        self._ages = AgeWatch()
        # raw, since a long plan is not deserialised here
        self._trajectories = node.create_subscription(
            JointTrajectory,
            '~/desired_trajectory',
            self._on_trajectory,
            qos.REFERENCE,
            raw=True,
        )

    def configure(self, settings: ServeSettings) -> None:
        """
        Subscribe to what is asked for.

        Raises
        ------
        ConfigError
            If the type of a message is not installed.

        """
        if settings.follow_controller:
            kind = _controller_state()
            self._add(kind, '~/controller_state', self._on_controller_state)
        if settings.follow_joint_states:
            self._add(JointState, 'joint_states', self._on_joint_state)

    def use(self, loaded: LoadedModel, settings: ServeSettings) -> None:
        """Answer long plans by this model from now on."""
        self._stop_worker()
        self._worker = PlanWorker(loaded.file) if loaded.file is not None else None
        self.adjust(settings)

    def adjust(self, settings: ServeSettings) -> None:
        """Answer long plans by these settings."""
        self._settings = settings
        self.interrupt_plans()

    def interrupt_plans(self) -> None:
        """Publish no plan any more that is being answered."""
        if self._worker is not None:
            self._worker.interrupt()

    @property
    def n_waiting(self) -> int:
        """How many plans are being answered beside the stream."""
        return self._worker.n_waiting if self._worker else 0

    def clean_up(self) -> None:
        """Unsubscribe from what `configure` subscribed to."""
        self._stop_worker()
        for subscription in self._optional:
            self._node.destroy_subscription(subscription)
        self._optional.clear()

    def watch(self) -> None:
        """Publish the safe torque where references have stopped, and what was computed beside."""
        tau = self._server.safe_torque(time.monotonic())
        if tau is not None:
            self._outputs.torque(self._now(), tau)
        deviated = self._server.take_deviation()
        if deviated is not None:
            self._outputs.joints(STD_TOPIC, deviated.tag, deviated.std)
        planned = self._worker.take() if self._worker else None
        if planned is not None:
            self._unless_refused(self._publish_planned, planned)

    def publish_zero(self) -> None:
        """Publish zero torque: whoever holds the last command then holds none."""
        self.interrupt_plans()
        if self._server.active and self._server.enabled:
            self._outputs.torque(self._now(), np.zeros(len(self._server.joint_names)))

    def _add(self, kind: Any, topic: str, callback: Callable[..., None]) -> None:
        subscription = self._node.create_subscription(kind, topic, callback, qos.NEWEST)
        self._optional.append(subscription)

    def _on_trajectory(self, raw: bytes, info: Info) -> None:
        """Answer a reference; where it lags, all plans that wait and the newest sample."""
        arrived = [(raw, info)]
        overtaken: list[int] = []
        if self._age(info) > LATE_S:
            arrived += self._node.arrived(self._trajectories)
            overtaken = [n for n, (each, _) in enumerate(arrived) if messages.is_sample(each)][:-1]
        self._references.received += len(arrived)
        for number, (each, its_info) in enumerate(arrived):
            if number in overtaken:
                self._unless_refused(self._skip)
            else:
                self._unless_refused(self._answer, each, its_info)

    def _skip(self) -> None:
        with self._references.refusing():
            raise RefusedError(Refusal.OVERTAKEN)

    def _answer(self, raw: bytes, info: Info) -> None:
        """Answer a plan, or a sample of a stream."""
        if len(raw) > INLINE_BYTES and (count := self._count_points(raw)) > 1:
            self._submit(raw, count)
            return
        try:
            message = deserialize_message(raw, JointTrajectory)
        except Exception:  # the class depends on the middleware
            self._references.refuse(Refusal.MALFORMED)
            raise RefusedError(Refusal.MALFORMED) from None
        if len(message.points) > 1:
            tau = self._server.plan(message.joint_names, message.points)
            self.interrupt_plans()
            self._outputs.plan(message, tau)
        else:
            self._answer_sample(message.header.stamp, message.joint_names, message.points, info)

    def _count_points(self, raw: bytes) -> int:
        with self._references.refusing():
            return messages.count_points(raw)

    def _submit(self, raw: bytes, n_points: int) -> None:
        """Have a long plan answered beside the stream."""
        with self._references.refusing():
            self._server.ready_arm()
            if n_points > self._settings.max_plan_points:
                raise RefusedError(Refusal.TOO_LONG)
            if self._worker is None:
                raise RefusedError(Refusal.INACTIVE)
            self._worker.submit(raw, self._settings)

    def _publish_planned(self, planned: Planned) -> None:
        with self._references.refusing():
            self._server.ready_arm()
            if planned.refusal:
                raise RefusedError(Refusal(planned.refusal))
        self._server.planned_beside(planned.counts)
        self._outputs.raw_plan(planned.raw)

    def _stop_worker(self) -> None:
        if self._worker is not None:
            for _ in range(self._worker.stop()):
                self._references.refuse(Refusal.INTERRUPTED)
            self._worker = None

    def _on_controller_state(self, message: Any, info: Info) -> None:
        # before Jazzy the reference was called desired
        reference = message.reference if hasattr(message, 'reference') else message.desired
        stamp, names = message.header.stamp, message.joint_names
        self._references.received += 1
        self._unless_refused(self._answer_sample, stamp, names, [reference], info)

    def _on_joint_state(self, message: JointState) -> None:
        """Publish energies and the torque residual while they have subscribers."""
        measured = self._server.measure(from_joint_state(message), time.monotonic())
        if measured is None:
            return
        beside = self._server.arm.measured
        if self._outputs.wants(*MEASURED_TOPICS):
            self._outputs.measured_energies(message.header.stamp, beside.energies(measured))
        if self._outputs.wants(RESIDUAL_TOPIC):
            residual = beside.residual(measured)
            if residual is not None:
                self._outputs.joints(RESIDUAL_TOPIC, message.header.stamp, residual)

    def _unless_refused(self, answer: Callable[..., None], *arguments: Any) -> None:
        try:
            answer(*arguments)
        except RefusedError as refused:
            self._node.warn_of_refusal(refused)

    def _answer_sample(
        self, stamp: Time, names: Sequence[str], points: Sequence[Any], info: Info
    ) -> None:
        now = self._now()
        if stamp.sec == stamp.nanosec == 0:  # left empty, which in a trajectory means now
            stamp = now
        age = max(
            self._age(info), stamp_age(messages.nanoseconds(stamp), messages.nanoseconds(now))
        )
        served = self._server.sample(names, points, time.monotonic(), stamp, age)
        self._outputs.torque(stamp, served.tau)
        self._outputs.energies(stamp, served.query)
        if self._outputs.wants(*COMPONENT_TOPICS):
            self._outputs.components(stamp, self._server.arm.components(served.state))

    def _age(self, info: Info) -> float:
        """Return how long ago a reference was sent [s]."""
        return self._ages.age(info['source_timestamp'], info['received_timestamp'], time.time_ns())

    def _now(self) -> Time:
        return self._node.get_clock().now().to_msg()


def _controller_state() -> Any:
    try:
        from control_msgs.msg import JointTrajectoryControllerState
    except ImportError:
        raise ConfigError(
            'follow_controller needs the package control_msgs, which is not installed; install '
            'ros-jazzy-control-msgs or leave follow_controller false.'
        ) from None
    return JointTrajectoryControllerState


def _publish_finite(publisher: Any, value: float) -> None:
    if math.isfinite(value):
        publisher.publish(Float64(data=value))


def _energies(stamp: Time, query: Query) -> Statistics:
    energies = {'kinetic_energy': query.kinetic, 'potential_energy': query.potential}
    return messages.energies_message(stamp, energies)

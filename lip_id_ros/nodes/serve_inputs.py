"""The subscriptions of the node `serve`, with their callbacks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
import time
from typing import Any

from builtin_interfaces.msg import Time
from control_msgs.msg import DynamicInterfaceGroupValues
import numpy as np
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.errors import ConfigError
from lip_id_ros.feedforward.goals import GoalCounts
from lip_id_ros.feedforward.loading import LoadedModel
from lip_id_ros.feedforward.server import Server
from lip_id_ros.feedforward.settings import ServeSettings
from lip_id_ros.nodes import messages, qos
from lip_id_ros.nodes.goals import Goals
from lip_id_ros.nodes.node import NodeBase
from lip_id_ros.nodes.plans import Planned, Plans
from lip_id_ros.nodes.serve_outputs import (
    COMPONENT_TOPICS,
    MEASURED_TOPICS,
    Outputs,
    RESIDUAL_TOPIC,
    STD_TOPIC,
)
from lip_id_ros.recording.joint_messages import from_joint_state
from lip_id_ros.signals.joint_states import AgeWatch, stamp_age
from lip_id_ros.signals.joints import Refusal, RefusedError
from lip_id_ros.signals.trajectory_header import read_header

INLINE_BYTES = 24 * 1024
"""A longer plan, of about a hundred points of seven joints, is answered beside the stream."""

Info = Mapping[str, Any]
"""What the middleware says of a message."""

LATE_S = 0.1
"""
Where a reference waits for longer, the newest that has arrived is answered in its place; a plan
that comes out later than this after its begin deserves a warning.
"""


class Inputs:
    """Subscriptions with their callbacks: convert, ask the server, convert, publish."""

    def __init__(self, node: NodeBase, server: Server, outputs: Outputs) -> None:
        self._node = node
        self._server = server
        self._references = server.counts.references
        self._outputs = outputs
        self._optional: list[Any] = []
        self._plans = Plans(server)
        self._goals: Goals | None = None
        self._updates: Any = None
        self.goals = GoalCounts()
        self._settings = ServeSettings()
        self._is_contradicted = False
        self._ages = AgeWatch()
        # raw, since a plan that takes long is not deserialised here
        self._trajectories = node.create_subscription(
            JointTrajectory,
            '~/desired_trajectory',
            self._on_trajectory,
            qos.REFERENCE,
            raw=True,
        )

    def configure(self, settings: ServeSettings) -> None:
        """Subscribe to what is asked for; ConfigError if a message type is not installed."""
        if settings.follow_controller:
            kind = _controller_state()
            self._add(kind, '~/controller_state', self._on_controller_state)
        if settings.follow_joint_states:
            self._add(JointState, 'joint_states', self._on_joint_state)
        if settings.follow_adaptation:
            self._updates = self._node.create_subscription(
                DynamicInterfaceGroupValues, 'adapt/update', self._on_update, qos.LATCHED
            )
        if settings.controller_action:
            action = settings.controller_action
            self._goals = Goals(self._node, self._server, self._plans, self.goals, action)

    def warnings(self) -> list[str]:
        """Describe a missing controller, and topics with several publishers unless allowed."""
        found = [] if self._goals is None else [self._goals.warnings()]
        if self._settings.several_publishers != 'allow':
            found += [qos.several_publishers(self._node, each) for each in self._single]
        return [warning for warnings in found for warning in warnings]

    @property
    def _single(self) -> list[str]:
        return [each.topic_name for each in (self._trajectories, *self._optional)]

    def use(self, loaded: LoadedModel, settings: ServeSettings) -> None:
        """Answer plans beside the stream by this model from now on."""
        self._plans.use(loaded)
        self.adjust(settings)

    def adjust(self, settings: ServeSettings) -> None:
        """Answer plans by these settings."""
        self._settings = settings
        self._plans.adjust(settings)

    @property
    def n_waiting(self) -> int:
        """How many plans and goals are being answered beside the stream."""
        return self._plans.n_waiting

    def clean_up(self) -> None:
        """Unsubscribe from what `configure` subscribed to."""
        self._plans.stop()
        for subscription in self._optional:
            self._node.destroy_subscription(subscription)
        self._optional.clear()
        if self._updates is not None:
            self._node.destroy_subscription(self._updates)
            self._updates = None
        if self._goals is not None:
            self._goals.destroy()
            self._goals = None

    def release_goals(self) -> None:
        """Have the controller cancel the goals that it has by this node."""
        if self._goals is not None:
            self._goals.release()

    def watch(self) -> None:
        """Publish the safe torque where references have stopped, and what was computed beside."""
        self._watch_publishers()
        if self._goals is not None:
            self._goals.watch()
        self._server.watch_updates(time.monotonic())
        tau = self._server.safe_torque(time.monotonic())
        if tau is not None:
            self._outputs.torque(self._now(), tau)
        self._publish_deviation()
        self._plans.watch()

    def _publish_deviation(self) -> None:
        """Publish a standard deviation that was computed beside the stream."""
        deviated = self._server.take_deviation()
        if deviated is not None:
            self._outputs.joints(STD_TOPIC, deviated.tag, deviated.std)

    def _watch_publishers(self) -> None:
        """Output zero where there are several publishers that are not to be answered."""
        before, refuse = self._is_contradicted, self._settings.several_publishers == 'refuse'
        self._is_contradicted = refuse and any(
            self._node.count_publishers(each) > 1 for each in self._single
        )
        if self._is_contradicted and not before:
            self._node.output_safe_torque()

    def publish_zero(self) -> None:
        """Publish zero torque: whoever holds the last command then holds none."""
        self._plans.interrupt()
        if self._server.active and self._server.enabled:
            self._outputs.torque(self._now(), np.zeros(len(self._server.joint_names)))

    def _add(self, kind: Any, topic: str, callback: Callable[..., None]) -> None:
        subscription = self._node.create_subscription(kind, topic, callback, qos.NEWEST)
        self._optional.append(subscription)

    def _on_trajectory(self, raw: bytes, info: Info) -> None:
        """Answer a reference; where it lags, all plans that wait and the newest sample."""
        arrived = [(raw, self._age(info))]
        overtaken: list[int] = []
        if arrived[0][1] > LATE_S:
            waiting = self._node.arrived(self._trajectories)
            arrived += [(each, self._age(its_info)) for each, its_info in waiting]
            overtaken = [n for n, (each, _) in enumerate(arrived) if messages.is_sample(each)][:-1]
        self._references.received += len(arrived)
        for number, (each, age) in enumerate(arrived):
            if number in overtaken:
                self._unless_refused(self._refuse, Refusal.OVERTAKEN)
            else:
                self._unless_refused(self._answer, each, age)

    def _refuse(self, reason: Refusal) -> None:
        with self._references.refusing():
            raise RefusedError(reason)

    def _answer(self, raw: bytes, age: float) -> None:
        if self._is_contradicted:
            self._refuse(Refusal.SEVERAL_PUBLISHERS)
        slow = self._plans.are_slow(len(raw) > INLINE_BYTES)
        if slow and (count := self._count_points(raw)) > 1:
            self._plans.submit(raw, count, self._on_planned)
            return
        try:
            message = deserialize_message(raw, JointTrajectory)
        except Exception:  # the class depends on the middleware
            self._references.refuse(Refusal.MALFORMED)
            raise RefusedError(Refusal.MALFORMED) from None
        if len(message.points) > 1:
            filled = messages.filled(message, self._server)
            self._plans.interrupt()
            self._outputs.plan(filled)
            self._note_lateness(messages.nanoseconds(message.header.stamp))
        else:
            self._answer_sample(message.header.stamp, message.joint_names, message.points, age)

    def _count_points(self, raw: bytes) -> int:
        with self._references.refusing():
            return messages.count_points(raw)

    def _on_planned(self, planned: Planned) -> None:
        self._unless_refused(self._publish_planned, planned)

    def _publish_planned(self, planned: Planned) -> None:
        raw = self._plans.accept(planned)
        self._outputs.raw_plan(raw)
        self._note_lateness(read_header(raw).stamp_ns)

    def _note_lateness(self, stamp_ns: int) -> None:
        """Count a plan that was published after its begin; a stamp of zero means now."""
        late = stamp_age(stamp_ns, messages.nanoseconds(self._now())) if stamp_ns else 0.0
        if late > LATE_S:
            self._server.counts.torques['late_plans'] += 1
            self._node.warn(
                'late_plans',
                f'a plan came out {late:.1f} s after the stamp at which it begins; send plans '
                'earlier, or leave their stamps zero',
            )

    def _on_controller_state(self, message: Any, info: Info) -> None:
        # before Jazzy the reference was called desired
        reference = message.reference if hasattr(message, 'reference') else message.desired
        stamp, names = message.header.stamp, message.joint_names
        self._references.received += 1
        self._unless_refused(self._answer_sample, stamp, names, [reference], self._age(info))

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

    def _on_update(self, message: DynamicInterfaceGroupValues) -> None:
        clock_ns = self._node.get_clock().now().nanoseconds
        self._unless_refused(self._server.take_update, message, time.monotonic(), clock_ns)

    def _unless_refused(self, answer: Callable[..., None], *arguments: Any) -> None:
        try:
            answer(*arguments)
        except RefusedError as refused:
            self._node.warn_of_refusal(refused)

    def _answer_sample(
        self, stamp: Time, names: Sequence[str], points: Sequence[Any], sent_s: float
    ) -> None:
        now = self._now()
        if stamp.sec == stamp.nanosec == 0:  # left empty, which in a trajectory means now
            stamp = now
        age = max(sent_s, stamp_age(messages.nanoseconds(stamp), messages.nanoseconds(now)))
        served = self._server.sample(names, points, time.monotonic(), stamp, age)
        self._outputs.torque(stamp, served.tau)
        self._outputs.energies(stamp, served.query)
        if self._outputs.wants(*COMPONENT_TOPICS):
            self._outputs.components(stamp, self._server.arm.components(served.state))
        self._publish_deviation()  # here too: the watch alone has 50 a second

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

"""The subscriptions of the node `serve`, with their callbacks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
import time
from typing import Any, NamedTuple

from builtin_interfaces.msg import Time
from control_msgs.msg import DynamicInterfaceGroupValues, JointTrajectoryControllerState
import numpy as np
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.errors import ConfigError
from lip_id_ros.feedforward.goals import GoalCounts
from lip_id_ros.feedforward.server import Server
from lip_id_ros.feedforward.settings import ServeSettings
from lip_id_ros.nodes import messages, plans, qos
from lip_id_ros.nodes.controller import Controller, SpeedScaling
from lip_id_ros.nodes.goals import Goals
from lip_id_ros.nodes.node import NodeBase
from lip_id_ros.nodes.serve_outputs import (
    COMPONENT_TOPICS,
    MEASURED_TOPICS,
    Outputs,
    RESIDUAL_TOPIC,
    STD_TOPIC,
)
from lip_id_ros.recording.joint_messages import from_joint_state
from lip_id_ros.signals.ages import AgeWatch, ReferenceStamps
from lip_id_ros.signals.joints import Refusal, RefusedError

Info = Mapping[str, Any]
"""What the middleware says of a message."""


class Arrival(NamedTuple):
    """How long ago a message was sent [s], and when by the clock of its sender [ns]."""

    age: float
    sent_ns: int


LONGEST_WAIT_S = 0.1
"""Where a reference waits for longer, the newest that has arrived is answered in its place."""


class Inputs:
    """Subscriptions with their callbacks: convert, ask the server, convert, publish."""

    def __init__(self, node: NodeBase, server: Server, outputs: Outputs) -> None:
        self._node = node
        self._server = server
        self._references = server.counts.references
        self._outputs = outputs
        self._optional: list[Any] = []
        self._goals: Goals | None = None
        self._controllers: list[Controller] = []  # that have something to cancel
        self._updates: Any = None
        self.goals = GoalCounts()
        self._settings = ServeSettings()
        self._ages, self._scaling = AgeWatch(), SpeedScaling()
        self._order: dict[str, ReferenceStamps] = {}  # by topic
        self._answered_at: dict[str, float] = {}
        # raw, so that neither a million names nor points are read
        self._trajectories = node.create_subscription(
            JointTrajectory,
            '~/desired_trajectory',
            self._on_trajectory,
            qos.REFERENCE,
            raw=True,
        )

    def configure(self, settings: ServeSettings) -> None:
        """Subscribe to what is asked for; ConfigError if an input is an output too."""
        if settings.follow_controller:
            kind = JointTrajectoryControllerState
            self._add(kind, '~/controller_state', self._on_controller_state)
        if settings.follow_joint_states:
            self._add(JointState, 'joint_states', self._on_joint_state)
        both = {each.topic_name for each in self._inputs()} & self._outputs.topics()
        if both:
            raise ConfigError(
                f'{both.pop()} must not be both an input and an output of this node; correct the '
                'remapping.'
            )
        if settings.follow_adaptation:
            self._updates = self._node.create_subscription(
                DynamicInterfaceGroupValues, 'adapt/update', self._on_update, qos.LATCHED
            )
        if settings.controller_action:
            action = settings.controller_action
            self._goals = goals = Goals(self._node, self._server, self.goals, action)
            if goals.state_topic not in {each.topic_name for each in self._optional}:
                self._add(JointTrajectoryControllerState, goals.state_topic, goals.hear)

    def warnings(self) -> list[str]:
        """Describe a missing controller, and what may contradict each other unless allowed."""
        found = [] if self._goals is None else self._goals.warnings()
        found += [each for one in self._asked() for each in one.warnings()]
        if self._settings.several_publishers != 'allow':
            found += self._contradictions()
        return found

    def _inputs(self) -> list[Any]:
        return [self._trajectories, *self._optional]

    def _contradictions(self) -> list[str]:
        """Describe topics with several publishers, and references from several topics."""
        topics = [*(each.topic_name for each in self._inputs()), *self._outputs.commands()]
        found = [each for topic in topics for each in qos.several_publishers(self._node, topic)]
        since = time.monotonic() - (self._settings.stale_timeout_s or np.inf)
        sources = [topic for topic, at in self._answered_at.items() if at >= since]
        if len(sources) > 1:
            found.append(f'references come from {" and ".join(sources)} and may contradict')
        return found

    def adjust(self, settings: ServeSettings) -> None:
        """Answer by these settings."""
        self._settings = settings

    def clean_up(self) -> None:
        """Unsubscribe from what `configure` subscribed to."""
        for subscription in self._optional:
            self._node.destroy_subscription(subscription)
        self._optional.clear()
        if self._updates is not None:
            self._node.destroy_subscription(self._updates)
            self._updates = None
        if self._goals is not None:
            self._goals.destroy()
            self._controllers.append(self._goals.controller)
            self._goals = None

    @property
    def is_settled(self) -> bool:
        """Whether controllers have cancelled all goals that they shall cancel."""
        return all(each.is_settled for each in self._asked())

    def _asked(self) -> list[Controller]:
        served = [] if self._goals is None else [self._goals.controller]
        return [*served, *self._controllers]

    def destroy(self) -> None:
        """Ask no controller any more."""
        for each in self._controllers:
            each.destroy()

    def close_goals(self) -> None:
        """Take no more goals, and have the controller cancel those that it has."""
        if self._goals is not None:
            self._goals.close()

    def release_goals(self) -> None:
        """Have the controller cancel the goals that it has by this node."""
        if self._goals is not None:
            self._goals.release()

    def watch(self) -> None:
        """Publish the safe torque where references have stopped."""
        self._watch_contradictions()
        if self._goals is not None:
            self._goals.watch()
        for each in self._controllers:
            each.watch()
            if each.is_settled:
                each.destroy()
        self._controllers = [each for each in self._controllers if not each.is_settled]
        self._server.watch_updates(time.monotonic())
        tau = self._server.safe_torque(time.monotonic())
        if tau is not None:
            self._outputs.torque(self._now(), tau)

    def _watch_contradictions(self) -> None:
        """Output zero where several publishers or topics are not to be answered."""
        server, refuse = self._server, self._settings.several_publishers == 'refuse'
        before = server.is_contradicted
        server.is_contradicted = refuse and bool(self._contradictions())
        if server.is_contradicted and not before:
            self._node.output_safe_torque()

    def publish_zero(self) -> None:
        """Publish zero torque: whoever holds the last command then holds none."""
        if self._server.active and self._server.enabled:
            self._outputs.torque(self._now(), np.zeros(len(self._server.joint_names)))

    def _add(self, kind: Any, topic: str, callback: Callable[..., None]) -> None:
        subscription = self._node.create_subscription(kind, topic, callback, qos.NEWEST)
        self._optional.append(subscription)

    def _on_trajectory(self, raw: bytes, info: Info) -> None:
        """Answer a reference; where it lags, all plans that wait and the newest sample."""
        arrived = [(raw, self._arrival(info))]
        overtaken: list[int] = []
        if arrived[0][1].age > LONGEST_WAIT_S:
            waiting = self._node.arrived(self._trajectories)
            arrived += [(each, self._arrival(its_info)) for each, its_info in waiting]
            overtaken = [n for n, (each, _) in enumerate(arrived) if messages.is_sample(each)][:-1]
        self._references.received += len(arrived)
        for number, (each, arrival) in enumerate(arrived):
            if number in overtaken:
                self._node.unless_refused(self._refuse, Refusal.SUPERSEDED)
            else:
                self._node.unless_refused(self._answer, each, arrival)

    def _refuse(self, reason: Refusal) -> None:
        with self._references.refusing():
            raise RefusedError(reason)

    def _answer(self, raw: bytes, arrival: Arrival) -> None:
        with self._references.refusing():
            count = messages.count_points(raw)
            if count > self._settings.max_plan_points:
                raise RefusedError(Refusal.TOO_LONG)
        try:
            message = deserialize_message(raw, JointTrajectory)
        except Exception:  # the class depends on the middleware
            self._references.refuse(Refusal.MALFORMED)
            raise RefusedError(Refusal.MALFORMED) from None
        if count == 1:
            topic, stamp = self._trajectories.topic_name, message.header.stamp
            self._answer_sample(topic, stamp, message.joint_names, message.points, arrival)
        elif count:
            self._outputs.plan(plans.answered(self._node, self._server, message, age=arrival.age))
        else:  # the end of a motion, as for a joint_trajectory_controller
            self._outputs.plan(message)
            self._server.end_stream()

    def _on_controller_state(self, message: Any, info: Info) -> None:
        reference, names = message.reference, message.joint_names
        speed, topic = self._scaling.read(message), self._optional[0].topic_name
        if self._goals is not None and topic == self._goals.state_topic:
            self._goals.hear(message)
        self._references.received += 1
        arguments = topic, message.header.stamp, names, [reference], self._arrival(info), speed
        self._node.unless_refused(self._answer_sample, *arguments)

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
        self._node.unless_refused(self._server.take_update, message, time.monotonic(), clock_ns)

    def _answer_sample(
        self,
        topic: str,
        stamp: Time,
        names: Sequence[str],
        points: Sequence[Any],
        arrival: Arrival,
        speed: float = 1.0,
    ) -> None:
        now, steady, age = self._now(), time.monotonic(), arrival.age
        order, stamp_ns = None, 0
        if stamp.sec == stamp.nanosec == 0:  # left empty, which in a trajectory means now
            stamp = now
        else:
            with self._references.refusing():
                stamp_ns = messages.nanoseconds(stamp)
                age += max(0.0, (self._sent_ns(arrival, now) - stamp_ns) / 1e9)
                order = self._order.setdefault(topic, ReferenceStamps())
                order.require(stamp_ns, steady)
        served = self._server.sample(names, points, steady, age, speed)
        if order is not None:  # the stamps of what is refused say nothing
            order.take(stamp_ns, steady)
        self._answered_at[topic] = steady
        self._outputs.torque(stamp, served.tau)
        self._outputs.energies(stamp, served.query)
        if self._outputs.wants(*COMPONENT_TOPICS):
            self._outputs.components(stamp, self._server.arm.components(served.state))
        if served.std is not None:
            self._outputs.joints(STD_TOPIC, stamp, served.std)

    def _arrival(self, info: Info) -> Arrival:
        sent_ns = info['source_timestamp']
        age = self._ages.age(sent_ns, info['received_timestamp'], time.time_ns())
        return Arrival(age, sent_ns)

    def _sent_ns(self, arrival: Arrival, now: Time) -> int:
        """Return when a message was sent by the clock of its stamp [ns]: of a simulation, now."""
        simulated = self._node.get_clock().ros_time_is_active
        return messages.nanoseconds(now) if simulated else arrival.sent_ns

    def _now(self) -> Time:
        return self._node.get_clock().now().to_msg()

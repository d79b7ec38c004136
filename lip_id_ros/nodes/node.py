"""The base of all nodes: parameters from a table, a status, a guard around every callback."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
import functools
import inspect
import math
import socket
import time
import traceback
from typing import Any, TypeVar

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from lip_id_ros.errors import ConfigError, LipIdError
from lip_id_ros.nodes import messages, parameters, qos
from lip_id_ros.settings import Row
from lip_id_ros.signals.joints import HARMLESS, RefusedError
from lip_id_ros.signals.status import Level, Status
from lip_id_ros.signals.streams import Streams

Result = TypeVar('Result')

STATUS_PERIOD_S = 0.5

LONGEST_TAKE_S = 2.0
"""A topic that never falls silent holds up the node's end no longer."""


class NodeBase(Node):
    """
    A node that no message and no request can end, with a table of parameters by name.

    An exception of a subscription's, a service's or a timer's callback is logged and counted
    (`faults`, `last_fault`), the robot gets the safe torque, and a service answers without
    success. Refusals are not such exceptions: they are handled where they arise.

    The status is latched on ~/status where it changes, and goes to /diagnostics twice a second.
    `**options`: those of `rclpy.node.Node`, of every node of the package too. ConfigError if a
    parameter is given that is wrong or unknown.
    """

    faults = n_callbacks = 0
    last_fault = ''

    def __init__(self, name: str, table: Mapping[str, Row], **options: Any) -> None:
        self._streams = Streams()
        super().__init__(name, **{'enable_logger_service': True, **options})
        self._table = table
        self._logged: dict[str, float] = {}
        parameters.declare(self, table)
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._apply_parameters)
        # a lifecycle node has a status in every state: these are plain publishers
        self._status = self.create_publisher(DiagnosticStatus, '~/status', qos.LATCHED)
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', qos.DIAGNOSTICS)
        # the robot's name where it has one: nodes of several arms may share a computer
        self._hardware = self.get_namespace().strip('/') or socket.gethostname()
        self._last_status: DiagnosticStatus | None = None
        self._faults_published = 0
        self.create_steady_timer(STATUS_PERIOD_S, self.publish_status)

    # what a node defines

    def status(self) -> Status:
        """Return the present state; called twice a second."""
        return Status(Level.OK, 'running')

    def warnings(self) -> list[str]:
        """Describe what is wrong around the node, such as publishers that do not fit."""
        return [*qos.misfits(self), *qos.without_effect(self), *self._missing_clock()]

    def stop(self) -> None:
        """Release the robot and keep the data; the node can still publish."""

    def check_change(self, values: Mapping[str, Any]) -> None:
        """Check new values of parameters, each allowed alone; LipIdError if refused."""

    def apply_change(self, values: Mapping[str, Any]) -> None:
        """Use new values of parameters."""

    def output_safe_torque(self) -> None:
        """Publish what keeps the robot safe; a node that commands nothing publishes nothing."""

    # what a node uses

    def set_parameters_atomically(
        self, parameter_list: Sequence[Parameter]
    ) -> SetParametersResult:
        """Set parameters in the types of their rows; a refusal names the parameter."""
        for each in parameter_list:
            if not self.has_parameter(each.name):
                return parameters.refused(parameters.unknown(each.name, self._table))
        try:
            typed = [parameters.typed(self._table, each) for each in parameter_list]
        except ConfigError as error:
            return parameters.refused(error)
        return super().set_parameters_atomically(typed)

    def values(self) -> dict[str, Any]:
        """Return the present value of every parameter."""
        return parameters.values(self, self._table)

    def arrived(self, subscription: Any) -> Iterator[tuple[Any, Any]]:
        """Take the messages that have arrived, each with what the middleware says of it."""
        end = time.monotonic() + LONGEST_TAKE_S
        while time.monotonic() < end:
            try:
                taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            except Exception as error:  # of a message of random bytes
                self.caught(error)
                continue
            if taken is None:
                return
            yield taken

    def take_waiting(self, subscription: Any) -> None:
        """Run the callback for messages that have arrived and no executor takes any more."""
        for message, _ in self.arrived(subscription):
            subscription.callback(message)

    def create_steady_timer(self, period_s: float, callback: Callable[[], None]) -> None:
        """Create a timer that goes on where a paused simulation stops the node's clock."""
        self.create_timer(period_s, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def publish_status(self) -> None:
        """Publish the status to /diagnostics, and to ~/status if anything changed."""
        status = self._with_warnings(self._with_faults(self.status()))
        message = self._message('status', status)
        if message != self._last_status:
            self._status.publish(message)
            self._last_status = message
        inputs = self._message('inputs', self._streams.status(time.monotonic()))
        diagnostics = DiagnosticArray(status=[message, inputs])
        diagnostics.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(diagnostics)

    def _message(self, task: str, status: Status) -> DiagnosticStatus:
        name = self.get_fully_qualified_name().lstrip('/')
        return messages.status_message(f'{name}: {task}', self._hardware, status)

    def unless_refused(self, use: Callable[..., Result], *arguments: Any) -> Result | None:
        """Use a message; a refusal is logged, for each reason at most every five seconds."""
        try:
            return use(*arguments)
        except RefusedError as refused:
            if refused.reason not in HARMLESS:
                self.warn(refused.reason, f'refused a message ({refused.reason}): {refused}')
        return None

    def warn(self, key: str, warning: str) -> None:
        """Log a warning, for each key at most every five seconds."""
        if self._is_due(key, 5.0):
            self.get_logger().warning(warning)

    # the guard

    def create_subscription(
        self, msg_type: Any, topic: str, callback: Any, profile: QoSProfile, **options: Any
    ) -> Any:
        """Create a guarded subscription; ConfigError if its qos_overrides are wrong."""
        guarded = self._guarded(self._counted(topic, callback, profile))
        with qos.overriding(self, 'subscription', topic, profile) as given:
            return super().create_subscription(msg_type, topic, guarded, **given, **options)

    def destroy_subscription(self, subscription: Any) -> bool:
        """Destroy a subscription, whose topic is no input any more."""
        self._streams.remove(subscription.topic_name)
        return bool(super().destroy_subscription(subscription))

    def create_publisher(
        self, msg_type: Any, topic: str, profile: QoSProfile, **options: Any
    ) -> Any:
        """Create a publisher; ConfigError if its qos_overrides are wrong."""
        with qos.overriding(self, 'publisher', topic, profile) as given:
            return super().create_publisher(msg_type, topic, **given, **options)

    def create_service(self, srv_type: Any, srv_name: str, callback: Any, **options: Any) -> Any:
        """Create a guarded service that loses no call."""
        options.setdefault('qos_profile', qos.CALLS)
        return super().create_service(srv_type, srv_name, self._guarded(callback), **options)

    def create_timer(
        self, timer_period_sec: float, callback: Any, *args: Any, **options: Any
    ) -> Any:
        """Create a guarded timer."""
        return super().create_timer(timer_period_sec, self._guarded(callback), *args, **options)

    def guard_services(self) -> None:
        """Guard services that were created without `create_service`, as those of a lifecycle."""
        for service in self.services:
            if not hasattr(service.callback, '__wrapped__'):
                service.callback = self._guarded(service.callback)

    def caught(self, error: Exception) -> None:
        """Log and count an exception of a callback, and output the safe torque."""
        self.faults += 1
        self.last_fault = f'{type(error).__name__}: {error}'
        if self._is_due(type(error).__name__, 1.0):
            where = ''.join(traceback.format_tb(error.__traceback__)[-2:]).strip()
            self.get_logger().error(
                f'a callback failed, the node goes on: {self.last_fault}\n{where}'
            )
        try:
            self.output_safe_torque()
        except Exception as failed:
            self.get_logger().error(f'no safe torque could be published: {failed}')

    def _is_due(self, key: str, period_s: float) -> bool:
        """Whether a line may be logged again: by a clock that nobody sets back."""
        now = time.monotonic()
        if now < self._logged.get(key, -math.inf) + period_s:
            return False
        self._logged[key] = now
        return True

    def _counted(self, topic: str, callback: Any, profile: QoSProfile) -> Any:
        """Return a callback whose messages are an input of the diagnostics, unless latched."""
        if profile.durability == DurabilityPolicy.TRANSIENT_LOCAL:
            return callback
        lasting = profile.reliability == ReliabilityPolicy.BEST_EFFORT
        stream = self._streams.add(self.resolve_topic_name(topic), lasting)

        @functools.wraps(callback)
        def counted(*arguments: Any) -> Any:
            stream.arrived(time.monotonic())
            return callback(*arguments)

        return counted

    def _guarded(self, callback: Callable[..., Any]) -> Callable[..., Any]:
        if inspect.iscoroutinefunction(callback):

            @functools.wraps(callback)
            async def awaited(*arguments: Any) -> Any:
                self.n_callbacks += 1
                try:
                    return await callback(*arguments)
                except Exception as error:
                    return self._failed(error, arguments)

            return awaited

        @functools.wraps(callback)
        def called(*arguments: Any) -> Any:
            self.n_callbacks += 1
            if len(arguments) == 1 and isinstance(arguments[0], tuple):
                (arguments,) = arguments  # the events executor has message and info in one
            try:
                return callback(*arguments)
            except Exception as error:
                return self._failed(error, arguments)

        return called

    def _failed(self, error: Exception, arguments: tuple[Any, ...]) -> Any:
        self.caught(error)
        if len(arguments) < 2:
            return None
        response = type(arguments[1])()  # the other may be half filled in
        if hasattr(response, 'message'):
            response.message = f'failed: {self.last_fault}'
        return response

    # parameters and status

    def _check_parameters(self, changed: Sequence[Parameter]) -> SetParametersResult:
        try:
            if values := parameters.changed_values(self._table, changed):  # not those of rclpy
                self.check_change(values)
        except LipIdError as error:
            return parameters.refused(error)
        return SetParametersResult(successful=True)

    def _apply_parameters(self, changed: Sequence[Parameter]) -> None:
        if values := parameters.changed_values(self._table, changed):
            self.apply_change(values)

    def _with_faults(self, status: Status) -> Status:
        values = {**status.values, 'faults': self.faults, 'last_fault': self.last_fault}
        new, self._faults_published = self.faults - self._faults_published, self.faults
        if new:
            return Status(Level.ERROR, f'a callback failed: {self.last_fault}', values)
        return replace(status, values=values)

    def _missing_clock(self) -> list[str]:
        simulated = self.get_parameter('use_sim_time').value
        if not simulated or self.get_clock().now().nanoseconds:
            return []
        return ['use_sim_time is true, but /clock has no time: what is stamped now has stamp 0']

    def _with_warnings(self, status: Status) -> Status:
        warnings = self.warnings()
        if not warnings:
            return status
        level = max(status.level, Level.WARN)
        return replace(status, level=level, summary='; '.join([status.summary, *warnings]))

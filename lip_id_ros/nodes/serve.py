"""Node `serve`: references in, feedforward torques and energies out."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
import math
import sys

from builtin_interfaces.msg import Time
import numpy as np
from numpy.typing import NDArray
from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.errors import LipIdError
from lip_id_ros.nodes import messages, parameters, qos, running
from lip_id_ros.nodes.background import outcome
from lip_id_ros.nodes.status import OK, Status, StatusPublisher, WARN
from lip_id_ros.runtime.feedforward import Answer, Feedforward
from lip_id_ros.runtime.loading import load_feedforward, make_limits, require_joints
from lip_id_ros.runtime.references import ON_PURPOSE, RefusedError
from lip_id_ros.runtime.server import Server
from lip_id_ros.runtime.settings import serve_parameters, ServeSettings

STATUS_PERIOD_S = 0.5
WARNING_PERIOD_S = 5.0


class ServeNode(LifecycleNode):
    """
    Managed node: a model is loaded on configure, references are answered while active.

    Raises
    ------
    InvalidParameterValueException
        If a parameter is given a value that is not allowed.

    """

    def __init__(self) -> None:
        super().__init__('serve')
        self._table = serve_parameters()
        parameters.declare(self, self._table)
        self._server = Server()
        self._loaded: Feedforward | None = None
        self._refused_before = 0
        self._pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix='loading')
        self._status = StatusPublisher(self)
        self._make_outputs()
        self._make_inputs()
        self.add_on_set_parameters_callback(self._check_change)
        self.add_post_set_parameters_callback(self._apply_change)
        if self._settings().autostart:
            self._start()

    def stop(self) -> None:
        """Let go of the robot and end the lifecycle."""
        if self._state_label != 'finalized':
            self.trigger_shutdown()
        self._pool.shutdown()

    @property
    def _state_label(self) -> str:
        label: str = self._state_machine.current_state[1]
        return label

    def _make_outputs(self) -> None:
        publisher = self.create_lifecycle_publisher
        self._torque = publisher(JointState, '~/feedforward_torque', qos.OUTPUT)
        self._kinetic = publisher(Float64, '~/kinetic_energy', qos.OUTPUT)
        self._potential = publisher(Float64, '~/potential_energy', qos.OUTPUT)
        self._plan = publisher(JointTrajectory, '~/trajectory_with_effort', qos.OUTPUT)
        self._commands = None
        if self._settings().publish_commands:
            self._commands = publisher(Float64MultiArray, '~/commands', qos.OUTPUT)

    def _make_inputs(self) -> None:
        self.create_subscription(
            JointTrajectory, '~/desired_trajectory', self._on_trajectory, qos.REFERENCE
        )
        self.create_service(SetBool, '~/enable', self._on_enable)
        own_group = MutuallyExclusiveCallbackGroup()
        self.create_service(Trigger, '~/reload_model', self._on_reload, callback_group=own_group)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(STATUS_PERIOD_S, self._publish_status, clock=steady)

    # parameters

    def _settings(self) -> ServeSettings:
        return ServeSettings(**parameters.values(self, self._table))

    def _check_change(self, changed: Sequence[Parameter]) -> SetParametersResult:
        try:
            values = parameters.changed_values(self._table, changed)
            settings = replace(self._settings(), **values)
            if self._loaded is not None:
                require_joints(self._loaded.joint_names, settings.joints, settings.model_path)
                make_limits(settings, self._loaded.joint_names)
        except LipIdError as error:
            return parameters.refused(error)
        return SetParametersResult(successful=True)

    def _apply_change(self, changed: Sequence[Parameter]) -> None:
        if self._server.active and self._loaded is not None:
            self._use(self._loaded)

    # lifecycle

    def _start(self) -> None:
        if self.trigger_configure() == TransitionCallbackReturn.SUCCESS:
            self.trigger_activate()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Load the model; on failure the node stays unconfigured and says why."""
        settings = self._settings()
        try:
            loaded = load_feedforward(settings.model_path, settings.joints)
            make_limits(settings, loaded.joint_names)
        except (LipIdError, OSError) as error:
            self.get_logger().error(f'not configured: {error}')
            return TransitionCallbackReturn.FAILURE
        self._loaded = loaded
        self.get_logger().info(f'serves {settings.model_path}: {", ".join(loaded.joint_names)}')
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Answer references from now on."""
        settings = self._settings()
        if not settings.torque_limits:
            self.get_logger().warning('torque_limits is empty: torques are not limited')
        self._server.enabled = settings.enabled
        if self._loaded is None:
            return TransitionCallbackReturn.FAILURE
        self._use(self._loaded)
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Let go of the robot."""
        self._let_go()
        self._server.release()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget the model."""
        self._loaded = None
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Let go of the robot, for good."""
        self._let_go()
        self._server.release()
        self._loaded = None
        return super().on_shutdown(state)

    def _use(self, loaded: Feedforward) -> None:
        self._server.use(loaded, make_limits(self._settings(), loaded.joint_names))

    def _let_go(self) -> None:
        """Publish zero torque: whoever holds the last command then holds none."""
        if self._server.active and self._server.enabled:
            now = self.get_clock().now().to_msg()
            self._publish_torque(now, np.zeros(len(self._server.joint_names)))

    # messages

    def _on_trajectory(self, message: JointTrajectory) -> None:
        answer = self._answer_plan if len(message.points) > 1 else self._answer_sample
        try:
            answer(message)
        except RefusedError as refused:
            if refused.reason not in ON_PURPOSE:
                self.get_logger().warning(
                    f'refused a reference ({refused.reason}): {refused}',
                    throttle_duration_sec=WARNING_PERIOD_S,
                )

    def _answer_sample(self, message: JointTrajectory) -> None:
        answer = self._server.sample(message.joint_names, message.points)
        self._publish_answer(self._stamp_of(message), answer)

    def _answer_plan(self, message: JointTrajectory) -> None:
        tau = self._server.plan(message.joint_names, message.points)
        self._plan.publish(messages.with_effort(message, tau))

    def _stamp_of(self, message: JointTrajectory) -> Time:
        stamp = message.header.stamp
        return self.get_clock().now().to_msg() if messages.is_zero(stamp) else stamp

    def _publish_answer(self, stamp: Time, answer: Answer) -> None:
        self._publish_torque(stamp, answer.tau)
        self._kinetic.publish(Float64(data=answer.kinetic))
        if not math.isnan(answer.potential):
            self._potential.publish(Float64(data=answer.potential))

    def _publish_torque(self, stamp: Time, tau: NDArray[np.float64]) -> None:
        self._torque.publish(messages.torque_message(stamp, self._server.joint_names, tau))
        if self._commands is not None:
            self._commands.publish(messages.command_message(tau))

    # services

    def _on_enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        if not request.data:
            self._let_go()
        self._server.enabled = request.data
        self._publish_status()
        response.success = True
        response.message = 'enabled' if request.data else 'disabled'
        return response

    async def _on_reload(
        self, request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        try:
            response.message = await self._reload()
            response.success = True
        except (LipIdError, OSError) as error:
            response.success = False
            response.message = str(error)
        return response

    async def _reload(self) -> str:
        """Load beside the executor, so that references are answered meanwhile; then swap."""
        settings = self._settings()
        if self._loaded is None:
            raise LipIdError('there is no model to replace; configure the node instead.')
        joints = settings.joints or self._loaded.joint_names
        loading = self._pool.submit(load_feedforward, settings.model_path, joints)
        loaded = await outcome(self, loading)
        if self._loaded is None:
            raise LipIdError('the node was cleaned up while the model was loaded.')
        self._loaded = loaded
        if self._server.active:
            self._use(loaded)
        return f'serves {settings.model_path}'

    # status

    def _publish_status(self) -> None:
        values = {'state': self._state_label, **self._server.status()}
        level = WARN if self._server.n_refused > self._refused_before else OK
        self._refused_before = self._server.n_refused
        self._status.publish(Status(level, self._server.summary, values))


def main() -> int:
    """Run the node `serve`."""
    return running.run(ServeNode)


if __name__ == '__main__':
    sys.exit(main())

"""Node `serve`: references in, feedforward torques and energies out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
import sys
import time
from typing import Any

from lifecycle_msgs.srv import ChangeState
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool, Trigger

from lip_id_ros.errors import LipIdError, one_line
from lip_id_ros.feedforward.loading import (
    load_models,
    LoadedModel,
    require_payload,
    require_rules,
)
from lip_id_ros.feedforward.server import Server
from lip_id_ros.feedforward.settings import (
    require_bounded,
    require_changeable,
    ServeSettings,
    unbounded,
)
from lip_id_ros.nodes import running
from lip_id_ros.nodes.controller import await_last_answers
from lip_id_ros.nodes.description import Description
from lip_id_ros.nodes.node import NodeBase
from lip_id_ros.nodes.running import outcome
from lip_id_ros.nodes.serve_inputs import Inputs
from lip_id_ros.nodes.serve_outputs import Outputs
from lip_id_ros.settings import parameters_of
from lip_id_ros.signals.status import Status
from lip_id_ros.signals.torque_steps import LimitsFrom, require_limits

WATCH_PERIOD_S = 0.02
SUCCESS = TransitionCallbackReturn.SUCCESS


class ServeNode(NodeBase, LifecycleNode):
    """Managed node: a model is loaded on configure, references are answered while active."""

    def __init__(self, **options: Any) -> None:
        super().__init__('serve', parameters_of(ServeSettings), **options)
        self._server = Server()
        self._models: dict[str, LoadedModel] = {}
        self._loaded: LoadedModel | None = None
        self._failure = ''
        self._description: Description | None = None
        self._limits: tuple[float, ...] = ()  # of the description, while active
        self._n_configured = 0
        self._pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix='loading')
        self._outputs = Outputs(self)
        self._inputs = Inputs(self, self._server, self._outputs)
        self._make_services()
        self._guard_transitions()
        if self._settings().autostart and self.trigger_configure() == SUCCESS:
            self.trigger_activate()

    def stop(self) -> None:
        """Release the robot and end the lifecycle, once controllers have cancelled goals."""
        self._inputs.close_goals()
        await_last_answers(self, lambda: self._inputs.is_settled)
        if self._state_label != 'finalized':
            self.trigger_shutdown()
        self._inputs.destroy()
        self._pool.shutdown()

    def warnings(self) -> list[str]:
        """Describe what is wrong around the node, several publishers of one topic too."""
        return [*super().warnings(), *self._inputs.warnings()]

    def status(self) -> Status:
        """Return the state of the lifecycle and the server's counts."""
        level, summary = self._server.judge(self._failure, time.monotonic())
        if self._server.active and (warning := unbounded(self._settings())):
            summary = f'{summary}; {warning}'
        values = {'state': self._state_label, 'goals': self._inputs.goals.values()}
        return Status(level, summary, {**values, **self._server.values()})

    @property
    def _state_label(self) -> str:
        label: str = self._state_machine.current_state[1]
        return label

    def _make_services(self) -> None:
        self.create_service(SetBool, '~/enable', self._on_enable)
        own_group = MutuallyExclusiveCallbackGroup()
        self.create_service(Trigger, '~/reload_model', self._on_reload, callback_group=own_group)
        self.create_steady_timer(WATCH_PERIOD_S, self._inputs.watch)

    def _guard_transitions(self) -> None:
        """Answer a transition that is not possible now; rclpy ends the node for it."""
        change: Callable[..., ChangeState.Response] = self._service_change_state.callback

        def if_possible(
            request: ChangeState.Request, response: ChangeState.Response
        ) -> ChangeState.Response:
            asked = request.transition
            possible = [each[:2] for each in self._state_machine.available_transitions]
            if asked.label in [label for _, label in possible] or (
                not asked.label and asked.id in [number for number, _ in possible]
            ):
                return change(request, response)
            labels = ', '.join(dict.fromkeys(label for _, label in possible))
            name, state = asked.label or asked.id, self._state_label
            self.get_logger().warning(
                f'refused transition {name}: in state {state} there are only {labels or "none"}'
            )
            response.success = False
            return response

        self._service_change_state.callback = if_possible
        self.guard_services()

    def output_safe_torque(self) -> None:
        """Publish zero torque; the next reference is ramped in from there."""
        self._inputs.publish_zero()
        self._server.rest(time.monotonic())

    # parameters

    def check_change(self, values: Mapping[str, Any]) -> None:
        """Refuse what would have no effect now, or does not fit the arm."""
        before = self._settings()
        settings = self._with_limits(ServeSettings(**{**self.values(), **values}))
        require_changeable(before, settings, self._state_label)
        require_rules(settings, self._loaded)
        if self._server.active:
            before_rules = self._server.arm.shaper.rules
            require_bounded(settings, before_rules, self._server.joint_names)
        if self._models and 'payload' in values:
            require_payload(settings, self._models)

    def apply_change(self, values: Mapping[str, Any]) -> None:
        """Use the new settings at once; a torque that they change is ramped to."""
        settings = self._settings()
        self._server.adjust(settings)
        self._inputs.adjust(settings)
        if self._models and self._models[settings.payload] is not self._loaded:
            self._serve(self._models[settings.payload], settings)
        if self._server.active and settings.enabled != self._server.enabled:
            self._enable(settings.enabled)

    def _serve(self, loaded: LoadedModel, settings: ServeSettings) -> None:
        self._loaded = loaded
        if self._server.active:
            self._server.use(loaded, settings)

    def _settings(self) -> ServeSettings:
        return self._with_limits(ServeSettings(**self.values()))

    def _with_limits(self, settings: ServeSettings) -> ServeSettings:
        if settings.torque_limits_from != LimitsFrom.DESCRIPTION:
            return settings
        return replace(settings, torque_limits=self._limits)

    def _read_limits(self, joint_names: Sequence[str]) -> ServeSettings:
        self._limits = ()
        settings = self._settings()
        self._listen(settings)
        if settings.torque_limits_from == LimitsFrom.DESCRIPTION and self._description:
            self._limits = self._description.torque_limits(settings.joints or joint_names)
        return self._with_limits(settings)

    def _listen(self, settings: ServeSettings) -> None:
        described = settings.torque_limits_from == LimitsFrom.DESCRIPTION
        if described and self._description is None:
            self._description = Description(self, settings.robot_description)

    # lifecycle

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Load the model; after a failure the node stays unconfigured and its status has why."""
        settings = self._settings()
        try:
            self._models = load_models(settings, None)
            self._loaded = self._models[settings.payload]
            for loaded in self._models.values():
                require_rules(settings, loaded)
            self._outputs.configure(settings, self._loaded.joint_names)
            self._inputs.configure(settings)
            self._inputs.adjust(settings)
        except (LipIdError, OSError) as error:
            self._failure = f'not configured: {one_line(error)}'
            self.get_logger().error(self._failure)
            self._forget()
            return TransitionCallbackReturn.FAILURE
        self._failure = ''
        self._listen(settings)
        self._n_configured += 1
        joints = ', '.join(self._loaded.joint_names)
        self.get_logger().info(f'serves {settings.model_path}: {joints}')
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Answer references from now on."""
        if self._loaded is None:
            return TransitionCallbackReturn.FAILURE
        try:
            settings = self._read_limits(self._loaded.joint_names)
            require_limits('torque_limits', settings.torque_limits, settings.torque_limits_from)
        except LipIdError as error:
            self._failure = f'not activated: {error}'
            self.get_logger().error(self._failure)
            return TransitionCallbackReturn.FAILURE
        self._failure = ''
        if warning := unbounded(settings):
            self.get_logger().warning(warning)
        self._server.use(self._loaded, settings)
        self._inputs.adjust(settings)
        result = super().on_activate(state)
        self._enable(settings.enabled)
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Output zero torque and release the robot."""
        self._release()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget the model."""
        result = super().on_cleanup(state)
        self._forget()
        return result

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Release the robot and forget the model; the node cannot be configured again."""
        self._release()
        result = super().on_shutdown(state)
        self._forget()
        return result

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Release the robot after a transition that raised an error; configure works again."""
        self._failure = 'a transition raised an error; configure the node again'
        self.get_logger().error(self._failure)
        self._release()
        self._forget()
        return super().on_error(state)

    def _release(self) -> None:
        self._inputs.release_goals()
        self._inputs.publish_zero()
        self._server.release()
        self._limits = ()

    def _forget(self) -> None:
        self._inputs.clean_up()
        self._outputs.clean_up()
        self._models, self._loaded = {}, None

    # services

    def _on_enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        (result,) = self.set_parameters([Parameter('enabled', value=request.data)])
        self.publish_status()
        response.success = result.successful
        done = 'enabled' if request.data else 'disabled'
        if request.data and not self._server.active:
            done += f'; the node is {self._state_label} and answers nothing until it is active'
        response.message = done if result.successful else result.reason
        return response

    def _enable(self, enabled: bool) -> None:
        if enabled:
            self._server.enable()
        else:
            self._inputs.release_goals()
            self._inputs.publish_zero()
            self._server.disable(time.monotonic())

    async def _on_reload(
        self, request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        configured = self._n_configured
        try:
            response.message = await self._reload(configured)
            response.success = True
            self._failure = ''
        except (LipIdError, OSError) as error:
            response.success = False
            response.message = one_line(error)
            if configured == self._n_configured:
                self._failure = response.message
        return response

    async def _reload(self, configured: int) -> str:
        """Load beside the executor, so that references are answered meanwhile; then swap."""
        settings, before = self._settings(), self._loaded
        if before is None:
            raise LipIdError('there is no model to replace; configure the node instead.')
        models = await outcome(self, self._pool.submit(load_models, settings, before))
        if self._loaded is None or self._n_configured != configured:
            raise LipIdError(
                'the node was cleaned up while the model was loaded; call reload_model again.'
            )
        now = self._settings()
        for loaded in models.values():
            require_rules(now, loaded)
        self._models = models
        if now.payload not in models:  # changed meanwhile to one that was not to be loaded
            self.get_logger().warning(f'no payload: {now.payload} is not loaded any more')
            self.set_parameters([Parameter('payload', value='')])
            now = self._settings()
        self._serve(models[now.payload], now)
        return f'serves {settings.model_path}'


def main() -> int:
    """Run the node `serve`."""
    return running.run(ServeNode)


if __name__ == '__main__':
    sys.exit(main())

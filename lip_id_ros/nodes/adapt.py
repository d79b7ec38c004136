"""Node `adapt`: joint states and payloads in; updates of the model, payloads and alarms out."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
import sys
import time
from typing import Any

from control_msgs.msg import DynamicInterfaceGroupValues
from geometry_msgs.msg import InertiaStamped
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from lip_id_ros.adaptation.live import AdaptSettings, LiveAdaptation, Step
from lip_id_ros.errors import DataError
from lip_id_ros.nodes import messages, qos, running
from lip_id_ros.nodes.node import NodeBase
from lip_id_ros.nodes.running import outcome
from lip_id_ros.recording.joint_messages import from_joint_state
from lip_id_ros.settings import parameters_of
from lip_id_ros.signals.status import Status

WATCH_PERIOD_S = 0.05
"""Half the least period of updates: each is published at the watch after its step."""


class AdaptNode(NodeBase):
    """Follow an arm in a thread beside the executor; LipIdError if the model does not fit."""

    def __init__(self, **options: Any) -> None:
        super().__init__('adapt', parameters_of(AdaptSettings), **options)
        name = self.get_fully_qualified_name()
        self._live = LiveAdaptation(self._settings(), name, time.monotonic(), time.time())
        if self._live.note:
            self.get_logger().warning(self._live.note)
        self._pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix='adaptation')
        self._step: Future[Step] | None = None
        self._due, self._period_s = time.monotonic(), 1.0 / self._settings().publish_rate_hz
        self._update = self.create_publisher(DynamicInterfaceGroupValues, '~/update', qos.LATCHED)
        self._payload = self.create_publisher(InertiaStamped, '~/payload', qos.LATCHED)
        own_group = MutuallyExclusiveCallbackGroup()
        self.create_service(Trigger, '~/reset', self._on_reset, callback_group=own_group)
        self.create_subscription(
            InertiaStamped, '~/announced_payload', self._on_announced, qos.DIAGNOSTICS
        )
        self._subscription = self.create_subscription(
            JointState, 'joint_states', self._on_joint_state, qos.SENSOR_STREAM
        )
        self.create_steady_timer(WATCH_PERIOD_S, self._watch)

    def stop(self) -> None:
        """Keep what was learned."""
        self._pool.submit(self._live.save, time.time()).result()
        self._pool.shutdown()

    def status(self) -> Status:
        """Return the state of the arm and the counts."""
        return self._live.status(time.monotonic())

    def warnings(self) -> list[str]:
        """Describe what is wrong around the node, several publishers of joint states too."""
        topic = self._subscription.topic_name
        return [*super().warnings(), *qos.several_publishers(self, topic)]

    def apply_change(self, values: Mapping[str, Any]) -> None:
        """Use new settings from the next joint state on."""
        self._live.settings = self._settings()

    def _settings(self) -> AdaptSettings:
        return AdaptSettings(**self.values())

    def _on_joint_state(self, message: JointState) -> None:
        self.unless_refused(self._live.take, from_joint_state(message))

    def _watch(self) -> None:
        """Publish what came of the last step, and begin the next when it is due."""
        if self._step is not None and self._step.done():
            step, self._step = self._step, None
            self._publish(step.result())
        now = time.monotonic()
        if self._step is None and now >= self._due:
            self._due = max(self._due + self._period_s, now)
            self._step = self._pool.submit(self._live.step, now, time.time())

    def _publish(self, step: Step) -> None:
        stamp, name = self.get_clock().now().to_msg(), self.get_fully_qualified_name()
        if step.update is not None:
            self._update.publish(messages.update_message(stamp, name, step.update))
        for event in step.payloads:
            self.get_logger().info(event.sentence())
        if step.payloads:
            frame = self._live.payload_frame
            self._payload.publish(messages.inertia_message(stamp, frame, *step.carried))
        for sentence in step.alarms:
            self.get_logger().warning(sentence)

    def _on_announced(self, message: InertiaStamped) -> None:
        try:
            self._live.announce(*messages.inertia_values(message.inertia), message.header.frame_id)
        except DataError as error:
            self.warn(str(error), f'refused a payload: {error}')
        self._due = time.monotonic()

    async def _on_reset(
        self, request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        await outcome(self, self._pool.submit(self._live.reset))
        self._due = time.monotonic()
        response.success, response.message = True, 'what was learned is forgotten'
        return response


def main() -> int:
    """Run the node `adapt`."""
    return running.run(AdaptNode)


if __name__ == '__main__':
    sys.exit(main())

"""Node `adapt`: joint states in; updates of the model, payloads and changes of the arm out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
import sys
import time
from typing import Any

from pal_statistics_msgs.msg import Statistics
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from lip_id_ros.adaptation.live import (
    AdaptSettings,
    LiveAdaptation,
    payload_values,
    require_centre,
    Step,
)
from lip_id_ros.nodes import messages, qos, running
from lip_id_ros.nodes.node import NodeBase
from lip_id_ros.nodes.running import outcome
from lip_id_ros.recording.joint_messages import from_joint_state
from lip_id_ros.settings import parameters_of
from lip_id_ros.signals.joints import RefusedError
from lip_id_ros.signals.status import Status

WATCH_PERIOD_S = 0.05


def watch_period_s(publish_rate_hz: float) -> float:
    """Return how often steps are watched [s]: each is published at the next watch."""
    return min(WATCH_PERIOD_S, 0.5 / publish_rate_hz)


class AdaptNode(NodeBase):
    """Follow an arm in a thread beside the executor; LipIdError if the model does not fit."""

    def __init__(self, **options: Any) -> None:
        super().__init__('adapt', parameters_of(AdaptSettings), **options)
        self._live = LiveAdaptation(self._settings(), time.monotonic())
        self._live.begin(time.time())
        self._pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix='adaptation')
        self._step: Future[Step] | None = None
        self._due, self._period_s = time.monotonic(), 1.0 / self._settings().publish_rate_hz
        self._update = self.create_publisher(String, '~/update', qos.LATCHED)
        self._payload = self.create_publisher(Statistics, '~/payload', qos.LATCHED)
        for kind, name, callback in (
            (Trigger, '~/reset', self._on_reset),
            (SetBool, '~/announce_payload', self._on_announce),
        ):
            own_group = MutuallyExclusiveCallbackGroup()
            self.create_service(kind, name, callback, callback_group=own_group)
        self._subscription = self.create_subscription(
            JointState, 'joint_states', self._on_joint_state, qos.SENSOR_STREAM
        )
        self.create_steady_timer(watch_period_s(self._settings().publish_rate_hz), self._watch)

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

    def check_change(self, values: Mapping[str, Any]) -> None:
        """Refuse a centre of mass that is none."""
        require_centre(replace(self._settings(), **values))

    def apply_change(self, values: Mapping[str, Any]) -> None:
        """Use new settings from the next joint state on."""
        self._live.settings = self._settings()

    def _settings(self) -> AdaptSettings:
        return AdaptSettings(**self.values())

    def _on_joint_state(self, message: JointState) -> None:
        try:
            self._live.take(from_joint_state(message))
        except RefusedError as refused:
            self.warn_of_refusal(refused)

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
        if step.update is not None:
            self._update.publish(String(data=step.update.to_text()))
        stamp = self.get_clock().now().to_msg()
        for event in step.payloads:
            self.get_logger().info(event.sentence())
            values = payload_values(event.payload)
            self._payload.publish(messages.statistics_message(stamp, values))
        for sentence in step.alarms:
            self.get_logger().warning(sentence)

    async def _on_reset(
        self, request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        await self._done(self._live.reset, time.time())
        response.success, response.message = True, 'what was learned is forgotten'
        return response

    async def _on_announce(
        self, request: SetBool.Request, response: SetBool.Response
    ) -> SetBool.Response:
        response.message = await self._done(self._live.announce, request.data, time.time())
        response.success = True
        return response

    async def _done(self, work: Callable[..., Any], *arguments: Any) -> Any:
        """Do work between two steps, and publish an update right after it."""
        found = await outcome(self, self._pool.submit(work, *arguments))
        self._due = time.monotonic()
        return found


def main() -> int:
    """Run the node `adapt`."""
    return running.run(AdaptNode)


if __name__ == '__main__':
    sys.exit(main())

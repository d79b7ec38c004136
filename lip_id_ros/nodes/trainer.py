"""The node `train` as `excite` uses it: it records motions, and fits."""

from __future__ import annotations

from collections.abc import Mapping
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import numpy as np
from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger

from lip_id_ros.nodes import messages, qos
from lip_id_ros.nodes.controller import LONGEST_ANSWER_S
from lip_id_ros.nodes.motion_goal import HaltError, Until
from lip_id_ros.nodes.node import NodeBase


class Trainer:
    """A node `train` by name; HaltError where it does not do as asked."""

    def __init__(self, node: NodeBase, name: str) -> None:
        self._node, self._name = node, node.resolve_service_name(name)
        self._record = node.create_client(SetBool, f'{name}/record')
        self._fit = node.create_client(Trigger, f'{name}/fit')
        self._end_disturbed = node.create_client(Trigger, f'{name}/end_disturbed')
        node.create_subscription(DiagnosticStatus, f'{name}/status', self._on_status, qos.LATCHED)
        node.create_subscription(
            DiagnosticArray, '/diagnostics', self._on_diagnostics, qos.DIAGNOSTICS
        )
        self._results: Mapping[str, Any] = {}
        self._heard_of_job: Future | None = None
        self._heard_at = np.inf  # no silence matters yet

    def silence(self) -> str | None:
        """Return that it is silent while it should record or fit, or None."""
        if time.monotonic() - self._heard_at <= LONGEST_ANSWER_S:
            return None
        return f'{self._name} is silent for {LONGEST_ANSWER_S:g} s; start it again'

    async def record(self, until: Until) -> None:
        """Have it record."""
        await self._asked(self._record, SetBool.Request(data=True), until)
        self._heard_at = time.monotonic()

    def end(self, disturbed: bool) -> None:
        """Have it end the recording, whose end is left out of fits where it is disturbed."""
        if disturbed:
            self._end_disturbed.call_async(Trigger.Request())
        self._heard_at = np.inf
        self._record.call_async(SetBool.Request(data=False))

    async def fitted(self, until: Until) -> str:
        """Have it fit; return the path of the model."""
        self._results = {}  # of a node that has been started again, numbers are too
        answer = await self._asked(self._fit, Trigger.Request(), until)
        number = answer.message.removeprefix('job ').partition(':')[0]
        self._heard_at = time.monotonic()
        try:
            while number not in self._results:
                self._heard_of_job = Future(executor=self._node.executor)
                await until(self._heard_of_job)
        finally:
            self._heard_at = np.inf
        result = self._results[number]
        if result['state'] != 'done':
            raise HaltError(f'the fit has ended without a model: {result["error"]}')
        return str(result['path'])

    async def _asked(self, client: Any, request: Any, until: Until) -> Any:
        if not client.service_is_ready():
            raise HaltError(f'nobody offers {client.srv_name}; start the node train')
        answer = await until(client.call_async(request), LONGEST_ANSWER_S, client.srv_name)
        if not answer.success:
            raise HaltError(f'{client.srv_name}: {answer.message}')
        return answer

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        if any(each.name == f'{self._name.lstrip("/")}: status' for each in message.status):
            self._heard_at = max(self._heard_at, time.monotonic())

    def _on_status(self, message: DiagnosticStatus) -> None:
        self._results = messages.status_values(message).get('results', {})
        if self._heard_of_job is not None and not self._heard_of_job.done():
            self._heard_of_job.set_result(None)

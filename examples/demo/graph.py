"""The ROS graph of the demo: its nodes in processes of their own, and calls to them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import math
import os
from pathlib import Path
import signal
import subprocess
import sys
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.srv import GetParameters, SetParameters
import rclpy
from rclpy.client import Client
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.errors import LipIdError
from lip_id_ros.nodes import messages, qos, running

ANSWER_SECONDS = 60.0
POLL_SECONDS = 0.1
ASK_AGAIN_SECONDS = 1.0
LAUNCHING = Path(__file__).with_name('launching.py')
STOP_SECONDS = 15.0


class Graph:
    """Services and topics of the demo's nodes; another thread spins the node."""

    def __init__(self, node: Node, alive: Callable[[], bool]) -> None:
        self.node = node
        self._alive = alive
        self.train_status: dict[str, Any] = {}
        self._known: set[str] = set()
        self._record = node.create_client(SetBool, '/train/record')
        self._save = node.create_client(Trigger, '/train/save_dataset')
        self._fit = node.create_client(Trigger, '/train/fit')
        self._lifecycle = node.create_client(ChangeState, '/serve/change_state')
        self._robot = node.create_client(SetParameters, '/simulated_panda/set_parameters')
        self._plans = node.create_publisher(JointTrajectory, '/desired_trajectory', qos.REFERENCE)
        node.create_subscription(DiagnosticStatus, '/train/status', self._on_status, qos.LATCHED)

    def wait_until(
        self,
        condition: Callable[[], bool],
        what: str,
        seconds: float = ANSWER_SECONDS,
        progress: Callable[[], Any] = lambda: None,
    ) -> None:
        """
        Wait for a condition; `what` names it, `progress` returns another value after progress.

        LipIdError if nothing progresses for so many seconds, or a node ends before.
        """
        reached, since = progress(), time.monotonic()
        while not condition():
            if not self._alive():
                raise LipIdError(f'the nodes ended while waiting for {what}; see nodes.log.')
            if (now := progress()) != reached:
                reached, since = now, time.monotonic()
            if time.monotonic() > since + seconds:
                raise LipIdError(
                    f'waited {seconds:g} s for {what} without progress; see nodes.log.'
                )
            time.sleep(POLL_SECONDS)

    def await_discovery(self) -> None:
        """Wait until all nodes know the topics and services of this one."""
        for name in ('train', 'serve', 'simulated_panda'):
            await_discovery(self.node, f'/{name}', self.wait_until)

    def set_recording(self, recording: bool) -> None:
        """Start or stop recording in `train`."""
        self._succeed(self._record, SetBool.Request(data=recording))

    def save_dataset(self) -> None:
        """Let `train` save its data set."""
        self._succeed(self._save, Trigger.Request())

    def start_fit(self) -> None:
        """Let `train` begin a fit."""
        self._succeed(self._fit, Trigger.Request())

    def activate_serve(self) -> None:
        """Let `serve` load the model and answer."""
        for transition in (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE):
            request = ChangeState.Request(transition=Transition(id=transition))
            if not self._call(self._lifecycle, request).success:
                raise LipIdError('serve could not be activated; see nodes.log.')

    def set_robot(self, **parameters: Any) -> None:
        """Set parameters of the simulated arm."""
        changes = [Parameter(name, value=value) for name, value in parameters.items()]
        request = SetParameters.Request(
            parameters=[change.to_parameter_msg() for change in changes]
        )
        for result in self._call(self._robot, request).results:
            if not result.successful:
                raise LipIdError(f'the simulated arm refused a parameter: {result.reason}')

    def publish_plan(self, plan: JointTrajectory) -> None:
        """Ask for the efforts of a plan."""
        self._plans.publish(plan)

    def _succeed(self, client: Client, request: Any) -> None:
        response = self._call(client, request)
        if not response.success:
            raise LipIdError(f'{client.srv_name}: {response.message}')

    def _call(self, client: Client, request: Any) -> Any:
        if client.srv_name not in self._known:
            self.wait_until(client.service_is_ready, client.srv_name)
            await_discovery(self.node, client.srv_name.rpartition('/')[0], self.wait_until)
            self._known.add(client.srv_name)
        answer = client.call_async(request)
        self.wait_until(answer.done, f'the answer of {client.srv_name}')
        return answer.result()

    def _on_status(self, message: DiagnosticStatus) -> None:
        self.train_status = messages.status_values(message)


def await_discovery(
    node: Node, remote: str, wait: Callable[[Callable[[], bool], str], None]
) -> None:
    """
    Wait until a remote node has discovered every endpoint that a node has created so far.

    A message or a response to an endpoint that its sender has not discovered is lost. What a node
    can see is only that it has discovered the other. But discovery announces endpoints in the
    order of their creation, so a remote node that answers a new client knows all older endpoints.

    The remote node must have parameter services; another thread spins this one.
    """
    client = node.create_client(GetParameters, f'{remote}/get_parameters')
    wait(client.service_is_ready, client.srv_name)
    answers: list[Any] = []
    asked = -math.inf

    def answered() -> bool:
        nonlocal asked
        if time.monotonic() > asked + ASK_AGAIN_SECONDS:
            answers.append(client.call_async(GetParameters.Request()))
            asked = time.monotonic()
        return any(answer.done() for answer in answers)

    wait(answered, f'an answer of {client.srv_name}')


@contextmanager
def spinning(name: str) -> Iterator[Node]:
    """Give a node that is spun in another thread while the block runs."""
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node(name)
    try:
        with running.spinning(node, executor=running.make_executor('events')):
            yield node
    finally:
        node.destroy_node()
        rclpy.shutdown()


@contextmanager
def launched(output: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Run the demo's launch file while the block runs; its log goes to the output folder."""
    with open(output / 'nodes.log', 'wb') as log:
        process = subprocess.Popen(
            [
                sys.executable,
                '-P',
                str(LAUNCHING),
                'demo.launch.py',
                f'folder:={output}',
                f'model_path:={output / "model.npz"}',
            ],
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            yield process
        finally:
            end(process)


def end(process: subprocess.Popen[bytes]) -> None:
    """Interrupt a process and its children, as Ctrl-C does; kill what is left."""
    for number in (signal.SIGINT, signal.SIGKILL):
        if process.poll() is None:
            os.killpg(process.pid, number)
            try:
                process.wait(STOP_SECONDS)
            except subprocess.TimeoutExpired:
                continue

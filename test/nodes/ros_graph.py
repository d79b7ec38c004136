"""Real nodes in real processes, and a client of theirs, in a ROS domain of their own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import itertools
import json
import os
from pathlib import Path
import signal
import subprocess
import sys
import threading
import time
from typing import Any

from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import SetParameters
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from lip_id_ros.nodes import qos

ROOT = Path(__file__).resolve().parents[2]
FOUND_S = 0.2
TIMEOUT_S = 120.0  # a loaded machine compiles for long
_numbers = itertools.count()


def free_domain() -> int:
    """Give another domain for each test of each process; beyond 101 ports may be taken."""
    return 1 + (17 * os.getpid() + next(_numbers)) % 100


class Process:
    """A node of the package in a process of its own."""

    def __init__(
        self, module: str, folder: Path, environment: dict[str, str], arguments: list[str]
    ) -> None:
        self.log_path = folder / f'{module}.log'
        with open(self.log_path, 'wb') as log:
            self._popen = subprocess.Popen(
                [sys.executable, '-m', f'lip_id_ros.nodes.{module}', '--ros-args', *arguments],
                cwd=folder,
                env=environment,
                stdout=log,
                stderr=subprocess.STDOUT,
                # under nohup the tests ignore it, and what they start would too
                preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL),
            )

    @property
    def log(self) -> str:
        return self.log_path.read_text()

    @property
    def alive(self) -> bool:
        return self._popen.poll() is None

    def end(self, number: int = signal.SIGINT) -> int:
        """Ask the process to end and return its exit status."""
        if self.alive:
            self._popen.send_signal(number)
        return self.wait()

    def wait(self) -> int:
        """Return the exit status."""
        try:
            return self._popen.wait(TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._popen.kill()
            raise


class Client:
    """A node that talks with the others; waiting fails loudly."""

    def __init__(self, context: Context) -> None:
        self.node = rclpy.create_node('client', context=context)
        self.received: dict[str, list[Any]] = {}

    def wait_until(self, condition: Callable[[], Any], what: str) -> None:
        deadline = time.monotonic() + TIMEOUT_S
        while not condition():
            assert time.monotonic() < deadline, f'{what} did not happen in {TIMEOUT_S} s'
            time.sleep(0.02)

    def call(self, kind: Any, name: str, request: Any) -> Any:
        client = self.node.create_client(kind, name)
        self.wait_until(client.service_is_ready, f'service {name}')
        # Fast DDS drops an answer when the server has not found the client yet
        time.sleep(FOUND_S)
        answer = client.call_async(request)
        self.wait_until(answer.done, f'answer of {name}')
        return answer.result()

    def trigger(self, name: str) -> Any:
        return self.call(Trigger, name, Trigger.Request())

    def switch(self, name: str, on: bool) -> Any:
        return self.call(SetBool, name, SetBool.Request(data=on))

    def set_parameter(self, node: str, name: str, value: Any) -> Any:
        request = SetParameters.Request(
            parameters=[Parameter(name, value=value).to_parameter_msg()]
        )
        return self.call(SetParameters, f'/{node}/set_parameters', request).results[0]

    def transition(self, number: int) -> bool:
        request = ChangeState.Request()
        request.transition.id = number
        return bool(self.call(ChangeState, '/serve/change_state', request).success)

    def state(self) -> str:
        return str(self.call(GetState, '/serve/get_state', GetState.Request()).current_state.label)

    def listen(self, kind: Any, topic: str, profile: QoSProfile = qos.OUTPUT) -> list[Any]:
        """Collect the messages of a topic once its publisher is there."""
        messages = self.await_topic(kind, topic, profile)
        self.wait_until(lambda: self.node.count_publishers(topic), f'publisher of {topic}')
        return messages

    def await_topic(self, kind: Any, topic: str, profile: QoSProfile = qos.OUTPUT) -> list[Any]:
        """Collect the messages of a topic whose publisher may come later."""
        messages = self.received.setdefault(topic, [])
        self.node.create_subscription(kind, topic, messages.append, profile)
        return messages

    def speak(
        self, kind: Any, topic: str, profile: QoSProfile = qos.REFERENCE, listeners: int = 1
    ) -> Any:
        """Return a publisher that is heard by so many."""
        publisher = self.node.create_publisher(kind, topic, profile)
        self.wait_until(
            lambda: publisher.get_subscription_count() >= listeners, f'subscriber of {topic}'
        )
        time.sleep(FOUND_S)  # the subscriber finds the publisher a little later
        return publisher

    def status(self, node: str, condition: Callable[[dict[str, Any]], Any]) -> dict[str, Any]:
        """Wait for a status of a node that fulfils a condition."""
        topic = f'/{node}/status'
        if topic not in self.received:
            self.listen(String, topic, qos.LATCHED)
        found: list[dict[str, Any]] = []

        def fulfilled() -> bool:
            for message in self.received[topic][-1:]:
                found[:] = [json.loads(message.data)]
            return bool(found and condition(found[0]))

        self.wait_until(fulfilled, f'status of {node}')
        return found[0]


class Graph:
    """Nodes and client of one test."""

    def __init__(self, folder: Path) -> None:
        self.domain = free_domain()
        self.folder = folder
        self.environment = {
            **os.environ,
            'ROS_DOMAIN_ID': str(self.domain),
            'ROS_LOG_DIR': str(folder / 'ros_log'),
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
            'PYTHONPATH': os.pathsep.join([str(ROOT), os.environ.get('PYTHONPATH', '')]),
        }
        self.processes: list[Process] = []
        self.context = Context()

    def start(self, module: str, **parameters: Any) -> Process:
        """Start a node with parameters; `__` in a name stands for a dot."""
        arguments = []
        for name, value in parameters.items():
            arguments += ['-p', f'{name.replace("__", ".")}:={json.dumps(value)}']
        return self.start_with(module, arguments)

    def start_with(self, module: str, arguments: list[str]) -> Process:
        """Start a node with ROS arguments."""
        process = Process(module, self.folder, self.environment, arguments)
        self.processes.append(process)
        return process


@contextmanager
def graph(folder: Path) -> Iterator[tuple[Graph, Client]]:
    """Give a graph and a client that is spun in a thread; end all processes afterwards."""
    made = Graph(folder)
    rclpy.init(context=made.context, domain_id=made.domain)
    client = Client(made.context)
    executor = SingleThreadedExecutor(context=made.context)
    executor.add_node(client.node)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    try:
        yield made, client
    finally:
        for process in made.processes:
            process.end()
        executor.shutdown()
        thread.join()
        rclpy.shutdown(context=made.context)

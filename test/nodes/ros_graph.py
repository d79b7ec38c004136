"""Real nodes in real processes, and a client of theirs, in a ROS domain of their own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, ExitStack
import json
import os
from pathlib import Path
import signal
import subprocess
import sys
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from lifecycle_msgs.srv import ChangeState, GetState
from nodes.forked import Fork, ForkServer
from programs import installed
import psutil
import pytest
from rcl_interfaces.srv import SetParameters
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from ros_domain import free_domain
from std_srvs.srv import SetBool, Trigger
from waiting import LIMIT_S, suspend, wait_until

from examples.demo.graph import await_discovery
from lip_id_ros.nodes import messages, qos, running

ROOT = Path(__file__).resolve().parents[2]
UNKNOWN = '_NODE_NAME_UNKNOWN_'
BECOME = 'import os, sys; os.execv(sys.argv[1], sys.argv[1:])'

FORK_SERVER = ForkServer()
STARTED: set[str] = set()
"""Nodes that a process of their own has run already: all that follow are forks."""


def heed_signals() -> None:
    """Under nohup or in the background the tests ignore these, and what they start would too."""
    for number in (signal.SIGHUP, signal.SIGINT):
        signal.signal(number, signal.SIG_DFL)


class Process:
    def __init__(self, log_path: Path, popen: subprocess.Popen[bytes] | Fork) -> None:
        self.log_path, self._popen = log_path, popen

    @classmethod
    def started(cls, log_path: Path, environment: dict[str, str], arguments: list[str]) -> Process:
        with open(log_path, 'wb') as log:
            popen = subprocess.Popen(
                [sys.executable, *arguments],
                cwd=log_path.parent,
                env=environment,
                stdout=log,
                stderr=subprocess.STDOUT,
                preexec_fn=heed_signals,
            )
        return cls(log_path, popen)

    @property
    def log(self) -> str:
        return self.log_path.read_text()

    @property
    def pid(self) -> int:
        return self._popen.pid

    @property
    def alive(self) -> bool:
        return self._popen.poll() is None

    def send(self, number: int) -> None:
        if self.alive:
            self._popen.send_signal(number)

    def children(self, module: str) -> list[psutil.Process]:
        """Return the processes beside it that run a module."""
        found = psutil.Process(self._popen.pid).children()
        return [each for each in found if module in str(each.cmdline())]

    def hold(self, module: str = '') -> None:
        """Have the process, or that of a module beside it, stand still until it gets SIGCONT."""
        process = psutil.Process(self._popen.pid)
        if module:
            (process,) = self.children(module)
        suspend(process)

    def end(self, number: int = signal.SIGINT) -> int:
        """Ask the process to end, also one that is held, and return its exit status."""
        self.send(number)
        self.send(signal.SIGCONT)
        return self.wait()

    def wait(self) -> int:
        try:
            wait_until(lambda: not self.alive, f'the end of {self.log_path.stem}')
        except AssertionError:
            self._popen.kill()
            raise
        status = self._popen.poll()
        assert status is not None
        return status


GOODBYE_S = 3.0
"""A process that was killed says none."""


class Client:
    """A node that talks with the others; waiting fails loudly."""

    def __init__(self, context: Context) -> None:
        self.node = rclpy.create_node('client', context=context)
        self.received: dict[str, list[Any]] = {}
        self.limit_s = LIMIT_S  # of one wait
        self.order: list[str] = []  # the topics of all messages received
        self._clients: dict[str, Any] = {}
        self._subscriptions: dict[str, Any] = {}
        self._publishers: dict[str, Any] = {}
        self._marks: dict[str, dict[str, Any]] = {}

    def wait_until(self, condition: Callable[[], Any], what: str) -> None:
        wait_until(condition, what, self.limit_s)

    def await_goodbyes(self) -> None:
        """Wait until others are gone: Fast DDS crashed where this node ended among many."""
        end = time.monotonic() + GOODBYE_S
        while len(self.node.get_node_names()) > 1 and time.monotonic() < end:
            time.sleep(0.02)

    def call(self, kind: Any, name: str, request: Any) -> Any:
        if name not in self._clients:
            self._clients[name] = self.node.create_client(kind, name)
            self.wait_until(self._clients[name].service_is_ready, f'service {name}')
            await_discovery(self.node, name.rpartition('/')[0], self.wait_until)
        answer = self._clients[name].call_async(request)
        self.wait_until(answer.done, f'answer of {name}')
        return answer.result()

    def trigger(self, name: str) -> Any:
        return self.call(Trigger, name, Trigger.Request())

    def switch(self, name: str, on: bool) -> Any:
        return self.call(SetBool, name, SetBool.Request(data=on))

    def set_parameter(self, node: str, name: str, value: Any) -> Any:
        return self.set_parameters(node, **{name: value})[0]

    def set_parameters(self, node: str, **values: Any) -> Any:
        parameters = [
            Parameter(name, value=value).to_parameter_msg() for name, value in values.items()
        ]
        request = SetParameters.Request(parameters=parameters)
        return self.call(SetParameters, f'/{node}/set_parameters', request).results

    def transition(self, number: int, node: str = '/serve') -> bool:
        request = ChangeState.Request()
        request.transition.id = number
        return bool(self.call(ChangeState, f'{node}/change_state', request).success)

    def state(self) -> str:
        return str(self.call(GetState, '/serve/get_state', GetState.Request()).current_state.label)

    def listen(self, kind: Any, topic: str, profile: QoSProfile = qos.OUTPUT) -> list[Any]:
        """Collect the messages of a topic from now on; its publishers know this subscription."""
        if topic in self._subscriptions:
            self.received[topic].clear()
            return self.received[topic]
        messages = self.await_topic(kind, topic, profile)
        subscription = self._subscriptions[topic]
        self.wait_until(lambda: subscription.get_publisher_count() > 0, f'publisher of {topic}')
        self._await_discovery(lambda: self.node.get_publishers_info_by_topic(topic))
        return messages

    def forget(self, topic: str) -> None:
        """Have the next `listen` wait for another publisher."""
        if topic not in self._subscriptions:
            return
        subscription = self._subscriptions.pop(topic)
        del self.received[topic]
        task = self.node.executor.create_task(self.node.destroy_subscription, subscription)
        self.wait_until(task.done, 'the end of a subscription')

    def await_topic(self, kind: Any, topic: str, profile: QoSProfile = qos.OUTPUT) -> list[Any]:
        """Collect the messages of a topic whose publisher may come later."""
        messages = self.received.setdefault(topic, [])

        def receive(message: Any) -> None:
            messages.append(message)
            self.order.append(topic)

        self._subscriptions[topic] = self.node.create_subscription(kind, topic, receive, profile)
        return messages

    def speak(
        self, kind: Any, topic: str, profile: QoSProfile = qos.REFERENCE, listeners: int = 1
    ) -> Any:
        """Return a publisher that so many subscribers know."""
        if topic in self._publishers:
            return self._publishers[topic]
        publisher = self.node.create_publisher(kind, topic, profile)
        self.wait_until(
            lambda: publisher.get_subscription_count() >= listeners, f'subscriber of {topic}'
        )
        self._await_discovery(lambda: self.node.get_subscriptions_info_by_topic(topic))
        self._publishers[topic] = publisher
        return publisher

    def withdraw(self, publisher: Any) -> None:
        """Destroy a publisher in the thread that spins: another may hold it while it waits."""
        task = self.node.executor.create_task(self.node.destroy_publisher, publisher)
        self.wait_until(task.done, 'the end of a publisher')

    def mark(self, node: str) -> None:
        """Count from now on: `status` subtracts what the node has counted so far."""
        diagnostics = self.listen(DiagnosticArray, '/diagnostics', qos.DIAGNOSTICS)

        def of_node() -> list[DiagnosticStatus]:
            return [
                each.status[0]
                for each in list(diagnostics)
                if each.status[0].name == f'{node}: status'
            ]

        self.wait_until(lambda: len(of_node()) > 1, f'diagnostics of {node}')
        self._marks[node] = messages.status_values(of_node()[-1])

    def _await_discovery(self, endpoints: Callable[[], list[Any]]) -> None:
        """Wait until the nodes of endpoints, others than this one, know what this one has."""
        self.wait_until(
            lambda: endpoints() and all(each.node_name != UNKNOWN for each in endpoints()),
            'the names of nodes',
        )
        for each in endpoints():
            if each.node_name != self.node.get_name():
                name = f'{each.node_namespace.rstrip("/")}/{each.node_name}'
                await_discovery(self.node, name, self.wait_until)

    def status(self, node: str, condition: Callable[[dict[str, Any]], Any]) -> dict[str, Any]:
        topic = f'/{node}/status'
        if topic not in self.received:
            self.listen(DiagnosticStatus, topic, qos.LATCHED)
        found: list[dict[str, Any]] = []

        def fulfilled() -> bool:
            for message in self.received[topic][-1:]:
                found[:] = [since(messages.status_values(message), self._marks.get(node, {}))]
            return bool(found and condition(found[0]))

        self.wait_until(fulfilled, f'status of {node}')
        return found[0]


def since(values: dict[str, Any], mark: dict[str, Any]) -> dict[str, Any]:
    """Return a status whose counts begin at an earlier one; reasons not met since are left out."""
    counted: dict[str, Any] = {}
    for key, value in values.items():
        before = mark.get(key)
        if isinstance(value, dict):
            counted[key] = since(value, before if isinstance(before, dict) else {})
            if key in ('refused', 'unmeasured'):
                counted[key] = {reason: n for reason, n in counted[key].items() if n}
        elif type(value) is int and type(before) is int:
            counted[key] = value - before
        else:
            counted[key] = value
    return counted


class Graph:
    def __init__(self, folder: Path, domain: int) -> None:
        self.domain = domain
        self.folder = folder
        self.environment = {
            **os.environ,
            'ROS_DOMAIN_ID': str(self.domain),
            'ROS_LOG_DIR': str(folder / 'ros_log'),
            'XDG_STATE_HOME': str(folder / 'state'),
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
            'PYTHONPATH': os.pathsep.join([str(ROOT), os.environ.get('PYTHONPATH', '')]),
        }
        self.processes: list[Process] = []
        self.ends = ExitStack()
        self.context = Context()

    def start(self, module: str, **parameters: Any) -> Process:
        """Start a node, `serve` active, with parameters; `__` in a name stands for a dot."""
        if module == 'serve':
            parameters = {'autostart': True, **parameters}
        arguments = []
        for name, value in parameters.items():
            arguments += ['-p', f'{name.replace("__", ".")}:={json.dumps(value)}']
        return self.start_with(module, arguments)

    def start_with(self, module: str, arguments: list[str]) -> Process:
        arguments = ['--ros-args', *arguments]
        if module == 'simulated_panda':
            code = 'from lip_id_ros.demo.nodes import simulated_panda; exit(simulated_panda())'
            return self.start_program(module, ['-c', code, *arguments])
        name = f'lip_id_ros.nodes.{module}'
        if module not in STARTED:
            STARTED.add(module)
            return self.start_program(module, ['-m', name, *arguments])
        return self.start_fork(module, name, arguments)

    def start_fork(self, name: str, module: str, arguments: list[str]) -> Process:
        path = self.folder / f'{name}.log'
        forked = FORK_SERVER.fork(module, arguments, path, self.environment)
        return self._keep(Process(path, forked))

    def start_program(self, name: str, arguments: list[str]) -> Process:
        path = self.folder / f'{name}.log'
        return self._keep(Process.started(path, self.environment, arguments))

    def _keep(self, process: Process) -> Process:
        self.processes.append(process)
        self.ends.callback(process.end)  # each ends, even where another does not
        return process

    def start_installed(self, package: str, name: str, arguments: list[str]) -> Process:
        """Start a program of a ROS package; the test is skipped where it is absent."""
        program = installed(package, name)
        if program is None:
            pytest.skip(f'needs the program {name} of {package}; with g++ make setup compiles it')
        return self.start_program(name, ['-c', BECOME, str(program), *arguments])


Ros = tuple[Graph, Client]
"""Where the nodes of a test live, and their client."""


@contextmanager
def graph(folder: Path) -> Iterator[Ros]:
    """Give a graph and a client that is spun in a thread; end all processes afterwards."""
    with free_domain() as domain:
        made = Graph(folder, domain)
        with spinning(made) as client:
            with made.ends:
                yield made, client
            client.await_goodbyes()


@contextmanager
def spinning(made: Graph) -> Iterator[Client]:
    """Give a client that is spun in a thread while the block runs."""
    rclpy.init(context=made.context, domain_id=made.domain)
    client = Client(made.context)
    executor = SingleThreadedExecutor(context=made.context)
    try:
        with running.spinning(client.node, executor=executor):
            yield client
    finally:
        # what it latched must not reach the next test in this domain
        client.node.destroy_node()
        rclpy.shutdown(context=made.context)

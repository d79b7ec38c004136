"""A node goes on after errors past its guard, and ends in good order when its executor breaks."""

from __future__ import annotations

import os
from pathlib import Path
import sys
import threading
import time
from typing import Any

import pytest
from waiting import run_to_end

pytest.importorskip('rclpy', reason='needs ROS 2')

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from ros_domain import free_domain

from lip_id_ros.feedforward.settings import ServeSettings
from lip_id_ros.nodes.node import NodeBase
from lip_id_ros.nodes.running import spinning
from lip_id_ros.settings import parameters_of
from lip_id_ros.signals.joints import Refusal, RefusedError

pytestmark = pytest.mark.ros

PROGRAM = """
import gc
import os
import signal
from rclpy.node import Node
from lip_id_ros.feedforward.settings import ServeSettings
from lip_id_ros.nodes import running
from lip_id_ros.nodes.node import NodeBase
from lip_id_ros.settings import parameters_of

BROKEN = {broken}
running.BROKEN_SECONDS = 0.2 if BROKEN else 60.0

class Faulty(NodeBase):
    n_failed = 0

    def __init__(self):
        super().__init__('faulty', parameters_of(ServeSettings))
        Node.create_timer(self, 0.001, self.fail)  # without the guard

    def fail(self):
        self.n_failed += 1
        if BROKEN:
            self.n_callbacks = 0  # as if no other callback had its turn
        elif self.n_failed == 150:
            os.kill(os.getpid(), signal.SIGINT)
        raise RuntimeError('a programming error')

    def stop(self):
        print('frozen', gc.get_freeze_count())
        print('kept the data after', self.faults)

raise SystemExit(running.run(Faulty))
"""


@pytest.mark.parametrize('executor', ['events', 'single_threaded'])
@pytest.mark.parametrize('broken', [False, True])
def test_errors_past_the_guard(executor: str, broken: bool, tmp_path: Path) -> None:
    program = PROGRAM.format(broken=broken)
    ended = run_to_end(
        [sys.executable, '-c', program, '--ros-args', '-p', f'executor:={executor}'],
        tmp_path,
        env={**os.environ, 'ROS_LOG_DIR': str(tmp_path)},
    )
    words = ended.stdout.split()
    assert words[2:5] == ['kept', 'the', 'data']
    assert int(words[1]) > 10_000  # what was imported costs no collection any more
    assert 'a callback failed, the node goes on: RuntimeError' in ended.stderr
    if broken:
        assert ended.returncode == 1
        assert ended.stderr.rstrip().endswith('RuntimeError: a programming error')
    else:
        assert ended.returncode == 0, ended.stderr
        assert int(words[-1]) >= 149


WRONG = """
from lip_id_ros.nodes import running
from lip_id_ros.nodes.serve import ServeNode

for given in (
    ['--frobnicate'],
    ['-p', 'use_sim_time:=5'],
    ['-p', 'torque_limits:=none'],
    ['-p', 'ramp_s:=-1.0'],
    ['-p', 'torque_limit:=[1.0]'],
    ['--params-file', 'none.yaml'],
):
    print(running.run(ServeNode, ['--ros-args', *given]))
"""


def test_wrong_arguments_end_a_node_with_a_sentence_each(tmp_path: Path) -> None:
    ended = run_to_end(
        [sys.executable, '-c', WRONG],
        tmp_path,
        env={**os.environ, 'ROS_LOG_DIR': str(tmp_path)},
    )
    assert ended.stdout.split() == ['1'] * 6, ended.stderr
    assert 'Traceback' not in ended.stderr
    logged = [line.partition('[lip_id_ros]: ')[2] for line in ended.stderr.splitlines()]
    sentences = [text for text in logged if text]
    assert sentences[0] == ("there are no such ROS arguments: ['--frobnicate']; correct them.")
    assert "parameter 'use_sim_time' to '5' of type 'INTEGER'" in sentences[1]
    assert sentences[2] == (
        "torque_limits must be a list of numbers >= 0 N m or N, not 'none'; write "
        'torque_limits_from: none.'
    )
    assert sentences[3] == 'ramp_s must be a number >= 0 and <= 60 s, not -1.0.'
    assert "did you mean 'torque_limits'?" in sentences[4]
    assert "Couldn't parse params file" in sentences[5]


class Busy(SingleThreadedExecutor):
    """Looks for nodes until it is shut down, or for a moment."""

    def __init__(self, context: Context) -> None:
        super().__init__(context=context)
        self.looks, self.is_shut_down = threading.Event(), threading.Event()

    def get_nodes(self) -> Any:
        self.looks.set()
        self.is_shut_down.wait(0.3)
        return super().get_nodes()

    def shutdown(self, timeout_sec: float | None = None) -> Any:
        ended = super().shutdown(timeout_sec)
        self.is_shut_down.set()
        return ended


def test_an_executor_spins_no_more_when_it_is_shut_down(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rclpy took a guard condition from under the spin: AttributeError, now and then."""
    failed: list[Any] = []
    monkeypatch.setattr(threading, 'excepthook', failed.append)
    context = Context()
    rclpy.init(context=context)
    node = rclpy.create_node('spun', context=context)
    executor = Busy(context)
    with spinning(node, executor=executor):
        executor.looks.wait()
    node.destroy_node()
    rclpy.shutdown(context=context)
    assert not failed


def refuse(reason: Refusal) -> None:
    raise RefusedError(reason)


def test_each_reason_is_logged_by_a_clock_that_nobody_sets_back(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """One reason hid all others for five seconds; a clock set back by an hour hid an hour."""
    with free_domain() as domain:
        rclpy.init(domain_id=domain)
        node = NodeBase('throttled', {})
        try:
            for reason in (Refusal.MALFORMED, Refusal.MISSING_JOINT, Refusal.MALFORMED):
                node.unless_refused(refuse, reason)
            set_back, later = time.time() - 3600.0, time.monotonic() + 6.0
            monkeypatch.setattr(time, 'time', lambda: set_back)
            monkeypatch.setattr(time, 'monotonic', lambda: later)
            node.unless_refused(refuse, Refusal.MALFORMED)
        finally:
            monkeypatch.undo()
            node.destroy_node()
            rclpy.shutdown()
    logged = capfd.readouterr().err
    assert logged.count('(malformed)') == 2
    assert logged.count('(joint missing)') == 1


def test_a_parameter_that_there_is_not_is_refused_by_its_name() -> None:
    with free_domain() as domain:
        rclpy.init(domain_id=domain)
        node = NodeBase('set', parameters_of(ServeSettings))
        try:
            unknown = Parameter('torque_limit', value=[1.0])
            reason = node.set_parameters_atomically([unknown]).reason
        finally:
            node.destroy_node()
            rclpy.shutdown()
    assert reason == (
        "torque_limit in the parameters given is not a setting; did you mean 'torque_limits'?"
    )

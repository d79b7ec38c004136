"""Node `serve` in a process of its own: what keeps a bad torque from the robot."""

from __future__ import annotations

import math
from pathlib import Path
import shutil
import signal
import threading
import time
from typing import Any, TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from lifecycle_msgs.msg import Transition
from nodes import toy
from nodes.test_serve import (
    exchange,
    EXPECTED,
    GOOD,
    point,
    start_serve,
    trajectory,
)
import numpy as np
import rclpy
from rclpy.parameter import Parameter
from ros_domain import free_domain
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool, Trigger

from lip_id_ros.feedforward import loading
from lip_id_ros.nodes import qos, serve

if TYPE_CHECKING:
    from nodes.ros_graph import Ros

pytestmark = pytest.mark.ros

FAR = trajectory(toy.JOINTS, point([0.3, -0.2], [90.0, 1.0], [1.0, -1.0]))


def efforts(messages: list[JointState]) -> list[list[float]]:
    return [list(message.effort) for message in messages]


def test_a_silent_stream_gets_zeros_until_it_comes_back_by_a_ramp(
    ros: Ros, model_path: str
) -> None:
    graph, client = ros
    # a clock of simulation that stands still must not keep the safe torque back
    graph.start(
        'serve',
        model_path=model_path,
        stale_timeout_s=1.0,
        torque_limits=[toy.LIMIT],
        ramp_s=0.5,
        safe_ramp_s=0.0,
        use_sim_time=True,
    )
    _, torques, publisher = exchange(ros)
    time.sleep(1.2)
    assert not torques  # nobody holds a torque yet
    publisher.publish(GOOD)
    client.wait_until(lambda: len(torques) > 5, 'safe torque, again and again')
    assert torques[0].header.stamp == GOOD.header.stamp
    assert all(effort == [0.0, 0.0] for effort in efforts(torques[1:]))
    status = client.status('serve', lambda status: status['stale'] == 1)
    assert status['summary'].startswith('no reference for ')
    # from here on a machine that stands still for a second must not begin a ramp anew
    assert client.set_parameter('serve', 'stale_timeout_s', 100.0).successful

    seen: list[float] = []

    def risen() -> bool:
        publisher.publish(GOOD)
        seen[:] = [each.effort[0] for each in torques if each.header.stamp == GOOD.header.stamp]
        return bool(seen[-1] > 0.99 * EXPECTED[0])

    torques.clear()
    publisher.publish(GOOD)
    client.wait_until(
        lambda: torques[-1:] and torques[-1].header.stamp == GOOD.header.stamp, 'an answer'
    )
    client.wait_until(risen, 'the end of the ramp')
    assert seen[0] < 0.5 * EXPECTED[0]
    assert seen == sorted(seen)


def test_limits_of_rate_and_range_hold_and_are_counted(ros: Ros, model_path: str) -> None:
    graph, client = ros
    start_serve(
        graph,
        model_path=model_path,
        rate_limits=[10.0],
        range_policy='zero',
        publish_commands=True,
    )
    _, torques, publisher = exchange(ros)
    commands = client.listen(Float64MultiArray, '/serve/commands')
    diagnostics = client.listen(DiagnosticArray, '/diagnostics')
    # an answer may rise by 0.5 N m, the rate limit times the longest step: seven at least
    while not torques or torques[-1].effort[0] < 0.8 * EXPECTED[0]:
        count = len(torques) + 1
        publisher.publish(GOOD)
        client.wait_until(lambda: len(torques) == len(commands) == count, 'answer')  # noqa: B023
    sent = np.array(efforts(torques))
    assert len(sent) >= 7
    assert np.abs(np.diff(sent, axis=0)).max() <= 10.0 * 0.05 + 1e-9
    np.testing.assert_array_equal(sent, [list(command.data) for command in commands])
    assert (np.diff(sent[:, 0]) > 0.0).all()

    before = len(torques)
    publisher.publish(FAR)
    status = client.status('serve', lambda status: status['out_of_range'] == 1)
    assert status['rate_limited'] >= len(sent)
    client.wait_until(lambda: len(torques) > before, 'answer')
    assert torques[-1].effort[0] < torques[before - 1].effort[0]

    def warned() -> bool:
        found = [each.status[0] for each in diagnostics if each.status[0].name == 'serve: status']
        return any(
            each.level == DiagnosticStatus.WARN
            and each.message == 'messages with trouble: out_of_range 1'
            for each in found
        )

    client.wait_until(warned, 'warning')


def test_parameters_are_refused_when_they_are_set(ros: Ros, model_path: str) -> None:
    graph, client = ros
    start_serve(graph, model_path=model_path, autostart=False)

    def reason(name: str, value: Any) -> str:
        result = client.set_parameter('serve', name, value)
        assert not result.successful, name
        return str(result.reason)

    assert reason('ramp_s', -1.0) == 'ramp_s must be a number >= 0 and <= 60 s, not -1.0.'
    assert reason('ramp_s', 'long') == "ramp_s must be a number >= 0 and <= 60 s, not 'long'."
    assert 'range_policy must be a text ignore or warn or scale or zero' in reason(
        'range_policy', 'panic'
    )
    assert reason('rate_limits', [1.0, math.nan]).startswith('rate_limits must be a list of')
    assert 'read-only' in reason('executor', 'single_threaded')
    assert client.set_parameter('serve', 'publish_commands', True).successful
    assert client.transition(Transition.TRANSITION_CONFIGURE)
    assert reason('publish_commands', False) == (
        'publish_commands is read when the node is configured, which it is; clean it up first.'
    )
    assert reason('torque_limits', [1.0] * 3).startswith('torque_limits must hold one value per')
    client.listen(Float64MultiArray, '/serve/commands')
    assert client.transition(Transition.TRANSITION_CLEANUP)
    assert client.set_parameter('serve', 'publish_commands', False).successful
    client.wait_until(
        lambda: not client.node.count_publishers('/serve/commands'), 'end of the publisher'
    )
    # the service and the parameter are one
    assert client.switch('/serve/enable', False).success
    assert client.transition(Transition.TRANSITION_CONFIGURE)
    assert client.transition(Transition.TRANSITION_ACTIVATE)
    assert client.status('serve', lambda status: status['state'] == 'active')['enabled'] is False
    assert client.set_parameter('serve', 'enabled', True).successful
    client.status('serve', lambda status: status['enabled'])


def test_enable_answers_by_its_effect(ros: Ros, model_path: str) -> None:
    """Settings that contradict each other refuse every change, that of the service too."""
    graph, client = ros
    start_serve(graph, model_path=model_path, joints=['shoulder', 'shoulder'])
    client.status('serve', lambda status: status['state'] == 'unconfigured')
    answer = client.switch('/serve/enable', False)
    assert not answer.success
    assert answer.message.startswith("joints must name each joint once, but 'shoulder' comes tw")
    assert client.set_parameter('serve', 'joints', []).successful
    assert client.switch('/serve/enable', False).message == 'disabled'
    enabled = client.switch('/serve/enable', True).message
    assert enabled == 'enabled; the node is unconfigured and answers nothing until it is active'


def test_a_stop_among_sixty_calls_is_heeded(serving: Ros) -> None:
    """A queue of 10 keeps the newest ten calls of sixty that come while the node is busy."""
    graph, client = serving
    stop = SetBool.Request(data=False)
    assert client.switch('/serve/enable', True).message == 'enabled'
    caller = client.node.create_client(SetBool, '/serve/enable', qos_profile=qos.CALLS)
    client.wait_until(caller.service_is_ready, 'the service enable')
    assert caller.call(stop).message == 'disabled'  # so both know each other
    graph.processes[0].hold()
    calls = [caller.call_async(stop if n == 5 else SetBool.Request(data=True)) for n in range(60)]
    graph.processes[0].send(signal.SIGCONT)
    client.wait_until(lambda: all(each.done() for each in calls), 'sixty answers')
    said = [each.result().message for each in calls]
    assert [n for n, each in enumerate(said) if each == 'disabled'] == [5]


def test_a_configuration_that_fails_is_diagnosed(ros: Ros, foreign_model_path: str) -> None:
    graph, client = ros
    start_serve(graph, model_path=foreign_model_path, joints=list(toy.JOINTS))
    diagnostics = client.listen(DiagnosticArray, '/diagnostics')
    client.wait_until(lambda: diagnostics, 'diagnostics')
    status = diagnostics[0].status[0]
    assert status.level == DiagnosticStatus.ERROR
    assert status.message.startswith(f'not configured: {foreign_model_path} must be a model of')


def test_a_reload_leaves_no_reference_unanswered(serving: Ros) -> None:
    client, torques, publisher = exchange(serving)
    publisher.publish(GOOD)
    client.wait_until(lambda: torques, 'answer')
    stop, sent = threading.Event(), [1]

    def stream() -> None:
        while not stop.is_set():
            publisher.publish(GOOD)
            sent[0] += 1
            time.sleep(0.005)

    thread = threading.Thread(target=stream)
    thread.start()
    try:
        assert all(client.trigger('/serve/reload_model').success for _ in range(3))
    finally:
        stop.set()
        thread.join()
    status = client.status('serve', lambda status: status['received']['references'] == sent[0])
    # a machine so loaded that references wait: the newest is answered in their place
    answered = sent[0] - status['refused'].get('overtaken by a newer one', 0)
    client.wait_until(lambda: len(torques) == answered, 'an answer to each reference')
    np.testing.assert_allclose(efforts(torques), np.tile(EXPECTED, (answered, 1)), atol=0.1)


def test_a_reload_does_not_outlive_its_configuration(
    model_path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else the model of an earlier path took the place of the one configured since."""
    other = shutil.copy(model_path, tmp_path / 'other.npz')
    slow, load = threading.Event(), loading.load_models

    def load_models(settings: Any, before: Any) -> Any:
        if before is not None:
            slow.wait()
        return load(settings, before)

    monkeypatch.setattr(serve, 'load_models', load_models)
    with free_domain() as domain:
        given = (f'model_path:={model_path}', 'torque_limits:=[50.0]', 'autostart:=true')
        parameters = [word for each in given for word in ('-p', each)]
        rclpy.init(args=['--ros-args', *parameters], domain_id=domain)
        node = serve.ServeNode()
        try:
            reload = node._on_reload(Trigger.Request(), Trigger.Response())
            reload.send(None)  # up to where it waits
            node.trigger_deactivate()
            node.trigger_cleanup()
            node.set_parameters([Parameter('model_path', value=str(other))])
            node.trigger_configure()
            configured = node._loaded
            slow.set()
            node._pool.submit(int).result()
            with pytest.raises(StopIteration) as ended:
                reload.send(None)
            assert not ended.value.value.success
            assert 'cleaned up while the model was loaded' in ended.value.value.message
            assert node._loaded is configured
            assert node.status().summary == 'inactive'
        finally:
            slow.set()
            node.stop()
            node.destroy_node()
            rclpy.shutdown()

"""Nodes `adapt` and `serve` in processes of their own: an arm that changes is followed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import itertools
from pathlib import Path
import signal
import time
from typing import Any, TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from adaptation import arms
from control_msgs.msg import DynamicInterfaceGroupValues
from geometry_msgs.msg import Inertia, InertiaStamped, Vector3
import numpy as np
from rclpy.duration import Duration
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from lip_id_ros.adaptation.updates import Update
from lip_id_ros.model import EffortCalibration, InverseDynamicsModel
from lip_id_ros.nodes import messages, qos

if TYPE_CHECKING:
    from nodes.ros_graph import Client, Ros

pytestmark = pytest.mark.ros

START_NS, RATE_HZ = 1_800_000_000_000_000_000, 100.0
UPDATE = '/adapt/update'
LIMITS = [1e4]


def known_model() -> InverseDynamicsModel:
    """Return a model of efforts that are torques."""
    model = arms.known_model()
    return replace(model, effort_calibrations=(EffortCalibration.identity(model.n_joints),))


@pytest.fixture
def path(tmp_path: Path) -> str:
    known_model().save(tmp_path / 'arm.npz')
    return str(tmp_path / 'arm.npz')


class Arm:
    """An arm that moves on, as far as it is asked to, with the torques of a model."""

    def __init__(self, client: Client, listeners: int = 1) -> None:
        self._publisher = client.speak(JointState, '/joint_states', listeners=listeners)
        self._rows = itertools.count()
        self.model = arms.with_friction(known_model(), 2.0)

    def move(self, count: int = 10) -> None:
        """Publish so many joint states, ten milliseconds apart by their stamps."""
        t = np.array(list(itertools.islice(self._rows, count))) / RATE_HZ
        w = 2.0 * np.pi * np.array([0.11, 0.17, 0.23])
        phase = np.outer(t, w) + np.array([0.0, 1.0, 2.0])
        q, dq, ddq = np.sin(phase), w * np.cos(phase), -(w**2) * np.sin(phase)
        tau = self.model.predict(q, dq, ddq).tau
        for at, *state in zip(t, q, dq, tau, strict=True):
            stamp = messages.stamp_at(START_NS + round(1e9 * at))
            message = messages.torque_message(stamp, self.model.joint_names, state[2])
            message.position, message.velocity = map(messages.doubles, state[:2])
            self._publisher.publish(message)
            time.sleep(0.001)  # best effort

    def until(self, condition: Callable[[], Any]) -> Callable[[], Any]:
        """Return a condition that has the arm move while it does not hold."""

        def held() -> Any:
            self.move()
            return condition()

        return held


def last(received: list[Any]) -> Update | None:
    return Update.from_message(received[-1]) if received else None


def trusted(received: list[Any]) -> bool:
    update = last(received)
    return update is not None and update.trusted


def test_friction_that_doubled_is_published_kept_and_forgotten(ros: Ros, path: str) -> None:
    graph, client = ros
    node = graph.start('adapt', model_path=path, publish_rate_hz=10.0)
    updates = client.listen(DynamicInterfaceGroupValues, UPDATE, qos.LATCHED)
    arm = Arm(client)
    client.wait_until(arm.until(lambda: trusted(updates)), 'a trusted update')
    update = last(updates)
    assert update is not None
    fitted = known_model()
    assert update.model == InverseDynamicsModel.load(path).fingerprint
    assert fitted.arm is not None
    coefficients = fitted.arm.friction.coefficients
    learned = update.numbers[-coefficients.size :]
    np.testing.assert_allclose(learned[::3], 2.0 * coefficients[::3], rtol=0.3)  # viscous
    status = client.status('adapt', lambda status: status['changes'])
    assert status['learned'] > 100
    assert status['summary'].startswith('joint_1: friction at')
    assert node.end(signal.SIGINT) == 0

    client.forget(UPDATE)
    graph.start('adapt', model_path=path, publish_rate_hz=10.0)
    again = client.listen(DynamicInterfaceGroupValues, UPDATE, qos.LATCHED)
    client.wait_until(arm.until(lambda: trusted(again)), 'what was kept')
    found = last(again)
    assert found is not None
    assert found.source == update.source == '/adapt'
    assert found.stamp_ns > update.stamp_ns
    np.testing.assert_allclose(found.numbers, update.numbers, atol=0.2)
    assert client.trigger('/adapt/reset').success

    def is_fitted() -> bool:
        update = last(again)
        return update is not None and not update.trusted

    client.wait_until(arm.until(is_fitted), 'the commissioned model')


def announce(client: Client, mass: float, node: str = '/adapt', **changes: float) -> None:
    """Announce a payload 0.1 m from the last link, or put it down."""
    inertia = Inertia(m=mass, com=Vector3(**{'z': 0.1, **changes}))
    topic = f'{node}/announced_payload'
    client.speak(InertiaStamped, topic, qos.DIAGNOSTICS).publish(InertiaStamped(inertia=inertia))


def test_a_payload_is_announced_and_put_down_while_the_arm_is_silent(ros: Ros, path: str) -> None:
    graph, client = ros
    adapt = graph.start('adapt', model_path=path)
    payloads = client.listen(InertiaStamped, '/adapt/payload', qos.LATCHED)
    updates = client.listen(DynamicInterfaceGroupValues, UPDATE, qos.LATCHED)
    announce(client, 1.5)
    client.wait_until(lambda: payloads, 'the payload')
    told = payloads[-1]
    assert (told.header.frame_id, round(told.inertia.m, 9)) == ('joint_3_link', 1.5)
    assert round(told.inertia.com.z, 9) == 0.1
    arm = known_model().arm
    assert arm is not None
    carried = arm.links[-1, 0] + 1.5
    mass = (len(arm.links) - 1) * arm.links.shape[1]
    client.wait_until(lambda: updates, 'an update though no joint state has come')
    assert Update.from_message(updates[-1]).numbers[mass] == pytest.approx(carried)

    announce(client, 400.0, z=120.0)  # grams and millimetres
    status = client.status('adapt', lambda status: 'a payload must have' in status['summary'])
    assert status['announced_kg'] == pytest.approx(1.5)
    client.wait_until(
        lambda: 'refused a payload: a payload must have a mass' in adapt.log, 'a log'
    )

    announce(client, 0.0)
    client.wait_until(lambda: payloads[-1].inertia.m == 0.0, 'the end of the payload')
    client.wait_until(
        lambda: Update.from_message(updates[-1]).numbers[mass] == arm.links[-1, 0], 'an update'
    )


def test_a_payload_of_one_arm_is_not_carried_by_another(ros: Ros, path: str) -> None:
    graph, client = ros

    def started() -> list[Any]:
        return [
            graph.start_fork(
                side,
                'lip_id_ros.nodes.adapt',
                ['--ros-args', '-r', f'__ns:=/{side}', '-p', f'model_path:={path}'],
            )
            for side in ('left', 'right')
        ]

    def announced(side: str) -> float:
        name = f'{side}/adapt'
        client.forget(f'/{name}/status')
        return float(client.status(name, lambda status: 'announced_kg' in status)['announced_kg'])

    nodes = started()
    announce(client, 1.5, '/left/adapt')
    client.status('left/adapt', lambda status: status['announced_kg'] > 0.0)
    for node in nodes:
        assert node.end() == 0
    nodes = started()
    assert announced('right') == 0.0
    assert announced('left') == pytest.approx(1.5)
    folder = graph.folder / 'state/ros/lip_id_ros'
    for node in nodes:
        assert node.end() == 0
    assert (folder / 'left/adapt/adaptation.npz').exists()
    assert (folder / 'right/adapt/adaptation.npz').exists()

    shared = str(folder / 'left/adapt/adaptation.npz')
    right = graph.start_fork(
        'right',
        'lip_id_ros.nodes.adapt',
        [
            *('--ros-args', '-r', '__ns:=/right', '-p', f'model_path:={path}'),
            *('-p', f'state_path:={shared}'),
        ],
    )
    assert announced('right') == 0.0
    sentence = f'state_path must be a file of /right/adapt alone, but {shared} is of /left/adapt'
    client.status('right/adapt', lambda status: status['note'].startswith(sentence))
    client.wait_until(lambda: sentence in right.log, 'a line of the log')


def test_a_model_that_is_not_there_is_one_line(ros: Ros) -> None:
    graph, _ = ros
    node = graph.start('adapt', model_path='none.npz')
    assert node.wait() == 1
    assert 'none.npz: No such file or directory; correct the path.' in node.log
    assert 'Traceback' not in node.log


REFERENCE, TORQUE = '/serve/desired_trajectory', '/serve/feedforward_torque'
STATE = np.array([[0.3, -0.4, 0.5], [1.0, -0.8, 0.6], [0.0, 0.0, 0.0]])


class Stream:
    """A reference that stands for a motion, sent again and again, and the torques for it."""

    def __init__(self, client: Client) -> None:
        self.torques = client.listen(JointState, TORQUE)
        self._publisher = client.speak(JointTrajectory, REFERENCE)
        q, dq, ddq = STATE.tolist()
        point = JointTrajectoryPoint(positions=q, velocities=dq, accelerations=ddq)
        names = list(known_model().joint_names)
        self._reference = JointTrajectory(joint_names=names, points=[point])

    def is_at(self, expected: np.ndarray, tolerance: float) -> bool:
        """Send a reference; return whether the last torque is the expected one."""
        self._publisher.publish(self._reference)
        time.sleep(0.002)  # not faster than it is answered
        if not self.torques:
            return False
        return bool((np.abs(np.array(self.torques[-1].effort) - expected) < tolerance).all())

    @property
    def largest_step(self) -> float:
        """Return the largest change between two torques."""
        sent = np.array([each.effort for each in self.torques])
        return float(np.abs(np.diff(sent, axis=0)).max())


def torque_of(model: InverseDynamicsModel) -> np.ndarray:
    return model.query(*STATE).tau


def following(path: str) -> dict[str, Any]:
    return {
        'model_path': path,
        'accept_unproven': True,
        'torque_limits': LIMITS,
        'rate_limits': LIMITS,
        'ramp_s': 0.0,
        'stale_timeout_s': 0.0,
        'follow_adaptation': True,
        'adaptation_limit': [5.0],
        'adaptation_timeout_s': 2.0,
        'blend_s': 0.5,
    }


def test_serve_follows_friction_that_doubled_and_goes_back_when_adapt_is_killed(
    ros: Ros, path: str
) -> None:
    graph, client = ros
    graph.start('serve', **following(path))
    node = graph.start('adapt', model_path=path, publish_rate_hz=10.0)
    client.status('serve', lambda status: status['state'] == 'active')
    updates = client.listen(DynamicInterfaceGroupValues, UPDATE, qos.LATCHED)
    arm, stream = Arm(client, listeners=2), Stream(client)
    fitted, doubled = torque_of(known_model()), torque_of(arm.model)
    client.wait_until(lambda: stream.is_at(fitted, 1e-6), 'the torque of the fit')
    client.wait_until(arm.until(lambda: trusted(updates)), 'a trusted update')
    near = 0.2 * np.abs(doubled - fitted)
    client.wait_until(
        arm.until(lambda: stream.is_at(doubled, float(near.min()))), 'the torque of the arm'
    )
    client.status('serve', lambda status: status['adaptation']['model'] == 'adapted')
    stream.torques.clear()
    node.send(signal.SIGKILL)
    client.wait_until(lambda: stream.is_at(fitted, 1e-6), 'the torque of the fit again')
    whole = float(np.abs(doubled - fitted).max())
    assert stream.largest_step < 0.3 * whole  # 0.05 s of 0.5 s count at most, and no more
    sentence = 'follows the commissioned model: no update for 2 s'
    status = client.status('serve', lambda status: sentence in status['summary'])
    assert status['adaptation']['gone_back'] >= 1  # more on a busy machine


def test_serve_refuses_updates_that_are_foreign_or_not_finite_and_may_stop_to_follow(
    ros: Ros, path: str
) -> None:
    graph, client = ros
    graph.start('serve', **{**following(path), 'adaptation_timeout_s': 900.0})
    client.status('serve', lambda status: status['state'] == 'active')
    publisher = client.speak(DynamicInterfaceGroupValues, UPDATE, qos.LATCHED)
    stream = Stream(client)
    fitted, other = known_model(), arms.with_friction(known_model(), 1.5)
    good = update_to(path, other)
    broken = good.numbers.copy()
    broken[-1] = np.nan

    def send(update: Update, source: str = '/adapt') -> None:
        publisher.publish(messages.update_message(now(client), source, update))

    def refused(update: Update, reason: str, source: str = '/adapt') -> None:
        send(update, source)
        client.status('serve', lambda status: status['adaptation']['refused'].get(reason))

    refused(replace(good, model='f' * 64), 'update of another model')
    refused(replace(good, numbers=broken), 'update not finite')
    client.wait_until(lambda: stream.is_at(torque_of(fitted), 1e-6), 'the torque of the fit')
    send(good)
    client.wait_until(lambda: stream.is_at(torque_of(other), 1e-6), 'the torque of the update')
    refused(good, 'update of another node', '/left/adapt')
    assert client.set_parameter('serve', 'follow_adaptation', False).successful
    client.wait_until(lambda: stream.is_at(torque_of(fitted), 1e-6), 'the fit, on request')


def now(client: Client, earlier_s: float = 0.0) -> Any:
    """Return the time, or one so long ago."""
    return (client.node.get_clock().now() - Duration(seconds=earlier_s)).to_msg()


def update_to(path: str, model: InverseDynamicsModel) -> Update:
    """Return an update of the model of a file that makes another of it."""
    assert model.arm is not None
    numbers = np.concatenate([model.arm.links.ravel(), model.arm.friction.coefficients])
    return Update(InverseDynamicsModel.load(path).fingerprint, numbers, True)


def test_an_old_update_is_not_followed_by_who_comes_late(ros: Ros, path: str) -> None:
    """Its payload has been put down meanwhile, and nobody has said so."""
    graph, client = ros
    publisher = client.node.create_publisher(DynamicInterfaceGroupValues, UPDATE, qos.LATCHED)
    update = update_to(path, arms.with_friction(known_model(), 1.5))
    publisher.publish(messages.update_message(now(client, 47.0), '/adapt', update))
    graph.start('serve', **following(path))
    graph.start('monitor', model_path=path, follow_adaptation=True, adaptation_timeout_s=2.0)
    for node in ('serve', 'monitor'):
        status = client.status(
            node, lambda status: (status.get('adaptation') or {}).get('refused')
        )
        assert status['adaptation']['refused'] == {'update too old': 1}
        assert status['adaptation']['model'] == 'commissioned'


def test_updates_that_never_come_are_told(ros: Ros, path: str) -> None:
    graph, client = ros
    graph.start('serve', **following(path))
    graph.start('monitor', model_path=path, follow_adaptation=True, adaptation_timeout_s=2.0)
    arm, stream = Arm(client, listeners=2), Stream(client)
    client.status('serve', lambda status: status['state'] == 'active')
    client.status('monitor', lambda status: True)

    def told(node: str) -> bool:
        arm.move()
        stream.is_at(torque_of(known_model()), 1e-6)
        status = client.received[f'/{node}/status'][-1]
        sentence = 'follows the commissioned model: no update for 2 s; start adapt, or set '
        return sentence in status.message and status.level == b'\x01'

    client.wait_until(lambda: told('serve'), 'a warning of serve')
    client.wait_until(lambda: told('monitor'), 'a warning of monitor')


def test_a_model_that_was_loaded_to_be_served_as_it_is_follows_nothing(
    serving: Ros,
) -> None:
    _, client = serving
    answer = client.set_parameter('serve', 'follow_adaptation', True)
    assert not answer.successful
    assert 'must be true when the model is loaded' in answer.reason

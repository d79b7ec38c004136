"""Nodes `adapt` and `serve` in processes of their own: an arm that changes is followed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import itertools
import math
from pathlib import Path
import signal
import time
from typing import Any, TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from adaptation import arms
import numpy as np
from pal_statistics_msgs.msg import Statistics
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from lip_id_ros.adaptation.live import AdaptSettings
from lip_id_ros.adaptation.updates import Update
from lip_id_ros.model import EffortCalibration, InverseDynamicsModel
from lip_id_ros.nodes import messages, qos
from lip_id_ros.nodes.adapt import watch_period_s
from lip_id_ros.settings import parameters_of

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
    return Update.from_text(received[-1].data) if received else None


def trusted(received: list[Any]) -> bool:
    update = last(received)
    return update is not None and update.trusted


def test_friction_that_doubled_is_published_kept_and_forgotten(ros: Ros, path: str) -> None:
    graph, client = ros
    node = graph.start('adapt', model_path=path, publish_rate_hz=10.0)
    updates = client.listen(String, UPDATE, qos.LATCHED)
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
    again = client.listen(String, UPDATE, qos.LATCHED)
    client.wait_until(arm.until(lambda: trusted(again)), 'what was kept')
    found = last(again)
    assert found is not None
    assert found.counter > update.counter
    np.testing.assert_allclose(found.numbers, update.numbers, atol=0.2)
    assert client.trigger('/adapt/reset').success

    def is_fitted() -> bool:
        update = last(again)
        return update is not None and not update.trusted

    client.wait_until(arm.until(is_fitted), 'the commissioned model')


def test_steps_are_watched_twice_as_often_as_updates_are_published() -> None:
    """A step is published at the next watch: at longer periods updates would come less often."""
    highest = parameters_of(AdaptSettings)['publish_rate_hz'].maximum
    assert highest is not None
    for rate_hz in (1.0, 20.0, highest):
        assert rate_hz * watch_period_s(rate_hz) <= 0.5


def test_a_payload_is_announced_and_a_foreign_state_kept_aside(ros: Ros, path: str) -> None:
    graph, client = ros
    (graph.folder / 'adaptation.npz').write_bytes(b'broken')
    graph.start('adapt', model_path=path, payload_centre=[0.0, 0.1, 0.0])
    payloads = client.listen(Statistics, '/adapt/payload', qos.LATCHED)
    arm = Arm(client)
    arm.move()
    assert client.set_parameter('adapt', 'payload_mass', 0.4).successful
    request = SetBool.Request(data=True)
    answer = client.call(SetBool, '/adapt/announce_payload', request)
    assert answer.success
    client.wait_until(lambda: payloads, 'the payload')
    values = {each.name: each.value for each in payloads[-1].statistics}
    assert values['mass'] == 0.4
    assert values['centre_y'] == 0.1
    status = client.status('adapt', lambda status: status['announced_kg'] > 0.0)
    assert math.isclose(status['announced_kg'], 0.4)
    assert 'it is kept as' in status['note']
    assert (graph.folder / 'adaptation.npz.1').read_bytes() == b'broken'


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
    updates = client.listen(String, UPDATE, qos.LATCHED)
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
    status = client.status('serve', lambda status: status['adaptation']['gone_back'] == 1)
    assert 'serves the commissioned model: no update for 2 s' in status['summary']


def test_serve_refuses_updates_that_are_foreign_or_not_finite_and_may_stop_to_follow(
    ros: Ros, path: str
) -> None:
    graph, client = ros
    graph.start('serve', **{**following(path), 'adaptation_timeout_s': 900.0})
    client.status('serve', lambda status: status['state'] == 'active')
    publisher = client.speak(String, UPDATE, qos.LATCHED)
    stream = Stream(client)
    fitted, other = known_model(), arms.with_friction(known_model(), 1.5)
    assert other.arm is not None
    numbers = np.concatenate([other.arm.links.ravel(), other.arm.friction.coefficients])
    hashed = InverseDynamicsModel.load(path).fingerprint
    good = Update(hashed, 5, numbers, True, (0.5, 1.0))
    broken = numbers.copy()
    broken[-1] = np.nan

    def refused(update: str, reason: str) -> None:
        publisher.publish(String(data=update))
        client.status('serve', lambda status: status['adaptation']['refused'].get(reason))

    refused(replace(good, model='f' * 64).to_text(), 'update of another model')
    refused(replace(good, numbers=broken).to_text(), 'update not finite')
    refused('{', 'no update')
    client.wait_until(lambda: stream.is_at(torque_of(fitted), 1e-6), 'the torque of the fit')
    publisher.publish(String(data=good.to_text()))
    client.wait_until(lambda: stream.is_at(torque_of(other), 1e-6), 'the torque of the update')
    refused(replace(good, counter=4).to_text(), 'update not newer')
    assert client.set_parameter('serve', 'follow_adaptation', False).successful
    client.wait_until(lambda: stream.is_at(torque_of(fitted), 1e-6), 'the fit, on request')


def test_a_model_that_was_loaded_to_be_served_as_it_is_follows_nothing(
    serving: Ros,
) -> None:
    _, client = serving
    answer = client.set_parameter('serve', 'follow_adaptation', True)
    assert not answer.successful
    assert 'must be true when the model is loaded' in answer.reason

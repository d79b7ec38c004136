"""Messages that a node never took: every node counts them by topic, and none that it took."""

from __future__ import annotations

import re
import signal
import time
from typing import Any, TYPE_CHECKING

import hypothesis as hyp
from hypothesis import strategies as st
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from nodes import toy
from nodes.test_computed_torque import SETTINGS
from nodes.test_serve import GOOD, REFERENCE, start_serve
import numpy as np
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.nodes import messages, qos
from lip_id_ros.nodes.losses import Losses

if TYPE_CHECKING:
    from nodes.ros_graph import Ros

pytestmark = pytest.mark.ros


def joint_state(number: int) -> JointState:
    """Return a joint state of an arm at rest, a millisecond after the one before."""
    stamp = messages.stamp_at(1_800_000_000_000_000_000 + number * 1_000_000)
    message = messages.torque_message(stamp, toy.JOINTS, np.array([1.0, 2.0]))
    message.position = message.velocity = messages.doubles(np.zeros(2))
    return message


def received(status: dict[str, Any], topic: str) -> int:
    found = status['received']
    kinds = {'joint_states': 'joint_states', 'desired_trajectory': 'references'}
    return int(found[kinds[topic]] if isinstance(found, dict) else found)


@pytest.mark.parametrize(
    ('name', 'topic', 'count', 'executor'),
    [
        ('train', 'joint_states', 6000, 'events'),
        ('monitor', 'joint_states', 2000, 'single_threaded'),
        ('computed_torque', 'joint_states', 1000, 'events'),
        ('serve', 'desired_trajectory', 3000, 'events'),
    ],
)
def test_messages_that_are_overwritten_in_a_queue_are_counted(
    ros: Ros, model_path: str, name: str, topic: str, count: int, executor: str
) -> None:
    graph, client = ros
    settings: dict[str, dict[str, Any]] = {
        'train': {'record_on_start': True},
        'monitor': {'model_path': model_path, 'rate_hz': 1000.0},
        'computed_torque': SETTINGS,
        'serve': {'model_path': model_path, 'torque_limits': [toy.LIMIT]},
    }
    node = graph.start(name, **settings[name], executor=executor)
    client.status(name, lambda status: status.get('state') != 'inactive' and not status['lost'])
    if topic == 'joint_states':
        publisher = client.speak(JointState, f'/{topic}', qos.NEWEST)
    else:
        publisher = client.speak(JointTrajectory, REFERENCE)
    sent = 0

    def send() -> None:
        nonlocal sent
        publisher.publish(joint_state(sent) if topic == 'joint_states' else GOOD)
        sent += 1

    for _ in range(3):
        send()
    client.status(name, lambda status: received(status, topic) == 3)
    node.hold()
    try:
        for _ in range(count):
            send()
    finally:
        node.send(signal.SIGCONT)

    def accounted(status: dict[str, Any]) -> bool:
        if status['lost'] and received(status, topic) + status['lost'][topic] == sent:
            return True
        send()  # a gap is found with the message behind it
        return False

    status = client.status(name, accounted)
    assert set(status['lost']) == {topic}
    if name == 'train':  # its recording has the gap
        assert status['gaps'] >= 1
        assert f'gaps in stamps: {status["gaps"]} up to ' in status['summary']
    assert re.search(rf'messages lost before they were taken: \d+ of {topic}', node.log)


def test_references_of_two_publishers_are_not_taken_for_lost(ros: Ros, model_path: str) -> None:
    """Each publisher numbers its own messages, and nothing tells which of them is whose."""
    graph, client = ros
    start_serve(graph, model_path=model_path)
    client.status('serve', lambda status: status['state'] == 'active')
    first = client.speak(JointTrajectory, REFERENCE)
    for _ in range(50):
        first.publish(GOOD)
    second = client.node.create_publisher(JointTrajectory, REFERENCE, qos.REFERENCE)
    status = client.status('serve', lambda status: '2 publishers of' in status['summary'])
    assert status['lost_uncounted'] == ['desired_trajectory']  # no losses are known, nor none
    for _ in range(20):
        first.publish(GOOD)
        second.publish(GOOD)
    client.status('serve', lambda status: status['received']['references'] == 90)
    client.withdraw(second)
    client.status('serve', lambda status: '2 publishers of' not in status['summary'])
    for _ in range(10):
        first.publish(GOOD)
    status = client.status('serve', lambda status: status['received']['references'] == 100)
    assert (status['lost'], status['lost_uncounted']) == ({}, [])


def test_a_monitor_at_a_thousand_hertz_accounts_for_every_joint_state(
    ros: Ros, model_path: str
) -> None:
    """A burst of a fifth of a second waits for it; none of it was lost in its own queue."""
    graph, client = ros
    monitor = graph.start('monitor', model_path=model_path, rate_hz=1000.0)
    publisher = client.speak(JointState, '/joint_states')
    client.status('monitor', lambda status: status['received'] == 0)
    monitor.hold()
    try:
        for number in range(qos.WATCHED.depth):
            publisher.publish(joint_state(number))
    finally:
        monitor.send(signal.SIGCONT)
    status = client.status('monitor', lambda status: status['received'] == qos.WATCHED.depth)
    assert status['watched'] == qos.WATCHED.depth - 1
    assert status['lost'] == {}


def note(losses: Losses, *numbers: int, age_s: float = 0.0) -> None:
    """Note messages with these numbers, which came so long ago."""
    for number in numbers:
        received = time.time_ns() - round(1e9 * age_s)
        losses.note({'publication_sequence_number': number, 'received_timestamp': received})


# one step of a stream: who publishes, whether the message is lost, whether the status is due
STEPS = st.tuples(st.integers(0, 1), st.booleans(), st.booleans())


@hyp.given(
    steps=st.lists(STEPS, max_size=60),
    ends=st.tuples(st.integers(0, 60), st.integers(0, 60)),
    ahead=st.integers(-5, 30),
)
def test_only_what_was_lost_is_counted(
    steps: list[tuple[int, bool, bool]], ends: tuple[int, int], ahead: int
) -> None:
    """A second publisher may join and leave; of a single one all that was lost is counted."""
    losses, numbers, told, lost, behind = Losses('topic'), [10, 10 + ahead], 0, 0, [0, 0]
    seen, both = [False, False], False
    for place, (who, is_lost, is_due) in enumerate(steps):
        before, both = both, ends[0] <= place < ends[1]
        publisher = who if both else 0
        publishers = {b'first', b'second'} if both else {b'first'}
        if both != before:
            told += losses.settle(publishers)
        numbers[publisher] += 1
        if not is_lost:
            note(losses, numbers[publisher])
            lost, behind[publisher], seen[publisher] = lost + behind[publisher], 0, True
        elif seen[publisher]:
            behind[publisher] += 1
        if is_due:
            told += losses.settle(publishers)
        assert told <= lost
    if ends[0] >= min(ends[1], len(steps)):
        assert told + losses.settle({b'first'}) == lost


def test_the_event_and_the_numbers_of_the_same_messages_count_once() -> None:
    class Event:
        total_count_change = 4

    losses = Losses('topic')
    note(losses, 1, 6, 7, 10)
    losses.on_event(Event)
    assert losses.settle({b'first'}) == 6
    losses.on_event(Event)  # late, of the same
    assert losses.settle({b'first'}) == 2
    # of a middleware without numbers
    losses.note({'publication_sequence_number': None, 'received_timestamp': 0})
    losses.on_event(Event)
    assert losses.settle({b'first'}) == 4
    assert losses.uncounted
    note(losses, 11)
    losses.settle({b'first'})
    assert not losses.uncounted


def test_a_restarted_publisher_loses_nothing() -> None:
    losses = Losses('topic')
    note(losses, 5, 6)
    assert losses.settle({b'first'}) == losses.settle(frozenset()) == 0
    assert not losses.uncounted
    note(losses, 20, 21)  # it began before this node knew of it
    assert losses.settle({b'second'}) == 0
    note(losses, 7, 8, age_s=1.0)  # of the first, which waited
    note(losses, 23, 25)
    assert losses.settle({b'second'}) == 1


def test_losses_are_counted_after_the_clock_was_set_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Messages that come an hour before the change of publishers are not older than it."""
    losses = Losses('topic')
    losses.settle({b'first'})
    losses.settle({b'first', b'second'})
    losses.settle({b'first'})
    an_hour_ago = time.time_ns() - 3600 * 10**9
    monkeypatch.setattr(time, 'time_ns', lambda: an_hour_ago)
    losses.settle({b'first'})
    note(losses, 23, 25)
    assert losses.settle({b'first'}) == 1

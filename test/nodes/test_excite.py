"""Node `excite` beside `train` and an arm: from nothing to a model, and what stops the arm."""

from __future__ import annotations

from pathlib import Path
import signal
import time
from typing import Any, TYPE_CHECKING

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')
pytest.importorskip('control_msgs', reason='needs control_msgs')

from control_msgs.msg import DynamicJointState
from nodes.moved_arm import ACTION, JOINTS, REFERENCE
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.nodes import messages, qos

if TYPE_CHECKING:
    from nodes.ros_graph import Client, Process, Ros

pytestmark = pytest.mark.ros

SETTINGS = """
motion:
  {joints: [shoulder, elbow], duration_s: 10.0, lower: [-1.5], upper: [1.5], velocity: [2.0],
   size: 1.0}
search: {draws: 4}
"""
URDF = """<robot name="arm">
  <link name="base"/>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>
    <limit lower="-1.5" upper="1.5" velocity="2" effort="30"/>
  </joint>
  <link name="upper"/>
  <joint name="elbow" type="revolute">
    <parent link="upper"/><child link="fore"/><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-1.5" upper="1.5" velocity="2" effort="20"/>
  </joint>
  <link name="fore"/>
</robot>
"""
IN_SPACE = """
space: {radius_m: 0.05, tool: [0.3, 0, 0], self_distance_m: none}
"""


def started(
    ros: Ros,
    folder: Path,
    arm: tuple[str, ...] = (),
    duration_s: float = 10.0,
    bags: tuple[str, ...] = (),
    **parameters: Any,
) -> Process:
    """Start the arm, `train` and `excite`; return the arm."""
    graph, client = ros
    moved = graph.start_fork('moved_arm', 'nodes.moved_arm', ['--ros-args', *arm])
    graph.start(
        'train',
        recording__joints=list(JOINTS),
        model_path=str(folder / 'model.npz'),
        unsaved_path=str(folder / 'kept'),
        bags=list(bags),
    )
    settings = folder / 'excite.yaml'
    settings.write_text(SETTINGS.replace('10.0', str(duration_s)))
    own = {
        'controller_action': ACTION,
        'config_path': str(settings),
        'motion_path': str(folder / 'motion.yaml'),
        'effort_limits_from': 'none',
        'tracking_tolerance': [10.0],  # the arm may lag where the machine is busy
        'stale_timeout_s': 30.0,
        'confirm': False,
        'first_size': 0.5,
        'use_robot_description': False,
    }
    graph.start('excite', **own | parameters)
    client.listen(JointState, '/joint_states', qos.SENSOR_STREAM)
    client.wait_until(lambda: client.received['/joint_states'], 'joint states')
    client.status('train', lambda status: True)
    return moved


def begin(client: Client) -> None:
    client.wait_until(lambda: client.trigger('/excite/start').success, 'the start')


def begin_to_move(client: Client) -> None:
    begin(client)
    now = client.status('excite', lambda status: status['stage'] in ('moving', 'stopped'))
    assert now['stage'] == 'moving', now
    client.wait_until(lambda: np.abs(position(client)).max() > 0.01, 'a motion')


def position(client: Client) -> np.ndarray:
    return np.array(client.received['/joint_states'][-1].position)


def await_hold_where_measured(client: Client) -> dict[str, float]:
    """Wait until the arm is held where the node has measured it; return that place."""
    held: dict[str, float] = client.status('excite', lambda status: status['held'])['held']
    wanted = [held[name] for name in JOINTS]
    told = client.listen(JointState, REFERENCE)
    client.wait_until(
        lambda: told and np.allclose(told[-1].position, wanted, atol=1e-9), 'the arm held'
    )
    client.wait_until(
        lambda: np.allclose(position(client)[::-1], wanted, atol=1e-9), 'the arm where it is held'
    )
    return held


def await_hold(client: Client) -> None:
    """Wait until the arm rests, on its way: at its end the motion is back at zero."""
    states = client.received['/joint_states']
    client.wait_until(
        lambda: len(states) > 50 and states[-1].position == states[-20].position, 'the arm at rest'
    )
    assert np.abs(position(client)).max() > 1e-3


@pytest.mark.slow
def test_from_nothing_to_a_model(ros: Ros, tmp_path: Path) -> None:
    _, client = ros
    started(ros, tmp_path, rounds=2, confirm=True, report_path=str(tmp_path / 'page'))
    begin(client)
    for number in (1, 2):
        waiting = client.status(
            'excite',
            lambda status: status['stage'] == 'waiting for confirm' and status['round'] == number,  # noqa: B023
        )
        assert (tmp_path / f'page_{number}' / 'index.html').is_file()
        assert np.abs(position(client)).max() < 1e-3  # nothing moves before leave is given
        assert client.trigger('/excite/confirm').success, waiting
    ended = client.status('excite', lambda status: status['stage'] in ('done', 'stopped'))
    assert ended['stage'] == 'done', ended
    # the second motion is larger, and is designed for what the first has not shown
    assert ended['size'] > 0.5
    assert len(ended['deviation_percent'][0]) == len(JOINTS)
    assert {each.name for each in tmp_path.glob('motion_*.yaml')} == {
        'motion_1.yaml',
        'motion_2.yaml',
    }
    model = InverseDynamicsModel.load(ended['model_path'])
    assert max(model.summary['unexplained_percent']) < 5.0


@pytest.mark.slow
def test_no_motion_follows_once_enough_is_known(ros: Ros, tmp_path: Path) -> None:
    _, client = ros
    started(ros, tmp_path, rounds=2, enough_percent=100.0)
    begin(client)
    ended = client.status('excite', lambda status: status['stage'] in ('done', 'stopped'))
    assert ended['summary'].startswith('done: 1 motions; the model is ')
    assert ended['round'] == 1


def test_a_blocked_joint_stops_the_motion_and_is_held_where_it_is(
    ros: Ros, tmp_path: Path
) -> None:
    _, client = ros
    started(ros, tmp_path, ('-p', 'blocked_at:=0.1'), first_size=1.0, tracking_tolerance=[0.2])
    begin(client)
    ended = client.status('excite', lambda status: status['stage'] == 'stopped')
    assert 'shoulder is ' in ended['summary']
    assert 'away from its plan, beyond 0.2' in ended['summary']
    held = await_hold_where_measured(client)
    assert abs(held['shoulder']) == pytest.approx(0.1)  # the reference was beyond
    # what was recorded is kept
    kept = client.status('train', lambda status: not status['recording'])
    assert kept['rows'] > 0
    # but for fits its end is left out
    client.status('train', lambda status: status['disturbed'] == 1)


def test_a_joint_that_stands_still_in_a_small_motion_is_told(ros: Ros, tmp_path: Path) -> None:
    _, client = ros
    started(ros, tmp_path, ('-p', 'blocked_at:=0.0'), duration_s=2.0, first_size=0.3)
    begin(client)
    ended = client.status('excite', lambda status: status['stage'] in ('fitting', 'stopped'))
    assert 'shoulder has moved 0 of its 0.0' in ended['summary']


def test_an_arm_that_falls_silent_stops_the_motion(ros: Ros, tmp_path: Path) -> None:
    _, client = ros
    arm = started(ros, tmp_path, stale_timeout_s=3.0)
    begin_to_move(client)
    arm.hold()
    ended = client.status('excite', lambda status: status['stage'] == 'stopped')
    assert 'no joint state for' in ended['summary']
    arm.send(signal.SIGCONT)
    await_hold(client)


def test_a_controller_that_does_not_cancel_is_told(ros: Ros, tmp_path: Path) -> None:
    _, client = ros
    arm = started(ros, tmp_path, ('-p', 'ignores_cancels:=true'))
    begin_to_move(client)
    assert client.trigger('/excite/stop').success
    ended = client.status('excite', lambda status: 'by other means' in status['summary'])
    assert ended['stage'] == 'stopped'
    assert '~/stop was called' in ended['summary']
    assert 'has refused to cancel a goal' in ended['summary']
    before = position(client)
    client.wait_until(lambda: np.any(position(client) != before), 'the motion that goes on')
    arm.end()


def test_a_controller_that_does_not_answer_a_cancel_is_told(ros: Ros, tmp_path: Path) -> None:
    _, client = ros
    arm = started(ros, tmp_path)
    begin_to_move(client)
    arm.hold()
    assert client.trigger('/excite/stop').success
    ended = client.status('excite', lambda status: 'by other means' in status['summary'])
    assert 'has not said for 5 s' in ended['summary']


def test_an_arm_whose_place_is_not_known_now_does_not_move(ros: Ros, tmp_path: Path) -> None:
    _, client = ros
    arm = started(ros, tmp_path, confirm=True, stale_timeout_s=3.0)
    begin(client)
    client.status('excite', lambda status: status['stage'] == 'waiting for confirm')
    arm.hold()
    silent_since, states = time.monotonic(), client.received['/joint_states']
    client.wait_until(lambda: time.monotonic() - silent_since > 4.0, 'silence')
    assert client.trigger('/excite/confirm').success
    ended = client.status('excite', lambda status: status['stage'] == 'stopped')
    assert 'no joint state of shoulder for' in ended['summary']
    arm.send(signal.SIGCONT)
    heard = len(states)
    client.wait_until(lambda: len(states) > heard + 50, 'joint states')
    assert np.abs(position(client)).max() == 0.0


def test_leave_is_asked_for_and_a_stop_is_heeded(ros: Ros, tmp_path: Path) -> None:
    _, client = ros
    started(ros, tmp_path, confirm=True)
    assert not client.trigger('/excite/confirm').success
    begin(client)
    assert not client.trigger('/excite/start').success
    client.status('excite', lambda status: status['stage'] == 'waiting for confirm')
    assert client.trigger('/excite/stop').success
    ended = client.status('excite', lambda status: status['stage'] == 'stopped')
    assert '~/stop was called' in ended['summary']
    assert np.abs(position(client)).max() == 0.0


def test_a_stop_right_after_leave_is_heeded(ros: Ros, tmp_path: Path) -> None:
    _, client = ros
    started(ros, tmp_path, confirm=True)
    begin(client)
    client.status('excite', lambda status: status['stage'] == 'waiting for confirm')
    assert not client.trigger('/excite/start').success  # now the client knows the node
    calls = [client.node.create_client(Trigger, f'/excite/{name}') for name in ('confirm', 'stop')]
    client.wait_until(lambda: all(each.service_is_ready() for each in calls), 'services')
    answers = [each.call_async(Trigger.Request()) for each in calls]
    client.wait_until(lambda: all(each.done() for each in answers), 'answers')
    ended = client.status('excite', lambda status: status['stage'] in ('fitting', 'stopped'))
    assert '~/stop was called' in ended['summary']


def test_leave_that_is_given_twice_is_answered_and_harmless(ros: Ros, tmp_path: Path) -> None:
    """The second ended what was awaited after the first, and with it the run."""
    _, client = ros
    started(ros, tmp_path, confirm=True, duration_s=1.0)
    begin(client)
    client.status('excite', lambda status: status['stage'] == 'waiting for confirm')
    assert not client.trigger('/excite/start').success  # now the client knows the node
    confirm = client.node.create_client(Trigger, '/excite/confirm', qos_profile=qos.CALLS)
    client.wait_until(confirm.service_is_ready, 'service')
    answers = [confirm.call_async(Trigger.Request()) for _ in range(40)]
    client.wait_until(lambda: all(each.done() for each in answers), 'answers')
    ended = client.status(
        'excite', lambda status: status['stage'] in ('fitting', 'done', 'stopped')
    )
    assert 'an error of this node' not in ended['summary']
    assert [each.result().success for each in answers].count(True) == 1
    assert 'the node is moving' in answers[-1].result().message


def test_a_controller_that_does_not_end_a_motion_is_not_awaited(ros: Ros, tmp_path: Path) -> None:
    _, client = ros
    started(ros, tmp_path, ('-p', 'ends_after:=1e9'), duration_s=1.0)
    begin(client)
    ended = client.status('excite', lambda status: status['stage'] == 'stopped')
    assert 'the controller has not ended the motion 5' in ended['summary']


def test_a_motion_that_ends_before_its_time_is_not_learned_from(ros: Ros, tmp_path: Path) -> None:
    _, client = ros
    started(ros, tmp_path, ('-p', 'ends_after:=1.0'))
    begin(client)
    ended = client.status('excite', lambda status: status['stage'] in ('fitting', 'stopped'))
    assert 's before its end that the motion is done' in ended['summary']
    client.status('train', lambda status: status['disturbed'] == 1)


def test_a_fit_that_fails_as_the_last_one_is_not_awaited_either(ros: Ros, tmp_path: Path) -> None:
    _, client = ros
    (tmp_path / 'broken.mcap').write_bytes(b'')
    started(ros, tmp_path, duration_s=1.0, bags=(str(tmp_path / 'broken.mcap'),))
    client.limit_s = 120.0  # joint states keep busy a graph in which nothing else happens
    for _ in range(2):
        begin(client)
        client.status('excite', lambda status: status['stage'] not in ('idle', 'stopped'))
        ended = client.status('excite', lambda status: status['stage'] == 'stopped')
        assert 'the fit has ended without a model: ' in ended['summary']


def test_an_effort_beyond_its_limit_stops_the_motion(ros: Ros, tmp_path: Path) -> None:
    _, client = ros
    started(ros, tmp_path, effort_limits=[0.01], effort_limits_from='parameters')
    begin(client)
    ended = client.status('excite', lambda status: status['stage'] == 'stopped')
    assert 'has an effort of' in ended['summary']


def test_a_killed_node_leaves_the_arm_to_its_controller_and_the_data_to_train(
    ros: Ros, tmp_path: Path
) -> None:
    graph, client = ros
    started(ros, tmp_path, rounds=1)
    begin_to_move(client)
    excite = graph.processes[-1]
    assert excite.end(signal.SIGTERM) == 0
    await_hold(client)


def test_a_node_that_ends_before_the_controller_answers_lets_nothing_move(
    ros: Ros, tmp_path: Path
) -> None:
    graph, client = ros
    started(ros, tmp_path, ('-p', 'answers_after:=1.5'))
    begin(client)
    client.status('excite', lambda status: status['stage'] == 'moving')
    assert graph.processes[-1].end(signal.SIGTERM) == 0
    states = client.received['/joint_states']
    heard = len(states)
    client.wait_until(lambda: len(states) > heard + 100, 'joint states')
    assert states[-1].position == states[-20].position
    client.status('train', lambda status: not status['recording'] and status['disturbed'] == 1)


@pytest.mark.parametrize('number', [signal.SIGSTOP, signal.SIGKILL, signal.SIGTERM])
def test_a_train_that_falls_silent_stops_the_motion(
    ros: Ros, tmp_path: Path, number: signal.Signals
) -> None:
    graph, client = ros
    started(ros, tmp_path)
    train = graph.processes[1]
    begin_to_move(client)
    train.send(number)
    ended = client.status('excite', lambda status: status['stage'] == 'stopped')
    assert '/train is silent for 5 s' in ended['summary']
    await_hold(client)
    if number != signal.SIGKILL:
        train.end()
        assert list(tmp_path.glob('kept*'))


def test_a_train_that_falls_silent_while_it_fits_is_not_awaited(ros: Ros, tmp_path: Path) -> None:
    graph, client = ros
    started(ros, tmp_path)
    begin(client)
    client.status('train', lambda status: status['job']['stage'])  # the request is answered
    graph.processes[1].hold()
    ended = client.status('excite', lambda status: status['stage'] == 'stopped')
    assert '/train is silent for 5 s' in ended['summary']


def test_two_controllers_of_one_action_are_refused(ros: Ros, tmp_path: Path) -> None:
    graph, client = ros
    graph.start_fork('second', 'nodes.moved_arm', ['--ros-args', '-r', '__node:=second_arm'])
    started(ros, tmp_path, confirm=True)
    service = f'{ACTION}/_action/send_goal'
    client.wait_until(lambda: client.node.count_services(service) == 2, 'both controllers')
    begin(client)
    client.status('excite', lambda status: status['stage'] == 'waiting for confirm')
    assert client.trigger('/excite/confirm').success
    ended = client.status('excite', lambda status: status['stage'] in ('moving', 'stopped'))
    assert f'2 controllers offer {ACTION}' in ended['summary']
    assert np.abs(position(client)).max() == 0.0


def test_a_killed_arm_ends_in_a_sentence(ros: Ros, tmp_path: Path) -> None:
    _, client = ros
    arm = started(ros, tmp_path, stale_timeout_s=3.0)
    begin_to_move(client)
    arm.send(signal.SIGKILL)
    ended = client.status('excite', lambda status: status['stage'] == 'stopped')
    assert 'no joint state for' in ended['summary'] or 'has ended' in ended['summary']
    kept = client.status('train', lambda status: not status['recording'])
    assert kept['rows'] > 0


def test_the_question_for_leave_says_how_far_it_goes_and_the_floor_holds_in_all_rounds(
    ros: Ros, tmp_path: Path
) -> None:
    _, client = ros
    description = client.node.create_publisher(String, '/robot_description', qos.LATCHED)
    description.publish(String(data=URDF))
    started(ros, tmp_path, rounds=2, confirm=True, use_robot_description=True, first_size=0.5)
    with open(tmp_path / 'excite.yaml', 'a') as settings:
        settings.write(IN_SPACE)
    begin(client)
    sizes = []
    for number in (1, 2):
        waiting = client.status(
            'excite',
            lambda status: (
                status['stage'] in ('waiting for confirm', 'stopped') and status['round'] == number  # noqa: B023
            ),
        )
        assert 'm above the base plane. Farthest point: ' in waiting['summary']
        assert 'Fastest joint: ' in waiting['summary']
        assert 'Nobody has checked self-collision: the settings say so' in waiting['summary']
        sizes.append(float(waiting['summary'].partition(' s, at ')[2].partition(' ')[0]))
        assert client.trigger('/excite/confirm').success
    client.status('excite', lambda status: status['stage'] == 'fitting' and status['round'] == 2)
    assert sizes[1] > sizes[0]
    way = np.array([np.array(each.position)[::-1] for each in client.received['/joint_states']])
    assert np.ptp(way, axis=0).min() > 0.1
    elbow = 0.3 - 0.4 * np.sin(way[:, 0])
    tool = elbow - 0.3 * np.sin(way.sum(axis=1))
    assert min(elbow.min() - 0.05, tool.min()) >= 0.05


def test_without_a_urdf_the_question_says_what_nobody_has_checked(
    ros: Ros, tmp_path: Path
) -> None:
    _, client = ros
    started(ros, tmp_path, confirm=True)
    begin(client)
    waiting = client.status('excite', lambda status: status['stage'] == 'waiting for confirm')
    assert 'Nobody has checked the floor and self-collision: no URDF' in waiting['summary']


@pytest.mark.parametrize(
    ('joints', 'stage'),
    [('[elbow, shoulder]', 'moving'), ('[shoulder, elbow, wrist]', 'stopped')],
)
def test_the_joints_of_the_controller_are_looked_at(
    ros: Ros, tmp_path: Path, joints: str, stage: str
) -> None:
    _, client = ros
    started(ros, tmp_path, ('-p', f'joints:={joints}'), tracking_tolerance=[0.3])
    begin(client)
    ended = client.status('excite', lambda status: status['stage'] in ('fitting', 'stopped'))
    if stage == 'moving':  # they are told by their place in the controller's list
        assert ended['stage'] == 'fitting', ended
        return
    assert 'moves shoulder, elbow, wrist, but the motion shoulder, elbow;' in ended['summary']
    assert np.abs(position(client)).max() == 0.0


def test_joints_in_different_messages_are_refused_before_anything_moves(
    ros: Ros, tmp_path: Path
) -> None:
    _, client = ros
    started(ros, tmp_path, ('-p', 'splits:=true'), confirm=True)
    begin(client)
    ended = client.status(
        'excite', lambda status: status['stage'] in ('waiting for confirm', 'stopped')
    )
    assert ended['stage'] == 'stopped', ended
    assert 'no message of joint_states has all joints of the motion: ' in ended['summary']
    assert not any(any(each.position) for each in client.received['/joint_states'])


def test_a_monitor_that_dies_stops_the_motion(ros: Ros, tmp_path: Path, model_path: str) -> None:
    graph, client = ros
    unmoved = {'smallest_contact': [1e3], 'deviation_constant': [1e3]}  # it knows another arm
    monitor = graph.start('monitor', model_path=model_path, **unmoved)
    started(ros, tmp_path, stale_timeout_s=1.0)
    contacts = client.listen(DynamicJointState, '/monitor/contact')
    client.wait_until(lambda: contacts, 'a word on contacts')
    begin_to_move(client)
    monitor.send(signal.SIGKILL)
    ended = client.status('excite', lambda status: status['stage'] == 'stopped')
    assert 'the monitor is silent for 1' in ended['summary']
    await_hold_where_measured(client)


def test_a_contact_at_any_joint_stops_the_motion(ros: Ros, tmp_path: Path) -> None:
    _, client = ros
    started(ros, tmp_path)
    monitor = client.speak(DynamicJointState, '/monitor/contact', qos.OUTPUT)
    begin_to_move(client)
    values = {'torque': np.array([0.1, 9.0]), 'contact': np.array([0.0, 1.0])}
    stamp = client.node.get_clock().now().to_msg()
    monitor.publish(messages.joint_values_message(stamp, JOINTS, values))
    ended = client.status('excite', lambda status: status['stage'] == 'stopped')
    assert 'the monitor has found a contact' in ended['summary']
    await_hold_where_measured(client)


def test_what_is_missing_is_named(ros: Ros, tmp_path: Path) -> None:
    graph, _ = ros
    for parameters, sentence in (
        ({}, 'controller_action must be the action'),
        ({'controller_action': ACTION}, 'effort_limits must hold the largest of each joint'),
        ({'controller_action': ACTION, 'motion_path': 'm.txt'}, 'm.txt ends otherwise; name'),
    ):
        process = graph.start('excite', **parameters)
        assert process.wait() == 1
        assert sentence in process.log

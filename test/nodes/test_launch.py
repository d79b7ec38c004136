"""Launch files: they start their nodes, in any namespace, and end in good order."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from copy import deepcopy
import os
from pathlib import Path
import subprocess
import sys
import time
from typing import Any, TYPE_CHECKING

import psutil
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from ament_index_python.packages import get_package_share_path, PackageNotFoundError
from launch import LaunchContext
from launch.launch_description_sources import AnyLaunchDescriptionSource
from nodes.ros_graph import FORK_SERVER, heed_signals, Process
from nodes.test_serve import GOOD
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
import yaml

from examples.demo.graph import end, LAUNCHING
from lip_id_ros.nodes import qos
from lip_id_ros.recording import read_bag
from lip_id_ros.settings import RecordingSettings

if TYPE_CHECKING:
    from nodes.ros_graph import Graph, Ros

try:
    get_package_share_path('lip_id_ros')
except PackageNotFoundError:
    pytest.skip('the package is not built; run make setup', allow_module_level=True)

pytestmark = pytest.mark.ros


@contextmanager
def launched(graph: Graph, name: str, *arguments: str) -> Iterator[Path]:
    """Run a launch file of the package while the block runs; give the log."""
    log_path = graph.folder / f'{name}.log'
    with open(log_path, 'wb') as log:
        process = subprocess.Popen(
            [sys.executable, '-P', str(LAUNCHING), name, *arguments],
            env=graph.environment,
            cwd=graph.folder,
            stdout=log,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=heed_signals,
        )
    try:
        yield log_path
    finally:
        end(process)
    assert process.returncode == 0, log_path.read_text()


def limited(graph: Graph) -> str:
    """Write limits for serve to a file; give the launch argument."""
    (graph.folder / 'limits.yaml').write_text(
        '/**/serve: {ros__parameters: {torque_limits: [100.0]}}\n'
    )
    return 'params_file:=limits.yaml'


def test_two_arms_are_served_side_by_side(ros: Ros, model_path: str) -> None:
    graph, client = ros
    arguments = (f'model_path:={model_path}', limited(graph))
    with (
        launched(graph, 'serve.launch.py', *arguments, 'namespace:=left'),
        launched(graph, 'serve.launch.py', *arguments, 'namespace:=right'),
    ):
        left = client.listen(JointState, '/left/serve/feedforward_torque')
        right = client.listen(JointState, '/right/serve/feedforward_torque')
        publisher = client.speak(JointTrajectory, '/left/serve/desired_trajectory')
        for name in ('left/serve', 'right/serve'):
            client.status(name, lambda status: status['state'] == 'active')

        def answered() -> Any:  # what waits for too long on a busy machine is refused
            publisher.publish(GOOD)
            return left

        client.wait_until(answered, 'answer')
        assert not right


def test_two_arms_are_recorded_side_by_side(ros: Ros, tmp_path: Path) -> None:
    graph, client = ros
    for arm in ('left', 'right'):
        (tmp_path / arm).mkdir()
    (tmp_path / 'arm.yaml').write_text(
        '/**/train:\n  ros__parameters: {record_on_start: true, recording: {joints: [b, a]}}\n'
    )
    left = ('namespace:=left', 'folder:=left', 'params_file:=arm.yaml')
    right = ('namespace:=right', 'folder:=right', 'joint_states:=/cell/right/states')
    with (
        launched(graph, 'train.launch.py', *left),
        launched(graph, 'train.launch.py', *right, f'params_file:={tmp_path / "arm.yaml"}'),
    ):
        for arm, topic, value in (
            ('left', '/left/joint_states', 1.0),
            ('right', '/cell/right/states', 2.0),
        ):
            publisher = client.speak(JointState, topic)
            assert client.status(f'{arm}/train', lambda status: True)['rows'] == 0
            message = JointState(name=['a', 'b'], position=[value, -value])

            def keeps_moving(message: JointState = message, publisher: Any = publisher) -> None:
                message.header.stamp.sec += 1
                publisher.publish(message)

            timer = client.node.create_timer(0.01, keeps_moving)
            client.status(f'{arm}/train', lambda status: status['rows'] >= 10)
            timer.cancel()
    for arm, value in (('left', 1.0), ('right', 2.0)):
        kept = read_bag(tmp_path / arm / 'unsaved.mcap', RecordingSettings(joints=('b', 'a')))
        assert kept.n_samples >= 10
        assert (kept.position == [-value, value]).all()
    assert not (tmp_path / 'unsaved.mcap').exists()


def test_both_nodes_of_two_arms_share_a_graph(ros: Ros, model_path: str, tmp_path: Path) -> None:
    graph, client = ros
    parameters = tmp_path / 'arm.yaml'
    parameters.write_text(
        '/**/train: {ros__parameters: {record_on_start: true}}\n'
        '/**/serve: {ros__parameters: {torque_limits_from: none, ramp_s: 0.0, '
        'joints: [elbow, shoulder]}}\n'
    )

    def arm(name: str) -> AbstractContextManager[Path]:
        return launched(
            graph,
            'arm.launch.py',
            f'params_file:={parameters}',
            f'model_path:={model_path}',
            f'namespace:={name}',
            'autostart:=true',
            f'desired_trajectory:=/{name}/wanted',
            f'trajectory_with_effort:=/{name}/controller/joint_trajectory',
            f'joint_states:=/{name}/measured',
        )

    with arm('left'), arm('right'):
        plans = {
            name: client.listen(JointTrajectory, f'/{name}/controller/joint_trajectory')
            for name in ('left', 'right')
        }
        publisher = client.speak(JointTrajectory, '/left/wanted')
        for name in ('left/serve', 'right/serve'):
            client.status(name, lambda status: status['state'] == 'active')
        plan = deepcopy(GOOD)
        plan.points = [deepcopy(plan.points[0]) for _ in range(3)]
        for number, each in enumerate(plan.points):
            each.time_from_start.sec = number
        publisher.publish(plan)
        client.wait_until(lambda: plans['left'], 'plan')
        assert all(len(point.effort) == 2 for point in plans['left'][0].points)
        assert not plans['right']

        measured = client.speak(JointState, '/right/measured', qos.OUTPUT, listeners=2)
        for number in range(1, 21):
            state = JointState(name=GOOD.joint_names, position=[0.0] * 2, velocity=[0.0] * 2)
            state.header.stamp.sec = number
            measured.publish(state)
        client.status('right/serve', lambda status: status['answered']['measured'] > 0)
        client.status('right/train', lambda status: status['rows'] > 0)
        assert client.status('left/train', lambda status: True)['rows'] == 0


SERVE = '/**/serve: {ros__parameters: {torque_limits: [100.0]}}'
TRAIN = '/**/train: {ros__parameters: {model_path: model.npz}}'
BOTH = f'{SERVE}\n{TRAIN}'


def started_in(folder: Path, program: str = '') -> list[psutil.Process]:
    """Processes that were started in a folder and run on, with a word in their command lines."""
    return [
        each
        for each in psutil.process_iter(['cwd', 'cmdline'])
        if each.info['cwd'] == str(folder) and program in ' '.join(each.info['cmdline'] or ())
    ]


@pytest.mark.parametrize(
    ('name', 'content', 'arguments', 'sentence'),
    [
        ('serve', SERVE, ['params_file:=absent.yaml'], 'params_file must be a file, there is'),
        ('serve', '', [], 'its sections are: none; name one /**/serve'),
        ('serve', SERVE.replace('/serve', '/sevre'), [], 'its sections are: /**/sevre; name one'),
        ('serve', SERVE, ['namespace:=left', 'torque_limits:=[1.0]'], 'torque_limits is not a la'),
        ('serve', SERVE, ['param_file:=panda.yaml'], 'param_file is not a launch argument'),
        ('arm', SERVE, ['folder_:=x'], 'folder_ is not a launch argument'),
        ('serve', SERVE, ['use_sim_time:=2'], 'use_sim_time must be true or false, not 2'),
        ('arm', BOTH, ['respawn:=2'], 'respawn must be true or false, not 2'),
        ('arm', SERVE, [], 'has no section for the node /train'),
        ('arm', TRAIN, [], 'has no section for the node /serve'),
        ('serve', SERVE, ['namespace:=1st'], 'Invalid namespace'),
        ('arm', BOTH, ['autostart:=maybe'], 'autostart must be true or false, not maybe'),
        ('excite', BOTH, [], 'has no section for the node /excite'),
        ('train', SERVE.replace('serve', 'train'), ['folder:=/nope'], 'folder must be a folder'),
    ],
)
def test_a_launch_with_wrong_arguments_starts_nothing(
    name: str, content: str, arguments: list[str], sentence: str, tmp_path: Path
) -> None:
    (tmp_path / 'arm.yaml').write_text(content)
    given = ['params_file:=arm.yaml', *arguments]
    if name != 'train':
        given.append('model_path:=model.npz')
    log = tmp_path / 'launch.log'
    forked = FORK_SERVER.fork(
        'examples.demo.launching', [f'{name}.launch.py', *given], log, os.environ
    )
    process = Process(log, forked)
    assert process.wait() == 1
    said = process.log
    assert sentence in said
    assert 'Traceback' not in said
    assert 'process started' not in said
    assert not started_in(tmp_path)


@pytest.mark.parametrize(
    ('name', 'given', 'state'),
    [
        ('serve', (), 'active'),
        ('serve', ('autostart:=false',), 'unconfigured'),
        ('arm', (), 'unconfigured'),
        ('arm', ('autostart:=true',), 'active'),
    ],
)
def test_the_launch_activates_serve_if_asked_to(
    name: str, given: tuple[str, ...], state: str, ros: Ros, model_path: str
) -> None:
    graph, client = ros
    (graph.folder / 'arm.yaml').write_text(
        f'/**/serve: {{ros__parameters: {{torque_limits: [9.0], autostart: true, '
        f'model_path: {model_path}}}}}\n/**/train: {{ros__parameters: {{model_path: x.npz}}}}\n'
    )
    with launched(graph, f'{name}.launch.py', 'params_file:=arm.yaml', *given) as log:
        client.status('serve', lambda status: status['state'] == state)
        # launch_ros does not end while it waits for the answer to a transition
        time.sleep(2.0)
    assert 'Failed to make transition' not in log.read_text()


def test_the_example_of_ros2_control_is_about_the_same_joints() -> None:
    config = get_package_share_path('lip_id_ros') / 'config'
    controllers = yaml.safe_load((config / 'controllers.yaml').read_text())
    serve = yaml.safe_load((config / 'panda.yaml').read_text())['/**/serve']
    manager = controllers['controller_manager']['ros__parameters']
    named = {name for name, value in manager.items() if isinstance(value, dict)}
    assert named == set(controllers) - {'controller_manager'}
    for name in named:
        joints = controllers[name]['ros__parameters']['joints']
        assert joints == serve['ros__parameters']['joints']


@pytest.mark.parametrize('name', ['panda.yaml', 'ur10.yaml', 'fr3.yaml', 'serve.yaml'])
def test_serve_takes_its_parameters_from_a_file(name: str, ros: Ros) -> None:
    graph, client = ros
    path = get_package_share_path('lip_id_ros') / 'config' / name
    with launched(
        graph, 'serve.launch.py', f'params_file:={path}', 'model_path:=none', 'autostart:=false'
    ) as log:
        client.status('serve', lambda status: status['state'] == 'unconfigured')
    assert 'is not a setting' not in log.read_text()


def test_train_takes_its_parameters_from_a_file(ros: Ros) -> None:
    graph, client = ros
    share = get_package_share_path('lip_id_ros')
    panda = share / 'config' / 'panda.yaml'
    with launched(graph, 'train.launch.py', f'params_file:={panda}', 'namespace:=arm'):
        status = client.status('arm/train', lambda status: True)
    assert status['joint_names'] == [f'panda_joint{number}' for number in range(1, 8)]


def test_the_node_ends_well_with_its_launch(ros: Ros, model_path: str) -> None:
    graph, client = ros
    with launched(graph, 'serve.launch.py', f'model_path:={model_path}', limited(graph)) as log:
        client.status('serve', lambda status: status['state'] == 'active')
    assert 'process has finished cleanly' in log.read_text()


def test_an_arm_is_watched(ros: Ros, model_path: str) -> None:
    graph, client = ros
    arguments = (f'model_path:={model_path}', 'namespace:=left', 'joint_states:=/cell/states')
    with launched(graph, 'monitor.launch.py', *arguments):
        client.speak(JointState, '/cell/states')
        status = client.status('left/monitor', lambda status: True)
        assert status['state'] == 'not calibrated'


BRINGUP = """
from ament_index_python.packages import get_package_share_path
from launch import LaunchDescription
from launch.actions import *
from launch.event_handlers import OnProcessExit
from launch_ros.actions import PushRosNamespace

def generate_launch_description():
    path = get_package_share_path('lip_id_ros') / 'launch' / 'serve.launch.py'
    serve = IncludeLaunchDescription(str(path), launch_arguments=ARGUMENTS.items())
    first = ExecuteProcess(cmd=['true'], name='first')
    driver = ExecuteProcess(cmd=['sleep', '1000'], name='driver')
    after = RegisterEventHandler(OnProcessExit(target_action=first, on_exit=[serve]))
    return LaunchDescription([DeclareLaunchArgument('robot_ip'), driver, WAY])
"""

WAYS = {
    'included': 'serve',
    'after a process': 'GroupAction([after, first], scoped=False)',
    'by a function': 'OpaqueFunction(function=lambda context: [serve])',
    'after a time': 'TimerAction(period=0.1, actions=[serve])',
    'in a namespace': "GroupAction([PushRosNamespace('left'), serve])",
    'in a namespace, after a time': (
        "GroupAction([PushRosNamespace('left'), TimerAction(period=0.1, actions=[serve])])"
    ),
}


def bringup(graph: Graph, way: str, **arguments: str) -> AbstractContextManager[Path]:
    """Launch a driver, and serve.launch.py in one of the ways."""
    path = graph.folder / 'bringup.launch.py'
    path.write_text(BRINGUP.replace('ARGUMENTS', repr(arguments)).replace('WAY', WAYS[way]))
    return launched(graph, str(path), 'robot_ip:=10.0.0.1')


@pytest.mark.parametrize('way', WAYS)
def test_a_launch_file_can_be_included_anywhere(way: str, ros: Ros, model_path: str) -> None:
    graph, client = ros
    name = 'left/serve' if 'namespace' in way else 'serve'
    (graph.folder / 'arm.yaml').write_text(f'/{name}: {{ros__parameters: {{torque_limits: [9]}}}}')
    with bringup(graph, way, params_file='arm.yaml', model_path=model_path) as log:
        client.status(name, lambda status: status['state'] == 'active')
    assert 'Caught exception' not in log.read_text()


@pytest.mark.parametrize('way', ['included', 'after a process', 'in a namespace'])
def test_a_wrong_argument_does_not_end_the_driver(way: str, ros: Ros) -> None:
    graph, client = ros
    (graph.folder / 'arm.yaml').write_text('/serve: {ros__parameters: {torque_limits: [9]}}')
    with bringup(graph, way, params_file='arm.yaml', namespace='right') as log:
        client.wait_until(lambda: 'serve not started: ' in log.read_text(), 'the reason')
        client.wait_until(lambda: 'driver' in log.read_text(), 'the driver')
        assert started_in(graph.folder, 'sleep 1000')
    said = log.read_text()
    assert 'arm.yaml has no section for the node /' in said
    assert 'Caught exception' not in said


def test_a_node_that_ends_is_started_again_if_asked_to(ros: Ros, model_path: str) -> None:
    graph, client = ros
    arguments = (f'model_path:={model_path}', limited(graph), 'respawn:=true', 'log_level:=debug')
    with launched(graph, 'serve.launch.py', *arguments) as log:
        client.status('serve', lambda status: status['state'] == 'active')
        (serve,) = started_in(graph.folder, 'lip_id_ros/serve')
        serve.kill()
        client.wait_until(lambda: log.read_text().count('process started') == 2, 'a new process')
        client.status('serve', lambda status: status['state'] == 'unconfigured')
    assert '[DEBUG]' in log.read_text()


@pytest.mark.parametrize('name', ['adapt', 'arm', 'demo', 'excite', 'monitor', 'serve', 'train'])
def test_every_launch_file_takes_the_usual_arguments(name: str) -> None:
    path = get_package_share_path('lip_id_ros') / 'launch' / f'{name}.launch.py'
    source = AnyLaunchDescriptionSource(str(path))
    arguments = source.get_launch_description(LaunchContext()).get_launch_arguments()
    names = {argument.name for argument in arguments}
    assert {'params_file', 'namespace', 'use_sim_time', 'log_level', 'respawn'} <= names


def test_the_demo_runs_in_a_namespace(ros: Ros, tmp_path: Path) -> None:
    graph, client = ros
    with launched(graph, 'demo.launch.py', f'folder:={tmp_path}', 'namespace:=cell'):
        assert client.status('cell/train', lambda status: True)['rows'] == 0
        assert client.status('cell/serve', lambda status: True)['state'] == 'unconfigured'
        client.wait_until(
            lambda: client.node.count_publishers('/cell/joint_states'), 'the simulated arm'
        )

"""Parameters have the type of their row, empty lists too, and refusals print plain values."""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from nodes.test_serve import start_serve
from rcl_interfaces.msg import LoggerLevel
from rcl_interfaces.srv import SetLoggerLevels
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.topic_endpoint_info import TopicEndpointInfo
from ros_domain import free_domain
from std_srvs.srv import SetBool

from lip_id_ros.feedforward.settings import ServeSettings
from lip_id_ros.nodes import running
from lip_id_ros.nodes.node import NodeBase
from lip_id_ros.nodes.serve import ServeNode
from lip_id_ros.nodes.train import TrainNode
from lip_id_ros.settings import parameters_of
from lip_id_ros.settings.settings import AT_START

if TYPE_CHECKING:
    from nodes.ros_graph import Ros

pytestmark = pytest.mark.ros

KINDS = Parameter.Type


@pytest.fixture
def node() -> Iterator[NodeBase]:
    given = ['-p', 'joints:=[]', '-p', 'ramp_s:=3', '-p', 'torque_limits:=[1,2]']
    with free_domain() as domain:
        context = Context()
        rclpy.init(args=['--ros-args', *given], context=context, domain_id=domain)
        made = NodeBase('parametrised', parameters_of(ServeSettings), context=context)
        yield made
        made.destroy_node()
        rclpy.shutdown(context=context)


@pytest.mark.parametrize(
    ('name', 'kind', 'value'),
    [
        ('joints', KINDS.STRING_ARRAY, []),
        ('torque_limits', KINDS.DOUBLE_ARRAY, [1.0, 2.0]),
        ('rate_limits', KINDS.DOUBLE_ARRAY, []),
        ('ramp_s', KINDS.DOUBLE, 3.0),
        ('max_plan_points', KINDS.INTEGER, 10_000),
    ],
)
def test_types_of_the_table(
    node: NodeBase, name: str, kind: Parameter.Type, value: object
) -> None:
    assert node.describe_parameter(name).type == kind.value
    assert node.get_parameter(name).type_ == kind
    assert node.get_parameter(name).value == value


def test_every_parameter_has_one_type(node: NodeBase) -> None:
    """Of dynamic types rqt and launch files do not know what a value may be."""
    described = [node.describe_parameter(name) for name in parameters_of(ServeSettings)]
    assert not any(each.dynamic_typing for each in described)
    assert [each.name for each in described if each.read_only] == [
        name for name, row in parameters_of(ServeSettings).items() if row.applies == AT_START
    ]


def is_set(node: NodeBase, name: str, value: object) -> bool:
    return bool(node.set_parameters_atomically([Parameter(name, value=value)]).successful)


def test_types_stay_when_values_are_set(node: NodeBase) -> None:
    for value in ([], [3], [3, 4], [3.5]):
        assert is_set(node, 'torque_limits', value)
        assert node.get_parameter('torque_limits').type_ == KINDS.DOUBLE_ARRAY
        assert node.get_parameter('torque_limits').value == value
    assert is_set(node, 'ramp_s', 4)
    assert node.get_parameter('ramp_s').type_ == KINDS.DOUBLE
    for absurd in (3, 'text', [True], [b'1'], None):
        assert not is_set(node, 'torque_limits', absurd)
    assert not is_set(node, 'executor', 'events')  # read at the start only


def test_a_refusal_prints_plain_numbers(node: NodeBase) -> None:
    wrong = Parameter('torque_limits', value=array('d', [float('nan')]))
    reason = node.set_parameters_atomically([wrong]).reason
    assert reason == 'torque_limits must be a list of numbers >= 0 N m or N, not [nan].'


def quality(found: list[TopicEndpointInfo]) -> list[tuple[str, str]]:
    profiles = [each.qos_profile for each in found]
    return [(each.reliability.name, each.durability.name) for each in profiles]


def test_the_quality_of_topics_can_be_overridden(ros: Ros, model_path: str) -> None:
    """Of the stream that comes in, and of the lifecycle publisher that goes out."""
    graph, client = ros
    states, torques = '/joint_states', '/serve/feedforward_torque'
    given = {
        f'qos_overrides.{states}.subscription.reliability': 'reliable',
        f'qos_overrides.{torques}.publisher.durability': 'transient_local',
        'qos_overrides./joint_state.subscription.depth': 3,
    }
    start_serve(graph, model_path=model_path, **given)
    status = client.status('serve', lambda status: status['state'] == 'active')
    assert (
        'qos_overrides./joint_state.subscription.depth has no effect: the node has no such topic'
    ) in status['summary']
    client.wait_until(
        lambda: (
            quality(client.node.get_subscriptions_info_by_topic(states))
            == [('RELIABLE', 'VOLATILE')]
            and quality(client.node.get_publishers_info_by_topic(torques))
            == [('RELIABLE', 'TRANSIENT_LOCAL')]
        ),
        'the qualities that were asked for',
    )


@pytest.mark.parametrize(
    ('policy', 'value'), [('reliability', 'maybe'), ('reliability', 1), ('depth', 'deep')]
)
def test_a_quality_that_is_none_is_refused(policy: str, value: str, ros: Ros) -> None:
    graph, _ = ros
    train = graph.start('train', **{f'qos_overrides./joint_states.subscription.{policy}': value})
    assert train.wait() == 1
    assert 'qos_overrides./joint_states.subscription.* must be policies of quality' in train.log
    assert 'Traceback' not in train.log


def test_nodes_share_a_process(model_path: str, tmp_path: Path) -> None:
    """Each in its namespace, with values of its own, and one executor for both."""
    with free_domain() as domain:
        context = Context()
        rclpy.init(context=context, domain_id=domain, args=[])

        def options(namespace: str, **values: object) -> dict[str, Any]:
            overrides = [Parameter(name, value=value) for name, value in values.items()]
            return {'context': context, 'namespace': namespace, 'parameter_overrides': overrides}

        serve = ServeNode(**options('left', model_path=model_path, torque_limits=[9]))
        train = TrainNode(**options('right', unsaved_path=str(tmp_path / 'unsaved.mcap')))
        client = rclpy.create_node('client', context=context)
        executor = SingleThreadedExecutor(context=context)
        with running.spinning(serve, train, client, executor=executor):
            record = client.create_client(SetBool, '/right/train/record')
            levels = client.create_client(SetLoggerLevels, '/left/serve/set_logger_levels')
            assert record.wait_for_service(10.0)
            assert levels.wait_for_service(10.0)
            assert record.call(SetBool.Request(data=True)).success
            level = LoggerLevel(name='left.serve', level=LoggerLevel.LOG_LEVEL_DEBUG)
            (result,) = levels.call(SetLoggerLevels.Request(levels=[level])).results
            assert result.successful
        assert serve.get_parameter('torque_limits').value == [9.0]
        assert serve.trigger_configure() == TransitionCallbackReturn.SUCCESS
        for node in (serve, train):
            node.stop()
        for each in (serve, train, client):
            each.destroy_node()
        rclpy.shutdown(context=context)

"""Parameters have the type of their row, empty lists too, and refusals print plain values."""

from __future__ import annotations

from array import array
from collections.abc import Iterator

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

import rclpy
from rclpy.context import Context
from rclpy.parameter import Parameter
from ros_domain import free_domain

from lip_id_ros.feedforward.settings import ServeSettings
from lip_id_ros.nodes.node import NodeBase
from lip_id_ros.settings import parameters_of
from lip_id_ros.settings.settings import AT_START

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
    return node.set_parameters_atomically([Parameter(name, value=value)]).successful


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

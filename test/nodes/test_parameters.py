"""Parameters have the type of their row, empty lists too, and refusals print plain values."""

from __future__ import annotations

from array import array
from collections.abc import Iterator

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter

from lip_id_ros.feedforward.settings import ServeSettings
from lip_id_ros.nodes import parameters
from lip_id_ros.settings import parameters_of

pytestmark = pytest.mark.ros

KINDS = Parameter.Type


@pytest.fixture
def node() -> Iterator[Node]:
    given = ['-p', 'joints:=[]', '-p', 'ramp_s:=3', '-p', 'torque_limits:=[1,2]']
    context = Context()
    rclpy.init(args=['--ros-args', *given], context=context)
    made = Node('parametrised', context=context)
    parameters.declare(made, parameters_of(ServeSettings))
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
def test_types_of_the_table(node: Node, name: str, kind: Parameter.Type, value: object) -> None:
    assert node.describe_parameter(name).type == kind.value
    assert node.get_parameter(name).type_ == kind
    assert node.get_parameter(name).value == value


def test_types_stay_when_values_are_set(node: Node) -> None:
    assert node.set_parameters([Parameter('torque_limits', value=[])])[0].successful
    assert node.get_parameter('torque_limits').type_ == KINDS.DOUBLE_ARRAY
    assert node.set_parameters([Parameter('ramp_s', value=4)])[0].successful
    assert node.get_parameter('ramp_s').type_ == KINDS.DOUBLE
    for absurd in (3, 'text', [True], [b'1']):
        assert not node.set_parameters([Parameter('torque_limits', value=absurd)])[0].successful


def test_a_refusal_prints_plain_numbers(node: Node) -> None:
    wrong = Parameter('torque_limits', value=array('d', [float('nan')]))
    reason = node.set_parameters([wrong])[0].reason
    assert reason == (
        'torque_limits must be a list of numbers >= 0 N m or N or none or robot_description, not '
        '[nan].'
    )

"""
Write docs/reference/surface.md from nodes that run: topics, services, actions and parameters.

``python scripts/surface_page.py > docs/reference/surface.md`` writes it; a test holds it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import chdir
import sys
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from rcl_interfaces.msg import ParameterDescriptor
import rclpy
from rclpy.action import (
    get_action_client_names_and_types_by_node,
    get_action_server_names_and_types_by_node,
)
from rclpy.context import Context
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile

from lip_id_ros.dataset import Dataset
from lip_id_ros.identification import fit
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.nodes.adapt import AdaptNode
from lip_id_ros.nodes.excite import ExciteNode
from lip_id_ros.nodes.monitor import MonitorNode
from lip_id_ros.nodes.node import NodeBase
from lip_id_ros.nodes.serve import ServeNode
from lip_id_ros.nodes.train import TrainNode
from lip_id_ros.settings import FitSettings

COMMAND = 'python scripts/surface_page.py > docs/reference/surface.md'
NAMESPACE = '/arm'
ACTION = 'arm_controller/follow_joint_trajectory'


def _configured(**options: Any) -> ServeNode:
    node = ServeNode(**options)
    if node.trigger_configure() != TransitionCallbackReturn.SUCCESS:
        raise RuntimeError('serve could not be configured; see the lines above')
    return node


NODES: dict[Callable[..., NodeBase], dict[str, Any]] = {
    TrainNode: {},
    ExciteNode: {
        'controller_action': ACTION,
        'use_robot_description': True,
        'effort_limits_from': 'none',
    },
    _configured: {
        'accept_unproven': True,
        'controller_action': ACTION,
        'torque_limits_from': 'robot_description',
        'follow_controller': True,
        'follow_adaptation': True,
        'publish_commands': True,
        'publish_parts': True,
        'publish_std': True,
    },
    MonitorNode: {'follow_adaptation': True},
    AdaptNode: {},
}
"""What makes each node, with parameters for all its topics."""

INTRODUCTION = f"""\
# Public surface of the nodes

What each node offers and asks for, with all its options on, as it runs.
`{COMMAND}` writes this page. [Interfaces](interfaces.md) says what each is for, and
[parameters](parameters.md) lists parameters with types and ranges.
*Latched* is transient local.
"""

HEADER = """\
| Kind | Name | Type | Quality of service |
|---|---|---|---|"""


class Surface(NamedTuple):
    """Rows of a node's table, and its parameters as ``ros2 param describe`` has them."""

    rows: list[str]
    parameters: dict[str, ParameterDescriptor]


def page(found: Mapping[str, Surface]) -> str:
    """Return the page as Markdown."""
    tables = {name: surface.rows for name, surface in found.items()}
    first, *others = tables.values()
    common = [row for row in first if all(row in rows for rows in others)]
    parts = [INTRODUCTION, _table('Every node', common)]
    for name, rows in tables.items():
        parts.append(_table(f'`{name}`', [row for row in rows if row not in common]))
    return '\n'.join(parts)


def _table(title: str, rows: Sequence[str]) -> str:
    return '\n'.join([f'## {title}', '', HEADER, *rows, ''])


def surfaces(domain: int | None = None) -> dict[str, Surface]:
    """Return what each node has, by its name; they run one by one, in a context of their own."""
    context = Context()
    with TemporaryDirectory() as folder, chdir(folder):
        _model().save('model.npz')
        rclpy.init(args=[], context=context, domain_id=domain)
        try:
            return dict(_surface(make, given, context) for make, given in NODES.items())
        finally:
            rclpy.shutdown(context=context)


def _surface(
    make: Callable[..., NodeBase], given: Mapping[str, Any], context: Context
) -> tuple[str, Surface]:
    overrides = [Parameter(name, value=value) for name, value in given.items()]
    node = make(context=context, namespace=NAMESPACE, parameter_overrides=overrides)
    try:
        names = node.list_parameters([], 0).names
        described = {name: node.describe_parameter(name) for name in names}
        return node.get_name(), Surface(list(_rows(node)), described)
    finally:
        node.stop()
        node.destroy_node()


def _rows(node: NodeBase) -> Iterator[str]:
    """Yield what a node has in the graph; what belongs to an action is left out."""
    for kind, topics in (('publisher', node.publishers), ('subscription', node.subscriptions)):
        for each in sorted(topics, key=lambda each: each.topic_name):
            if '/_action/' not in each.topic_name:
                yield _row(node, kind, each.topic_name, _type(each.msg_type), each.qos_profile)
    for kind, services in (('service', node.services), ('client', node.clients)):
        for each in sorted(services, key=lambda each: each.srv_name):
            name = node.resolve_service_name(each.srv_name)
            if '/_action/' not in name:
                yield _row(node, kind, name, _type(each.srv_type), each.qos_profile)
    me = node.get_name(), node.get_namespace()
    for kind, found in (
        ('action', get_action_server_names_and_types_by_node(node, *me)),
        ('action client', get_action_client_names_and_types_by_node(node, *me)),
    ):
        for name, types in found:
            yield _row(node, kind, name, types[0], None)


def _row(node: Node, kind: str, name: str, kind_of: str, profile: QoSProfile | None) -> str:
    private = f'{NAMESPACE}/{node.get_name()}/'
    shown = name.replace(private, '~/').removeprefix(f'{NAMESPACE}/')
    return f'| {kind} | `{shown}` | {kind_of} | {_quality(profile) if profile else ""} |'


def _type(kind: Any) -> str:
    package, folder, *_ = kind.__module__.split('.')
    return f'{package}/{folder}/{kind.__name__}'


def _quality(profile: QoSProfile) -> str:
    words = [profile.reliability.name.lower().replace('_', ' ')]
    if profile.durability == DurabilityPolicy.TRANSIENT_LOCAL:
        words.append('latched')
    words.append(f'{profile.depth} deep')
    usual = QoSProfile(depth=1)
    words += [
        f'{name} {getattr(profile, name).nanoseconds * 1e-9:g} s'
        for name in ('lifespan', 'deadline')
        if getattr(profile, name) != getattr(usual, name)
    ]
    return ', '.join(words)


def _model() -> InverseDynamicsModel:
    """Fit two pendulums, which is enough for every node to begin."""
    t = np.arange(600)[:, np.newaxis] / 100.0
    omega, q = np.array([2.0, 3.1]), np.empty(0)
    q, dq, ddq = np.sin(omega * t), omega * np.cos(omega * t), -(omega**2) * np.sin(omega * t)
    data = Dataset.from_arrays(q, dq, ddq, 2.0 * ddq + 9.0 * np.sin(q), ('a', 'b'), t=t[:, 0])
    return fit(data, FitSettings(subset=30, max_samples=60, iterations=5))


def main() -> None:
    """Print the page."""
    sys.stdout.write(page(surfaces()))


if __name__ == '__main__':
    main()

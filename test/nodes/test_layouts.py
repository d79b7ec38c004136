"""The topics of `serve` in layouts, which load, and in docs/reference/interfaces.md."""

from __future__ import annotations

from collections.abc import Iterator
import json
from pathlib import Path
import re
from typing import Any, TYPE_CHECKING
from xml.etree import ElementTree

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from nodes.test_serve import start_serve

if TYPE_CHECKING:
    from nodes.ros_graph import Ros

pytestmark = pytest.mark.ros

ROOT = Path(__file__).resolve().parents[2]
CONFIG = ROOT / 'config'
FIELD = {'sensor_msgs/msg/JointState': 'effort', 'std_msgs/msg/Float64': 'data'}


def plotjuggler_curves() -> list[str]:
    root = ElementTree.parse(CONFIG / 'plotjuggler.xml').getroot()
    assert root.tag == 'root'
    for splitter in root.iter('DockSplitter'):
        assert len(splitter) == int(splitter.attrib['count'])
        assert len(splitter.attrib['sizes'].split(';')) == len(splitter)
    return [curve.attrib['name'] for curve in root.iter('curve')]


def panels(node: Any) -> Iterator[str]:
    if isinstance(node, str):
        yield node
    else:
        yield from panels(node['first'])
        yield from panels(node['second'])


def foxglove_paths() -> list[str]:
    layout = json.loads((CONFIG / 'foxglove.json').read_text())
    configs = layout['configById']
    assert sorted(panels(layout['layout'])) == sorted(configs)
    return [path['value'] for each in configs.values() for path in each.get('paths', ())]


def documented() -> dict[str, set[str]]:
    """Names that the table of `serve` has without special settings, by the kind of its rows."""
    page = (ROOT / 'docs' / 'reference' / 'interfaces.md').read_text(encoding='utf-8')
    _, _, text = page.partition('### `ros2 run lip_id_ros serve`\n')
    text, _, _ = text.partition('\n### ')
    names: dict[str, set[str]] = {}
    rows = re.findall(r'^\| (subscription|publisher|service) \| (.*?) \|(.*)$', text, re.MULTILINE)
    for kind, cell, rest in rows:
        if 'only with `torque_limits_from: robot_description`' in rest:
            continue
        topics = {name.replace('~', '/serve') for name in re.findall('`(.*?)`', cell)}
        names.setdefault(kind, set()).update(f'/{topic.lstrip("/")}' for topic in topics)
    return names


def of_the_node(node: Any) -> dict[str, set[str]]:
    """Names that `serve` has in the graph, without those that every lifecycle node has."""
    of_any = {'/rosout', '/parameter_events', '/serve/transition_event'}
    asked = {
        'subscription': node.get_subscriber_names_and_types_by_node,
        'publisher': node.get_publisher_names_and_types_by_node,
        'service': node.get_service_names_and_types_by_node,
    }
    found = {
        kind: {
            name
            for name, types in ask('serve', '/')
            if not re.match('rcl_interfaces|lifecycle_msgs|type_description', types[0])
        }
        for kind, ask in asked.items()
    }
    return {kind: names - of_any for kind, names in found.items()}


def test_layouts_and_documentation_name_what_is_there(ros: Ros, model_path: str) -> None:
    graph, client = ros
    everything = (
        'publish_parts',
        'publish_std',
        'publish_commands',
        'follow_controller',
        'follow_adaptation',
    )
    start_serve(graph, model_path=model_path, **dict.fromkeys(everything, True))
    client.status('serve', lambda status: status['state'] == 'active')
    kinds: dict[str, str] = {'/joint_states': 'sensor_msgs/msg/JointState'}

    def found() -> bool:
        kinds.update({topic: kind[0] for topic, kind in client.node.get_topic_names_and_types()})
        return '/serve/torque_std' in kinds

    client.wait_until(found, 'all topics')
    client.wait_until(lambda: of_the_node(client.node) == documented(), 'names as documented')
    curves, paths = plotjuggler_curves(), foxglove_paths()
    assert curves
    assert paths
    for curve in curves:  # /topic/joint/effort or /topic/data
        topic, _, field = curve.rpartition('/')
        topic = topic if topic in kinds else topic.rpartition('/')[0]
        assert FIELD[kinds[topic]] == field, curve
    for path in paths:  # /topic.effort[0] or /topic.data
        topic, _, field = path.partition('.')
        assert FIELD[kinds[topic]] == field.partition('[')[0], path

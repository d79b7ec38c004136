"""Quality of service of every topic, each with its reason."""

from collections.abc import Iterator
from contextlib import contextmanager
from copy import copy
from typing import Any

from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    qos_check_compatible,
    QoSCompatibility,
    QoSPolicyKind,
    QoSProfile,
    ReliabilityPolicy,
)
from rclpy.qos_overriding_options import QoSOverridingOptions

from lip_id_ros.errors import ConfigError, one_line

SENSOR_STREAM = QoSProfile(
    reliability=ReliabilityPolicy.BEST_EFFORT, history=HistoryPolicy.KEEP_LAST, depth=2000
)
"""joint_states: takes any publisher; deep, so that two busy seconds at 1 kHz lose nothing."""

NEWEST = QoSProfile(
    reliability=ReliabilityPolicy.BEST_EFFORT, history=HistoryPolicy.KEEP_LAST, depth=10
)
"""What is followed as it happens: takes any publisher; what is late is of no use."""

WATCHED = QoSProfile(
    reliability=ReliabilityPolicy.BEST_EFFORT, history=HistoryPolicy.KEEP_LAST, depth=200
)
"""
joint_states of the monitor: at 1 kHz the 0.2 s that it bridges, where 10 lost one in nine. Not
deeper: where it does not keep up, its contacts would be as late as its queue is long.
"""

REFERENCE = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_LAST, depth=1000
)
"""
desired_trajectory: a lost plan is a robot that does not move. Deep, so that a busy second at 1 kHz
loses no plan; with 100, a tenth of a second on a loaded machine did.
"""

COMMAND = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_LAST, depth=1
)
"""
Torques: the newest counts. It has no lifespan, since the last zero must reach a controller however
late that is.
"""

OUTPUT = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_LAST, depth=100
)
"""What is recorded and plotted, and plans: reliable, so that any subscriber matches."""

CALLS = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_LAST, depth=1000
)
"""
Services: a request or an answer that finds the queue full is lost, and with it a goal or a stop.
The usual depth of 10 lost most of 70 that came at once.
"""

LATCHED = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
)
"""Status: who comes late sees the last one."""

DIAGNOSTICS = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_LAST, depth=10
)
"""/diagnostics, as everybody else publishes it."""


OVERRIDES = 'qos_overrides.'
"""How parameters begin that change the quality of one topic, as rclpy has them."""


@contextmanager
def overriding(
    node: Node, entity: str, topic: str, profile: QoSProfile
) -> Iterator[dict[str, Any]]:
    """
    Give the arguments with which a 'publisher' or 'subscription' takes the overrides given for it.

    ConfigError where it cannot be created with them.
    """
    prefix = f'{OVERRIDES}{node.resolve_topic_name(topic)}.{entity}.'
    given = [
        kind for kind in QoSPolicyKind if prefix + kind.name.lower() in node._parameter_overrides
    ]
    try:  # rclpy writes into the profile
        yield {'qos_profile': copy(profile), 'qos_overriding_options': QoSOverridingOptions(given)}
    except Exception as error:
        if not given:
            raise
        raise ConfigError(
            f'{prefix}* must be policies of quality of service, as rclpy names them, but: '
            f'{one_line(error)}; correct them.'
        ) from error


def without_effect(node: Node) -> list[str]:
    """Describe overrides of topics, or of policies, that there are not."""
    return [
        f'{name} has no effect: the node has no such topic now, or ROS no such policy'
        for name in node._parameter_overrides
        if name.startswith(OVERRIDES) and not node.has_parameter(name)
    ]


def misfits(node: Node) -> list[str]:
    """Describe publishers of another type, or of too low a quality, for a subscription."""
    pairs = [
        (subscription, publisher)
        for subscription in node.subscriptions
        for publisher in node.get_publishers_info_by_topic(subscription.topic_name)
    ]
    types = [
        f'{publisher.node_name} publishes {subscription.topic_name} as {publisher.topic_type}, '
        f'which must be {wanted}'
        for subscription, publisher in pairs
        if publisher.topic_type != (wanted := _type_name(subscription.msg_type))
    ]
    return types + [
        f'{publisher.node_name} publishes {subscription.topic_name} with a quality of service '
        f'that does not fit: {reason}'
        for subscription, publisher in pairs
        for fit, reason in [qos_check_compatible(publisher.qos_profile, subscription.qos_profile)]
        if fit == QoSCompatibility.ERROR
    ]


def _type_name(message: Any) -> str:
    package, kind, *_ = message.__module__.split('.')
    return f'{package}/{kind}/{message.__name__}'


def several_publishers(node: Node, topic: str) -> list[str]:
    """Describe the publishers of a topic, by its full name, if there is more than one."""
    if node.count_publishers(topic) < 2:  # a tenth of the time
        return []
    names = [each.node_name for each in node.get_publishers_info_by_topic(topic)]
    return [f'{len(names)} publishers of {topic} may contradict each other: {", ".join(names)}']

"""
Program `replay`: publish the joint states and trajectories of a bag.

``ros2 run lip_id_ros replay BAG [--speed FACTOR] [--ros-args -r /old/topic:=/new/topic]``; for
bags of every kind that `lip_id` reads, and for systems without ``ros2 bag``. Stamps stay.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
import heapq
from pathlib import Path
import sys
import time
from typing import Any

import rclpy
from rclpy.duration import Duration
from rclpy.exceptions import NameValidationException
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from rclpy.validate_topic_name import validate_topic_name
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.errors import SourceError
from lip_id_ros.nodes import messages, qos
from lip_id_ros.nodes.running import in_words, START_ERRORS
from lip_id_ros.recording import Bag, Topic

KINDS: Mapping[str, tuple[Any, Callable[[Any], Any]]] = {
    'sensor_msgs/msg/JointState': (JointState, messages.recorded_joint_state),
    'trajectory_msgs/msg/JointTrajectory': (JointTrajectory, messages.recorded_trajectory),
}
SUBSCRIBER_SECONDS = 30.0
FLUSH_SECONDS = 5.0
PAUSE_SECONDS = 10.0
LONGEST_SLEEP_SECONDS = 1e8  # the system refuses much longer ones


def main(argv: Sequence[str] | None = None) -> int:
    """Publish a bag; return 0, or 1 with one line in the log."""
    argv = sys.argv[1:] if argv is None else list(argv)
    parser = argparse.ArgumentParser(prog='replay', description=__doc__)
    parser.add_argument('bag', help='rosbag2 folder, .mcap, .db3 or ROS 1 .bag')
    parser.add_argument('--speed', type=float, default=1.0, help='times the recorded speed')
    try:
        arguments = parser.parse_args(remove_ros_args(argv))
        if not arguments.speed > 0:
            parser.error(f'--speed must be above 0, not {arguments.speed:g}')
        # Ctrl-C and SIGTERM end a pause of the recording too
        rclpy.init(args=argv, signal_handler_options=SignalHandlerOptions.NO)
        node = rclpy.create_node('replay')
        count = replay(Path(arguments.bag), node, arguments.speed)
        node.get_logger().info(f'published {count} messages of {arguments.bag}')
    except START_ERRORS as error:
        get_logger('lip_id_ros').fatal(in_words(error))
        return 1
    except KeyboardInterrupt:
        return 1
    finally:
        rclpy.try_shutdown()
    return 0


def replay(path: Path, node: Node, speed: float) -> int:
    """
    Publish the messages of a bag at the pace of their reception; return how many.

    `speed`: times the recorded speed. SourceError if it is no bag, or there is nothing to publish.
    """
    topics = [topic for topic in _topics(path) if _is_ros_name(node, topic.name)]
    publishers = {
        topic.name: node.create_publisher(KINDS[topic.type][0], topic.name, qos.OUTPUT)
        for topic in topics
    }
    if not publishers:
        raise SourceError(f'{path} must have a topic that ROS 2 can name, but has none.')
    _wait_for_subscribers(node, list(publishers.values()))
    count = 0
    merged = heapq.merge(*(_stream(path, topic) for topic in topics))
    for topic, message in _paced(merged, speed, node.get_logger().info):
        publishers[topic].publish(message)
        count += 1
    for publisher in publishers.values():
        publisher.wait_for_all_acked(Duration(seconds=FLUSH_SECONDS))
    return count


def _topics(path: Path) -> list[Topic]:
    with Bag(path) as bag:
        topics = [topic for topic in bag.topics if topic.type in KINDS and topic.count]
    if not topics:
        known = ' or '.join(KINDS)
        raise SourceError(f'{path} must hold messages of type {known}, but has none.')
    return topics


def _is_ros_name(node: Node, name: str) -> bool:
    try:
        validate_topic_name(name)
    except NameValidationException as error:
        reason = str(error).splitlines()[0]
        node.get_logger().warning(f'{name!r} is left out: {reason}')
        return False
    return True


def _stream(path: Path, topic: Topic) -> Iterator[tuple[int, str, int, Any]]:
    """Yield time [ns], topic, number (so that messages are never compared) and message."""
    convert = KINDS[topic.type][1]
    with Bag(path) as bag:
        for number, (receive_ns, recorded) in enumerate(bag.messages(topic.name)):
            if recorded is not None:
                yield receive_ns, topic.name, number, convert(recorded)


def _paced(
    stream: Iterator[tuple[int, str, int, Any]], speed: float, inform: Callable[[str], Any]
) -> Iterator[tuple[str, Any]]:
    first_ns: int | None = None
    begun = time.monotonic()
    for receive_ns, topic, _, message in stream:
        first_ns = receive_ns if first_ns is None else first_ns
        ahead = 1e-9 * (receive_ns - first_ns) / speed - (time.monotonic() - begun)
        if ahead > PAUSE_SECONDS:
            inform(f'the recording pauses, the next message is due in {ahead:.0f} s')
        if ahead > 0:
            time.sleep(min(ahead, LONGEST_SLEEP_SECONDS))
        yield topic, message


def _wait_for_subscribers(node: Node, publishers: Sequence[Any]) -> None:
    deadline = time.monotonic() + SUBSCRIBER_SECONDS
    while not any(publisher.get_subscription_count() for publisher in publishers):
        if time.monotonic() > deadline:
            node.get_logger().warning('no subscriber found; published all the same')
            return
        time.sleep(0.05)
    time.sleep(0.5)  # the other side finds the publisher a little later


if __name__ == '__main__':
    sys.exit(main())

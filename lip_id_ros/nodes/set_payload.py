"""
Program `set_payload`: give a payload that `lip_id payload --yaml` wrote to the robot's controller.

``ros2 run lip_id_ros set_payload FILE ur|franka [--service NAME]``; the service is that of the
driver, whose messages are looked up when it is called.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
import math
import sys
from typing import Any

import rclpy
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.utilities import remove_ros_args
from rosidl_runtime_py import set_message_fields
from rosidl_runtime_py.utilities import get_service
import yaml

from lip_id_ros.errors import ConfigError, DataError, LipIdError, shortened, SourceError
from lip_id_ros.export.payload import mass_cautions
from lip_id_ros.files import require_regular_file
from lip_id_ros.nodes.running import in_words, START_ERRORS

Values = Mapping[str, Any]

LONGEST_S = 10.0
"""A driver offers its service, and answers, sooner."""


def ur_request(payload: Values, fields: Collection[str]) -> Values:
    """
    Return a request of ur_msgs/srv/SetPayload, which has had three definitions.

    Without inertia until July 2026, then with it beside the mass, and in Makoa as a
    geometry_msgs/Inertia (pull requests 42 and 43 of ur_msgs).
    """
    flat = payload['ur_set_payload']
    if 'payload' in fields:
        inertia = {name: value for name, value in flat.items() if name.startswith('i')}
        return {'payload': {'m': flat['mass'], 'com': flat['center_of_gravity'], **inertia}}
    return {name: value for name, value in flat.items() if name in fields}


def franka_request(payload: Values, fields: Collection[str]) -> Values:
    """Return a request of franka_msgs/srv/SetLoad."""
    request: Values = payload['franka_set_load']
    return request


@dataclass(frozen=True)
class Driver:
    """A driver's service: its type, its usual name, and its request from a payload and fields."""

    kind: str
    service: str
    request: Callable[[Values, Collection[str]], Values]


DRIVERS = {
    'ur': Driver('ur_msgs/srv/SetPayload', '/io_and_status_controller/set_payload', ur_request),
    'franka': Driver('franka_msgs/srv/SetLoad', '/service_server/set_load', franka_request),
}


def main(argv: Sequence[str] | None = None) -> int:
    """Call the service; return 0 where the robot has the payload, or 1 with a line in the log."""
    argv = sys.argv[1:] if argv is None else list(argv)
    parser = argparse.ArgumentParser(prog='set_payload', description=__doc__)
    parser.add_argument('payload', help='the file that `lip_id payload --yaml` wrote')
    parser.add_argument('driver', choices=DRIVERS, help='the driver of the robot')
    parser.add_argument('--service', help='its service, where that has another name')
    arguments = parser.parse_args(remove_ros_args(argv))
    driver = DRIVERS[arguments.driver]
    try:
        payload = read_payload(arguments.payload)
        kind = service_type(driver.kind)
        rclpy.init(args=argv)
        node = rclpy.create_node('set_payload')
        call(node, driver, kind, arguments.service or driver.service, payload)
    except START_ERRORS as error:
        get_logger('lip_id_ros').fatal(in_words(error))
        return 1
    finally:
        rclpy.try_shutdown()
    return 0


def read_payload(path: str) -> Values:
    """Return the entries of a payload; SourceError if it is none, DataError if it is not known."""
    require_regular_file(path)
    with open(path, 'rb') as file:
        try:
            found = yaml.safe_load(file)
        except (yaml.YAMLError, ValueError) as error:
            raise SourceError(f'{path} is not readable YAML ({error}).') from error
    if not _is_payload(found):
        raise SourceError(
            f'{path} must be what lip_id payload --yaml wrote, but is {shortened(found)}.'
        )
    if cautions := mass_cautions(float(found['mass']), float(found['mass_std'])):
        raise DataError(f'the payload of {path} is not given to a robot. {cautions[0]}')
    return found  # type: ignore[no-any-return]


def _is_payload(found: object) -> bool:
    """Return whether a file has the entries of a payload, and all of their values are known."""
    if not isinstance(found, Mapping):
        return False
    requests = [found.get(name) for name in ('ur_set_payload', 'franka_set_load')]
    values = [found.get('mass'), found.get('mass_std'), *requests]
    return all(isinstance(each, Mapping) for each in requests) and _are_numbers(values)


def _are_numbers(found: object) -> bool:
    """Return whether all in a mapping or a list is a finite number: YAML has 1e-05 as a text."""
    if isinstance(found, Mapping):
        return _are_numbers(list(found.values()))
    if isinstance(found, list):
        return all(_are_numbers(each) for each in found)
    try:
        return math.isfinite(float(found))  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return False


def service_type(kind: str) -> Any:
    """Return the class of a service; ConfigError where its package is not installed."""
    try:
        return get_service(kind)
    except (ImportError, AttributeError, ValueError):
        package = kind.partition('/')[0]
        raise ConfigError(
            f'{kind} is needed, but {package} is not installed or too old; install the messages '
            'of the driver (ros-$ROS_DISTRO-' + package.replace('_', '-') + '), and source them.'
        ) from None


def call(node: Node, driver: Driver, kind: Any, service: str, payload: Values) -> None:
    """Have the driver set a payload; LipIdError where it does not."""
    request = kind.Request()
    set_message_fields(request, driver.request(payload, request.get_fields_and_field_types()))
    client = node.create_client(kind, service)
    if not client.wait_for_service(LONGEST_S):
        raise ConfigError(
            f'{client.srv_name} is offered by nobody; start the driver, or name its service with '
            '--service.'
        )
    answer = client.call_async(request)
    rclpy.spin_until_future_complete(node, answer, timeout_sec=LONGEST_S)
    if not answer.done():
        raise LipIdError(f'{client.srv_name} has not answered in {LONGEST_S:g} s; see its log.')
    if not answer.result().success:
        reason = getattr(answer.result(), 'error', '') or 'see its log'
        raise LipIdError(f'{client.srv_name} has not set the payload: {reason}.')
    node.get_logger().info(f'{client.srv_name} has set the payload: {payload["mass"]:.4g} kg')


if __name__ == '__main__':
    sys.exit(main())

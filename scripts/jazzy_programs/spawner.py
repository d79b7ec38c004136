#!/usr/bin/env python3
"""
`ros2 run controller_manager spawner`, which the PyPI wheel has not: load, configure, activate.

It takes the options that docs/ and launch/ use. The packaged one has more.

"""

import argparse
from pathlib import Path
import sys
from typing import Any

from controller_manager_msgs.srv import ConfigureController, LoadController, SwitchController
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
import rclpy
from rclpy.node import Node
from rclpy.utilities import remove_ros_args


def arguments(words: list[str]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog='spawner')
    parser.add_argument('controllers', nargs='+', metavar='CONTROLLER')
    parser.add_argument('-c', '--controller-manager', default='controller_manager')
    parser.add_argument('-p', '--param-file', action='append', default=[])
    parser.add_argument('--inactive', action='store_true', help='configure, but do not activate')
    return parser.parse_args(words)


class Manager:
    """The services of a controller manager; SystemExit with a sentence where one fails."""

    def __init__(self, node: Node, name: str) -> None:
        self._node, self._name = node, name

    def call(self, kind: Any, service: str, **fields: Any) -> Any:
        """Call one of its services, however long it takes to come up."""
        client = self._node.create_client(kind, f'{self._name}/{service}')
        while not client.wait_for_service(10.0):
            self._node.get_logger().info(f'waits for {client.srv_name}')
        answer = client.call_async(kind.Request(**fields))
        rclpy.spin_until_future_complete(self._node, answer)
        return answer.result()

    def require(self, kind: Any, service: str, **fields: Any) -> None:
        """Call a service that answers with ok."""
        if not self.call(kind, service, **fields).ok:
            sys.exit(f'spawner: {service} failed for {fields}; see the log of the manager')

    def give_files(self, controller: str, paths: list[str]) -> None:
        """Name the files in which a controller that is loaded next finds its parameters."""
        files = [str(Path(path).resolve()) for path in paths]
        value = ParameterValue(type=ParameterType.PARAMETER_STRING_ARRAY, string_array_value=files)
        parameter = Parameter(name=f'{controller}.params_file', value=value)
        self.call(SetParameters, 'set_parameters', parameters=[parameter])


def main() -> None:
    """Spawn the controllers that the command line names."""
    rclpy.init()
    asked = arguments(remove_ros_args(sys.argv)[1:])
    node = rclpy.create_node(f'spawner_{asked.controllers[0]}')
    manager = Manager(node, asked.controller_manager)
    for controller in asked.controllers:
        if asked.param_file:
            manager.give_files(controller, asked.param_file)
        manager.require(LoadController, 'load_controller', name=controller)
        manager.require(ConfigureController, 'configure_controller', name=controller)
    if not asked.inactive:
        manager.require(
            SwitchController,
            'switch_controller',
            activate_controllers=asked.controllers,
            strictness=SwitchController.Request.STRICT,
        )
    node.get_logger().info(f'spawned {", ".join(asked.controllers)}')
    rclpy.shutdown()


if __name__ == '__main__':
    main()

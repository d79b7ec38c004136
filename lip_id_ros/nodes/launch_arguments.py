"""Arguments that all launch files of the package share, and actions that start its nodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_path
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

PACKAGE = 'lip_id_ros'
PARAMS_FILE = PathJoinSubstitution([str(Path.cwd()), LaunchConfiguration('params_file')])
"""Path of the parameter file, also for a node that runs in another folder."""

JOINT_STATES = ('joint_states', 'joint_states', 'Topic of the measured joint states.')


def common_arguments(config: str | None, nodes: str) -> list[DeclareLaunchArgument]:
    """
    Declare `params_file`, `namespace` and `use_sim_time`.

    Parameters
    ----------
    config : str, optional
        File of the package's folder config with the default parameters; without it `params_file`
        is required.
    nodes : str
        Names of the nodes that read it.

    """
    default = config and str(get_package_share_path(PACKAGE) / 'config' / config)
    return [
        argument('params_file', default, f'File with parameters of {nodes}.'),
        argument('namespace', '', 'Namespace of the arm.'),
        argument('use_sim_time', 'false', 'Whether the nodes follow /clock.'),
    ]


def argument(name: str, default: str | None, description: str) -> DeclareLaunchArgument:
    """Declare an argument; one without a default is required."""
    return DeclareLaunchArgument(name, default_value=default, description=description)


def value(name: str, kind: type) -> ParameterValue:
    """Return an argument as a parameter of a type."""
    return ParameterValue(LaunchConfiguration(name), value_type=kind)


def node(
    name: str,
    parameters: Mapping[str, Any] | None = None,
    topics: Sequence[tuple[str, Any]] = (),
    **options: Any,
) -> Node:
    """
    Return a node of the package in the namespace, with the clock and parameters of the arguments.

    Parameters
    ----------
    name : str
        Of the program and of the node.
    parameters : mapping, optional
        Beside those of the parameter file, which they override.
    topics : sequence of (str, substitution)
        Name in the node, name in the graph.
    **options
        Further arguments of `launch_ros.actions.Node`.

    """
    return Node(
        package=PACKAGE,
        executable=name,
        name=name,
        namespace=LaunchConfiguration('namespace'),
        parameters=[
            PARAMS_FILE,
            {'use_sim_time': value('use_sim_time', bool), **(parameters or {})},
        ],
        remappings=list(topics),
        output='screen',
        **options,
    )

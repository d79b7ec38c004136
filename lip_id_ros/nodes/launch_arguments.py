"""Arguments that all launch files of the package share, and actions that start its nodes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
import os
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_path
from launch import Action, LaunchContext
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from lip_id_ros.errors import ConfigError
from lip_id_ros.settings.sections import parameters_in_file

PACKAGE = 'lip_id_ros'
PARAMS_FILE = PathJoinSubstitution([str(Path.cwd()), LaunchConfiguration('params_file')])
"""Path of the parameter file, also for a node that runs in another folder."""

AS_IN_FILE = '; empty: as in params_file'

KINDS = {bool: 'true or false', int: 'a whole number', float: 'a number'}

MakeNode = Callable[[LaunchContext], list[Node]]
"""Makes a node from the arguments of a launch; ConfigError if one of them is wrong."""

SHARED = ('params_file', 'namespace', 'joint_states', 'use_sim_time')
"""Arguments that a launch file hands to one that it includes."""

JOINT_STATES = ('joint_states', 'joint_states', 'Topic of the measured joint states.')


def common_arguments(config: str | None, nodes: str) -> list[Action]:
    """
    Declare `params_file`, `namespace` and `use_sim_time`; refuse arguments that nobody declares.

    `config`: file of the package's folder config with the default parameters; without it
    `params_file` is required. `nodes`: names of the nodes that read it.
    """
    default = config and str(get_package_share_path(PACKAGE) / 'config' / config)
    return [
        argument('params_file', default, f'File with parameters of {nodes}.'),
        argument('namespace', '', 'Namespace of the arm.'),
        argument('use_sim_time', '', f'Whether the nodes follow /clock{AS_IN_FILE}.'),
        OpaqueFunction(function=_refuse_undeclared),
    ]


def _refuse_undeclared(context: LaunchContext) -> None:
    launched = context.locals.event.launch_description
    known = {declared.name for declared in launched.get_launch_arguments()}
    given = [each.partition(':=')[0] for each in context.argv if ':=' in each]
    unknown = [name for name in given if name not in known]
    if unknown:
        raise ConfigError(
            f'{unknown[0]} is not a launch argument; there are: {", ".join(sorted(known))}. '
            'Parameters of a node belong in params_file.'
        )


def require_folder(name: str) -> Action:
    """Refuse an argument that is not a folder."""

    def check(context: LaunchContext) -> None:
        path = LaunchConfiguration(name).perform(context)
        if not os.path.isdir(path):
            raise ConfigError(f'{name} must be a folder, not {path}; make it first.')

    return OpaqueFunction(function=check)


def argument(name: str, default: str | None, description: str) -> DeclareLaunchArgument:
    """Declare an argument; one without a default is required."""
    return DeclareLaunchArgument(name, default_value=default, description=description)


def node(
    name: str,
    parameters: Mapping[str, Any] | None = None,
    topics: Sequence[tuple[str, Any]] = (),
    given: Mapping[str, type] | None = None,
    defaults: Mapping[str, Any] | None = None,
    **options: Any,
) -> MakeNode:
    """
    Return what makes a node of the package in the namespace, with clock and parameters as given.

    `name`: of the program and of the node.
    `parameters`: beside those of the parameter file, which they override.
    `topics`: name in the node, name in the graph.
    `given`: parameters with their types that launch arguments of the same names override, unless
    empty.
    `defaults`: parameters where neither the arguments nor the parameter file have one.
    `**options`: further arguments of `launch_ros.actions.Node`.
    """

    def made(context: LaunchContext) -> list[Node]:
        namespace = LaunchConfiguration('namespace').perform(context).strip('/')
        path = PARAMS_FILE.perform(context)
        in_file = parameters_in_file(path, f'/{namespace}/{name}'.replace('//', '/'))
        overriding = {
            each: _value(context, each, kind)
            for each, kind in {'use_sim_time': bool, **(given or {})}.items()
            if LaunchConfiguration(each).perform(context)
        }
        left = {key: each for key, each in (defaults or {}).items() if key not in in_file}
        return [
            Node(
                package=PACKAGE,
                executable=name,
                name=name,
                namespace=namespace,
                parameters=[path, {**left, **(parameters or {}), **overriding}],
                remappings=list(topics),
                output='screen',
                **options,
            )
        ]

    return made


def start(*nodes: MakeNode, included: Sequence[Action] = ()) -> list[Action]:
    """
    Return actions that start nodes once the arguments of all are right, behind other launch files.

    What is being started when launch comes to an error runs on without it.
    """

    def check(context: LaunchContext) -> None:
        for make in nodes:
            make(context)

    return [
        OpaqueFunction(function=check),
        *included,
        *(OpaqueFunction(function=make) for make in nodes),
    ]


def included(file: str) -> IncludeLaunchDescription:
    """Return another launch file of the package, with the arguments `SHARED` of this one."""
    path = get_package_share_path(PACKAGE) / 'launch' / file
    shared = {each: LaunchConfiguration(each) for each in SHARED}
    return IncludeLaunchDescription(
        PythonLaunchDescriptionSource(str(path)), launch_arguments=shared.items()
    )


def _value(context: LaunchContext, name: str, kind: type) -> ParameterValue:
    """Return an argument as a parameter of a type; ConfigError if it is of another."""
    found = ParameterValue(LaunchConfiguration(name), value_type=kind)
    try:
        found.evaluate(context)
    except ValueError:
        given = LaunchConfiguration(name).perform(context)
        raise ConfigError(f'{name} must be {KINDS[kind]}, not {given}; correct it.') from None
    return found

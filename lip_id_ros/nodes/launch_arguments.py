"""Launch descriptions of the package's nodes, which any other launch file can include."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import os
from typing import Any

from ament_index_python.packages import get_package_share_path
from launch import Action, LaunchContext, LaunchDescription, logging
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.events import IncludeLaunchDescription as LaunchBegins
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode, Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.utilities import make_namespace_absolute, prefix_namespace
from rclpy.validate_namespace import validate_namespace

from lip_id_ros.errors import ConfigError
from lip_id_ros.settings.sections import parameters_in_file

PACKAGE = 'lip_id_ros'
LIFECYCLE = 'serve'
SECONDS_TO_SAVE = '60'  # a million samples of train take about 20 s to write
SECONDS_TO_RESPAWN = 2.0

TOPICS = {
    'joint_states': ('joint_states', 'the measured joint states'),
    'desired_trajectory': ('~/desired_trajectory', 'the references and plans'),
    'controller_state': ('~/controller_state', 'a controller that is followed'),
    'trajectory_with_effort': ('~/trajectory_with_effort', 'plans with efforts'),
    'commands': ('~/commands', 'torques for a forward_command_controller'),
}
"""Name in the node, and what is published there, by argument."""

ARGUMENTS = {
    'params_file': ('', 'File with a section of parameters for each node.'),
    'namespace': ('', 'Namespace of the nodes within that of the launch.'),
    'use_sim_time': ('', 'Whether the nodes follow /clock; empty: as in params_file.'),
    'log_level': ('info', 'Least level of what the nodes log.'),
    'respawn': ('false', 'Whether a node that ends begins anew, serve unconfigured.'),
    'model_path': ('', 'Model of the arm; empty: as in params_file.'),
    'autostart': ('true', 'Whether serve is configured and activated.'),
    'folder': ('.', 'Folder of what train writes, one for each robot; must exist.'),
    **{each: (topic, f'Topic of {what}.') for each, (topic, what) in TOPICS.items()},
}
"""Default and description of every argument."""

COMMON = ('params_file', 'namespace', 'use_sim_time', 'log_level', 'respawn')
OF_NODE = {
    'adapt': ('model_path', 'joint_states'),
    'excite': ('joint_states',),
    'monitor': ('model_path', 'joint_states'),
    'serve': ('model_path', 'autostart', *TOPICS),
    'simulated_panda': (),
    'train': ('joint_states', 'folder'),
}
"""Arguments of each node beside the common ones."""


def launch_of(*nodes: str, **defaults: str) -> LaunchDescription:
    """
    Return what starts nodes of the package, in the namespace of the context.

    Where an argument is wrong nothing is started. `ros2 launch` of the file itself ends with the
    reason; a launch that includes it logs the reason and goes on, since it may run the robot.

    `**defaults`: of arguments, where they are not those of `ARGUMENTS`; `params_file` is the name
    of one in the package's folder config.
    """
    if 'params_file' in defaults:
        config = get_package_share_path(PACKAGE) / 'config' / defaults['params_file']
        defaults['params_file'] = str(config)
    names = dict.fromkeys([*COMMON, *(each for node in nodes for each in OF_NODE[node])])
    declared = [
        DeclareLaunchArgument(
            name,
            default_value=defaults.get(name, ARGUMENTS[name][0]),
            description=ARGUMENTS[name][1],
        )
        for name in names
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=_start, args=[nodes, names])])


def _start(context: LaunchContext, nodes: Sequence[str], names: Sequence[str]) -> list[Action]:
    given = {name: LaunchConfiguration(name).perform(context) for name in names}
    if _is_launched_itself(context):
        _refuse_unknown(context.argv, names)
        return [_node(context, name, given) for name in nodes]
    try:
        return [_node(context, name, given) for name in nodes]
    except Exception as error:  # whatever it is, launch would stop the driver for it
        logging.get_logger(PACKAGE).error(f'{", ".join(nodes)} not started: {error}')
        return []


def _is_launched_itself(context: LaunchContext) -> bool:
    """Whether `ros2 launch` was given the present file, and none that includes it."""
    event = context.get_locals_as_dict().get('event')
    if not isinstance(event, LaunchBegins):
        return False
    entities = event.launch_description.entities
    paths = [
        os.path.abspath(each.launch_description_source.location)
        for each in entities
        if isinstance(each, IncludeLaunchDescription)
    ]
    return paths == [context.locals.current_launch_file_path]


def _refuse_unknown(argv: Sequence[str], names: Sequence[str]) -> None:
    given = [each.partition(':=')[0] for each in argv if ':=' in each]
    unknown = [name for name in given if name not in names]
    if unknown:
        raise ConfigError(
            f'{unknown[0]} is not a launch argument; there are: {", ".join(sorted(names))}. '
            'Parameters of a node belong in params_file.'
        )


def _node(context: LaunchContext, name: str, given: Mapping[str, str]) -> Node:
    """Return the action that starts a node; ConfigError if an argument is wrong."""
    mine = (*COMMON, *OF_NODE[name])
    pushed = context.launch_configurations.get('ros_namespace')
    namespace = make_namespace_absolute(prefix_namespace(pushed, given['namespace']))
    validate_namespace(namespace)
    path = os.path.abspath(given['params_file'])
    parameters_in_file(path, prefix_namespace(namespace, name))
    parameters: dict[str, Any] = {}
    if given['use_sim_time']:
        parameters['use_sim_time'] = _flag('use_sim_time', given)
    if 'model_path' in mine and given['model_path']:
        parameters['model_path'] = ParameterValue(given['model_path'], value_type=str)
    options: dict[str, Any] = {}
    if name == 'train':
        options = {'cwd': _folder(given['folder']), 'sigterm_timeout': SECONDS_TO_SAVE}
    if name == LIFECYCLE:
        parameters['autostart'] = False  # the launch does it
        options = {'autostart': _flag('autostart', given)}
    return (LifecycleNode if name == LIFECYCLE else Node)(
        package=PACKAGE,
        executable=name,
        name=name,
        namespace=namespace,
        parameters=[path, parameters],
        remappings=[(TOPICS[each][0], given[each]) for each in mine if each in TOPICS],
        ros_arguments=['--log-level', given['log_level']],
        respawn=_flag('respawn', given),
        respawn_delay=SECONDS_TO_RESPAWN,
        output='screen',
        **options,
    )


def _flag(name: str, given: Mapping[str, str]) -> bool:
    flags = {'true': True, 'false': False}
    if (flag := flags.get(given[name].lower())) is None:
        raise ConfigError(f'{name} must be true or false, not {given[name]}; correct it.')
    return flag


def _folder(path: str) -> str:
    if not os.path.isdir(path):
        raise ConfigError(f'folder must be a folder, not {path}; make it first.')
    return path

"""
Computed torque in a ROS graph: ``ros2 launch lip_id_ros track.launch.py model_path:=panda.npz``.

The reference goes to `serve`, which fills in the efforts; `computed_torque` adds feedback; the
simulated arm moves by a millisecond for each torque.

"""

from ament_index_python.packages import get_package_share_path
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

PLAN = 'plan_with_effort'


def generate_launch_description() -> LaunchDescription:
    share = get_package_share_path('lip_id_ros')
    n_joints = {'n_joints': typed('n_joints', int)}
    motion = {name: typed(name, float) for name in ('amplitude', 'horizon')}
    model = {
        'model_path': LaunchConfiguration('model_path'),
        'autostart': typed('autostart', bool),
    }
    return LaunchDescription(
        [
            DeclareLaunchArgument('model_path', description='Model of the Panda.'),
            DeclareLaunchArgument(
                'params_file',
                default_value=str(share / 'config' / 'track.yaml'),
                description='Parameters of the nodes.',
            ),
            DeclareLaunchArgument('namespace', default_value='', description='Of the robot.'),
            DeclareLaunchArgument(
                'use_sim_time', default_value='false', description='Follow /clock.'
            ),
            DeclareLaunchArgument(
                'autostart',
                default_value='true',
                description='Whether serve configures and activates itself.',
            ),
            DeclareLaunchArgument('n_joints', default_value='7', description='From the base.'),
            DeclareLaunchArgument('amplitude', default_value='0.6', description='[rad].'),
            DeclareLaunchArgument('horizon', default_value='10.0', description='[s].'),
            node('simulated_arm', n_joints, {'command': 'computed_torque/command'}),
            node('computed_torque', {}, {'~/joint_trajectory': PLAN}),
            node(
                'serve',
                model,
                {'~/desired_trajectory': 'desired_trajectory', '~/trajectory_with_effort': PLAN},
            ),
            node('reference', {**n_joints, **motion}, {}),
        ]
    )


def typed(name: str, kind: type) -> ParameterValue:
    return ParameterValue(LaunchConfiguration(name), value_type=kind)


def node(name: str, parameters: dict, remappings: dict[str, str]) -> Node:
    shared = {'use_sim_time': LaunchConfiguration('use_sim_time')}
    return Node(
        package='lip_id_ros',
        executable=name,
        name=name,
        namespace=LaunchConfiguration('namespace'),
        parameters=[LaunchConfiguration('params_file'), {**shared, **parameters}],
        remappings=list(remappings.items()),
        output='screen',
    )

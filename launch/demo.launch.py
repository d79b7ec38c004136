"""A simulated Panda, `train` and `serve`; ``python -m lip_id_ros.demo.ros`` conducts them."""

from ament_index_python.packages import get_package_share_path
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    share = get_package_share_path('lip_id_ros')
    output = LaunchConfiguration('output')
    model = {'model_path': PathJoinSubstitution([output, 'model.npz'])}
    files = {
        'dataset_path': PathJoinSubstitution([output, 'training.npz']),
        'unsaved_path': PathJoinSubstitution([output, 'unsaved.mcap']),
    }
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'output', default_value='.', description='Folder of the model and the data.'
            ),
            DeclareLaunchArgument(
                'params_file',
                default_value=str(share / 'config' / 'demo.yaml'),
                description='Parameters of the three nodes.',
            ),
            DeclareLaunchArgument('namespace', default_value='', description='Of the robot.'),
            DeclareLaunchArgument(
                'use_sim_time', default_value='false', description='Follow /clock.'
            ),
            node('simulated_panda', {}, {}),
            node('train', {**model, **files}, {}),
            node('serve', model, {'~/desired_trajectory': 'desired_trajectory'}),
        ]
    )


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

"""A simulated Panda, `train` and `serve`; ``python -m lip_id_ros.demo.ros`` conducts them."""

from ament_index_python.packages import get_package_share_path
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    parameters = str(get_package_share_path('lip_id_ros') / 'config' / 'demo.yaml')
    output = LaunchConfiguration('output')
    model = PathJoinSubstitution([output, 'model.npz'])
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'output', default_value='.', description='Folder of the model and the data.'
            ),
            Node(
                package='lip_id_ros',
                executable='simulated_panda',
                name='simulated_panda',
                parameters=[parameters],
                output='screen',
            ),
            Node(
                package='lip_id_ros',
                executable='train',
                name='train',
                parameters=[
                    parameters,
                    {
                        'model_path': model,
                        'dataset_path': PathJoinSubstitution([output, 'training.npz']),
                        'unsaved_path': PathJoinSubstitution([output, 'unsaved.mcap']),
                    },
                ],
                output='screen',
            ),
            Node(
                package='lip_id_ros',
                executable='serve',
                name='serve',
                parameters=[parameters, {'model_path': model}],
                remappings=[('~/desired_trajectory', 'desired_trajectory')],
                output='screen',
            ),
        ]
    )

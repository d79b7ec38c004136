"""Serve a model: ``ros2 launch lip_id_ros serve.launch.py model_path:=model.npz``."""

from ament_index_python.packages import get_package_share_path
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    share = get_package_share_path('lip_id_ros')
    return LaunchDescription(
        [
            DeclareLaunchArgument('model_path', description='Model to serve.'),
            DeclareLaunchArgument(
                'params_file',
                default_value=str(share / 'config' / 'serve.yaml'),
                description='Parameters of the node serve.',
            ),
            DeclareLaunchArgument('namespace', default_value='', description='Of the robot.'),
            DeclareLaunchArgument(
                'desired_trajectory',
                default_value='~/desired_trajectory',
                description='Topic of the references and plans.',
            ),
            DeclareLaunchArgument(
                'use_sim_time', default_value='false', description='Follow /clock.'
            ),
            Node(
                package='lip_id_ros',
                executable='serve',
                name='serve',
                namespace=LaunchConfiguration('namespace'),
                parameters=[
                    LaunchConfiguration('params_file'),
                    {
                        'model_path': LaunchConfiguration('model_path'),
                        'use_sim_time': LaunchConfiguration('use_sim_time'),
                    },
                ],
                remappings=[('~/desired_trajectory', LaunchConfiguration('desired_trajectory'))],
                output='screen',
            ),
        ]
    )

"""Watch an arm: ``ros2 launch lip_id_ros monitor.launch.py model_path:=model.npz``."""

from ament_index_python.packages import get_package_share_path
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    share = get_package_share_path('lip_id_ros')
    return LaunchDescription(
        [
            DeclareLaunchArgument('model_path', description='Model of the arm.'),
            DeclareLaunchArgument(
                'params_file',
                default_value=str(share / 'config' / 'monitor.yaml'),
                description='Parameters of the node monitor.',
            ),
            DeclareLaunchArgument('namespace', default_value='', description='Of the robot.'),
            DeclareLaunchArgument(
                'joint_states', default_value='joint_states', description='Topic of the arm.'
            ),
            DeclareLaunchArgument(
                'use_sim_time', default_value='false', description='Follow /clock.'
            ),
            Node(
                package='lip_id_ros',
                executable='monitor',
                name='monitor',
                namespace=LaunchConfiguration('namespace'),
                parameters=[
                    LaunchConfiguration('params_file'),
                    {
                        'model_path': LaunchConfiguration('model_path'),
                        'use_sim_time': LaunchConfiguration('use_sim_time'),
                    },
                ],
                remappings=[('joint_states', LaunchConfiguration('joint_states'))],
                output='screen',
            ),
        ]
    )

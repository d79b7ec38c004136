"""Record and fit: ``ros2 launch lip_id_ros train.launch.py params_file:=my_robot.yaml``."""

from pathlib import Path

from ament_index_python.packages import get_package_share_path
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node

SECONDS_TO_SAVE = '60'  # a million samples take about 20 s to write


def generate_launch_description() -> LaunchDescription:
    share = get_package_share_path('lip_id_ros')
    params_file = PathJoinSubstitution([str(Path.cwd()), LaunchConfiguration('params_file')])
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'params_file',
                default_value=str(share / 'config' / 'train.yaml'),
                description='Parameters of the node train.',
            ),
            DeclareLaunchArgument('namespace', default_value='', description='Of the robot.'),
            DeclareLaunchArgument(
                'joint_states',
                default_value='joint_states',
                description='Topic of the measured joint states.',
            ),
            DeclareLaunchArgument(
                'folder',
                default_value='.',
                description='Folder of the model and the data, one for each robot; must exist.',
            ),
            DeclareLaunchArgument(
                'use_sim_time', default_value='false', description='Follow /clock.'
            ),
            Node(
                package='lip_id_ros',
                executable='train',
                name='train',
                namespace=LaunchConfiguration('namespace'),
                parameters=[
                    params_file,
                    {'use_sim_time': LaunchConfiguration('use_sim_time')},
                ],
                remappings=[('joint_states', LaunchConfiguration('joint_states'))],
                cwd=LaunchConfiguration('folder'),
                sigterm_timeout=SECONDS_TO_SAVE,
                output='screen',
            ),
        ]
    )

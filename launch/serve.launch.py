"""Serve a model: ``ros2 launch lip_id_ros serve.launch.py model_path:=model.npz``."""

from ament_index_python.packages import get_package_share_path
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

# Launch argument, name in the node, what it is.
TOPICS = (
    ('joint_states', 'joint_states', 'Topic of the measured joint states.'),
    ('desired_trajectory', '~/desired_trajectory', 'Topic of the references and plans.'),
    ('controller_state', '~/controller_state', 'Topic of a controller that is followed.'),
    ('trajectory_with_effort', '~/trajectory_with_effort', 'Topic of plans with efforts.'),
    ('commands', '~/commands', 'Topic of torques for a forward_command_controller.'),
)


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
            *(
                DeclareLaunchArgument(name, default_value=topic, description=description)
                for name, topic, description in TOPICS
            ),
            DeclareLaunchArgument(
                'use_sim_time', default_value='false', description='Follow /clock.'
            ),
            DeclareLaunchArgument(
                'autostart', default_value='true', description='Configure and activate.'
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
                        'autostart': LaunchConfiguration('autostart'),
                    },
                ],
                remappings=[(topic, LaunchConfiguration(name)) for name, topic, _ in TOPICS],
                output='screen',
            ),
        ]
    )

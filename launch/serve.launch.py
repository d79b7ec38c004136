"""Serve a model: ``ros2 launch lip_id_ros serve.launch.py model_path:=model.npz``."""

from launch import LaunchDescription
from launch.substitutions import LaunchConfiguration

from lip_id_ros.nodes.launch_arguments import (
    argument,
    AS_IN_FILE,
    common_arguments,
    JOINT_STATES,
    node,
    start,
)

# Launch argument, name in the node, description.
TOPICS = (
    JOINT_STATES,
    ('desired_trajectory', '~/desired_trajectory', 'Topic of the references and plans.'),
    ('controller_state', '~/controller_state', 'Topic of a controller that is followed.'),
    ('trajectory_with_effort', '~/trajectory_with_effort', 'Topic of plans with efforts.'),
    ('commands', '~/commands', 'Topic of torques for a forward_command_controller.'),
)


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription(
        [
            argument('model_path', None, 'Model to serve.'),
            *common_arguments('serve.yaml', 'serve'),
            *(argument(*topic) for topic in TOPICS),
            argument(
                'autostart', '', f'Whether serve configures and activates itself{AS_IN_FILE}.'
            ),
            *start(
                node(
                    'serve',
                    topics=[(topic, LaunchConfiguration(name)) for name, topic, _ in TOPICS],
                    given={'model_path': str, 'autostart': bool},
                )
            ),
        ]
    )

"""Watch an arm: ``ros2 launch lip_id_ros monitor.launch.py model_path:=model.npz``."""

from launch import LaunchDescription
from launch.substitutions import LaunchConfiguration

from lip_id_ros.nodes.launch_arguments import argument, common_arguments, JOINT_STATES, node, start


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription(
        [
            argument('model_path', None, 'Model of the arm.'),
            *common_arguments('monitor.yaml', 'monitor'),
            argument(*JOINT_STATES),
            *start(
                node(
                    'monitor',
                    topics=[('joint_states', LaunchConfiguration('joint_states'))],
                    given={'model_path': str},
                )
            ),
        ]
    )

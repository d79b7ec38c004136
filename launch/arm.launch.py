"""
Both nodes of one arm: ``ros2 launch lip_id_ros arm.launch.py params_file:=panda.yaml``.

The parameter file has a section for each node, as config/panda.yaml. `serve` waits unconfigured
for the model that `train` writes, unless `autostart` is true.

"""

from launch import LaunchDescription
from launch.substitutions import LaunchConfiguration

from lip_id_ros.nodes.launch_arguments import (
    argument,
    AS_IN_FILE,
    common_arguments,
    included,
    JOINT_STATES,
    node,
    start,
)

TOPICS = (
    ('desired_trajectory', '~/desired_trajectory', 'Topic of the references and plans.'),
    ('trajectory_with_effort', '~/trajectory_with_effort', 'Topic of plans with efforts.'),
)


def generate_launch_description() -> LaunchDescription:
    topics = (JOINT_STATES, *TOPICS)
    return LaunchDescription(
        [
            *common_arguments(None, 'train and serve'),
            *(argument(*topic) for topic in topics),
            argument('model_path', '', f'Model to serve: the model_path of train{AS_IN_FILE}.'),
            argument(
                'autostart',
                '',
                f'Whether serve configures and activates itself{AS_IN_FILE}, else false.',
            ),
            *start(
                node(
                    'serve',
                    topics=[(topic, LaunchConfiguration(name)) for name, topic, _ in topics],
                    given={'model_path': str, 'autostart': bool},
                    defaults={'autostart': False},
                ),
                included=[included('train.launch.py')],
            ),
        ]
    )

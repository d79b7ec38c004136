"""Record and fit: ``ros2 launch lip_id_ros train.launch.py params_file:=my_robot.yaml``."""

from launch import LaunchDescription
from launch.substitutions import LaunchConfiguration

from lip_id_ros.nodes.launch_arguments import (
    argument,
    common_arguments,
    JOINT_STATES,
    node,
    require_folder,
    start,
)

SECONDS_TO_SAVE = '60'  # a million samples take about 20 s to write


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription(
        [
            *common_arguments('train.yaml', 'train'),
            argument(*JOINT_STATES),
            argument(
                'folder', '.', 'Folder of the model and the data, one for each robot; must exist.'
            ),
            require_folder('folder'),
            *start(
                node(
                    'train',
                    topics=[('joint_states', LaunchConfiguration('joint_states'))],
                    cwd=LaunchConfiguration('folder'),
                    sigterm_timeout=SECONDS_TO_SAVE,
                )
            ),
        ]
    )

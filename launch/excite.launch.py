"""
From nothing to a model: ``ros2 launch lip_id_ros excite.launch.py params_file:=my_robot.yaml``.

`excite` moves the arm, `train` records and fits, and `serve` waits for the model. The parameter
file has a section for each, as config/panda.yaml for the latter two and config/excite_node.yaml.

"""

from ament_index_python.packages import get_package_share_path
from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration

from lip_id_ros.nodes.launch_arguments import argument, common_arguments, JOINT_STATES, node, start

SHARED = ('params_file', 'namespace', 'joint_states', 'use_sim_time')


def generate_launch_description() -> LaunchDescription:
    arm = get_package_share_path('lip_id_ros') / 'launch' / 'arm.launch.py'
    return LaunchDescription(
        [
            *common_arguments(None, 'excite, train and serve'),
            argument(*JOINT_STATES),
            *start(
                node('excite', topics=[('joint_states', LaunchConfiguration('joint_states'))]),
                included=[
                    IncludeLaunchDescription(
                        PythonLaunchDescriptionSource(str(arm)),
                        launch_arguments={
                            each: LaunchConfiguration(each) for each in SHARED
                        }.items(),
                    )
                ],
            ),
        ]
    )
